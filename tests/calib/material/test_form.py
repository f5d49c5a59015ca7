"""The form of a specimen where nobody says it: a parameter with a range, fitted beside the material."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calib.api import Calibration
from calib.errors import MaterialError
from calib.material.food import FoodSpec, load_food, load_foods
from calib.material.form import open_shape, with_roundness
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, of_specimen, specimen
from calib.problem.food_parameters import fit_parameters
from calib.problem.setup import Setup, set_up
from calib.trace.trace import Trace
from tests.calib.made_cuts import made_cut

POTATO = load_food("potato")


@pytest.fixture
def record() -> Trace:
    """The record of a cut."""
    return made_cut().trace()


def names(setup: Setup) -> tuple[str, ...]:
    """What is fitted."""
    return setup.objective.parameters.names


def test_it_is_fitted_where_nobody_said_it(record: Trace) -> None:
    """And only where the food leaves it open; a scene without it is the same as ever."""
    open_form = set_up(Calibration("potato", record).request())
    said = set_up(Calibration("potato", record, shape="half_cylinder").request())
    assert names(open_form) == (*names(said), "roundness")
    assert (open_form.fine.food.shape.kind, open_form.fine.food.shape.roundness) == ("half_barrel", 0.5)
    assert (said.fine.food.shape.kind, said.fine.food.shape.roundness) == ("half_cylinder", None)
    assert any("its roundness" in text and "--outline" in text for text in open_form.assumed)
    assert not any("shape is not known" in text for text in said.assumed)
    sized = open_form.sized({**open_form.start_values, "roundness": 0.25})
    assert sized.fine.food.shape == replace(open_form.fine.food.shape, roundness=0.25)
    for other in ("banana", "cucumber"):
        assert "roundness" not in names(set_up(Calibration(other, record).request()))


def test_what_the_blade_leaves_uncut_is_said_once(record: Trace) -> None:
    """Of the specimen as it is: fitted, it is not said of its size before as well."""
    setup = set_up(Calibration("potato", record, knife="edc", width=0.08).request())
    shape = setup.fine.food.shape
    for width in (0.08, 0.09):
        fine = replace(setup.fine, food=replace(setup.fine.food, shape=replace(shape, width=width)))
        (said,) = [text for text in replace(setup, fine=fine).assumptions if "stay uncut" in text]
        assert f"{1e3 * width:.0f} mm wide" in said and said in replace(setup, fine=fine).notes


def test_a_list_of_what_is_fitted_is_obeyed(record: Trace) -> None:
    """Without it the food's usual shape is cut; beside a shape that is said it is refused, as for a food without."""
    few = set_up(Calibration("potato", record, fit=["E", "R"]).request())
    assert names(few) == ("E", "R") and few.fine.food.shape.kind == "half_cylinder"
    assert names(set_up(Calibration("potato", record, fit=["R", "roundness"]).request())) == ("R", "roundness")
    with pytest.raises(MaterialError, match="--fit roundness beside --shape"):
        set_up(Calibration("potato", record, fit=["R", "roundness"], shape="hemisphere").request())
    with pytest.raises(MaterialError, match="the shape of banana is not open"):
        set_up(Calibration("banana", record, fit=["R", "roundness"]).request())


def test_any_roundness_is_as_likely_at_first() -> None:
    """The prior has the spread of a uniform one over the food's range, which bounds it."""
    p = fit_parameters(load_food("apple"), ("R", "roundness"))["roundness"]
    assert (p.low, p.high, p.log) == (0.5, 1.0, False)
    assert p.prior_range == (0.5, 1.0) and p.prior_low < 0.5 and p.prior_high > 1.0
    assert p.prior_mean == pytest.approx(0.75) and p.prior_sd == pytest.approx(0.5 / 12**0.5)


def test_a_candidate_has_its_form() -> None:
    """Beside its height; the rest is the material's."""
    shape, _ = specimen(POTATO, None, Sizing(), open_form=True)
    scene = cut_scene(POTATO, shape, load_knife("kitchen"))
    found, rest = of_specimen(scene, {"E": 1e6, "roundness": 0.2, "height": 1.1 * shape.height})
    assert rest == {"E": 1e6}
    assert found.food.shape.roundness == 0.2 and found.food.shape.height == pytest.approx(1.1 * shape.height)


def test_a_fitted_form_is_drawn_and_kept(tmp_path: Path) -> None:
    """The file of the food has it, and a cut of that food is of it; its range stays, and so does that it is open."""
    fitted = with_roundness(POTATO, 0.2, status="fitted", source="fitted to cut.csv")
    fitted.save(tmp_path / "potato.yaml")
    read = FoodSpec.load(tmp_path / "potato.yaml")
    assert read.roundness == fitted.roundness and read.sizes["roundness"].value == 0.2
    assert read.to_scene_food().shape.words == "half_barrel of roundness 0.2"
    assert POTATO.to_scene_food().shape.words == "half_cylinder"
    assert open_shape(read) == "half_barrel:0.2"
    assert read.to_scene_food(shape="half_barrel").shape.roundness is None


def test_only_shapes_of_the_family_have_one() -> None:
    """A block with a roundness is an error of the food; all foods that have one can be drawn at its ends."""
    with pytest.raises(MaterialError, match="a block has no roundness"):
        replace(POTATO, shape_kind="block")
    for food in load_foods().values():
        if food.roundness is not None:
            for end in (food.roundness.low, food.roundness.high):
                drawn = with_roundness(food, end, status="given", source="test")
                assert drawn.to_scene_food().shape.roundness == end


@pytest.mark.parametrize(("speed", "unusual"), [(0.02, False), (0.06, True)])
def test_a_stroke_longer_than_the_food_is_high_is_said(record: Trace, speed: float, unusual: bool) -> None:
    """A wrong speed, or a knife that stood before it went up; not where the height is given."""
    bare = replace(record, position=None)
    said = set_up(Calibration("banana", bare, speed=speed).request()).assumed
    assert (
        any("longer than banana is usually high (45 mm at most): check the speed" in text for text in said) == unusual
    )
