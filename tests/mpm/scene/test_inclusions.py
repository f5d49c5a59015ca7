"""Stones and cavities as geometry: what they take of volume and section, their mirrors, and what is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mpm.discretisation.particles import seed
from mpm.scene import Arm, EdgeLaw, Food, Inclusion, Knife, Motion, Numerics, Parted, Scene
from mpm.scene.errors import SceneError
from mpm.scene.layers import in_whole, layer_ties, mean_toughness
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

BALL = Shape("sphere", 0.04, 0.04, 0.04)
FLESH = Material(1e6, 0.35, 1000.0, R=100.0)
STONE = Inclusion(0.01, 0.02, 0.014)
BLADE = Knife("thin", 0.2e-3, 0.02, 0.05, 0.4)
EVEN = (np.arange(100) + 0.5) / 100


def scene(food: Food, **numerics) -> Scene:
    """A cut of a food."""
    return Scene(food, BLADE, Motion(food.shape.height), edge=EdgeLaw(zone=3e-3), numerics=Numerics(2e-3, **numerics))


@pytest.mark.parametrize("where", [{}, {"turn": 0.5}, {"aside": 3e-3, "above": -2e-3}, {"beyond": 2e-3, "turn": 1.2}])
def test_what_an_inclusion_takes_is_what_it_holds(where):
    """Volume, section, and the highest point in the blade's plane, against a lattice of points."""
    stone = replace(STONE, **where)
    x, y, z = (0.04 * (EVEN - 0.5), 0.04 * (EVEN - 0.5), 0.04 * EVEN)
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    assert 0.04**3 * stone.holds(BALL, points).mean() == pytest.approx(stone.volume(BALL), rel=0.01)
    plane = points * [1, 0, 1]
    held = stone.holds(BALL, plane)
    assert 0.04**2 * held.mean() == pytest.approx(stone.section_area(BALL), rel=0.02)
    assert plane[held][:, 2].max() == pytest.approx(stone.section_top(BALL), abs=5e-4)


def test_food_without_its_cavity_and_section_without_both():
    """Particles fill flesh and stone; the section to be severed is flesh alone."""
    cavity = Inclusion(0.02, 0.02, 0.02)
    hollow = Food(BALL, FLESH, cavity=cavity)
    seeds = seed(scene(hollow, mirror=False))
    assert not cavity.holds(BALL, seeds.x).any()
    assert seeds.total == pytest.approx(math.pi / 6 * (0.04**3 - 0.02**3))
    assert hollow.section_area == pytest.approx(math.pi / 4 * (0.04**2 - 0.02**2))
    assert Food(BALL, FLESH, STONE).section_area == pytest.approx(math.pi / 4 * (0.04**2 - 0.02 * 0.014))
    beside = Food(replace(BALL, cut=0.01), FLESH, STONE)
    assert beside.crossed == () and beside.section_area == pytest.approx(math.pi / 4 * 0.04**2 * 0.75)
    dome = Food(Shape("hemisphere", 0.04, 0.04, 0.02), FLESH, cavity=cavity)
    assert dome.volume == pytest.approx(math.pi / 12 * (0.04**3 - 0.02**3))


@pytest.mark.parametrize(
    ("where", "mirrors"),
    [
        ({}, (True, True)),
        ({"aside": 1e-3}, (False, True)),
        ({"beyond": 1e-3}, (True, False)),
        ({"turn": 0.3}, (False, True)),
        ({"turn": math.pi / 2}, (True, True)),
    ],
)
def test_mirrors_are_those_of_stone_and_earlier_cuts(where, mirrors):
    """A stone off the middle or turned has no mirror there, and no more have cuts from one side."""
    assert scene(Food(BALL, FLESH, replace(STONE, **where))).mirrors == mirrors
    both = Food(BALL, FLESH, STONE, parted=(Parted(1.0, 0.01), Parted(-1.0, 0.01)))
    assert scene(both).mirrors == (True, True)
    assert scene(replace(both, parted=both.parted[:1])).mirrors == (False, True)


def test_layers_end_at_a_cavity():
    """A tie at the rim of a hollow stands for its flesh, and the mean toughness is that of the flesh."""
    cored = replace(FLESH, R_core=20.0, core_ratio=0.6)
    hollow = Inclusion(0.02, 0.02, 0.02)
    areas = {"core": 0.6**2 - 0.5**2, "flesh": 1 - 0.6**2}
    mean = (20 * areas["core"] + 100 * areas["flesh"]) / sum(areas.values())
    assert mean_toughness(BALL, cored, without=(hollow,)) == pytest.approx(mean, rel=0.01)
    food = Food(BALL, cored, cavity=hollow)
    seeds = seed(scene(food))
    places = seeds.x[seeds.ties(True)[:, 0]][:, [0, 2]]
    tough, share = in_whole(*layer_ties(BALL, cored, seeds.spacing, places, 8, food.crossed))
    assert 2 * share.sum() * seeds.spacing**2 == pytest.approx(food.section_area, rel=0.01)
    assert (tough * share).sum() / share.sum() == pytest.approx(mean, rel=0.02)


def test_what_cannot_be_is_one_line():
    """A stone that sticks out, one in a halved fruit, one that cells do not resolve."""
    with pytest.raises(SceneError, match="do not lie within the food"):
        Food(BALL, FLESH, Inclusion(0.01, 0.02, 0.014, above=0.015))
    with pytest.raises(SceneError, match="was halved"):
        Food(Shape("hemisphere", 0.04, 0.04, 0.02), FLESH, Inclusion(0.01, 0.01, 0.01))
    with pytest.raises(SceneError, match="under 3 cells"):
        scene(Food(BALL, FLESH, Inclusion(0.005, 0.02, 0.014)))
    with pytest.raises(SceneError, match="between -7 and 7"):
        replace(STONE, turn=math.nan)


def test_what_a_food_has_not_is_no_part_of_its_scene():
    """A food without stone and cavity has the scene, and so the key of a stored run, that it had."""
    assert set(scene(Food(BALL, FLESH)).as_dict()["food"]) == {"shape", "material"}
    assert "stone" in scene(Food(BALL, FLESH, STONE)).as_dict()["food"]
    assert Arm(force_limit=60.0).rigid
