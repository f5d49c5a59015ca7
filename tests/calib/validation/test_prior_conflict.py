"""Prior-data conflict: how probable it is before the trace that a food leads to such values."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from calib.material.food import load_food
from calib.material.scene import Sizing, specimen
from calib.problem.parameters import Parameter, ParameterSet
from calib.validation.acceptance import CONFLICT_LINE, SIZE_LINE, discrimination
from calib.validation.predictive_score import PredictiveScore
from calib.validation.prior_conflict import PriorConflict, prior_conflict, probability_of_size

NAMES = ("E", "yield_stress", "R", "R_skin")
FOOD = ParameterSet(tuple(Parameter(n, 1.0, 1e-4, 1e4, "Pa", 0.1, 10.0) for n in NAMES))
SD = FOOD.items[0].prior_sd
SEEN = np.array([0.05, 0.1, 0.3, 1.0])
"""Posterior standard deviations over the prior's: the trace says nothing of the last property."""


def found(away: list[float]) -> PriorConflict:
    """The conflict of values so many prior standard deviations off, each known by itself."""
    return prior_conflict(FOOD, SD * np.array(away), np.diag((SD * SEEN) ** 2))


def test_no_value_is_further_away_than_all_of_them() -> None:
    """The distance of one property counts the combinations that T counts, so its square is no more than T."""
    random = np.random.default_rng(5)
    for _ in range(200):
        slopes = random.standard_normal((3, 4)) * np.array([[5.0], [2.0], [0.3]])
        covariance = np.linalg.inv(slopes.T @ slopes + np.eye(4))
        conflict = prior_conflict(FOOD, SD * 2.0 * random.standard_normal(4), SD**2 * covariance)
        assert conflict.distance**2 <= chi2.isf(conflict.probability, conflict.directions) * (1.0 + 1e-9)


def test_a_food_of_the_literature_is_refused_as_often_as_said() -> None:
    """Values that the prior draws and a linear trace of three combinations estimates: p is uniform, so that one in a
    hundred is below 0.01 and half are below 0.5."""
    random = np.random.default_rng(4)
    slopes = random.standard_normal((3, 4)) * np.array([[5.0], [2.0], [1.0]])
    covariance = np.linalg.inv(slopes.T @ slopes + np.eye(4))
    p = []
    for _ in range(2000):
        data = slopes @ random.standard_normal(4) + random.standard_normal(3)
        p.append(prior_conflict(FOOD, SD * covariance @ slopes.T @ data, SD**2 * covariance).probability)
    assert np.mean(np.array(p) < 0.01) == pytest.approx(0.01, abs=0.006)
    assert np.mean(np.array(p) < 0.5) == pytest.approx(0.5, abs=0.04)


def test_values_far_from_the_literature_conflict() -> None:
    """Two properties at 3 and -2.5 standard deviations: p = exp(-chi-square/2) and less, by the worse one."""
    conflict = found([3.0, -2.5, 0.0, 0.0])
    assert conflict.probability < 0.01
    assert (conflict.furthest, round(conflict.distance, 1)) == ("E", 3.0)
    assert found([1.0, -1.0, 1.0, 0.0]).probability > 0.3


def test_an_estimate_that_the_prior_has_pulled_counts_for_more() -> None:
    """The same distance where the prior holds against the trace means that the trace asks for more."""
    pulled = prior_conflict(FOOD, SD * np.array([1.8, 0, 0, 0]), np.diag((SD * np.array([0.8, 1, 1, 1])) ** 2))
    free = prior_conflict(FOOD, SD * np.array([1.8, 0, 0, 0]), np.diag((SD * np.array([0.1, 1, 1, 1])) ** 2))
    assert pulled.probability < 0.01 < free.probability
    assert pulled.distance == pytest.approx(1.8 / math.sqrt(1 - 0.64))


def test_a_trace_that_says_nothing_conflicts_with_nothing() -> None:
    """No combination is seen, so there is nothing to test."""
    silent = prior_conflict(FOOD, np.zeros(4), SD**2 * np.eye(4))
    assert (silent.probability, silent.directions) == (1.0, 0)


def test_the_verdict_has_a_line_for_it_that_fails() -> None:
    """Below one in a hundred; the property that is furthest away is named."""

    def line(p: float) -> tuple[bool | None, str | None]:
        score = PredictiveScore(0.5, 0.1, 0.1, {"ramp": 0.5}, PriorConflict(p, 3, "R", 4.2))
        (one,) = (v for v in discrimination(score) if v.name == CONFLICT_LINE)
        return one.passed, one.note

    assert line(0.009)[0] is False and line(0.011)[0] is True
    assert "furthest: R, by 4.2 sd" in str(line(0.5)[1])


def test_a_specimen_larger_than_the_food_conflicts_and_a_piece_does_not() -> None:
    """A grape of 38 mm is no grape; one at the upper end of the 95 % range has 2.5 %; a piece of an apple, its half and
    the whole fruit are apples, whichever way they lie."""
    grape, apple = load_food("grape"), load_food("apple")
    long = specimen(grape, None, Sizing(length=0.038))[0]
    assert probability_of_size(grape, long) < 0.01
    usual = specimen(grape, None, Sizing(length=grape.dims["length"].high))[0]
    assert probability_of_size(grape, usual) == pytest.approx(0.025)
    for height in (0.02, 0.0375):
        assert probability_of_size(apple, specimen(apple, None, Sizing(height=height))[0]) > 0.1
    whole = specimen(apple, None, Sizing("sphere", 0.075, 0.075, 0.075))[0]
    assert probability_of_size(apple, whole) > 0.1


def test_the_verdict_has_a_line_for_the_size_that_fails() -> None:
    """Below one in a hundred."""
    for p, passed in ((0.009, False), (0.011, True)):
        (line,) = (
            v for v in discrimination(PredictiveScore(0.5, 0.1, 0.1, {"ramp": 0.5}, None, p)) if v.name == SIZE_LINE
        )
        assert line.passed is passed
