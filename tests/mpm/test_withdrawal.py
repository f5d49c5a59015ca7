"""A blade that is withdrawn from the food it has cut: friction, adhesion, no resistance, and where the work goes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Board, Knife, Motion
from mpm.solver import Simulation
from mpm.state.host_transfer import of_particles
from mpm.state.state import FACE_POINTS
from tests.mpm.scenes import FLESH, PRISM, cut

HALF = np.deg2rad(5.5)
STROKE = 0.012
# a wedge all the way, in food that springs back and is held on the board: what touches it is known to be at its angle
WEDGE = Knife("tall wedge", 8e-3, 2 * HALF, 0.05, 0.2)
HELD = replace(
    PRISM,
    knife=WEDGE,
    food=replace(PRISM.food, material=replace(FLESH, yield_stress=np.inf, loss_factor=0.1)),
    board=Board(9.0),
    motion=Motion(STROKE, 0.005, retract=0.014),
    numerics=replace(PRISM.numerics, gravity=98.1),  # or what holds the blade is lifted
)
ENERGY = 2.0  # work of adhesion [J/m^2]
STICKY = HELD.with_material(adhesion=5e3, adhesion_energy=ENERGY)


@pytest.fixture(scope="module")
def dry() -> ForceRecord:
    """Without friction and adhesion: the food pushes the wedge out."""
    return cut(HELD)


@pytest.fixture(scope="module")
def sticky() -> ForceRecord:
    """Without friction, of faces that stick."""
    return cut(STICKY)


def rising(record: ForceRecord, low: float = 3e-3, high: float = 9e-3) -> np.ndarray:
    """Rows of the withdrawal between two depths [m], clear of the edge's slip after the turn."""
    up = np.arange(len(record.stroke)) >= record.cut_rows
    return np.flatnonzero(up & (record.stroke > low) & (record.stroke < high))


def wetted_area() -> float:
    """Area of the food's faces that have touched the wedge when it is at its lowest [m^2]: a quarter of a particle's
    face for each of its points that sticks."""
    scene = replace(STICKY, motion=replace(HELD.motion, retract=0.0))
    simulation = Simulation(scene, Runtime(threads=1))
    simulation.run()
    stuck = of_particles(simulation.state, simulation.state.adhering).clip(0)
    points = sum(int(np.count_nonzero(stuck & (1 << q))) for q in range(FACE_POINTS))
    seeds = simulation.setup.seeds
    return float(points / FACE_POINTS * seeds.spacing**2 * simulation.setup.grid.images)


@pytest.mark.slow
@pytest.mark.parametrize("mu", [0.05, 0.1])
def test_friction_is_mu_times_a_normal_force_that_is_known(dry, mu):
    """On a wedge of half angle h a normal force N gives 2 N sin h upwards, and friction takes 2 mu N cos h of it.

    The cut without friction says N at each depth. Friction is mu times that within 5 %: N is the same to some per cent,
    as friction drags the faces along.
    """
    record = cut(HELD.with_material(mu=mu))
    rows = rising(dry)
    normal = dry.resolved_face[rows] / (2 * np.sin(HALF))
    assert np.array_equal(rows, rising(record))  # the same depths
    drag = dry.resolved_face[rows] - record.resolved_face[rows]
    assert drag.sum() / (2 * np.cos(HALF) * normal).sum() == pytest.approx(mu, rel=0.05)


@pytest.mark.slow
def test_work_of_adhesion_comes_back_on_the_way_up(dry, sticky):
    """The work that takes the food off the blade is that of adhesion times the area that touched, within 5 %: what is
    booked, and what the knife needs more than without it. The way down has none of it."""
    area, section = wetted_area(), 2 * STROKE * HELD.food.shape.width / np.cos(HALF)
    assert 0.4 * section < area < 0.8 * section  # the food has run ahead of the rest
    expected = ENERGY * area
    assert sticky.adhesion is not None and dry.adhesion is None
    assert sticky.adhesion[-1] == pytest.approx(expected, rel=0.05)
    assert sticky.withdrawal["work_J"] - dry.withdrawal["work_J"] == pytest.approx(expected, rel=0.05)
    assert abs(sticky.adhesion[sticky.cut_rows - 1]) < 0.01 * expected
    assert sticky.work == pytest.approx(dry.work, abs=0.01 * expected)


@pytest.mark.slow
def test_what_is_held_only_by_its_pull_does_not_rub(dry, sticky):
    """Adhesion adds little to the friction on the way up: its pull times mu would be mu / tan h of its work more.

    What there is comes from faces that touch with one end and are held at the other.
    """
    mu, works = 0.2, []
    for scene in (HELD, STICKY):
        works.append(cut(scene.with_material(mu=mu)).withdrawal["work_J"])
    rubbed = works[1] - works[0] - (sticky.withdrawal["work_J"] - dry.withdrawal["work_J"])
    assert rubbed < 0.5 * mu / np.tan(HALF) * sticky.adhesion[-1]


@pytest.mark.slow
def test_nothing_is_cut_on_the_way_up(sticky):
    """Behind the edge's slip the edge feels nothing, no new surface is paid for, and no more of the section is cut."""
    down = cut(replace(HELD, motion=replace(HELD.motion, retract=0.0)))
    assert np.abs(sticky.edge[rising(sticky), 2]).max() < 1e-3 * sticky.peak
    assert np.diff(sticky.parting[sticky.cut_rows :]).max() < 1e-6 * sticky.parting[-1]
    assert sticky.severed_area == pytest.approx(down.severed_area, rel=1e-9)


@pytest.mark.slow
def test_work_of_both_ways_is_booked(dry, sticky):
    """All that knife and gravity do on both ways is in the energies; what adhesion adds to what no law takes is under
    5 % of it, and the momentum balance closes."""
    more = sticky.unbooked[-1] - dry.unbooked[-1]
    assert abs(more) < 0.05 * sticky.adhesion[-1]
    assert sum(sticky.budget.values()) == pytest.approx(float(sticky.work_done[-1] + sticky.weighing[-1]), rel=1e-9)
    assert "adhesion" in sticky.budget and "adhesion" not in dry.budget and "adhesion_J" in sticky.columns()
    assert sticky.momentum_residual < 1e-10


def test_cut_and_withdrawal_are_apart():
    """Peak and work are those of the way down, and the mean over a cell does not mix the ways where the blade turns."""
    scene = replace(PRISM, knife=WEDGE, motion=Motion(8e-3, 0.02)).with_material(mu=0.3)
    down = cut(scene)
    both = cut(replace(scene, motion=replace(scene.motion, retract=4e-3)))
    assert down.withdrawal is None and "withdrawal" not in down.summary()
    assert both.cut_rows == len(down.stroke) == both.rows_down
    np.testing.assert_allclose(both.resolved[: both.cut_rows], down.resolved, rtol=1e-9)
    assert both.peak == pytest.approx(down.peak) and both.work == pytest.approx(down.work)
    up = both.summary()["withdrawal"]
    steps = np.diff(both.stroke)[both.cut_rows - 1 :]
    assert up["work_J"] == pytest.approx(float(both.knife[both.cut_rows :, 2] @ steps), rel=1e-9)
    assert up["pull_N"] == pytest.approx(-both.resolved[both.cut_rows :].min()) and up["pull_N"] > 0.0


def test_strong_adhesion_is_as_weak_as_the_grid_resolves():
    """Of a strength that lets go over less than the food stretches no more is used than gives it half a spacing of
    process zone, at the same work; a weak one is used as it is."""
    spacing = 1.5e-3
    strong = replace(FLESH, adhesion=5e5, adhesion_energy=ENERGY)
    used = strong.sticking_strength(spacing)
    assert strong.E * ENERGY / used**2 == pytest.approx(spacing / 2)
    assert replace(strong, adhesion=5e3).sticking_strength(spacing) == 5e3 and FLESH.sticking_strength(spacing) == 0.0
