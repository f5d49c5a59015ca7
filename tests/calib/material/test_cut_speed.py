"""How fast a default cut is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.cut_speed import END_SPEED, MACH
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from mpm.scene.shapes import Shape
from mpm.solver import simulate

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


@pytest.mark.slow
def test_a_screening_run_hardly_changes_at_half_its_speed() -> None:
    """By 4.7 % of the peak, root mean square, in a small potato under a thin blade; by 9.9 % at twice its speed."""
    scene = cut_scene(
        load_food("potato"), Shape("half_cylinder", 0.06, 0.045, 0.0375), load_knife("kitchen"), coarse=True
    )
    slow = simulate(replace(scene, motion=replace(scene.motion, mach=scene.motion.mach / 2)))
    usual = simulate(scene)
    stroke = np.linspace(0.0, usual.stroke[-1], 200)
    away = np.interp(stroke, usual.stroke, usual.resolved) - np.interp(stroke, slow.stroke, slow.resolved)
    assert np.sqrt(np.mean(away**2)) < 0.07 * slow.peak
