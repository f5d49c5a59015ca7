"""Whether the values that a trace asks for are those of the food that is claimed: prior-data conflict.

With priors as wide as the literature's, a wrong food can often be bent until it draws the curve. What it is bent to
then lies beyond its literature in several properties at once. Before the trace is seen, the most probable values z
that it will lead to are normal about the prior's mean m, with the covariance that the prior loses to the trace (normal
approximation, P the prior's and S the posterior's covariance):

    z - m ~ N(0, P - S),   T = (z - m)^T (P - S)^-1 (z - m) ~ chi-square

Where the trace says nothing of a direction, P - S is zero there and so is z - m: such directions are left out, and each
other one is a degree of freedom. This is the part of Box's prior predictive check that the size of the misfit leaves
over (Box 1980, J. R. Statist. Soc. A 143:383; Evans and Moshonov 2006, Bayesian Anal. 1:893).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, norm

from calib.material.food import FoodSpec
from calib.problem.parameters import Z95, ParameterSet
from calib.uncertainty.intervals import NOT_SEEN
from mpm.arrays import FloatArray
from mpm.scene.shapes import Shape

SIZES = ("length", "width", "height")


@dataclass(frozen=True)
class PriorConflict:
    """How far the values that a trace asks for are from what was known of the food.

    Attributes:
        probability: How probably the claimed food would lead to values as far from its literature [-].
        directions: Combinations of properties that the trace tells something of.
        furthest: The property whose value is furthest away in these combinations.
        distance: How far, in standard deviations of what was to be expected of it there [-], with its sign. Its square
            is no more than T.
    """

    probability: float
    directions: int
    furthest: str
    distance: float


def prior_conflict(parameters: ParameterSet, values: FloatArray, covariance: FloatArray) -> PriorConflict:
    """The conflict between a posterior and its prior.

    Args:
        parameters: The fitted parameters with their priors.
        values: Most probable values, in internal coordinates [-] (p,).
        covariance: Covariance of the posterior there [-] (p, p).

    Returns:
        The conflict.
    """
    root = parameters.prior_jacobian()
    left, axes = np.linalg.eigh(root @ covariance @ root.T)
    seen = left <= NOT_SEEN**2
    away, taken = (axes.T @ parameters.prior_residual(values))[seen], 1.0 - left[seen]
    size = float(np.sum(away**2 / taken))
    count = int(seen.sum())
    parts = np.linalg.solve(root, axes[:, seen])  # of the properties, by one unit of each combination
    variance = parts**2 @ taken
    # of a property of which the trace says nothing, the little that it says is mostly the fit's own noise
    told = variance >= (1.0 - NOT_SEEN**2) * parameters.prior_sd**2
    alone = np.where(told, parts @ away / np.sqrt(np.where(told, variance, 1.0)), 0.0)
    furthest = int(np.argmax(np.abs(alone)))
    names: Sequence[str] = parameters.names
    probability = float(chi2.sf(size, count)) if count else 1.0
    return PriorConflict(probability, count, names[furthest], float(alone[furthest]))


def probability_of_size(food: FoodSpec, shape: Shape) -> float:
    """How probably a whole food of the literature is as large as a specimen.

    The largest size of the one is compared with that of the other, whichever way they lie. A specimen that is smaller
    is a piece, and says nothing.

    Args:
        food: The food, whose sizes are lognormal with the literature's 95 % ranges.
        shape: The specimen.

    Returns:
        Probability [-]; 1 where the literature has no range.
    """
    known = max((food.dims[name] for name in SIZES if name in food.dims), key=lambda d: d.value or 0.0, default=None)
    if known is None or not (known.low and known.high):
        return 1.0
    low, high = np.log([known.low, known.high])
    own = np.log(max(getattr(shape, name) for name in SIZES))
    return float(norm.sf((own - 0.5 * (low + high)) / ((high - low) / (2.0 * Z95))))
