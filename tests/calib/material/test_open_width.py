"""The width of a specimen that its blade does not reach across is fitted."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from calib.api import Calibration
from calib.calibration.calibrated import Calibrated
from calib.errors import MaterialError
from calib.material.food import load_food
from calib.material.form import known_of
from calib.material.knife import load_knife
from calib.material.scene import Sizing, aspect_range, cut_scene, of_specimen, specimen
from calib.problem.food_parameters import fit_parameters
from calib.problem.parameters import Z95
from calib.problem.setup import Setup, set_up
from calib.trace.trace import Trace
from mpm.discretisation.particles import seed
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
    assert "aspect" in fitted(short) and "width" not in unsearched(short)
    assert any("the blade may not reach across it" in text and "--width" in text for text in short.assumed)
    for other in (
        Calibration("apple", record, knife="edc", height=0.04, width=0.08),
        Calibration("apple", record, knife="kitchen", height=0.04),
        Calibration("apple", record, knife="edc", height=0.03),
    ):
        setup = set_up(other.request())
        assert "aspect" not in fitted(setup)
        assert ("width" in unsearched(setup)) == (other.width is None)
        assert not any("may not reach across" in text for text in setup.assumed)


def test_it_cannot_be_fitted_where_it_is_known(record: Trace) -> None:
    """The error says why."""
    with pytest.raises(MaterialError, match="--fit aspect: the width is given, or the blade reaches across"):
        set_up(Calibration("apple", record, knife="kitchen", fit=("R", "aspect")).request())


def test_its_prior_is_that_of_the_proportions() -> None:
    """About the likely ratio, a quarter more or less, whatever the height."""
    for height in (0.044, 0.05):
        shape, _ = specimen(APPLE, None, Sizing(height=height))
        ratios = aspect_range(shape, SHORT, Sizing())
        assert ratios is not None and aspect_range(shape, LONG, Sizing()) is None
        (aspect,) = fit_parameters(APPLE, ("aspect",), {"aspect": ratios})
        assert (aspect.unit, aspect.value) == ("-", pytest.approx(2.0))
        assert aspect.prior_centre == pytest.approx(2.0)
        assert Z95 * aspect.prior_sd == pytest.approx(math.log(1.25))


def test_a_candidate_has_its_width() -> None:
    """A height changes all sizes alike, so that the particles stay; an aspect changes the width alone."""
    shape, _ = specimen(APPLE, None, Sizing(height=0.044))
    scene = cut_scene(APPLE, shape, SHORT)
    placed, rest = of_specimen(scene, {"E": 3e6, "height": 0.0484, "aspect": 1.5})
    assert rest == {"E": 3e6}
    assert (placed.food.shape.width, placed.food.shape.height) == (pytest.approx(0.0726), 0.0484)
    assert placed.food.shape.length == pytest.approx(1.1 * shape.length)
    assert placed.numerics.dx == pytest.approx(1.1 * scene.numerics.dx)
    lower, _ = of_specimen(scene, {"height": 0.042, "aspect": 1.5})
    assert len(seed(placed).x) == len(seed(lower).x)
    assert of_specimen(scene, {"aspect": 1.5})[0].numerics == scene.numerics


def test_the_food_that_is_written_has_the_fitted_width(record: Trace) -> None:
    """And the height that it belongs to, so that another cut of it is predicted in these proportions."""
    setup = set_up(Calibration("apple", record, knife="edc", height=0.04).request())
    values = setup.start_values | {"aspect": 1.6}
    fit: Any = SimpleNamespace(best=SimpleNamespace(evaluation=SimpleNamespace(parameters=values)))
    made: Any = SimpleNamespace(setup=setup.sized(values), fit=fit)
    food = Calibrated.food(made)
    assert food.dims["width"].value == pytest.approx(0.064)
    assert (food.dims["height"].value, food.dims["height"].status) == (0.04, "given")
    assert food.dims["width"].status == "fitted"


def test_what_is_known_of_it_is_the_range_of_the_fit() -> None:
    """The report shows it beside the fitted value, with the range that the fit has; any other property is the food's
    own."""
    known, width = known_of(APPLE, "aspect"), APPLE.dims["width"]
    likely = width.value / APPLE.dims["height"].value
    assert (known.value, known.low, known.high) == pytest.approx((likely, likely / 1.25, likely * 1.25))
    assert known.status == "assumed"
    assert known_of(APPLE, "R") == APPLE.properties["R"] and known_of(APPLE, "height") == APPLE.dims["height"]
