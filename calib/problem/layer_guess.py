"""Where a search for rind, flesh and core begins: at what the trace's own peaks, dip and fall say of them.

The force of a cut through layers is about the sum of the chords that the edge has in each, times its resistance. The
food gives way under the edge, so that the edge is a dent higher in the food than its stroke says, until it comes out.
For each of some dents and sizes of the layers the three resistances are linear in the force: non-negative least squares
(Lawson and Hanson 1974) finds them, and the best of all is a start for the search. From values of the literature it
ends in a hump without the second peak. The answer is the search's: this knows nothing of stiffness, flow and friction.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from calib.material.properties import LAYERS
from calib.problem.parameters import ParameterSet, is_shared
from mpm.arrays import FloatArray
from mpm.scene import Scene
from mpm.scene.layers import toughness
from mpm.scene.material import RESISTANCES, Material
from mpm.scene.shapes import Shape, inside

DENTS = np.arange(0.0, 0.201, 0.025)
"""Dents under the edge that are tried, parts of the food's height [-]."""
SIZES = 5
"""Sizes of each layer that are tried, over its prior's 95 % range."""
POINTS = (120, 160)
"""Points along and across a section at which its layers are looked up."""
EDGE_PART = 0.85
"""Part of the force that is new surface in what is begun with [-]: the rest is flow and friction."""
LINE_DENT = 2.0
"""Dent under a line load, over the load and Young's modulus [-]. It grows with the logarithm of the body's width over
the contact's (Johnson 1985, Contact Mechanics), so any number near it will do for a start."""
FRICTION_PART = 0.3
"""Friction in what is begun with over the food's [-]: what rubs is not part of the chords."""
PARTS_AT = 0.05
"""Dent at which a firm food parts in what is begun with, over its height [-]."""
STARTS = 0.7
"""Part of the largest force of the first third at which the cut has started in what is begun with [-]."""


def layer_guesses(
    scene: Scene, parameters: ParameterSet, stroke: FloatArray, curve: FloatArray
) -> tuple[FloatArray, ...]:
    """Starts for the fitted parameters of a food with layers: a food of the usual stiffness that parts at once, whose
    force is the chords' alone; a soft food whose skin gives way soon; and a food of the usual stiffness that gives way
    under the edge up to the largest force of the first third of the stroke.

    The soft food yields at the usual strain. With the usual yield stress a search ended in a cucumber that yields at a
    strain of 0.9, which no tissue bears, and whose crack 3 mm do not resolve.

    Args:
        scene: The cut with the food's values.
        parameters: What is fitted.
        stroke: Stroke of the trace [m], shape (n,).
        curve: Its force [N], shape (n,).

    Returns:
        Internal coordinates, each (p,), those of the food's values where the trace says nothing; none where no layer
        is fitted.
    """
    fitted = [size for size in LAYERS if size in parameters.names and LAYERS[size] in parameters.names]
    if not fitted or "R" not in parameters.names or not all(is_shared(name) for name in parameters.names):
        return ()
    food, shape, start = scene.food.material, scene.food.shape, _first_load(stroke, curve)
    used = stroke > start
    best, found = np.inf, {}
    for sizes in itertools.product(*(_tried(parameters, size) for size in fitted)):
        given = dict(zip(fitted, sizes, strict=True))
        height, chords = layer_chords(shape, replace(food, **given))
        for dent in DENTS * shape.height:
            rows = np.array([np.interp(_reached(stroke, dent, shape.height), height, c) for c in chords])[:, used]
            values, misfit = nnls(rows.T, EDGE_PART * curve[used])
            if misfit < best:
                best, found = misfit, given | dict(zip(("R", "R_rind", "R_core"), values, strict=True)) | {"dent": dent}
    outer = found["R_rind"] if "R_rind" in parameters.names else found["R"]
    found |= {"initiation_depth": start / 2, "R_skin": outer, "R_initiation": outer}
    found |= {"E": LINE_DENT * outer / max(found["dent"], start / 2)}
    if {"E", "yield_stress"} <= set(parameters.names):
        found["yield_stress"] = parameters["yield_stress"].value * found["E"] / parameters["E"].value
    if "mu" in parameters.names:
        found["mu"] = FRICTION_PART * parameters["mu"].value
    reached = float(stroke[int(np.argmax(curve[: max(len(curve) // 3, 2)]))])
    height, chords = layer_chords(shape, food)
    chord = max(float(np.interp(reached, height, chords.sum(axis=0))), chords.max() / POINTS[1])
    line = EDGE_PART * float(np.interp(reached, stroke, curve)) / chord
    usual = {name: value for name, value in found.items() if name not in ("E", "yield_stress")}
    firm = usual | {"initiation_depth": PARTS_AT * shape.height}
    dented = usual | {"initiation_depth": reached, "R_skin": max(line, outer), "R_initiation": max(line, outer)}
    pace = food.rate_factor(scene.motion.speed)  # the force is that of the trace's speed
    return guess_at(parameters, firm, pace), guess_at(parameters, found, pace), guess_at(parameters, dented, pace)


def _tried(parameters: ParameterSet, size: str) -> FloatArray:
    """Sizes of a layer over the literature's range of it [m or -]."""
    item = parameters[size]
    return np.geomspace(max(item.prior_low, item.low), min(item.prior_high, item.high), SIZES)


def _first_load(stroke: FloatArray, curve: FloatArray) -> float:
    """Stroke at which the cut has started: where the first third of the force is near its largest [m]."""
    third = curve[: max(len(curve) // 3, 2)]
    return float(stroke[int(np.argmax(third >= STARTS * third.max()))])


def _reached(stroke: FloatArray, dent: float, height: float) -> FloatArray:
    """Depth of the edge in the food before it gave way [m]: a dent less than the stroke, until there is nothing left
    below it that can give way."""
    return np.minimum(np.maximum(stroke - dent, 0.0) * height / max(height - dent, 1e-9), height)


def layer_chords(shape: Shape, food: Material) -> tuple[FloatArray, FloatArray]:
    """Chords of the layers of a section over its depth.

    Args:
        shape: The specimen.
        food: Its layers.

    Returns:
        Depths below the top [m], shape (POINTS[0],), and the chords of flesh, rind and core there [m], shape
        (3, POINTS[0]).
    """
    depth = (np.arange(POINTS[0]) + 0.5) / POINTS[0] * shape.height
    x = ((np.arange(POINTS[1]) + 0.5) / POINTS[1] - 0.5) * shape.width
    up, along = (axis.ravel() for axis in np.meshgrid(shape.height - depth, x, indexing="ij"))
    points = np.column_stack([along, np.zeros_like(along), up])
    marked = toughness(shape, replace(food, R=1.0, R_rind=2.0, R_core=3.0), points).reshape(POINTS)
    there = inside(shape, points).reshape(POINTS)
    return depth, np.array([(there & (marked == k)).sum(axis=1) for k in (1, 2, 3)]) * shape.width / POINTS[1]


def guess_at(parameters: ParameterSet, found: Mapping[str, float], pace: float = 1.0) -> FloatArray:
    """A start for a search.

    Args:
        parameters: What is fitted.
        found: Values [SI] by name that are known of it; of the others the present ones are taken.
        pace: Resistances at the speed of the trace over those at the reference speed [-].

    Returns:
        Internal coordinates (p,) of these values within the bounds.
    """
    found = {name: value / (pace if name in RESISTANCES else 1.0) for name, value in found.items()}
    values = {p.name: min(max(found.get(p.name, p.value), p.low), p.high) for p in parameters}
    return parameters.to_vector(values)
