"""Repeats as a group: intervals, the area metric, ratios."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.errors import CurveError
from calib.texture.repeats import area_metric, ratio_of_means, scatter


def test_intervals_of_a_group():
    """Student's interval of the mean, and of one more repeat, by hand; none of one repeat. One more repeat of what is
    positive is judged by its logarithm: no interval reaches below zero."""
    one = scatter([1.0, 2.0, 3.0])
    assert (one.mean, one.sd, one.repeats) == (2.0, 1.0, 3)
    assert one.high - one.mean == pytest.approx(4.3027 / math.sqrt(3), rel=1e-4)
    signed = scatter([-1.0, 0.0, 1.0])
    assert signed.next_high == -signed.next_low == pytest.approx(4.3027 * math.sqrt(4 / 3), rel=1e-4)
    doubled = scatter([1.0, 2.0, 4.0])
    factor = math.exp(4.3027 * math.sqrt(4 / 3) * math.log(2.0))
    assert (doubled.next_low, doubled.next_high) == pytest.approx((2.0 / factor, 2.0 * factor), rel=1e-3)
    assert scatter([1.0, 5.0]).next_low > 0.0
    assert math.isnan(scatter([5.0]).sd) and math.isnan(scatter([5.0]).next_low)
    with pytest.raises(CurveError):
        scatter([])


def test_area_metric_in_closed_form():
    """Two values against two: the mean distance of the sorted ones; a shift is its size; one value is a step."""
    assert area_metric([1.0, 4.0], [2.0, 3.0]) == pytest.approx(1.0)
    values = np.random.default_rng(0).normal(size=50)
    assert area_metric(values + 0.7, values) == pytest.approx(0.7)
    assert area_metric(2.5, values) == pytest.approx(np.mean(np.abs(values - 2.5)))


def test_ratio_and_its_interval():
    """The interval holds the truth in about 95 of 100 draws of ten and ten, is the same for the same seed, and
    scales."""
    draw = np.random.default_rng(3)
    held = 0
    for _ in range(60):
        one, other = draw.normal(2.0, 0.3, 10), draw.normal(4.0, 0.6, 10)
        found = ratio_of_means(one, other, 0)
        held += found.low <= 0.5 <= found.high
    assert held >= 51
    assert found == ratio_of_means(one, other, 0) and found != ratio_of_means(one, other, 1)
    twice = ratio_of_means(2 * one, other, 0)
    assert (twice.value, twice.low) == pytest.approx((2 * found.value, 2 * found.low))
    assert math.isnan(ratio_of_means([1.0], [2.0, 3.0], 0).low)
    with pytest.raises(CurveError):
        ratio_of_means([1.0], [0.0], 0)
