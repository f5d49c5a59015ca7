"""How fast a default cut is simulated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.cut_speed import END_SPEED, MACH
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import cut_scene, of_specimen
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
    ("food", "knife", "cut", "times"),
    [
        ("cucumber", "kitchen", 0.0, 1),
        ("cucumber", "kitchen", 0.02, 2),
        ("cucumber", "edc", 0.0, 2),
        ("potato", "kitchen", 0.0, 2),
    ],
)
def test_a_food_that_may_bend_is_screened_at_the_speed_of_a_default_cut(
    food: str, knife: str, cut: float, times: int
) -> None:
    """Under a thin blade at its middle; off it nothing but inertia holds it, and a thick blade is slow already."""
    shape = replace(HALF, cut=cut)
    fine, coarse = (cut_scene(load_food(food), shape, load_knife(knife), coarse=c) for c in (False, True))
    assert coarse.motion.mach == times * fine.motion.mach <= 2 * MACH


@pytest.mark.slow
def test_halves_do_not_chatter() -> None:
    """A stiff food that rubs: dampers keep the halves at rest, 0.05 % in motion. Without them they vibrate against the
    blade with 2.6 %, which takes a tenth of the work away."""
    scene = cut_scene(load_food("potato"), HALF, load_knife("kitchen"), coarse=True)
    scene = replace(scene, motion=replace(scene.motion, mach=MACH))
    free = simulate(replace(scene, numerics=replace(scene.numerics, damper_mass=0.0)))
    damped = simulate(scene)
    assert damped.ke_over_ie < 0.002 < 0.01 < free.ke_over_ie
    assert damped.lost < 0.01 and free.work < 0.95 * damped.work
    assert damped.momentum_residual < 1e-10


@pytest.mark.slow
def test_a_cucumber_on_its_ends_hardly_feels_half_the_speed_of_its_screening() -> None:
    """By 4.0 % of the peak, root mean square; at twice that speed by 14 %, for it has no time to bend."""
    flesh = {"E": 8.1e6, "yield_stress": 4.3e5, "R": 115.0, "mu": 0.045, "board_friction": 0.4, "bow": 3.5e-4}
    rind = {"R_rind": 280.0, "rind_thickness": 1.7e-3, "rind_stiffness": 3.2, "R_skin": 245.0}
    core = {"R_core": 27.0, "core_ratio": 0.63, "core_stiffness": 0.24}
    shape, knife = Shape("cylinder", 0.168, 0.042, 0.042), load_knife("slicing")
    scene, material = of_specimen(cut_scene(load_food("cucumber"), shape, knife, coarse=True), flesh | rind | core, ())
    scene = scene.with_material(**material)
    slow = simulate(replace(scene, motion=replace(scene.motion, mach=scene.motion.mach / 2)))
    usual = simulate(scene)
    stroke = np.linspace(0.0, usual.stroke[-1], 200)
    away = np.interp(stroke, usual.stroke, usual.resolved) - np.interp(stroke, slow.stroke, slow.resolved)
    assert np.sqrt(np.mean(away**2)) < 0.07 * slow.peak
    assert max(usual.momentum_residual, slow.momentum_residual) < 1e-10  # a board with a bow takes its part
