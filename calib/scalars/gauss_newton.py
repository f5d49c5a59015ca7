"""Least squares with few evaluations: Gauss-Newton steps in a box, a Jacobian that learns from each step, many at once.

A descent is a generator. It yields points that it wants evaluated and is sent their values, so that
:func:`solve_together` evaluates the wishes of all descents as one batch.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import lsq_linear

from calib.problem.parameters import ParameterSet
from mpm.arrays import FloatArray

#: Points (p,) out, their values (n,) in; None for one that broke down.
Descent = Generator[list[FloatArray], list[FloatArray | None], "Minimum"]

MOST_STEPS = 16  # steps after which a descent ends
CONVERGED_GAIN = 0.005  # expected fall of half chi-square below which it has converged
FIRST_RADIUS = 0.75  # longest first step, in standard deviations of the priors


@dataclass(frozen=True)
class LeastSquaresProblem:
    """What a descent brings its values to.

    Attributes:
        parameters: Coordinates, bounds and priors.
        target: Values [-], shape (n,).
        sd: Their standard deviations [-], shape (n,).
        centre: Centre of the priors in internal coordinates [-], shape (p,); None for their own.
    """

    parameters: ParameterSet
    target: FloatArray
    sd: FloatArray
    centre: FloatArray | None = None

    def residual(self, z: FloatArray, y: FloatArray) -> FloatArray:
        """Distances from target and prior in standard deviations, (n + p,)."""
        p = self.parameters
        centre = p.prior_mean if self.centre is None else self.centre
        return np.concatenate([(y - self.target) / self.sd, p.prior_jacobian() @ (z - centre)])

    def half_chi_square(self, z: FloatArray, y: FloatArray | None) -> float:
        """Half chi-square at a point (p,) with its values (n,); infinite without values."""
        return float("inf") if y is None else 0.5 * float(np.sum(self.residual(z, y) ** 2))

    def residual_jacobian(self, jacobian: FloatArray) -> FloatArray:
        """Derivative of the residual, (n + p, p)."""
        return np.vstack([jacobian / self.sd[:, None], self.parameters.prior_jacobian()])


@dataclass(frozen=True)
class Minimum:
    """Where a descent ended.

    Attributes:
        z: Internal coordinates (p,).
        y: Values there (n,), None where its start broke down.
        jacobian: Derivative of the values (n, p).
        converged: Whether no step was expected to gain any more.
        evaluations: How many points were evaluated.
    """

    z: FloatArray
    y: FloatArray | None
    jacobian: FloatArray
    converged: bool
    evaluations: int


@dataclass
class _Iterate:
    """Where a descent stands."""

    problem: LeastSquaresProblem
    z: FloatArray
    y: FloatArray
    jacobian: FloatArray
    radius: float = field(default=FIRST_RADIUS)

    def step(self) -> tuple[FloatArray, float]:
        """The best step (p,) within bounds and radius, and the fall of half chi-square that is expected of it."""
        p = self.problem.parameters
        reach = self.radius * p.prior_sd
        low, high = np.maximum(p.lower - self.z, -reach), np.minimum(p.upper - self.z, reach)
        residual, slope = self.problem.residual(self.z, self.y), self.problem.residual_jacobian(self.jacobian)
        free = high - low > 1e-12
        step = np.zeros_like(self.z)
        if free.any():
            step[free] = lsq_linear(slope[:, free], -residual, (low[free], high[free])).x
        return step, self.problem.half_chi_square(self.z, self.y) - 0.5 * float(np.sum((residual + slope @ step) ** 2))

    def learn(self, step: FloatArray, y: FloatArray | None) -> None:
        """Go on to the new point if it is better; the Jacobian takes up what the step showed (Broyden 1965)."""
        if y is None:
            self.radius *= 0.5
            return
        scaled = step / self.problem.parameters.prior_sd**2
        missed = y - self.y - self.jacobian @ step
        self.jacobian = self.jacobian + np.outer(missed, scaled) / float(step @ scaled)
        if self.problem.half_chi_square(self.z + step, y) < self.problem.half_chi_square(self.z, self.y):
            self.z, self.y, self.radius = self.z + step, y, 2.0 * self.radius
        else:
            self.radius = 0.5 * float(np.max(np.abs(step) / self.problem.parameters.prior_sd))


def gauss_newton(problem: LeastSquaresProblem, start: FloatArray, jacobian: FloatArray | None = None) -> Descent:
    """Least squares from a start, by Gauss-Newton steps within a radius.

    Args:
        problem: What is aimed at.
        start: Internal coordinates [-], shape (p,).
        jacobian: Derivative of the values [-], shape (n, p), if it is about known; by differences otherwise.

    Returns:
        The descent; its value at the end is where it ended.
    """
    p = problem.parameters
    z = p.clip(np.asarray(start, float))
    count = 1
    y = (yield [z])[0]
    if y is None:
        return Minimum(z, None, np.zeros((len(problem.target), len(p))), False, count)
    if jacobian is None:
        sign = np.where(z + p.steps <= p.upper, 1.0, -1.0)
        beside = yield [z + sign * step for step in np.diag(p.steps)]
        count += len(p)
        columns = [
            np.zeros_like(y) if b is None else s * (b - y) / d for b, s, d in zip(beside, sign, p.steps, strict=True)
        ]
        jacobian = np.array(columns).T
    place = _Iterate(problem, z, y, jacobian)
    for _ in range(MOST_STEPS):
        step, gain = place.step()
        if gain < CONVERGED_GAIN:
            return Minimum(place.z, place.y, place.jacobian, True, count)
        count += 1
        place.learn(step, (yield [place.z + step])[0])
    return Minimum(place.z, place.y, place.jacobian, False, count)


def solve_together(
    descents: Sequence[Descent], values: Callable[[list[tuple[int, FloatArray]]], list[FloatArray | None]]
) -> list[Minimum]:
    """Run descents side by side.

    Args:
        descents: The descents.
        values: Called with (descent, point (p,)) pairs; returns their values (n,), None for what broke down.

    Returns:
        Where each ended.
    """
    ends: dict[int, Minimum] = {}
    wishes = {k: next(one) for k, one in enumerate(descents)}
    while wishes:
        asked = [(k, z) for k, points in wishes.items() for z in points]
        found = iter(values(asked))
        answers = {k: [next(found) for _ in points] for k, points in wishes.items()}
        wishes = {}
        for k, answer in answers.items():
            try:
                wishes[k] = descents[k].send(answer)
            except StopIteration as end:
                ends[k] = end.value
    return [ends[k] for k in range(len(descents))]
