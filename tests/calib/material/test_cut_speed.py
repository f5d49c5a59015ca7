"""How fast a default cut is simulated."""

from __future__ import annotations

import pytest

from calib.material.cut_speed import END_SPEED
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
