"""The width of a specimen that its blade does not reach across is fitted."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.api import Calibration
from calib.errors import MaterialError
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, of_specimen, specimen, width_range
from calib.problem.food_parameters import fit_parameters, size_relative_sd
from calib.problem.setup import Setup, set_up
from calib.trace.trace import Trace
from tests.calib.made_cuts import made_cut

APPLE = load_food("apple")
SHORT, LONG = load_knife("edc"), load_knife("kitchen")


@pytest.fixture
def record() -> Trace:
    """The record of a cut."""
    return made_cut().trace()


def fitted(setup: Setup) -> tuple[str, ...]:
    """What is fitted."""
    return setup.objective.parameters.names


def unsearched(setup: Setup) -> set[str]:
    """What scales the curve of a set-up and is not searched."""
    return {n.name for n in setup.objective.nuisances}


def test_it_is_fitted_where_the_blade_is_short(record: Trace) -> None:
    """It is then no factor of the curve. A given width, a longer blade and a smaller food leave nothing to fit."""
    short = set_up(Calibration("apple", record, knife="edc", height=0.04).request())
    assert "width" in fitted(short) and "width" not in unsearched(short)
    assert any("the blade may not reach across it" in text and "--width" in text for text in short.assumed)
    for other in (
        Calibration("apple", record, knife="edc", height=0.04, width=0.08),
        Calibration("apple", record, knife="kitchen", height=0.04),
        Calibration("apple", record, knife="edc", height=0.03),
    ):
        setup = set_up(other.request())
        assert "width" not in fitted(setup)
        assert ("width" in unsearched(setup)) == (other.width is None)
        assert not any("may not reach across" in text for text in setup.assumed)


def test_it_cannot_be_fitted_where_it_is_known(record: Trace) -> None:
    """The error says why."""
    with pytest.raises(MaterialError, match="--fit width: the width is known"):
        set_up(Calibration("apple", record, knife="kitchen", fit=("R", "width")).request())


def test_its_prior_is_that_of_the_proportions() -> None:
    """At any height the likely width is in proportion, with the spread that the literature gives for a width."""
    shape, _ = specimen(APPLE, None, Sizing(height=0.044))
    heights = (0.04, 0.044, 0.05)
    widths = width_range(APPLE, shape, SHORT, Sizing(), heights)
    assert widths is not None and width_range(APPLE, shape, LONG, Sizing(), heights) is None
    parameters = fit_parameters(APPLE, ("R", "height", "width"), {"height": heights, "width": widths})
    covariance, mean = parameters.prior_covariance, parameters.prior_mean
    slope = covariance[1, 2] / covariance[1, 1]
    assert slope == pytest.approx(1.0)
    left = math.sqrt(covariance[2, 2] - slope * covariance[1, 2])
    assert left == pytest.approx(size_relative_sd(APPLE, "width"))
    at = mean[2] + math.log(heights[1]) - mean[1]
    assert math.exp(at) == pytest.approx(shape.width)
    alone = width_range(APPLE, shape, SHORT, Sizing(height=0.044))
    assert alone is not None and np.prod(alone[::2]) == pytest.approx(shape.width**2)
    assert math.log(alone[2] / alone[0]) == pytest.approx(2 * 1.959964 * left)


def test_a_candidate_has_its_width() -> None:
    """It does not follow the height then; cells and length do."""
    shape, _ = specimen(APPLE, None, Sizing(height=0.044))
    scene = cut_scene(APPLE, shape, SHORT)
    placed, rest = of_specimen(scene, {"E": 3e6, "height": 0.0484, "width": 0.07})
    assert rest == {"E": 3e6}
    assert (placed.food.shape.width, placed.food.shape.height) == (0.07, 0.0484)
    assert placed.food.shape.length == pytest.approx(1.1 * shape.length)
    assert placed.numerics.dx == pytest.approx(1.1 * scene.numerics.dx)
    assert of_specimen(scene, {"width": 0.07})[0].numerics == scene.numerics
