"""Fits to scattered numbers at drawn properties: randomised maximum likelihood (Oliver, He and Reynolds 1996).

What is not fitted is drawn from its prior. For each draw the fit is made again, to given numbers that are scattered by
their own uncertainty and with priors centred on a draw from them, so that what the numbers leave open stays open. Draws
that cannot meet the numbers are left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.stats import norm, qmc

from calib.scalars.cut_simulator import CutSimulator
from calib.scalars.gauss_newton import LeastSquaresProblem, Minimum, gauss_newton, solve_together
from calib.scalars.given_numbers_fit import given_problem, given_values
from calib.scalars.published_data import QUANTITIES, PublishedData
from calib.scalars.result import MET_WITHIN
from calib.validation.prior_predictive import draw
from mpm.arrays import FloatArray


@dataclass(frozen=True)
class RandomisedFits:
    """What the draws came to.

    Attributes:
        values: Values [SI] by property, of each draw that met the given numbers.
        numbers: Logarithms [-] by cut and quantity, of the same draws.
        unmet: How many could not meet them.
        broken: How many broke down.
    """

    values: list[dict[str, float]]
    numbers: list[dict[tuple[str, str], float]]
    unmet: int
    broken: int


def randomised_fits(simulator: CutSimulator, best: Minimum, draws: int, seed: int) -> RandomisedFits:
    """Fit again for each draw of what is not fitted, and predict with it.

    Args:
        simulator: Where it is simulated; corrected at the best values.
        best: The fit at the values of the food.
        draws: How many draws; 0 for none.
        seed: Their seed.

    Returns:
        What the draws came to.
    """
    if draws == 0:
        return RandomisedFits([], [], 0, 0)
    published = simulator.published
    fixed, problems, centres = _draws(published, draws, seed)
    ends = _best_ends(simulator, best, fixed, problems, centres)
    whole = [k for k in range(draws) if ends[k].y is not None]
    kept = [k for k in whole if _met(problems[k], ends[k])]
    values = [fixed[k] | published.fitted.to_dict(ends[k].z) for k in kept]
    rows: list[dict[tuple[str, str], float]] = [{} for _ in kept]
    for cut in published.cuts:
        for row, found in zip(rows, simulator.simulate(cut, values), strict=True):
            row.update({(cut.name, quantity): x for quantity, x in (found or {}).items()})
    good = [k for k, row in enumerate(rows) if len(row) == len(published.cuts) * len(QUANTITIES)]
    return RandomisedFits(
        [values[k] for k in good],
        [rows[k] for k in good],
        unmet=len(whole) - len(kept),
        broken=draws - len(whole) + len(kept) - len(good),
    )


def _draws(
    published: PublishedData, draws: int, seed: int
) -> tuple[list[dict[str, float]], list[LeastSquaresProblem], list[FloatArray]]:
    """Values of what is not fitted, the problem with scattered numbers, and the centre of its priors, of each draw."""
    parameters, varied = published.fitted, published.varied
    fixed: list[dict[str, float]] = draw(varied, draws, seed) if varied is not None else [{}] * draws
    sample = qmc.Sobol(len(published.given), scramble=True, seed=seed + 1).random_base2(math.ceil(math.log2(draws)))
    noise = norm.ppf(sample[:draws])
    centres = [parameters.to_vector(x) for x in draw(parameters, draws, seed + 2)]
    problems = [given_problem(published, *both) for both in zip(noise, centres, strict=True)]
    return fixed, problems, centres


def _best_ends(
    simulator: CutSimulator,
    best: Minimum,
    fixed: Sequence[dict[str, float]],
    problems: Sequence[LeastSquaresProblem],
    centres: Sequence[FloatArray],
) -> dict[int, Minimum]:
    """Ends of fits from the best values; where one does not meet the numbers, also from its centre: the better one."""
    parameters = simulator.published.fitted
    ends: dict[int, Minimum] = {}
    starts: Sequence[FloatArray] = [best.z] * len(problems)
    for again in (False, True):
        late = [k for k in range(len(problems)) if not _met(problems[k], ends.get(k))]
        retried = solve_together(
            [gauss_newton(problems[k], starts[k], None if again else best.jacobian) for k in late],
            partial(given_values, simulator, parameters, [fixed[k] for k in late]),
        )
        for k, end in zip(late, retried, strict=True):
            misfit = problems[k].half_chi_square
            if k not in ends or misfit(end.z, end.y) < misfit(ends[k].z, ends[k].y):
                ends[k] = end
        starts = centres
    return ends


def _met(problem: LeastSquaresProblem, end: Minimum | None) -> bool:
    """Whether a fit meets all given numbers."""
    if end is None or end.y is None:
        return False
    return bool(np.max(np.abs(end.y - problem.target) / problem.sd) <= MET_WITHIN)
