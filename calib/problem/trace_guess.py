"""Where a search begins: at foods that differ in what bears the force, and in how their cut starts.

A curve may be that of an edge that pays for new surface, of faces that press the halves apart, or of faces that rub. A
descent (:mod:`calib.fit.descent`) seldom leads from one to another. So several begin, each at another food, and go on
as long as they may win:

- The usual food, from the literature, and a stiffer one that hardly rubs. Friction multiplies what the other two bear,
  so that much of it hides them: a descent finds its way to much friction, and not back.
- What the trace itself says, where it says something: of layers (:mod:`calib.problem.layer_guess`), or of the start of
  a cut. That is a peak with a dip behind it. It tells two numbers: the force at which the cut starts, over the chord
  that the edge has met, and the dent under the edge. How much of the rest the edge bears it does not tell. So there is
  a start for either: a food that costs the edge nearly all of the force, and a stiffer one that costs it a quarter.
- Where the board's suction is fitted, the stiffest food that the trace tells of, else the usual one with a third of its
  friction, on a board that hardly holds it. How firmly the halves of a stiff food are held decides the second half of
  its force, so a food that is hardly held has a narrow valley of its own, and no descent from a food that is held came
  to it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.material.properties import BOARD_SUCTION
from calib.problem.layer_guess import EDGE_PART, FRICTION_PART, guess_at, layer_chords, layer_guesses
from calib.problem.parameters import ParameterSet, is_shared
from mpm.arrays import FloatArray
from mpm.scene import Knife, Scene

DIP = 0.05
"""Part of its height by which the force falls behind a peak that is the start of a cut."""
NOISE_SD = 4.0
"""The same in standard deviations of the curve's noise."""
FACES_EDGE_PART = 0.25
"""Part of the force that the edge takes where the faces bear most of it."""
STIFFER = 1.0
"""By how many standard deviations of its prior a stiffer food is stiffer than usual."""
FACES_FRICTION_PART = 0.7
"""Friction of such a food over the usual."""
SLIPPERY_PART = 1 / 15
"""Friction of a food that hardly rubs over the usual."""
PLATEAU = (0.25, 0.85)
"""Part of the stroke over which the force for each length of the edge is looked at."""
LEAST_CHORD = 1e-3
"""Chord that an edge on a round food has met at least [m]."""


def trace_guesses(
    scene: Scene, parameters: ParameterSet, stroke: FloatArray, curve: FloatArray, noise_sd: float
) -> tuple[FloatArray, ...]:
    """Starts for the fitted parameters of a food.

    Args:
        scene: The cut with the food's values.
        parameters: What is fitted.
        stroke: Stroke of the trace [m], shape (n,).
        curve: Its force [N], shape (n,).
        noise_sd: Standard deviation of the force's noise [N].

    Returns:
        Internal coordinates, each (p,).
    """
    seen = layer_guesses(scene, parameters, stroke, curve) or _peak_guesses(scene, parameters, stroke, curve, noise_sd)
    found = seen or (parameters.start,)
    usual_mu = parameters["mu"].value if "mu" in parameters.names else None
    slippery = () if usual_mu is None else (_hardly_rubs(parameters, usual_mu),)
    less = () if usual_mu is None else (guess_at(parameters, {"mu": FRICTION_PART * usual_mu}),)
    # what every trace has comes first: a fit of several goes on from the first of each together, and so on
    loose = (_hardly_held(parameters, (*less, *found)),) if BOARD_SUCTION in parameters.names else ()
    return *slippery, *loose, *found


def _hardly_rubs(parameters: ParameterSet, usual_mu: float) -> FloatArray:
    """A stiffer food than usual that hardly rubs."""
    return guess_at(parameters, _stiffer(parameters) | {"mu": SLIPPERY_PART * usual_mu})


def _stiffer(parameters: ParameterSet) -> dict[str, float]:
    """Young's modulus and yield stress of a food that is stiffer than usual, where they are fitted."""
    names = [name for name in ("E", "yield_stress") if name in parameters.names]
    factor = float(np.exp(STIFFER * parameters["E"].prior_sd)) if "E" in parameters.names else 1.0
    return {name: factor * parameters[name].value for name in names}


def _hardly_held(parameters: ParameterSet, guesses: Sequence[FloatArray]) -> FloatArray:
    """The stiffest of some starts, the first of equals, on a board that hardly holds it: its suction is at the low end
    of its prior."""
    values = [parameters.to_dict(z) for z in guesses]
    stiffest = max(values, key=lambda one: one.get("E", 0.0))
    return parameters.to_vector(stiffest | {BOARD_SUCTION: parameters[BOARD_SUCTION].prior_range[0]})


def start_of_cut(curve: FloatArray, noise_sd: float) -> int | None:
    """Place of the peak with which a cut starts.

    Args:
        curve: Force over the stroke [N], shape (n,).
        noise_sd: Standard deviation of its noise [N].

    Returns:
        Index of the first peak in the first third of the stroke that the force falls behind, before it rises above it;
        None where there is none.
    """
    for i in range(1, len(curve) // 3):
        if curve[i] < curve[: i + 1].max() or curve[i + 1] >= curve[i]:
            continue
        above = np.flatnonzero(curve[i:] > curve[i])
        dip = curve[i] - curve[i : i + (int(above[0]) if len(above) else len(curve))].min()
        if dip > max(DIP * curve[i], NOISE_SD * noise_sd):
            return i
    return None


def _peak_guesses(
    scene: Scene, parameters: ParameterSet, stroke: FloatArray, curve: FloatArray, noise_sd: float
) -> tuple[FloatArray, ...]:
    """The starts that a peak tells of, by the faces and by the edge: none without one, or where R, E or the start of
    the cut are not fitted."""
    usual = {p.name: p.value for p in parameters}
    starts = [name for name in ("R_skin", "R_initiation") if name in usual]
    peak = start_of_cut(curve, noise_sd)
    wanted = {"R", "E", "initiation_depth"} <= set(usual) and len(starts) > 0
    if peak is None or not wanted or not all(is_shared(name) for name in parameters.names):
        return ()
    shape, knife = scene.food.shape, scene.knife
    depth, each = layer_chords(shape, scene.food.material)
    reach = knife.length if isinstance(knife, Knife) else np.inf
    chord = np.maximum(np.interp(stroke, depth, np.minimum(each.sum(axis=0), reach)), LEAST_CHORD)
    first, last = (int(part * len(stroke)) for part in PLATEAU)
    line = float(np.median((curve / chord)[first : last + 1]))
    pace = scene.food.material.rate_factor(scene.motion.speed)  # the force is that of the trace's speed
    found = dict.fromkeys(starts, EDGE_PART * curve[peak] / chord[peak]) | {
        "initiation_depth": EDGE_PART * stroke[peak]
    }
    faces = found | _stiffer(parameters)
    edge = found | {"R": EDGE_PART * line}
    faces |= {"R": FACES_EDGE_PART * line}
    if "mu" in usual:
        edge["mu"], faces["mu"] = FRICTION_PART * usual["mu"], FACES_FRICTION_PART * usual["mu"]
    return tuple(guess_at(parameters, values, pace) for values in (faces, edge))
