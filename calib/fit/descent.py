"""A descent on cheap simulations: Levenberg-Marquardt with a Jacobian of differences, for valleys of many parameters.

A surrogate of fifteen parameters needs more runs than a screening has before it knows where a valley leads. One step
along each parameter says so at once, and all these runs are made at a time. Steps of several dampings are tried in one
batch; what they find corrects the Jacobian (Broyden 1965, Math. Comput. 19:577), and only where that no longer helps
are differences made anew. Several descents are raced, for a curve may be that of foods far apart.

Source: More 1978, Lecture Notes in Mathematics 630:105, for the scaling and the damping.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import lsq_linear

from calib.problem.parameters import ParameterSet
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
LEAST_GAIN = 0.03
"""Part of the chi-square that a step along new differences must gain for the descent to go on [-]."""
NEXT_TO_NOTHING = 1e-9
"""Added to the diagonal, for a parameter that is not felt."""


class Descent:
    """A way down a valley, one set of differences at a time.

    Args:
        run: Runs points, internal coordinates [-] (p,) each, or looks them up; those that can be paid, in any order.
        parameters: What is fitted, with steps, bounds and priors. Differences are made on the side of the prior's
            centre. A step along a parameter is at most one standard deviation of its prior long.
        start: Where it begins.

    Attributes:
        best: The best run so far.
        gained: What the last set of differences has taken off the chi-square [-].
        over: Whether it has ended: the last set brought no gain, or could not be paid.
    """

    def __init__(
        self,
        run: Callable[[Sequence[FloatArray]], list[ScoredRun]],
        parameters: ParameterSet,
        start: ScoredRun,
    ) -> None:
        self.run, self.parameters = run, parameters
        self.best, self.gained, self.over = start, math.inf, False
        self._damping = 1.0

    def go_on(self) -> None:
        """Make one set of differences, and step along them as long as that helps."""
        begun = self.best.misfit
        paid = self._follow()
        self.gained = begun - self.best.misfit
        self.over = not paid or self.gained <= LEAST_GAIN * begun

    def _follow(self) -> bool:
        """The same; False where the differences, or none of the steps, could be paid."""
        best = self.best
        signs = np.where(best.z > self.parameters.prior_mean, -1.0, 1.0)
        sides = self.run([best.z + d for d in np.diag(signs * self.parameters.steps)])
        self.best = min([best, *sides], key=_misfit)
        if len(sides) < len(self.parameters):
            return False
        jacobian = _differences(best, sides)
        while True:
            trials = _trials(best, jacobian, self._damping, self.parameters)
            tried = self.run(trials)
            before, best = best, min([best, *sides, *tried], key=_misfit)
            self.best = best
            jacobian = _corrected(jacobian, before, tried)
            if any(best is one for one in tried):
                nearest = int(np.argmin([np.abs(trial - best.z).max() for trial in trials]))
                self._damping = float(np.clip(self._damping * DAMPINGS[nearest] / USUAL_DAMPING, *DAMPING_RANGE))
            if not tried or before.misfit - best.misfit <= REFINED * before.misfit:
                return bool(tried)


def race(descents: Sequence[Descent]) -> list[ScoredRun]:
    """Let several descents go on in turn, each as long as it may still win.

    One drops out where its last gain, made once more, would leave it above the best of all: the valley that is lowest
    after one set of differences need not be the deepest.

    Args:
        descents: The descents.

    Returns:
        The best run of each, in their order.

    Source: racing, Maron and Moore 1994, Advances in Neural Information Processing Systems 6:59.
    """
    running = [one for one in descents if one.best.ok]
    while running:
        for one in running:
            one.go_on()
        least = min(_misfit(one.best) for one in descents)
        running = [one for one in running if not one.over and one.best.misfit - one.gained <= least]
    return [one.best for one in descents]


def _misfit(run: ScoredRun) -> float:
    """Chi-square of a run; of one that broke down it is no answer."""
    return run.misfit if run.ok else math.inf


def _differences(best: ScoredRun, sides: Sequence[ScoredRun]) -> FloatArray:
    """Derivatives of the residual by least squares through steps along each parameter (rows, p)."""
    moved = np.array([side.z - best.z for side in sides])
    changed = np.array([side.residual - best.residual if side.ok else 0.0 * best.residual for side in sides])
    return np.linalg.lstsq(moved, changed, rcond=None)[0].T


def _trials(best: ScoredRun, jacobian: FloatArray, damping: float, parameters: ParameterSet) -> list[FloatArray]:
    """Steps of several dampings from the best point. What a parameter at its bound cannot do is left to the others."""
    scale = np.sqrt((jacobian**2).sum(axis=0) + NEXT_TO_NOTHING)
    wanted = np.concatenate([-best.residual, np.zeros(len(scale))])
    longest = parameters.prior_sd
    room = np.maximum(parameters.lower - best.z, -longest), np.minimum(parameters.upper - best.z, longest)
    rows = [np.vstack([jacobian, math.sqrt(k * damping) * np.diag(scale)]) for k in DAMPINGS]
    return [best.z + lsq_linear(each, wanted, bounds=room, method="bvls").x for each in rows]


def _corrected(jacobian: FloatArray, best: ScoredRun, tried: Sequence[ScoredRun]) -> FloatArray:
    """Broyden's correction of the Jacobian by runs that are known."""
    for run in sorted(tried, key=_misfit, reverse=True):
        step = run.z - best.z
        length = float(step @ step)
        if run.ok and length > 0:
            wrong = run.residual - best.residual - jacobian @ step
            jacobian = jacobian + np.outer(wrong, step) / length
    return jacobian
