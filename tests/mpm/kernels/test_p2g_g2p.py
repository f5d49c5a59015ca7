"""The bare method without tools: conservation, rigid motion, waves and weight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.runtime import Runtime
from mpm.scene import Board, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from mpm.state import tables as kn
from mpm.state.host_transfer import fill, of_particles, particles, set_velocity_gradients, velocity_gradients
from mpm.state.tables import parts_of_report

DX = 3e-3
KNIFE = Knife("thin", 1e-3, 0.1, 0.04, 0.2)
MATERIAL = Material(E=2e5, nu=0.0, rho=1000.0)


def scene(shape: Shape, material: Material = MATERIAL, gravity: float = 0.0, damper_mass: float = 0.0) -> Scene:
    """A block with the knife far above it."""
    numerics = Numerics(dx=DX, gravity=gravity, mirror=False, damper_mass=damper_mass)
    return Scene(Food(shape, material), KNIFE, Motion(5e-3), Board(mu=0.0), numerics=numerics)


class Free:
    """A body away from all tools, driven step by step."""

    def __init__(self, shape: Shape, gravity: float = 0.0, damper_mass: float = 0.0) -> None:
        self.sim = Simulation(scene(shape, gravity=gravity, damper_mass=damper_mass), Runtime(threads=1))
        self.k, self.dt, self.x0 = self.sim.state, self.sim.setup.time_step(MATERIAL), self.sim.setup.seeds.x
        self.load()

    def load(self) -> None:
        """Back to the beginning: another body may have had the fields."""
        self.sim.load(MATERIAL)
        self.sim.set_pose(1.0)
        self.k.board_gap.fill(-1.0)  # nothing touches the board

    def start(self, velocity: np.ndarray, gradient: np.ndarray) -> None:
        """Give every particle a velocity [m/s] (n, 3) and its gradient [1/s] (3, 3) or (n, 3, 3)."""
        fill(self.k, self.k.v, velocity)
        set_velocity_gradients(self.k, np.broadcast_to(gradient, (len(velocity), 3, 3)))

    def advance(self, steps: int) -> np.ndarray:
        """Run with the knife far above; returns a row of the report for each 20 steps."""
        return self.sim.advance((steps, 20, self.dt, 0.0, 0.0, 0.0))

    def momenta(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Linear momentum, angular momentum with the affine part, and mass."""
        m = self.k.par.to_numpy()[0, kn.MASS]
        x, v, c = of_particles(self.k, self.k.x), of_particles(self.k, self.k.v), velocity_gradients(self.k)
        spin = DX**2 / 4 * np.stack([c[:, 2, 1] - c[:, 1, 2], c[:, 0, 2] - c[:, 2, 0], c[:, 1, 0] - c[:, 0, 1]], -1)
        return m * v.sum(0), m * (np.cross(x, v) + spin).sum(0), m * len(x)


@pytest.fixture(scope="module")
def block() -> Free:
    """A small free block."""
    return Free(Shape("block", 0.03, 0.024, 0.02))


def test_linear_and_angular_momentum_of_a_spinning_stretching_block(block):
    """Without tools 300 steps change neither: 1e-12 of their size; and the particles add up to rho times volume."""
    rng = np.random.default_rng(0)
    grad = np.array([[0.0, -3.0, 1.0], [2.0, 5.0, 0.0], [0.0, 1.0, -4.0]])
    x = block.x0 - block.x0.mean(0)
    block.load()
    block.start(x @ grad.T + 0.05 * rng.standard_normal(x.shape) + [0.1, 0.0, 0.05], grad)
    p0, l0, mass = block.momenta()
    block.advance(300)
    p1, l1, _ = block.momenta()
    assert mass == pytest.approx(1000 * 0.03 * 0.024 * 0.02, rel=1e-12)
    np.testing.assert_allclose(p1, p0, atol=1e-12 * np.linalg.norm(p0))
    np.testing.assert_allclose(l1, l0, atol=1e-11 * np.linalg.norm(l0))


def test_affine_velocity_is_reproduced(block):
    """One step of a stress-free affine field returns velocity and gradient of every inner particle (patch test)."""
    grad = np.array([[0.3, -0.2, 0.1], [0.0, 0.4, 0.2], [0.1, 0.0, -0.5]])
    block.load()
    block.start(block.x0 @ grad.T, grad)
    soft = block.k.par.to_numpy().copy()
    free = soft.copy()
    free[0, [kn.MU, kn.LAM]] = 0.0
    block.k.par.from_numpy(free)
    block.advance(1)
    block.k.par.from_numpy(soft)
    np.testing.assert_allclose(of_particles(block.k, block.k.v), block.x0 @ grad.T, atol=1e-13)
    np.testing.assert_allclose(velocity_gradients(block.k), np.broadcast_to(grad, (len(block.x0), 3, 3)), atol=1e-9)


def test_rigid_spin_stays_free_of_stress(block):
    """A tenth of a turn at omega dt = 1e-3 leaves |F^T F - I| below the O(dt) of the update."""
    dt, omega = block.dt, 1e-3 / block.dt
    spin = omega * np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    block.load()
    block.start((block.x0 - block.x0.mean(0)) @ spin.T, spin)
    block.advance(int(2 * np.pi / 10 / (omega * dt)))
    f = particles(block.k).F
    assert np.abs(np.swapaxes(f, 1, 2) @ f - np.eye(3)).max() < 5e-2
    assert np.abs(np.linalg.det(f) - 1).max() < 5e-2


def test_free_fall_is_exact():
    """With gravity the centre of mass falls by g dt^2 n (n + 1) / 2, the exact sum of the symplectic steps."""
    body = Free(Shape("block", 0.024, 0.024, 0.024), gravity=9.81)
    body.start(np.zeros_like(body.x0), np.zeros((3, 3)))
    n = 60
    body.advance(n)
    fall = body.x0.mean(0) - of_particles(body.k, body.k.x).mean(0)
    np.testing.assert_allclose(fall, [0, 0, 9.81 * body.dt**2 * n * (n + 1) / 2], atol=1e-15)


def test_dampers_of_a_thrown_block_take_their_part_of_its_momentum():
    """They lag behind by 1/(1 + k) a step, k = (1 + m) w dt with w of the first shear mode, until all move alike; the
    momentum of both is kept, and the energy that is lost is what is booked."""
    shape, m, thrown, n = Shape("block", 0.03, 0.024, 0.02), 0.4, np.array([0.1, -0.3, 0.2]), 60
    body = Free(shape, damper_mass=m)
    body.start(np.broadcast_to(thrown, body.x0.shape), np.zeros((3, 3)))
    before, _, mass = body.momenta()
    rows = body.advance(n)
    after, report = body.momenta()[0], parts_of_report(rows[-1])
    k = (1 + m) * 2 * np.pi * np.sqrt(1e5 / 1000.0) / (4 * 0.02) * body.dt
    np.testing.assert_allclose(after, before * (1 + m * (1 + k) ** -n) / (1 + m), rtol=1e-10)
    dampers = report.particles[kn.DAMPER_MOMENTUM : kn.DAMPER_MOMENTUM + 3]
    np.testing.assert_allclose(after + dampers, before, rtol=1e-12)
    booked = rows[:, kn.VISCOUS].sum() * body.sim.setup.seeds.volume
    assert booked > 0.1 * report.particles[kn.KINETIC]
    assert report.particles[kn.KINETIC] + booked == pytest.approx(before @ before / (2 * mass), rel=1e-10)


def test_dampers_keep_the_moment_of_momentum_but_for_what_lags():
    """A spinning block: food and dampers together lose no more moment of momentum than the kinetic energy times the
    time, the sum of all m v x v_d; without the dampers' own ten times that is missing."""
    m, spin, n = 0.4, np.array([3.0, -2.0, 5.0]), 60
    body = Free(Shape("block", 0.03, 0.024, 0.02), damper_mass=m)
    cross = np.array([[0.0, -spin[2], spin[1]], [spin[2], 0.0, -spin[0]], [-spin[1], spin[0], 0.0]])
    body.start((body.x0 - body.x0.mean(0)) @ cross.T, cross)
    before = body.momenta()[1]
    report = parts_of_report(body.advance(n)[-1])
    after, particle = body.momenta()[1], body.k.par.to_numpy()[0, kn.MASS]
    x, v = (of_particles(body.k, field) for field in (body.k.x, body.k.damper_v))
    dampers = m * particle * np.cross(x, v).sum(0)
    most = report.particles[kn.KINETIC] * n * body.dt
    assert np.linalg.norm(after + dampers - before) <= most < 0.1 * np.linalg.norm(dampers)


@pytest.mark.slow
def test_bar_vibrates_with_its_wave_speed():
    """A free bar swings lengthwise with the period 2 L / sqrt(E/rho) (nu = 0), within 2 %."""
    length = 0.12
    bar = Free(Shape("block", 0.016, length, 0.016))  # along the cut plane: across it, ties would be loaded
    amplitude = 0.01 * MATERIAL.p_wave
    y = bar.x0[:, 0]
    v = np.zeros_like(bar.x0)
    v[:, 0] = amplitude * np.sin(np.pi * y / length)
    grad = np.zeros((len(y), 3, 3))
    grad[:, 0, 0] = amplitude * np.pi / length * np.cos(np.pi * y / length)
    bar.start(v, grad)
    mode, signal = np.sin(np.pi * y / length), []
    period = 2 * length / np.sqrt(MATERIAL.E / MATERIAL.rho)
    steps = int(1.3 * period / bar.dt / 20)
    for _ in range(steps):
        bar.advance(20)
        signal.append(of_particles(bar.k, bar.k.v)[:, 0] @ mode)
    # stress is that of the strain at the end of a step, so the velocity after n steps belongs to half a step later
    t = bar.dt * (20 * np.arange(1, steps + 1) + 0.5)
    down = np.flatnonzero((np.array(signal[:-1]) > 0) & (np.array(signal[1:]) <= 0))[0]
    quarter = np.interp(0, [-signal[down], -signal[down + 1]], [t[down], t[down + 1]])
    assert 4 * quarter == pytest.approx(period, rel=0.02)


def test_block_at_rest_weighs_its_weight():
    """Averaged over a swing of the block, the board carries its weight within 2 %."""
    sc = scene(Shape("block", 0.024, 0.024, 0.024), replace(MATERIAL, loss_factor=0.3), gravity=9.81)
    sc = replace(sc, knife=replace(KNIFE, name="away"), motion=Motion(2e-3, 1e-3))
    sim = Simulation(sc, Runtime(threads=1))
    sim.load(sc.food.material)
    sim.set_pose(1.0)
    dt = sim.setup.time_step(sc.food.material)
    report = sim.advance((1200, 20, dt, 0.0, 0.0, 0.0))
    weight = 1000 * 9.81 * 0.024**3
    assert -report[30:, kn.BOARD + 2].sum() / (600 * dt) == pytest.approx(weight, rel=0.02)


def test_food_that_leaves_the_grid_is_counted_and_does_not_crash(block):
    """Particles thrown out of the grid are counted, also with positions that are not numbers, and touch no memory."""
    block.load()
    block.start(np.full_like(block.x0, 1e4), np.zeros((3, 3)))
    assert block.advance(40)[:, kn.OUTSIDE].sum() > 0
    fill(block.k, block.k.x, np.full_like(block.x0, np.nan))
    block.advance(2)
