"""What of a trace no combination of simulated curves follows: stick and slip of the blade, cracks that run ahead, the arm's swing.

The model's error is taken for a part of the peak everywhere (:data:`calib.objective.DISCREPANCY`).  Where a trace swings by more
than that about everything that the food can do in the simulation, the material is not to blame, and a search that goes on for it
spends its simulations for nothing.  The measured curve is therefore projected on the leading shapes of the first simulated ones,
beside tare, drift and lag; a combination of them need not belong to any material, so what it leaves is the least that the model
is off there, wherever the search ends.  Its local root mean square, where it is the larger one, takes the place of the constant
part: a variance that follows the residuals (Carroll & Ruppert 1988, Transformation and Weighting in Regression, ch. 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from calib.joint import JointObjective
from calib.objective import Objective, Trial

FloatArray = npt.NDArray[np.float64]

SHAPES = 8
"""Leading shapes of the simulated curves: one for each parameter that is usually fitted, and their mean."""
LIBRARY = 2 * SHAPES
"""Least number of simulated curves whose shapes say something of what the food can do."""
MENTIONED = 1.5
"""Roughness over the model's error elsewhere from which a reader is told of it."""


def roughened(objective: Objective | JointObjective, trials: Sequence[Trial]) -> Objective | JointObjective:
    """The objective with the roughness of its traces, as the first simulations show it.

    Args:
        objective: What is fitted.
        trials: Its simulations so far; those that broke down are left out.
    """
    whole = [t for t in trials if t.ok]
    if len(whole) < LIBRARY:
        return objective
    found = [
        replace(c.objective, rough=roughness(c.objective, np.array([t.each[k].curve for t in whole])))
        for k, c in enumerate(objective.cases)
    ]
    if isinstance(objective, Objective):
        return found[0]
    return replace(objective, cases=tuple(replace(c, objective=o) for c, o in zip(objective.cases, found, strict=True)))


def roughness(objective: Objective, curves: FloatArray) -> FloatArray:
    """Local root mean square of what simulated curves leave of a measured one [N] (n,).

    Args:
        objective: That of the trace.
        curves: Smoothed simulated forces on its grid [N] (m, n).
    """
    own = curves / np.abs(curves).max(axis=1, keepdims=True)
    shapes = np.linalg.svd(own, full_matrices=False)[2][:SHAPES]
    open_ended = [n.shape / np.abs(n.shape).max() for n in objective.nuisances if n.searched]
    columns = np.vstack([shapes, *open_ended]).T
    target = objective.target
    left = target.curve - columns @ np.linalg.lstsq(columns, target.curve, rcond=None)[0]
    width = objective.errors.correlation * (target.curve.size - 1)
    local: FloatArray = np.sqrt(gaussian_filter1d(left**2, width, mode="nearest"))
    return local


def rough_parts(objective: Objective) -> list[tuple[float, float, float]]:
    """Where a trace is much rougher than the model's error elsewhere: first and last stroke [m], root mean square [N] there."""
    target, rough = objective.target, np.broadcast_to(objective.rough, objective.target.curve.shape)
    much = rough > MENTIONED * objective.errors.discrepancy * target.peak
    beyond = np.flatnonzero(np.diff(np.concatenate([[0], much, [0]])))
    return [
        (float(target.stroke[a]), float(target.stroke[b - 1]), float(np.sqrt(np.mean(rough[a:b] ** 2))))
        for a, b in beyond.reshape(-1, 2)
    ]


def words(objective: Objective) -> list[str]:
    """The same in words, one sentence each."""
    peak = objective.target.peak
    return [
        f"from {a * 1e3:.0f} to {b * 1e3:.0f} mm of the stroke the trace swings by {size:.2g} N ({size / peak:.0%} of the peak) "
        "about all that the simulation can do: its tolerance there is that, and the fit hardly looks at it"
        for a, b, size in rough_parts(objective)
    ]
