"""Halving a fruit around its stone: where the passes go, what they leave, and that an arm that bears them parts it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice
from types import SimpleNamespace

import pytest

from calib.simulation.around_stone import Around, Pass, cut_around, left_over, pass_scene, turned
from mpm.output.record import LIMIT, STROKE
from mpm.runtime import Runtime
from mpm.scene import Arm, EdgeLaw, Food, Inclusion, Knife, Motion, Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

BALL = Shape("sphere", 0.032, 0.032, 0.032)
FLESH = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=100.0, initiation_depth=3e-4)
STONE = Inclusion(0.012, 0.018, 0.014)
FRUIT = Scene(
    Food(BALL, FLESH, STONE),
    Knife("thin", 0.2e-3, 0.02, 0.06, 0.4),
    Motion(0.032),
    edge=EdgeLaw(4e-3),
    numerics=Numerics(4e-3),
    arm=Arm(force_limit=30.0),
)


def done(turns: int, ended: str = STROKE) -> list[Pass]:
    """So many passes that all came down to the stone, as if they had been simulated."""
    record = SimpleNamespace(status="done", ended=ended, peak=5.0, work=0.1)
    passes = []
    for k in range(turns):
        turn = 2 * math.pi * k / turns
        one = pass_scene(FRUIT, turn, passes)
        passes.append(Pass(turn, record, one.food.shape.height / 2 - one.motion.stroke))
    return passes


@pytest.mark.parametrize("turns", [4, 8])
def test_passes_leave_the_corners_of_a_polygon(turns):
    """Around a round stone of radius r it is the polygon of n sides less the circle: r^2 (n tan(pi/n) - pi)."""
    left = left_over(replace(FRUIT, food=Food(BALL, FLESH, Inclusion(0.012, 0.016, 0.016))), done_round(turns))
    assert left == pytest.approx(8e-3**2 * (turns * math.tan(math.pi / turns) - math.pi), rel=0.05)


def done_round(turns: int) -> list[Pass]:
    """Passes that came down to a round stone of 16 mm."""
    return [replace(one, reached=8e-3) for one in done(turns)]


def test_each_pass_ends_at_the_stone():
    """From above, from the side and at a slant: the stroke is the way to the stone, which is turned with the fruit."""
    above, side, slant = (pass_scene(FRUIT, turn) for turn in (0.0, math.pi / 2, math.pi / 4))
    assert above.motion.stroke == pytest.approx(0.016 - 0.007)
    assert side.motion.stroke == pytest.approx(0.016 - 0.009)
    assert slant.motion.stroke == pytest.approx(0.016 - math.hypot(0.007, 0.009) / math.sqrt(2))
    assert above.mirrors == side.mirrors == (True, True) and slant.mirrors == (False, True)
    off = replace(FRUIT, food=Food(BALL, FLESH, replace(STONE, above=2e-3)))
    assert pass_scene(off, 0.0).motion.stroke == pytest.approx(0.016 - 0.009)
    assert pass_scene(off, math.pi).motion.stroke == pytest.approx(0.016 - 0.005)
    assert pass_scene(off, math.pi / 2).food.stone.aside == pytest.approx(-2e-3)


def test_later_passes_find_open_what_was_parted():
    """What an earlier pass parted from above lies at the side of the fruit that was turned by a quarter."""
    second = pass_scene(FRUIT, math.pi / 2, done(4)[:1]).food.parted[0]
    assert second.turn == pytest.approx(-math.pi / 2) and second.beyond == pytest.approx(0.007)
    flat = Shape("ellipsoid", 0.03, 0.05, 0.04)
    assert (turned(flat, math.pi / 2).width, turned(flat, math.pi / 2).height) == pytest.approx((0.04, 0.05))


def test_what_is_said_of_it():
    """Severed where all passes came down and little is left; an arm that stopped is named."""
    flesh = FRUIT.food.section_area
    whole = Around(tuple(done(8)), flesh, 0.01 * flesh)
    assert whole.severed and whole.words().startswith("severed around the stone: 8 passes of at most 5.0 N, 99.0%")
    stopped = Around(tuple(done(4, LIMIT)), flesh, 0.01 * flesh)
    assert not stopped.severed and "the arm stopped before the stone" in stopped.words()
    assert not Around(tuple(done(3)), flesh, 0.2 * flesh).severed


def test_what_cannot_be_cut_around():
    """A fruit without a stone in the plane of the cut, a block, and two passes."""
    with pytest.raises(SceneError, match="no stone in the blade's plane"):
        next(cut_around(replace(FRUIT, food=Food(BALL, FLESH))))
    block = Shape("block", 0.032, 0.032, 0.032)
    with pytest.raises(SceneError, match="cannot be turned"):
        next(cut_around(replace(FRUIT, food=Food(block, FLESH, STONE))))
    with pytest.raises(SceneError, match="at least 3"):
        next(cut_around(FRUIT, 2))


def test_an_arm_that_a_stone_stops_parts_the_fruit_around_it():
    """Passes down to the stone take less than the limit; where the arm bears too little the first is the last."""
    one = Runtime(threads=1)
    *_, last = islice(cut_around(FRUIT, 4, one), 2)
    assert all(done.complete for done in last.passes) and last.peak < 10.0
    assert last.severed_part == pytest.approx(0.47, abs=0.03) and not last.severed
    first, second = (done.record.work for done in last.passes)
    assert second < first  # its corner is open
    weak = list(cut_around(replace(FRUIT, arm=Arm(force_limit=0.5)), 4, one))
    assert len(weak) == 1 and not weak[0].passes[0].complete
