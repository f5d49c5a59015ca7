"""Least squares of the fitted properties to the given numbers: on the coarse grid, corrected by the default one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from calib.problem.parameters import ParameterSet
from calib.scalars.cut_simulator import CutSimulator, Values
from calib.scalars.gauss_newton import LeastSquaresProblem, Minimum, gauss_newton, solve_together
from calib.scalars.published_data import PublishedData
from mpm.arrays import FloatArray

START_STRIDE = 1.0
"""Standard deviations of the prior to either side of a first fit, where further fits start: a peak where the cut begins
and one in its middle are two minima."""
CORRECTION_ROUNDS = 4  # fits, each corrected by the default grid at the end of the one before, at most
CORRECTION_TOLERANCE = 0.005  # change of the corrections below which they stand, in logarithms


def given_problem(
    published: PublishedData, noise: FloatArray | None = None, centre: FloatArray | None = None
) -> LeastSquaresProblem:
    """The given numbers as a least-squares problem.

    Args:
        published: The numbers.
        noise: Standard deviations [-] by which each is scattered, shape (n,).
        centre: Centre of the priors in internal coordinates [-], shape (p,); their own without it.

    Returns:
        The problem.
    """
    target = np.array([math.log(number.value) for _, number in published.given])
    sd = np.array([number.relative_sd for _, number in published.given])
    return LeastSquaresProblem(published.fitted, target if noise is None else target + noise * sd, sd, centre)


def given_values(
    simulator: CutSimulator,
    parameters: ParameterSet,
    fixed: Sequence[Values],
    asked: list[tuple[int, FloatArray]],
) -> list[FloatArray | None]:
    """What descents ask for, each with the values that are fixed in it.

    Args:
        simulator: Where it is simulated.
        parameters: The fitted properties.
        fixed: Values [SI] of other properties, of each descent.
        asked: Number of the descent, and internal coordinates [-] that it asks for, shape (p,).

    Returns:
        Logarithms of the given numbers (n,) at each point; None for a breakdown.
    """
    return simulator.given_numbers([{**fixed[k], **parameters.to_dict(z)} for k, z in asked])


def fit_given_numbers(simulator: CutSimulator) -> Minimum:
    """The fitted properties at which the default grid meets the given numbers best.

    Raises:
        PublishedError: The cut at the start or at the end breaks down.
    """
    published = simulator.published
    parameters, problem = published.fitted, given_problem(published)

    values = partial(given_values, simulator, parameters, [{}] * (1 + 2 * len(parameters)))
    ends = solve_together([gauss_newton(problem, parameters.start)], values)
    strides = START_STRIDE * np.diag(parameters.prior_sd)
    ends += solve_together([gauss_newton(problem, ends[0].z + stride) for stride in (*strides, *-strides)], values)
    for _ in range(CORRECTION_ROUNDS):
        end = min(ends, key=lambda one: problem.half_chi_square(one.z, one.y))
        if simulator.correct(parameters.to_dict(end.z)) < CORRECTION_TOLERANCE:
            break
        ends = solve_together([gauss_newton(problem, end.z, end.jacobian)], values)
    return end
