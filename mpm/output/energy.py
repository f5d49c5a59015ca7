"""Where the work of a cut has gone: its parts in words, and the part that no law has taken."""

from __future__ import annotations

from collections.abc import Mapping

SPENT = {
    "parting": "parting the food",
    "cohesion": "opening ahead of the edge",
    "friction": "friction",
    "plastic": "flow",
    "damage": "damage",
    "viscous": "loss factor",
    "elastic": "elastic",
    "kinetic": "kinetic",
}
"""Where the work of a cut goes, in words."""
LEAST = 0.005
"""Part of the work from which on a part is named [-]."""


def spent(energy: Mapping[str, float]) -> str:
    """Where the work of a cut has gone, in words, largest part first; what is less than half a per cent is left out.

    Args:
        energy: Energies by name [J], as in ``mpm.output.record.ForceRecord.budget``.

    Returns:
        The text; empty where no work was done.
    """
    total = sum(energy.values())
    parts = {words: energy.get(name, 0.0) / total for name, words in SPENT.items()} if total > 0 else {}
    large = sorted((part, words) for words, part in parts.items() if part >= LEAST)
    return ", ".join(f"{words} {part:.0%}" for part, words in reversed(large))


def unbooked(energy: Mapping[str, float]) -> float | None:
    """Part of the work of a cut that no law has taken [-].

    Args:
        energy: Energies by name [J], as in ``mpm.output.record.ForceRecord.budget``.

    Returns:
        That part; None where no work was done, or an older record does not have it.
    """
    total = sum(energy.values())
    return energy["unbooked"] / total if total > 0 and "unbooked" in energy else None
