"""Where the work of a cut has gone."""

from __future__ import annotations

from collections.abc import Mapping

SPENT = {
    "parting": "parting the food",
    "friction": "friction",
    "plastic": "flow",
    "damage": "damage",
    "viscous": "loss factor",
    "elastic": "elastic",
    "kinetic": "kinetic",
}
"""Where the work of a cut goes, in words."""
LEAST_SHARE = 0.005  # part of the work that is named


def spent(energy: Mapping[str, float]) -> str:
    """Where the work of a cut has gone, in words, largest first; what is less than :data:`LEAST_SHARE` is left out."""
    total = sum(energy.values())
    parts = {words: energy[name] / total for name, words in SPENT.items()} if total > 0 else {}
    large = sorted((part, words) for words, part in parts.items() if part >= LEAST_SHARE)
    return ", ".join(f"{words} {part:.0%}" for part, words in reversed(large))


def unbooked(energy: Mapping[str, float]) -> float | None:
    """Part of the work of a cut that no law has taken [-]; None where no work was done."""
    total = sum(energy.values())
    return energy["unbooked"] / total if total > 0 and "unbooked" in energy else None
