"""What each data set and attribute of ``evaluations.h5`` is; units of parameters are those of the properties' table."""

from __future__ import annotations

from calib.io.meaning import NO_UNIT, UNKNOWN, Meaning
from calib.material.properties import DIMENSIONS, FORM, OF_TRACE, PROPERTIES, SPECIMEN, property_of

WHAT = "Simulations of a run of cutcal, one entry each along the first axis"
ATTRIBUTES = {
    "schema": Meaning(NO_UNIT, "version of this layout"),
    "trace_sha256": Meaning(NO_UNIT, "SHA-256 of the trace's file; empty without a trace"),
    "scene_key": Meaning(NO_UNIT, "hash or name of what is simulated, without the values in parameters"),
}
"""Of the file."""

FIXED = {
    "key": Meaning(NO_UNIT, "SHA-256 of scene, values and version of the code", "(n,)"),
    "sha256": Meaning(NO_UNIT, "checksum of the entry", "(n,)"),
    "fidelity": Meaning(NO_UNIT, "what the simulation was made for, such as fine, coarse or check", "(n,)"),
    "status": Meaning(NO_UNIT, "ok, or how the simulation ended early", "(n,)"),
    "reason": Meaning(NO_UNIT, "why it ended early; empty where it is ok", "(n,)"),
    "fraction": Meaning(NO_UNIT, "part of the stroke that was completed", "(n,)"),
    "seconds": Meaning("s", "run time", "(n,)"),
    "curves/start": Meaning(NO_UNIT, "entry k has the places start[k] to start[k + 1] of both curves", "(n + 1,)"),
    "curves/stroke": Meaning("m", "way of the knife from first contact, the way up added; all end to end", "(m,)"),
    "curves/force": Meaning("N", "upward force of the food on the knife, all curves end to end", "(m,)"),
    "conditioning/time_s": Meaning("s", "time of the whole trace", "(k,)"),
    "conditioning/raw_N": Meaning("N", "force of the trace as it was recorded", "(k,)"),
    "conditioning/tared_N": Meaning("N", "force of the trace less its baseline", "(k,)"),
}
"""Data sets whose names do not hang on the run: n simulations, m samples of their curves, k of the trace."""

SCALARS = {
    "peak_N": Meaning("N", "largest upward force on the knife on its way down", "(n,)"),
    "work_J": Meaning("J", "work of the knife on the food until it is withdrawn", "(n,)"),
    "unbooked_J": Meaning("J", "part of the work that no law has taken", "(n,)"),
    "momentum_residual": Meaning(NO_UNIT, "largest gap of the momentum balance over the peak force", "(n,)"),
    "ke_over_ie": Meaning(NO_UNIT, "kinetic over internal energy, the worst after a quarter of the work", "(n,)"),
    "ripple_N": Meaning("N", "standard deviation of the grid's ripple, which is not in the force", "(n,)"),
    "steps": Meaning(NO_UNIT, "number of time steps", "(n,)"),
    "particles": Meaning(NO_UNIT, "number of particles, mirror images not counted", "(n,)"),
    "parted": Meaning(NO_UNIT, "energy of new surface over R times its area", "(n,)"),
    "turn_m": Meaning("m", "stroke at which the blade turns back", "(n,)"),
    "particle_steps": Meaning(NO_UNIT, "time steps times particles", "(n,)"),
    "energy_gain": Meaning(NO_UNIT, "largest energy from nothing over what was put in", "(n,)"),
    "dt_s": Meaning("s", "time step", "(n,)"),
}
"""Data sets of the group ``scalars``."""


def meaning_of(path: str) -> Meaning:
    """What a data set of the store is.

    Args:
        path: Its path in the file, such as ``parameters/E``.

    Returns:
        Its unit and meaning.
    """
    group, _, name = path.partition("/")
    if group == "parameters":
        return _of_parameter(name)
    return SCALARS.get(name, UNKNOWN) if group == "scalars" else FIXED.get(path, UNKNOWN)


def _of_parameter(name: str) -> Meaning:
    rule = {**PROPERTIES, **DIMENSIONS, **FORM, **SPECIMEN}.get(property_of(name))
    if rule is None:
        return UNKNOWN
    _, _, owner = name.partition(OF_TRACE)
    return Meaning(
        rule.unit, f"{rule.meaning}; of {owner} alone, a trace or a knife" if owner else rule.meaning, "(n,)"
    )
