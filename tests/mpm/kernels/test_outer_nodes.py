"""Nodes with little mass beside the cut plane, which follow those inside."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti

from mpm.kernels.outer_nodes import extend_end, extend_interior, follow
from mpm.runtime import Runtime
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation, simulate
from mpm.state.tables import EXTENSION, N_PARAMETERS
from tests.mpm.scenes import PRISM

PLACES = np.array([2.0, 1.0, 0.0])  # of a node, the next one inside and the one behind [cells]


@ti.data_oriented
class Line:
    """Three nodes on a line."""

    def __init__(self) -> None:
        self.u = ti.Vector.field(4, ti.f64, 3)

    @ti.kernel
    def follow(self, part: float):
        """Carry the first on from the others."""
        for _ in range(1):
            follow(self, 0, 1, 2, part)


@pytest.fixture(scope="module")
def line():
    """Three nodes on a line."""
    Simulation(PRISM, Runtime(threads=1))
    return Line()


def moved(line, velocities, masses, part):
    """Velocities after the first node has followed, shape (3, 3)."""
    line.u.from_numpy(np.column_stack([velocities, masses]))
    line.follow(part)
    return line.u.to_numpy()[:, :3]


@pytest.mark.parametrize("masses", [(0.001, 1.0, 1.0), (0.19, 1.0, 2.0), (0.1, 0.9, 0.6)])
def test_following_keeps_momentum_and_moment_and_makes_no_energy(line, masses):
    """And then the three lie on a line."""
    m, before = np.array(masses), np.random.default_rng(3).normal(size=(3, 3))
    after = moved(line, before, m, 0.2)
    np.testing.assert_allclose(m @ after, m @ before, rtol=1e-12)
    np.testing.assert_allclose((m * PLACES) @ after, (m * PLACES) @ before, rtol=1e-12)
    assert m @ (after**2).sum(1) < m @ (before**2).sum(1)
    np.testing.assert_allclose(after[0] - 2 * after[1] + after[2], 0, atol=1e-12)


def test_what_is_linear_in_space_is_left_alone(line):
    """So a food that moves, turns or stretches evenly feels nothing of it."""
    slope = np.outer(PLACES, [1.0, -2.0, 0.5]) + [3.0, 1.0, -1.0]
    np.testing.assert_allclose(moved(line, slope, [0.01, 1.0, 1.0], 0.1), slope, rtol=1e-12)


@pytest.mark.parametrize(
    ("masses", "part"),
    [((0.11, 1.0, 1.0), 0.1), ((0.11, 2.0, 0.5), 0.1), ((0.0, 1.0, 1.0), 0.1), ((0.01, 1.0, 1.0), 0)],
)
def test_a_node_with_mass_of_its_own_and_one_without_any_do_not_follow(line, masses, part):
    """The mass inside is that of the next node, or of two behind it."""
    before = np.random.default_rng(4).normal(size=(3, 3))
    np.testing.assert_array_equal(moved(line, before, masses, part), before)


TUBER = Material(E=9.5e6, nu=0.3, rho=1000.0, R=87.0, loss_factor=0.02)
SCENE = Scene(
    Food(Shape("block", 0.03, 0.012, 0.03), replace(TUBER, tensile_strength=0.3e6)),
    Knife("wedge", 2e-3, np.radians(11.0), 0.06, 0.4),
    Motion(8e-3, 3.1e-3),
    Board(0.0),
    EdgeLaw(zone=4e-3),
    Numerics(dx=3e-3, gravity=0.0, room=1.0, contact_stiffness=8.0),
)  # fmt: skip


@pytest.mark.parametrize(
    "shift, turn",
    [(0.0, 0.0), pytest.param(0.5, 0.0, marks=pytest.mark.long), pytest.param(0.0, 0.4, marks=pytest.mark.long)],
)
def test_a_stiff_food_does_not_creep_under_a_thick_blade(shift, turn):
    """Without it the first layer creeps under the blade, the more the stiffer the contact is. No law takes that."""
    lost = []
    for part in (SCENE.numerics.extension, 0.0):
        grid = replace(SCENE.numerics, extension=part, grid_shift=(0.0, shift, 0.0), grid_turn=turn)
        record = simulate(replace(SCENE, numerics=grid), runtime=Runtime(threads=1))
        assert np.abs(record.residual).max() < 1e-9 * np.abs(record.face).max()
        lost.append(record.unbooked[-1] / record.work)
    assert abs(lost[0]) < 0.5 * lost[1], lost


@ti.data_oriented
class Column:
    """A column of nodes with little mass at both ends, as the kernels see one."""

    masses = np.array([0.0, 0.02, 0.15, 1.0, 1.0, 0.9, 0.1, 0.03, 0.001, 0.0])

    def __init__(self) -> None:
        self.u = ti.Vector.field(4, ti.f64, len(self.masses))
        self.window, self.par = ti.field(ti.i32, (1, 6)), ti.field(ti.f64, (1, N_PARAMETERS))
        self.window[0, 5], self.par[0, EXTENSION] = len(self.masses), 0.25

    @ti.kernel
    def extend(self, back: ti.template()):
        """Let both ends follow, one after the other."""
        for _ in range(1):
            for turn in ti.static(range(2)):
                extend_end(self, 0, 0, back, (turn + back) % 2)

    def matrix(self, ways: tuple[bool, ...]) -> np.ndarray:
        """What velocities become, a column for the unit velocity of each node."""
        out = []
        for one in np.eye(len(self.masses)):
            self.u.from_numpy(np.column_stack([one, 0 * one, 0 * one, self.masses]))
            for back in ways:
                self.extend(back)
            out.append(self.u.to_numpy()[:, 0])
        return np.array(out).T


def test_there_and_back_nodes_follow_without_making_energy(line):
    """Mass times what it does to velocities is symmetric, so a force with a potential keeps one. One way it is not: a
    cucumber that flows then ended with 45 % of its work made by no law."""
    column = Column()
    mass = np.diag(column.masses)
    both, one = column.matrix((False, True)), column.matrix((False,))
    np.testing.assert_allclose(mass @ both, (mass @ both).T, atol=1e-14)
    assert np.abs(mass @ one - (mass @ one).T).max() > 1e-3
    assert np.abs(both - np.eye(len(both))).max() > 0.1 and np.linalg.norm(both - one) > 1e-3
    kept = np.linalg.eigvalsh(mass - both.T @ mass @ both)
    assert kept.min() > -1e-14  # no kinetic energy is made


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_all_lines_of_a_cut_together_are_symmetric(turn):
    """Across, upright and, in a turned grid, along: one after the other and then in reverse, on the nodes of a cut."""
    numerics = replace(SCENE.numerics, extension=0.24, grid_turn=turn)
    simulation = Simulation(replace(SCENE, motion=Motion(2e-3, 0.02), numerics=numerics), Runtime(threads=1))
    simulation.run()
    state = simulation.state
    before = state.u.to_numpy()
    mass = np.where(before[:, 3] > 0, before[:, 3], 0.0)

    @ti.kernel
    def extend(s: ti.template()):
        extend_interior(s, 0)

    def extended(velocity):
        state.u.from_numpy(np.column_stack([velocity, velocity, velocity, before[:, 3]]))
        extend(state)
        return state.u.to_numpy()[:, 0]

    one, other = np.random.default_rng(5).normal(size=(2, len(mass)))
    there, back = (other * mass) @ extended(one), (one * mass) @ extended(other)
    assert there == pytest.approx(back, rel=1e-9)
    assert np.abs(extended(one) - one).max() > 0.1
