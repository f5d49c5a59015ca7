"""Repeats as a group: mean and scatter, a model judged against them, and a ratio of two groups with its interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student
from scipy.stats import wasserstein_distance

from calib.errors import CurveError
from calib.io.type_schema import Count, NumberOrNull
from mpm.arrays import FloatArray

DRAWS = 4000
"""Draws of a bootstrap."""


@dataclass(frozen=True)
class Scatter:
    """One quantity of a group of repeats.

    Attributes:
        mean: Mean of the repeats, in the unit of the quantity.
        sd: Their standard deviation; null for one repeat.
        low: Lower end of the 95 % interval of the mean (Student); null for one repeat.
        high: Upper end; null for one repeat.
        next_low: Lower end of the 95 % interval of one more repeat: Student's of the logarithms where all repeats are
            above 0, else of the values; null for one repeat.
        next_high: Upper end; null for one repeat.
        repeats: Number of repeats.
    """

    mean: float
    sd: NumberOrNull
    low: NumberOrNull
    high: NumberOrNull
    next_low: NumberOrNull
    next_high: NumberOrNull
    repeats: Count


def scatter(values: Sequence[float] | FloatArray) -> Scatter:
    """Mean and scatter of the values of a group.

    Raises:
        CurveError: There is no value.
    """
    x = np.asarray(values, dtype=float)
    n = len(x)
    if not n:
        raise CurveError("a group without repeats has no mean")
    mean = float(x.mean())
    if n == 1:
        return Scatter(mean, math.nan, math.nan, math.nan, math.nan, math.nan, 1)
    sd, wide = float(x.std(ddof=1)), float(student.ppf(0.975, n - 1))
    half = wide * sd / math.sqrt(n)
    low, high = _one_more(np.log(x)) if x.min() > 0.0 else _one_more(x)
    if x.min() > 0.0:
        low, high = math.exp(low), math.exp(high)
    return Scatter(mean, sd, mean - half, mean + half, low, high, n)


def _one_more(x: FloatArray) -> tuple[float, float]:
    """Student's 95 % interval of one more value; x is two values or more, shape (n,)."""
    n = len(x)
    wide = float(student.ppf(0.975, n - 1)) * float(x.std(ddof=1)) * math.sqrt(1.0 + 1.0 / n)
    return float(x.mean()) - wide, float(x.mean()) + wide


def area_metric(model: float | Sequence[float] | FloatArray, measured: Sequence[float] | FloatArray) -> float:
    """Area between the distribution of a model and that of repeats (Ferson, Oberkampf and Ginzburg 2008, Comput.
    Methods Appl. Mech. Eng. 197:2408-2430), in the unit of the values.

    In one dimension it is the Wasserstein distance of order 1. One value of a model without scatter is a step.
    """
    return float(wasserstein_distance(np.atleast_1d(model), np.atleast_1d(measured)))


@dataclass(frozen=True)
class Ratio:
    """Ratio of the means of two groups.

    Attributes:
        value: Mean along over mean across [-].
        low: Lower end of its 95 % interval, bootstrap over specimens; null where a group has one repeat.
        high: Upper end; null where a group has one repeat.
    """

    value: float
    low: NumberOrNull
    high: NumberOrNull


def ratio_of_means(above: Sequence[float], below: Sequence[float], seed: int) -> Ratio:
    """Ratio of the means of two groups, with an interval by the bootstrap over specimens.

    The interval is the percentile one (Efron and Tibshirani 1993, chapter 13). Specimens are drawn again within each
    group.

    Args:
        above: Values of the one group.
        below: Values of the other, in the same unit.
        seed: Seed of the draws.

    Returns:
        The ratio.

    Raises:
        CurveError: The mean of the other group is zero.
    """
    one, other = np.asarray(above, dtype=float), np.asarray(below, dtype=float)
    if other.mean() == 0.0:
        raise CurveError("a ratio to a group whose mean is zero")
    value = float(one.mean() / other.mean())
    if min(len(one), len(other)) < 2:
        return Ratio(value, math.nan, math.nan)
    draw = np.random.default_rng(seed)
    tops, bottoms = (group[draw.integers(len(group), size=(DRAWS, len(group)))].mean(axis=1) for group in (one, other))
    low, high = np.percentile(tops / bottoms, [2.5, 97.5])
    return Ratio(value, float(low), float(high))
