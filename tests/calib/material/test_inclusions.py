"""Stones and cavities of foods: from the file, from text, in a scene that is asked for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from calib.errors import MaterialError
from calib.material.food import load_food, load_foods, load_material_file
from calib.material.food_file import dump_material
from calib.material.inclusions import STONE_MACH, check_limit, sizes_of, with_inclusions
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from mpm.scene import Arm, Scene
from mpm.scene.errors import SceneError


def scene(name: str, **sizing) -> Scene:
    """The default cut of a food."""
    food = load_food(name)
    return cut_scene(food, specimen(food, None, Sizing(**sizing))[0], load_knife("kitchen"))


def test_sizes_are_read_with_and_without_units():
    """One unit for all, one for each, metres; anything else is no size."""
    for text in ("17x33x24mm", "17mm x 3.3cm x 24mm", "0.017x0.033x0.024", "17\u00d733\u00d724 mm"):
        assert sizes_of(text) == pytest.approx((0.017, 0.033, 0.024))
    for text in ("17x33mm", "17x-33x24mm", "17xwidex24mm", "nanx1x1mm"):
        with pytest.raises(ValueError):
            sizes_of(text)


@pytest.mark.parametrize("name", ["peach", "plum", "cherry"])
def test_stones_are_in_cuts_that_ask_for_them(name):
    """A default cut has none; with it the blade is slow, and the stone grows with the fruit."""
    plain, food = scene(name), load_food(name)
    assert plain.food.stone is None and with_inclusions(plain, food) is plain
    stony = with_inclusions(plain, food, stone="")
    assert stony.food.stone.width == food.inclusions["stone"]["width"].value
    assert stony.motion.mach == STONE_MACH < plain.motion.mach
    large = scene(name, height=1.2 * plain.food.shape.height)
    assert with_inclusions(large, food, stone="").food.stone.height == pytest.approx(1.2 * stony.food.stone.height)
    assert "--stone" in food.warnings()[0]


def test_a_melon_may_be_hollow():
    """Its cavity is that of the file, or one that is given."""
    melon = load_food("melon")
    assert with_inclusions(scene("melon"), melon, cavity="").food.cavity.width == 0.05
    assert with_inclusions(scene("melon"), melon, cavity="3x4x4cm").food.cavity.length == 0.03


def test_a_blade_that_meets_a_stone_needs_a_limit():
    """Not where it ends above, nor beside it, nor where the arm has one."""
    food = load_food("peach")
    stony = with_inclusions(scene("peach"), food, stone="")
    with pytest.raises(SceneError, match="--force-limit"):
        check_limit(stony)
    check_limit(replace(stony, arm=Arm(force_limit=60.0)))
    check_limit(replace(stony, motion=replace(stony.motion, stroke=0.015)))
    check_limit(with_inclusions(scene("peach", at=0.75), food, stone=""))
    check_limit(scene("peach"))


def test_what_a_food_has_not_is_an_error():
    """A banana has no stone; a size that cannot be read says how it is written; one that sticks out is refused."""
    with pytest.raises(MaterialError, match="banana has no stone"):
        with_inclusions(scene("banana"), load_food("banana"), stone="")
    with pytest.raises(MaterialError, match="write length x width x height"):
        with_inclusions(scene("peach"), load_food("peach"), stone="large")
    with pytest.raises(SceneError, match="do not lie within the food"):
        with_inclusions(scene("peach"), load_food("peach"), stone="17x70x24mm")


def test_a_file_keeps_the_stone(tmp_path: Path):
    """What a calibration writes has it, and reads back; a stone without a height is an error that names the place."""
    dump_material(load_food("plum"), tmp_path / "plum.yaml", {})
    assert load_material_file(tmp_path / "plum.yaml").inclusions == load_food("plum").inclusions
    text = (tmp_path / "plum.yaml").read_text(encoding="utf-8")
    broken = text.replace("  stone:\n    length:", "  stone:\n    depth:")
    assert broken != text
    (tmp_path / "broken.yaml").write_text(broken, encoding="utf-8")
    with pytest.raises(MaterialError, match="stone"):
        load_material_file(tmp_path / "broken.yaml")
    assert {name for name, food in load_foods().items() if food.inclusions} == {"peach", "plum", "cherry", "melon"}
