"""Rind and core that are stiffer or softer than the flesh: their stiffness, their weight, and their price."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.output.snapshot import SnapshotRecorder
from mpm.runtime import Runtime
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.errors import SceneError
from mpm.scene.layers import layer_stiffness
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.setup.setup import Setup
from mpm.solver import Simulation
from tests.mpm.scenes import FLESH, cut
from tests.mpm.test_layered_cuts import FRUIT, scene

BLOCK = Shape("block", 0.024, 0.024, 0.024)
RIND = {"R": 100.0, "R_rind": 100.0, "rind_thickness": 3e-3}


def pressed(stiffness: float) -> float:
    """Rise of the force on a block with a rind on all sides from 1 to 3 % of strain, over that of flesh alone."""
    soft = Material(E=1e6, nu=0.0, rho=1e3, loss_factor=0.1)
    motion, numerics = Motion(0.03 * 0.024, 5e-4), Numerics(dx=2e-3, gravity=0.0)
    block = Scene(
        Food(BLOCK, replace(soft, **RIND, rind_stiffness=stiffness)), Press(), motion, Board(0.0), numerics=numerics
    )
    record = cut(block)
    force = np.interp([0.01 * 0.024, 0.03 * 0.024], record.stroke, record.resolved)
    return float(force[1] - force[0]) / (1e6 * 0.02 * 0.024**2)


def test_a_block_with_a_stiff_rind_is_as_stiff_as_its_parts() -> None:
    """Between columns that do not know of each other and layers that stay plane, 2.44 and 2.59 of flesh alone (2 %)."""
    assert 0.98 < pressed(1.0) < 1.04
    assert 0.98 * 2.442 < pressed(4.0) < 1.04 * 2.585


def test_an_upright_cylinder_is_as_stiff_as_its_core_and_its_wall_side_by_side() -> None:
    """With nu 0 both are compressed alike: the modulus is the mean over the section, exactly (1 %); and the stress that
    is seen in the core is a tenth of the wall's (2 %)."""
    upright, ratio, soft = Shape("upright_cylinder", 0.024, 0.024, 0.024), 0.6, 0.1
    material = Material(E=1e6, nu=0.0, rho=1e3, loss_factor=0.1, R=100.0, R_core=50.0, core_ratio=ratio)
    rise = []
    for stiffness in (1.0, soft):
        food = Food(upright, replace(material, core_stiffness=stiffness))
        numerics = Numerics(dx=2e-3, gravity=0.0)
        pressed_down = Scene(food, Press(), Motion(0.03 * 0.024, 5e-4), Board(0.0), numerics=numerics)
        seen = SnapshotRecorder(1)
        record = Simulation(pressed_down, Runtime(threads=1)).run(snapshots=seen)
        force = np.interp([0.01 * 0.024, 0.03 * 0.024], record.stroke, record.resolved)
        rise.append(float(force[1] - force[0]))
    assert rise[1] / rise[0] == pytest.approx(1.0 - (1.0 - soft) * ratio**2, rel=0.01)
    radius, mises = np.hypot(seen.taken[-1].x[:, 0], seen.taken[-1].x[:, 1]), seen.taken[-1].mises
    inner, outer = mises[radius < 4e-3].mean(), mises[(radius > 9.5e-3) & (radius < 11e-3)].mean()
    assert inner / outer == pytest.approx(soft, rel=0.02)


def test_the_stiffness_of_a_particle_is_the_mean_over_its_cube() -> None:
    """Over a block's particles the rind's share is its part of the volume; deep inside there is none of it."""
    material = Material(E=1e6, nu=0.3, rho=1e3, **RIND, rind_stiffness=5.0)
    edge = (np.arange(24) + 0.5) * 1e-3
    x, y, z = (a.ravel() for a in np.meshgrid(edge - 0.012, edge - 0.012, edge, indexing="ij"))
    factors = layer_stiffness(BLOCK, material, 1e-3, np.column_stack([x, y, z]))
    assert factors.mean() == pytest.approx(1.0 + 4.0 * (1.0 - 0.75**3), rel=1e-6)
    assert factors.min() == 1.0 and factors.max() == 5.0
    three = replace(material, R_core=9.0, core_ratio=0.5, core_stiffness=0.2)
    cored = layer_stiffness(BLOCK, three, 1e-3, np.column_stack([x, y, z]))
    assert cored.min() == pytest.approx(0.2)  # it runs along y to the rind at the ends
    assert cored.mean() == pytest.approx(factors.mean() - 0.8 * 0.5**2 * 0.75, rel=1e-6)
    assert np.all(layer_stiffness(BLOCK, replace(material, rind_stiffness=1.0), 1e-3, np.zeros((3, 3))) == 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("layer", "mass"),
    [
        pytest.param({"rind_stiffness": 5.0}, (1.5, np.inf), marks=pytest.mark.long),
        pytest.param({"core_stiffness": 0.1}, (0.7, 0.85), marks=pytest.mark.long),
    ],
)
def test_a_layer_of_another_stiffness_weighs_nothing(layer: dict[str, float], mass: tuple[float, float]) -> None:
    """Half way through, weight is that of the food without it, though the simulated layer is heavier or lighter; the
    momentum balances, energy is booked, and half the speed gives the same work (3 %)."""
    of = scene("cylinder", replace(FRUIT, **layer), mirror=False)
    of = replace(of, numerics=replace(of.numerics, gravity=9.81))
    of = replace(of, motion=Motion(of.food.shape.height / 2, 0.02))
    record = cut(of)
    volume = Setup(of, Runtime(threads=1)).seeds.total
    assert np.abs(record.gravity[:, 2]) == pytest.approx(1e3 * volume * 9.81)
    assert mass[0] < record.mass / (1e3 * volume) < mass[1]
    assert record.momentum_residual < 1e-9
    assert abs(record.unbooked[-1]) < 0.05 * record.work
    quarter = replace(of, numerics=replace(of.numerics, mirror=True))
    fast, slow = (cut(replace(quarter, motion=replace(of.motion, mach=mach))) for mach in (0.01, 0.005))
    assert slow.work == pytest.approx(fast.work, rel=0.03)


def test_time_steps_are_those_of_the_flesh_and_of_its_lightest_layer() -> None:
    """A stiff rind costs no time; a core as tough as the flesh, a hundredth as stiff, holds the edge with less mass."""
    steps = [
        Setup(scene("cylinder", replace(FRUIT, **layer)), Runtime(threads=1)).time_step(replace(FRUIT, **layer))
        for layer in ({}, {"rind_stiffness": 5.0}, {"core_stiffness": 0.01, "R_core": 80.0})
    ]
    assert steps[1] == steps[0] > steps[2]


def test_a_food_that_is_all_rind_is_a_stiffer_food() -> None:
    """With a rind right through it, one four times as stiff as the flesh is cut and left again with the forces of one
    with four times E, yield stress and density, in a quarter of the gravity (1e-6): all of them, of the edge, the ties,
    the contact, the friction and the adhesion."""
    through = replace(FLESH, R_rind=FLESH.R, rind_thickness=0.013, mu=0.2, adhesion=5e3, adhesion_energy=0.5)
    through = replace(through, tensile_strength=2e4, yield_stress=5e5)
    four = replace(through, E=4 * FLESH.E, rho=4 * FLESH.rho, yield_stress=2e6)
    base = replace(scene("sphere"), food=Food(BLOCK, through), motion=Motion(0.018, 0.01, retract=4e-3))
    rind = cut(replace(base.with_material(rind_stiffness=4.0), numerics=replace(base.numerics, gravity=9.81)))
    food = cut(replace(base, food=Food(BLOCK, four), numerics=replace(base.numerics, gravity=9.81 / 4)))
    for name in ("edge", "face", "board", "friction", "elastic"):
        one, other = getattr(rind, name), getattr(food, name)
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max(), name
    dry = cut(base.with_material(adhesion=0.0, adhesion_energy=0.0))
    assert np.abs(rind.face[-1, 2]) > 1.2 * np.abs(dry.face[-1, 2])  # or the adhesion would not be seen


@pytest.mark.long
def test_both_ends_of_a_tie_are_as_heavy() -> None:
    """Or what one half gets the other would not lose: beside a blade aside of the middle the rinds differ."""
    aside = replace(scene("sphere", replace(FRUIT, rind_stiffness=5.0), mirror=False))
    aside = replace(aside, food=replace(aside.food, shape=replace(aside.food.shape, cut=6e-3)))
    ready = Setup(aside, Runtime(threads=1))
    ties, weights = ready.ties(), ready.layer_weights(aside.food.material)
    assert weights.max() > 4.0 and np.all(weights[ties[:, 0]] == weights[ties[:, 1]])
    assert cut(aside).momentum_residual < 1e-9


def test_a_layer_without_stiffness_is_refused() -> None:
    """What bears nothing is no layer of a solid."""
    with pytest.raises(SceneError, match="rind_stiffness"):
        replace(FLESH, **RIND, rind_stiffness=0.0)
    with pytest.raises(SceneError, match="core_stiffness"):
        replace(FLESH, R_core=9.0, core_ratio=0.5, core_stiffness=-1.0)
