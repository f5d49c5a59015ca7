"""How fast a default cut is simulated."""

from __future__ import annotations

from dataclasses import replace

import pytest

from calib.material.cut_speed import END_SPEED, MACH
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from mpm.scene.shapes import Shape

HALF = Shape("half_cylinder", 0.08, 0.06, 0.05)


@pytest.mark.parametrize(("knife", "slows"), [("kitchen", False), ("edc", True)])
def test_a_thick_blade_slows_down_towards_the_board(knife: str, slows: bool) -> None:
    """Where the faces limit the speed, on the fine grid and on the coarse one."""
    for coarse in (False, True):
        scene = cut_scene(load_food("potato"), HALF, load_knife(knife), coarse=coarse)
        assert scene.slows_down is slows and scene.motion.end_speed == (END_SPEED if slows else 1.0)


@pytest.mark.parametrize(
    ("food", "knife", "times"),
    [("potato", "kitchen", 1), ("apple", "kitchen", 2), ("banana", "kitchen", 2), ("potato", "edc", 2)],
)
def test_a_crack_that_runs_ahead_of_a_thin_blade_is_not_overtaken(food: str, knife: str, times: int) -> None:
    """Screening runs at the speed of a default one where the food is stiff for its resistance and the blade thin."""
    fine, coarse = (cut_scene(load_food(food), HALF, load_knife(knife), coarse=c) for c in (False, True))
    assert coarse.motion.mach == times * fine.motion.mach <= 2 * MACH


def test_a_food_that_tips_is_screened_at_twice_the_speed() -> None:
    """Off its middle nothing but inertia holds it."""
    fine, coarse = (
        cut_scene(load_food("potato"), replace(HALF, cut=0.02), load_knife("kitchen"), coarse=c) for c in (False, True)
    )
    assert coarse.motion.mach == 2 * fine.motion.mach
