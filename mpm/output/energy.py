"""Where the work of a cut has gone: its parts in words, and the part that no law has taken."""

from __future__ import annotations

from collections.abc import Mapping

SPENT = {
    "parting": "parting the food",
    "cohesion": "opening ahead of the edge",
    "friction": "friction",
    "adhesion": "adhesion",
    "suction": "lifting it off the board",
    "plastic": "flow",
    "damage": "damage",
    "viscous": "loss factor",
    "elastic": "elastic",
    "kinetic": "kinetic",
}
"""Where the work of a cut goes, in words."""
LEAST = 0.005
"""Part of the work from which on a part is named [-]."""
MOST_UNBOOKED = 0.1
"""Part of the work that no law has taken, up to which a balance closes [-]."""
MOST_KINETIC = 0.1
"""Kinetic over internal energy up to which an explicit run counts as quasi-static [-] (0.05 to 0.1 is customary)."""


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
    return ", ".join(f"{words} {100 * part:.0f}\u00a0%" for part, words in reversed(large))


def unbooked(energy: Mapping[str, float]) -> float | None:
    """Part of the work of a cut that no law has taken [-].

    Args:
        energy: Energies by name [J], as in ``mpm.output.record.ForceRecord.budget``.

    Returns:
        That part; None where no work was done, or an older record does not have it.
    """
    total = sum(energy.values())
    return energy["unbooked"] / total if total > 0 and "unbooked" in energy else None


def doubts(energy: Mapping[str, float], ke_over_ie: float) -> list[str]:
    """Why the energies of a cut say that its force is not to be trusted, one sentence each; none where they do not.

    Args:
        energy: Energies by name [J], as in ``mpm.output.record.ForceRecord.budget``.
        ke_over_ie: Kinetic over internal energy [-], as in ``mpm.output.record.ForceRecord.ke_over_ie``.
    """
    out = []
    part = unbooked(energy)
    if part is not None and not abs(part) <= MOST_UNBOOKED:
        gone = "taken" if part > 0 else "made"
        out.append(
            f"{abs(part):.0%} of the work is {gone} by no law (limit {MOST_UNBOOKED:.0%}): cells and "
            "contact lose it; use smaller cells (--dx), or a lower --mach"
        )
    if not ke_over_ie <= MOST_KINETIC:
        out.append(
            f"kinetic energy is {ke_over_ie:.0%} of the internal one (limit {MOST_KINETIC:.0%}): the force is that of "
            "waves, not of a cut; use a lower --mach"
        )
    return out
