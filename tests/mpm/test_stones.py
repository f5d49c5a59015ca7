"""Cuts of foods with a stone or a cavity: rigid, bonded, never entered; what is hollow costs nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fem_reference.stone import StoneInCube
from mpm.output.record import LIMIT, STROKE
from mpm.scene import Arm, Board, EdgeLaw, Food, Inclusion, Knife, Motion, Numerics, Parted, Press, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from tests.mpm.scenes import cut

BLADE = Knife("thin", 0.2e-3, np.deg2rad(1.0), 0.06, 0.4)
SMOOTH = Material(E=1e6, nu=0.35, rho=1000, loss_factor=0.03)
CUBE, BALL = Shape("block", 0.048, 0.048, 0.048), Shape("sphere", 0.032, 0.032, 0.032)
SMALL, ROUND, LARGE = (Inclusion(size, size, size) for size in (0.014, 0.016, 0.024))
FEM = StoneInCube(0.048, 0.012, SMOOTH)
FRUIT = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=100.0, R_initiation=100.0, initiation_depth=3e-4, mu=0.2)


def fruit(stone: Inclusion | None = None, *, limit: float | None = 30.0, cut: float = 0.0, **how) -> Scene:
    """A ball of flesh 32 mm high with a stone, under a rigid arm with a force limit."""
    food = Food(replace(BALL, cut=cut), how.pop("material", FRUIT), stone)
    motion = Motion(how.pop("stroke", 0.032), how.pop("mach", 0.002))
    numerics = Numerics(how.pop("dx", 3e-3), **how)
    return Scene(food, BLADE, motion, Board(0.5), EdgeLaw(zone=4e-3), numerics, Arm(force_limit=limit))


def pressed(stone: Inclusion) -> float:
    """Stiffness of a cube between smooth plates [N/m]."""
    numerics, damped = Numerics(4e-3, gravity=0.0, output=2e-5), replace(SMOOTH, loss_factor=0.1)
    record = cut(Scene(Food(CUBE, damped, stone), Press(), Motion(0.72e-3, 0.002), Board(0.0), numerics=numerics))
    late = record.stroke > 0.3e-3
    return float(np.polyfit(record.stroke[late], record.face[late, 2], 1)[0])


def test_a_cube_is_as_stiff_as_its_stone_makes_it():
    """A rigid ball of half the cube's size, against finite elements that fit it; cells are a third of its radius."""
    assert pressed(LARGE) == pytest.approx(FEM.pressing(), rel=0.02)


def test_the_edge_stops_at_the_stone_and_presses_it_into_the_flesh():
    """In flesh without resistance the force is nothing down to the stone, and then that of a ball that sinks."""
    numerics = Numerics(4e-3, gravity=0.0, output=2e-5, room=0.2)
    of = Scene(Food(CUBE, SMOOTH, LARGE), BLADE, Motion(0.0127, 0.004), Board(0.0), EdgeLaw(4e-3), numerics)
    record = cut(of)
    depth, force = record.stroke - 0.012, record.edge[:, 2]
    assert abs(force[depth < -1e-4]).max() < 0.02 * force.max()
    slope = np.polyfit(depth[depth > 1e-4], force[depth > 1e-4], 1)[0]
    assert slope == pytest.approx(FEM.sinking(0.012), rel=0.1)
    assert record.pieces.stone_met == pytest.approx(0.036, abs=1e-4)
    assert record.pieces.stone == pytest.approx((0.0, 0.0, 0.024 - depth[-1]), abs=3e-5)


def test_an_arm_with_a_limit_does_not_part_a_fruit_with_a_stone():
    """The cut ends at the limit, says why, and its momentum and energy balance."""
    record = cut(fruit(ROUND))
    assert record.ended == LIMIT and not record.severed and record.fraction < 1
    assert 30 < record.edge[-1, 2] + record.face[-1, 2] < 45
    assert record.pieces.words().startswith("not severed: stone at z = 2")
    assert record.summary()["stone_met_m"] == pytest.approx(0.0235, abs=1e-3)
    assert abs(record.lost) < 0.025
    assert record.severed_part == pytest.approx(0.2, abs=0.05)


@pytest.mark.parametrize("how", [{"mirror": False}, {"grid_shift": (0.5, 0.0, 0.4), "seed": 1}])
def test_wherever_grid_and_mirrors_are(how):
    """Whole, and elsewhere in the grid with other particles: the edge stands as high at the limit."""
    record, usual = cut(fruit(ROUND, **how)), cut(fruit(ROUND))
    assert record.ended == LIMIT and not record.severed
    assert record.stroke[-1] == pytest.approx(usual.stroke[-1], abs=0.6e-3)
    assert record.pieces.stone[:2] == pytest.approx((0.0, 0.0), abs=2e-4)
    assert abs(record.lost) < 0.03


def test_beside_the_stone_the_fruit_parts():
    """The blade passes a stone that its plane does not meet; the stone is in the larger piece, and is not met."""
    record = cut(fruit(SMALL, cut=0.008, mach=0.01, mirror=False))
    assert record.ended == STROKE and record.severed and record.pieces.stone_met is None
    assert record.pieces.stone[1] < -0.006
    assert record.severed_part == 1.0


def test_the_edge_slides_along_a_stone_off_its_middle():
    """A smooth blade that meets a stone on its flank pushes it aside with its half, and the other half stays."""
    record = cut(fruit(SMALL, material=replace(FRUIT, mu=0.0), cut=0.004, stroke=0.018, mirror=False))
    assert record.ended == STROKE and record.pieces.stone_met is not None
    assert record.edge[:, 1].max() > 3.0 and record.pieces.stone[1] < -0.0045  # to the left
    assert record.peak < 20.0


def test_an_arm_that_yields_stalls_on_the_stone():
    """Behind a spring with a limit the blade comes to stand on the stone with that force, and nothing rattles."""
    soft = replace(fruit(ROUND, stroke=0.016), arm=Arm(20e3, 12.0))
    record = cut(soft)
    late = record.command > record.stroke + 1e-3
    force = (record.edge + record.face)[late][-8:, 2]
    assert record.pieces.stone_met is not None and not record.severed
    assert force.mean() == pytest.approx(12.0, rel=0.1) and force.std() < 1.5


@pytest.mark.parametrize("how", [{}, {"grid_shift": (0.5, 0.0, 0.57), "seed": 1}])
def test_what_is_hollow_costs_nothing(how):
    """The work of a cut through a ball with a cavity is R times the flesh of its section, which is what was severed."""
    flesh = replace(FRUIT, R=200.0, R_initiation=200.0, tensile_strength=1e5, mu=0.0)
    food = Food(BALL, flesh, cavity=Inclusion(0.014, 0.014, 0.014))
    numerics = Numerics(2.5e-3, gravity=0.0, **how)
    record = cut(Scene(food, BLADE, Motion(0.032, 0.01), Board(0.5), EdgeLaw(3e-3), numerics))
    area = math.pi / 4 * (0.032**2 - 0.014**2)
    assert record.severed and record.severed_area == pytest.approx(area, rel=1e-6)
    assert record.work == pytest.approx(200 * area, rel=0.02)
    assert record.surface[-1] == pytest.approx(200 * area, rel=0.03)


def test_what_was_parted_before_costs_nothing():
    """A fruit that was cut to its middle before takes half of the work, and starts without a threshold."""
    tough = replace(FRUIT, R_initiation=400.0, mu=0.0)
    whole = fruit(limit=None, material=tough, mach=0.01, dx=2.5e-3)
    record = cut(replace(whole, food=replace(whole.food, parted=(Parted(0.0, 0.0),))))
    assert record.surface[-1] == pytest.approx(100 * math.pi / 8 * 0.032**2, rel=0.04)
    assert record.edge[record.stroke < 0.012, 2].max() < 0.1 * 400.0 * 0.02
