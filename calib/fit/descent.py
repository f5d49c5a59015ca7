"""A descent on cheap simulations: Levenberg-Marquardt with a Jacobian of differences, for valleys of many parameters.

A surrogate of fifteen parameters needs more runs than a screening has before it knows where a valley leads. One step
along each parameter says so at once, and all these runs are made at a time. Steps of several dampings are tried in one
batch; what they find corrects the Jacobian (Broyden 1965, Math. Comput. 19:577), and only where that no longer helps
are differences made anew.

Source: More 1978, Lecture Notes in Mathematics 630:105, for the scaling and the damping.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

DAMPINGS = (0.003, 0.03, 0.1, 0.4, 1.5, 6.0)
"""Dampings that are tried, over the diagonal of the normal equations and times the present damping [-]."""
USUAL_DAMPING = 0.1
"""That of them which keeps the present damping as it is; a longer step lowers it, a shorter one raises it [-]."""
DAMPING_RANGE = (0.1, 30.0)
"""Range of the present damping [-]."""
REFINED = 0.1
"""Part of the chi-square that a step must gain for the corrected Jacobian to be used for another one [-]."""
LEAST_GAIN = 0.01
"""Part of the chi-square that a step along new differences must gain for the descent to go on [-]."""
NEXT_TO_NOTHING = 1e-9
"""Added to the diagonal, for a parameter that is not felt."""


def descend(
    run: Callable[[Sequence[FloatArray]], list[ScoredRun]],
    steps: FloatArray,
    inwards: FloatArray,
    start: ScoredRun,
    most: float = math.inf,
) -> ScoredRun:
    """Follow a valley down.

    Args:
        run: Runs points, internal coordinates [-] (p,) each, or looks them up; those that can be paid, in any order.
        steps: Steps of the differences [-] (p,).
        inwards: Point on whose side of the present one the differences are made [-] (p,).
        start: Where it begins.
        most: How often differences are made.

    Returns:
        The best run, after the last that brought a gain or could be paid.
    """
    best, damping, made = start, 1.0, 0
    while made < most:
        made += 1
        signs = np.where(best.z > inwards, -1.0, 1.0)
        sides = run([best.z + d for d in np.diag(signs * steps)])
        if len(sides) < len(steps):
            return min([best, *sides], key=_misfit)
        jacobian = _differences(best, sides)
        begun = best.misfit
        while True:
            before, trials = best, _trials(best, jacobian, damping)
            tried = run(trials)
            best = min([best, *sides, *tried], key=_misfit)
            jacobian = _corrected(jacobian, before, tried)
            if any(best is one for one in tried):
                nearest = int(np.argmin([np.abs(trial - best.z).max() for trial in trials]))
                damping = float(np.clip(damping * DAMPINGS[nearest] / USUAL_DAMPING, *DAMPING_RANGE))
            if not tried or before.misfit - best.misfit <= REFINED * before.misfit:
                break
        if not tried or begun - best.misfit <= LEAST_GAIN * begun:
            break
    return best


def _misfit(run: ScoredRun) -> float:
    """Chi-square of a run; of one that broke down it is no answer."""
    return run.misfit if run.ok else math.inf


def _differences(best: ScoredRun, sides: Sequence[ScoredRun]) -> FloatArray:
    """Derivatives of the residual by least squares through steps along each parameter (rows, p)."""
    moved = np.array([side.z - best.z for side in sides])
    changed = np.array([side.residual - best.residual if side.ok else 0.0 * best.residual for side in sides])
    return np.linalg.lstsq(moved, changed, rcond=None)[0].T


def _trials(best: ScoredRun, jacobian: FloatArray, damping: float) -> list[FloatArray]:
    """Steps of several dampings from the best point."""
    normal, slope = jacobian.T @ jacobian, jacobian.T @ best.residual
    diagonal = np.diag(np.diag(normal) + NEXT_TO_NOTHING)
    return [best.z - np.linalg.solve(normal + k * damping * diagonal, slope) for k in DAMPINGS]


def _corrected(jacobian: FloatArray, best: ScoredRun, tried: Sequence[ScoredRun]) -> FloatArray:
    """Broyden's correction of the Jacobian by runs that are known."""
    for run in sorted(tried, key=_misfit, reverse=True):
        step = run.z - best.z
        length = float(step @ step)
        if run.ok and length > 0:
            wrong = run.residual - best.residual - jacobian @ step
            jacobian = jacobian + np.outer(wrong, step) / length
    return jacobian
