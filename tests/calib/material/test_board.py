"""Friction, suction and bow: properties of a food that belong to the board of a scene and not to its material."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calib.errors import MaterialError
from calib.material.food import FoodSpec, load_food, load_foods
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, of_specimen, specimen
from mpm.scene import Board, Scene

CHERRY, APPLE, CUCUMBER = load_food("cherry"), load_food("apple"), load_food("cucumber")


def scene(food: FoodSpec) -> Scene:
    """Its default cut."""
    shape, _ = specimen(food, None, Sizing())
    return cut_scene(food, shape, load_knife("kitchen"))


def test_a_cut_lies_on_the_board_of_its_food() -> None:
    """The food's value, another one given, and the default where a food has none."""
    own = CHERRY.properties["board_friction"].value
    assert scene(CHERRY).board == Board(own)
    assert scene(CHERRY.with_values({"board_friction": 0.3})).board == Board(0.3)
    properties = {name: p for name, p in CHERRY.properties.items() if name != "board_friction"}
    bare = FoodSpec(CHERRY.name, CHERRY.shape_kind, CHERRY.dims, properties)
    assert scene(bare).board == Board() and "board_friction" not in bare.default_fit


def test_a_fitted_friction_is_the_boards() -> None:
    """It leaves the values of the material, and nothing else of the scene changes."""
    plain = scene(CHERRY)
    found, rest = of_specimen(plain, {"board_friction": 0.8, "E": 2e5})
    assert rest == {"E": 2e5} and found.board == Board(0.8)
    assert {**found.as_dict(), "board": None} == {**plain.as_dict(), "board": None}


def test_a_half_food_is_held_down() -> None:
    """The food's suction is the board's; a specimen of the same food that stands on no flat face is not held."""
    own = APPLE.properties["board_suction"].value
    assert scene(APPLE).board.suction == scene(APPLE).suction == own > 0
    assert of_specimen(scene(APPLE), {"board_suction": 2e4})[0].suction == 2e4
    assert scene(CHERRY).board.suction == 0.0
    whole, _ = specimen(APPLE, None, Sizing(shape="sphere"))
    lying = cut_scene(APPLE, whole, load_knife("kitchen"))
    assert lying.board.suction == 0.0
    rolled = replace(scene(APPLE), food=lying.food)
    assert rolled.board.suction == own and rolled.suction == 0.0


def test_a_board_that_lets_air_in_leaves_nothing_to_fit() -> None:
    """A suction of 0 is held, and the others stay."""
    dry = APPLE.with_values({"board_suction": 0.0})
    assert set(APPLE.default_fit) - set(dry.default_fit) == {"board_suction"} and scene(dry).suction == 0.0


def test_foods_that_lie_on_a_cut_face_have_a_suction() -> None:
    """And no others: what touches the board in a line or a point is not held."""
    for name, food in load_foods().items():
        assert ("board_suction" in food.properties) == specimen(food, None, Sizing())[0].stands, name


def test_a_bow_that_is_given_is_not_fitted() -> None:
    """A cucumber's is fitted, about a straight one; none and 1 mm are what somebody saw."""
    assert scene(CUCUMBER).board.bow == 0.0 and "bow" in CUCUMBER.default_fit and "bow" not in APPLE.default_fit
    for bow in (0.0, 1e-3):
        seen = CUCUMBER.with_values({"bow": bow})
        assert set(CUCUMBER.default_fit) - set(seen.default_fit) == {"bow"} and scene(seen).board.bow == bow
    assert scene(CUCUMBER.with_values({"bow": 1e-3})).motion.stroke == pytest.approx(0.043)  # to the board
    bent = APPLE.with_values({"bow": -5e-4}).properties["bow"]  # of which literature has no range
    assert (bent.low, bent.high) == (-1.5e-3, 5e-4)
    found, rest = of_specimen(scene(CUCUMBER), {"bow": -5e-4, "E": 2e5})
    assert rest == {"E": 2e5} and found.board == Board(0.5, 0.0, -5e-4)


def test_every_food_says_it(tmp_path: Path) -> None:
    """With a range, as a fit's prior; and a saved food has what was given."""
    assert all(food.prior("board_friction") == (0.25, 1.0) for food in load_foods().values())
    CHERRY.with_values({"board_friction": 0.35}).save(tmp_path / "cherry.yaml")
    assert FoodSpec.load(tmp_path / "cherry.yaml").value("board_friction") == 0.35


def test_no_board_is_that_rough() -> None:
    """One clear error."""
    with pytest.raises(MaterialError, match="friction of food on board; it must lie between 0 and 2"):
        CHERRY.with_values({"board_friction": 3.0})
