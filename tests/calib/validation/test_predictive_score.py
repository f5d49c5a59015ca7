"""Bands and the lines that a wrong food does not pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.uncertainty.estimates import FittedParameter
from calib.validation.acceptance import discrimination, identified_words
from calib.validation.null_models import null_models
from calib.validation.predictive_score import PredictiveScore, interval_score, predictive_score
from tests.calib.fake import GRID, STROKE, three_terms

TRUTH = {"E": 6e5, "yield_stress": 6e4, "R": 400.0, "R_skin": 250.0, "mu": 0.25}
MEASURED = np.interp(GRID, STROKE, three_terms(TRUTH))
NULLS = null_models(GRID, MEASURED)


def lines(half: float, explained: float = 0.5, off: float = 0.0) -> dict[str, bool | None]:
    """Whether each line passes with a band of a half width about the measured curve, and off it [parts of the peak]."""
    peak = float(MEASURED.max())
    middle = MEASURED + off * peak
    found = predictive_score(explained, (middle - half * peak, middle + half * peak), MEASURED, NULLS)
    return {v.name: v.passed for v in discrimination(found)}


def test_interval_score_charges_for_width_and_for_what_lies_outside() -> None:
    """A band of 2 that holds the curve scores 2; where the curve is 0.5 outside of it, 20 more."""
    zero = np.zeros(10)
    assert interval_score(zero - 1.0, zero + 1.0, zero) == pytest.approx(2.0)
    assert interval_score(zero - 1.0, zero + 1.0, zero + 1.5) == pytest.approx(2.0 + 40.0 * 0.5)


def test_a_narrow_band_that_holds_the_curve_passes() -> None:
    """5 % of the peak either way."""
    assert all(lines(0.05).values())


def test_a_band_that_holds_anything_does_not_pass() -> None:
    """One and a half peaks either way hold the whole curve, and fail twice."""
    found = lines(1.5)
    assert found["width of the 95 % band"] is False
    assert found["interval score better than null models"] is False
    assert found["curve explained by the food"] is True


def test_a_narrow_band_beside_the_curve_does_not_pass() -> None:
    """Sharp and wrong: by its score."""
    found = lines(0.02, off=0.4)
    assert found["width of the 95 % band"] is True
    assert found["interval score better than null models"] is False


def test_a_misfit_that_the_right_food_would_not_leave_fails() -> None:
    """A p-value below one in a hundred."""
    assert lines(0.05, explained=0.009)["curve explained by the food"] is False
    assert lines(0.05, explained=0.011)["curve explained by the food"] is True


@pytest.mark.parametrize(
    ("score", "said"), [(0.2, "no better than seven numbers (20.0 %)"), (0.4, "seven numbers: 40.0 %")]
)
def test_it_is_said_whether_seven_numbers_do_as_well(score: float, said: str) -> None:
    """A description with seven numbers decides nothing, and is named where it has the better score."""
    found = discrimination(PredictiveScore(0.5, 0.1, 0.3, {"ramp": 0.5, "three_term": score}))
    (line,) = (v for v in found if v.name == "interval score better than null models")
    assert line.passed is True and str(line.note).replace("\u00a0", " ").endswith(said)


def test_it_is_said_how_many_parameters_are_identified() -> None:
    """Counted and named."""
    weak = FittedParameter(1.0, "Pa", 0.5, 2.0, 0.1, 10.0, "weak", "assumed", None)
    fitted = {"E": weak, "R": replace(weak, verdict="identified")}
    assert identified_words(fitted) == "1 of 2 parameters identified: R"
    assert identified_words({"E": weak}) == "0 of 1 parameters identified"
