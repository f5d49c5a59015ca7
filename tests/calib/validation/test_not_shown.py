"""What a calibration says that it does not show."""

from __future__ import annotations

from calib.material.food import load_food
from calib.uncertainty.estimates import FittedParameter
from calib.validation.acceptance import Verdict
from calib.validation.not_shown import limits


def fitted(verdict: str) -> FittedParameter:
    """A parameter with a verdict."""
    return FittedParameter(1.0, "-", 0.5, 2.0, 0.1, 10.0, verdict, "assumed", None)


def said(parameters: dict[str, FittedParameter], assumed: tuple[str, ...] = ()) -> list[str]:
    """Of a measured cut of a banana."""
    return limits("measured", "position", "air", [], parameters, assumed, load_food("banana"))


def test_a_value_that_the_trace_bounds_is_not_called_the_literatures() -> None:
    """Each verdict on a parameter has its own sentence; what is identified has none."""
    verdicts = {"E": "not_seen", "mu": "not_seen", "R": "weak", "R_skin": "one_sided", "yield_stress": "identified"}
    told = " ".join(said({name: fitted(verdict) for name, verdict in verdicts.items()}))
    assert "The trace says nothing of E and mu: the intervals are the literature's" in told
    assert "The trace bounds R on both sides" in told and "The trace bounds R_skin on one side" in told
    assert "yield_stress" not in told
    assert not any("The trace" in text for text in said({"R": fitted("identified")}))


def test_the_name_of_a_column_keeps_its_letters() -> None:
    """Only a sentence that begins with a word begins with a capital."""
    told = said({}, ("base_Fz_N: the sign was turned", "the width is assumed"))
    assert "base_Fz_N: the sign was turned." in told and "The width is assumed." in told


def test_a_line_that_failed_is_looked_up_in_the_verdict_table() -> None:
    """Report and page both have that; only one of them has a first page."""
    failed = Verdict("peak force error", 0.2, 0.05, "fraction", False, "")
    told = limits("measured", "position", "air", [failed], {}, (), load_food("banana"))
    assert "peak force error: failed; see the verdict table." in told
