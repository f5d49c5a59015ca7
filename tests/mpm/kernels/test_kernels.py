"""What the kernels skip or do at once changes no result: against NumPy, and one thread against two."""

import runpy
from dataclasses import replace

import numpy as np
import pytest
import taichi as ti
from scipy.linalg import polar

from mpm.discretisation.capacity import EXTRA_PARTICLES
from mpm.kernels.constitutive.stress import elastic_block
from mpm.kernels.crack import ALL_VISIBLE
from mpm.kernels.reductions import report
from mpm.kernels.surface_contact import friction_limit
from mpm.runtime import Runtime
from mpm.scene import EdgeLaw, Food, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.setup.setup import Setup
from mpm.solver import Simulation, state_of
from mpm.state import tables as kn
from mpm.state.host_transfer import TABLES, fill, of_particles, particles, set_velocity_gradients, velocity_gradients
from mpm.state.state import Configuration, State
from mpm.step.time_step import advance
from tests.mpm import twins
from tests.mpm.scenes import FLESH, PRISM, WEDGE

BRITTLE = Scene(
    Food(
        Shape("block", 0.05, 0.02, 0.016),
        Material(
            E=1e6,
            nu=0.35,
            rho=1000,
            yield_stress=5e4,
            R=200,
            mu=0.3,
            tensile_strength=1.2e4,
            fracture_energy=20,
            loss_factor=0.02,
        ),
    ),
    WEDGE,
    Motion(3e-3, 0.01),
    edge=EdgeLaw(zone=3e-3),
    numerics=Numerics(dx=2e-3, mirror=False),
)


@ti.kernel
def elastic(k: ti.template(), dt: float):
    """The elastic pass alone."""
    for block in range(k.size[0, kn.BLOCKS]):
        elastic_block(k, 0, block, dt)


@ti.kernel
def report_row(k: ti.template(), out: TABLES):
    """A row of the report alone."""
    report(k, 0, 0, out)


def padded(k, f):
    """Deformation gradients (n, 3, 3) as the fields store them, with room for more particles."""
    whole = np.zeros((k.room, 3, 3))
    whole[: len(f)] = f
    return whole.reshape(1, -1, k.lanes, 9).swapaxes(2, 3)


@pytest.fixture(scope="module", params=["at rest", "the last step", "nonsense"])
def strained(request):
    """A prism whose particles have random strains up to 20 %, a few of them inverted; its tables before and after.

    The search for the stretch starts from that at rest, from the right one before the step, or from nonsense.
    """
    viscous = replace(PRISM.food.material, loss_factor=0.1)
    scene = replace(PRISM, food=Food(PRISM.food.shape, viscous))
    sim = Simulation(scene, Runtime(threads=1))
    sim.load(viscous)
    k, rng = sim.state, np.random.default_rng(0)
    f = np.eye(3) + rng.uniform(-0.2, 0.2, (k.n[0], 3, 3)) * rng.uniform(0, 1, (k.n[0], 1, 1))
    f[:5] = np.diag([-0.5, 1.0, 1.0])
    slope = rng.uniform(-1, 1, (k.n[0], 3, 3))
    k.F.from_numpy(padded(k, f))
    if request.param != "at rest":
        starts = np.array([np.trace(polar(each, side="left")[1]) for each in f])
        if request.param == "nonsense":
            starts = rng.choice([0.0, np.nan, np.inf, 1e9, 1.0, -7.0], len(f))
        table = k.tau.to_numpy()
        table[0, :, 8].ravel()[: len(f)] = starts
        k.tau.from_numpy(table)
    set_velocity_gradients(k, slope)
    np.testing.assert_array_equal(particles(k).F, f)
    np.testing.assert_array_equal(velocity_gradients(k), slope)
    dt = 1e-5
    elastic(k, dt)
    tau = k.tau.to_numpy()[0].transpose(0, 2, 1).reshape(-1, 9)[: k.n[0]]
    return sim, dt, f, slope, tau, particles(k).F


def test_stress_of_four_particles_at_once(strained):
    """Deformation gradient, Kirchhoff stress with the viscous part, and the losses are those of the formulas, also
    where some of the four flow: to 1e-9, flowing ones to 1e-6."""
    sim, dt, f, slope, tau, new = strained
    par, m = sim.state.par.to_numpy()[0], sim.scene.food.material
    flowing = 0
    for p in np.flatnonzero(tau[:, 8] > 0)[::3]:
        want = f[p] + dt * slope[p] @ f[p]
        rate = (slope[p] + slope[p].T) / 2
        swell, j = np.trace(rate) * np.eye(3), np.linalg.det(want)
        drag = j * (2 * par[kn.ETA_S] * (rate - swell / 3) + par[kn.ETA_B] * swell)
        lost, near, tol = 0.0, 1e-13, 1e-9
        if twins.mises(twins.kirchhoff(want, m.shear, m.lame)) > m.yield_stress:
            turn, stretch = polar(want, side="left")
            back = twins.j2_return(stretch, m.shear, m.yield_stress)
            want, near, tol = back @ turn, 1e-7, 1e-6
            lost = m.shear * (np.sum((stretch - np.eye(3)) ** 2) - np.sum((back - np.eye(3)) ** 2))
            flowing += 1
        stress = twins.kirchhoff(want, m.shear, m.lame) + drag
        np.testing.assert_allclose(new[p], want, atol=near)
        np.testing.assert_allclose(tau[p, :6], stress[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], atol=tol * m.E)
        assert tau[p, 6] == pytest.approx(dt * np.sum(drag * rate), rel=1e-9)
        assert tau[p, 7] == pytest.approx(lost, rel=1e-5, abs=1e-8 * m.E)
    assert 50 < flowing < len(f) / 3 - 50


def test_inverted_particles_are_left_to_be_done_one_by_one(strained):
    """Marked are exactly those turned inside out, and they are not advanced."""
    _, dt, f, slope, tau, new = strained
    beyond = np.linalg.det(f + dt * slope @ f) <= 0
    assert beyond.sum() == 5
    np.testing.assert_array_equal(tau[:, 8] < 0, beyond)
    assert np.all(tau[~beyond, 8] > 0)
    np.testing.assert_array_equal(new[beyond], f[beyond])


@pytest.mark.slow
def test_strain_is_smoothed_wherever_it_can_matter():
    """About a few strongly strained particles the smoothed strain is the one over all particles, and most are
    spared."""
    tough = replace(BRITTLE.food.material, yield_stress=np.inf)
    sim = Simulation(replace(BRITTLE, food=Food(BRITTLE.food.shape, tough)), Runtime(threads=1))
    sim.load(tough)
    k, par = sim.state, sim.state.par.to_numpy()[0]
    calm = np.random.default_rng(0).uniform(0, 0.9 * par[kn.EPS0], (k.n[0], 1, 1))
    f = (1 + calm) * np.eye(3)
    f[np.linalg.norm(of_particles(k, k.x) - [0.002, 0.004, 0.008], axis=1) < 1.5e-3] += 9.0 * np.eye(
        3
    )  # far beyond what food bears, so that it is felt two cells away
    k.F.from_numpy(padded(k, f))
    k.v.fill(1.0)  # what the grid carried before must be gone
    advance(k, [(1, 1, 1e-12, 0.0, 0.0, 0.0)])
    x = (of_particles(k, k.x) - sim.setup.grid.origin) / sim.scene.numerics.dx
    base = np.floor(x - 0.5).astype(int)
    strain = np.array([np.linalg.eigvalsh(polar(f, side="left")[1])[-1] - 1 for f in particles(k).F])
    weight, total = np.zeros(sim.setup.grid.nodes), np.zeros(sim.setup.grid.nodes)
    near = [(i, j, m) for i in range(3) for j in range(3) for m in range(3)]
    shape = [np.prod(twins.bspline(base + d - x), axis=1) for d in near]
    for d, w in zip(near, shape, strict=True):
        np.add.at(weight, tuple((base + d).T), w)
        np.add.at(total, tuple((base + d).T), w * strain)
    mean = total / np.maximum(weight, 1e-30)
    smooth = sum(w * mean[tuple((base + d).T)] for d, w in zip(near, shape, strict=True))
    hit = smooth > par[kn.EPS0]
    assert 100 < hit.sum() < 0.2 * k.n[0]
    ours = of_particles(k, k.driving_strain)
    np.testing.assert_allclose(ours[hit], smooth[hit], rtol=1e-9)
    assert (ours[~hit] <= par[kn.EPS0]).all()
    assert (ours == 0).sum() > 0.5 * k.n


@pytest.fixture(scope="module")
def alone():
    """The brittle cut on one thread."""
    return Simulation(BRITTLE, Runtime(threads=1)).run()


@pytest.mark.slow
@pytest.mark.parametrize("threads", [2, 0])
def test_many_threads_repeat_one(alone, threads):
    """Split among two threads, or as on a GPU (here on the CPU), a cut with flow, friction, damage and both halves
    gives the same force to 1e-9."""
    sim = Simulation(BRITTLE, Runtime(threads=2))
    sim.state = state_of(sim.setup.configuration(threads), sim.serial)
    record = sim.run()
    assert alone.damage[-1] > 0
    assert alone.plastic[-1] > 0
    np.testing.assert_allclose(record.edge + record.face, alone.edge + alone.face, atol=1e-9 * alone.resolved.max())
    np.testing.assert_allclose(record.damage[-1], alone.damage[-1], rtol=1e-9)


@pytest.mark.parametrize(
    ("shift", "mirrors"),
    [
        ((0.0, 0.0, 0.0), (True, True)),
        pytest.param((0.25, 0.0, 0.0), (False, True), marks=pytest.mark.long),
        pytest.param((0.0, 0.25, 0.0), (True, False), marks=pytest.mark.long),
    ],
    ids=["both mirrors", "across y", "across x"],
)
def test_two_threads_repeat_one_beside_mirrors(shift, mirrors):
    """What two threads scatter is summed where the mirrors want it: the force of one thread, to 1e-9."""
    scene = replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=3e-3))
    scene = replace(scene, numerics=replace(scene.numerics, mirror=True, grid_shift=shift))
    assert scene.mirrors == mirrors
    one = Simulation(scene, Runtime(threads=1)).run()
    sim = Simulation(scene, Runtime(threads=2))
    sim.state = state_of(sim.setup.configuration(2), sim.serial)
    assert sim.state.threads == 2
    two = sim.run()
    for part in ("edge", "face", "board"):
        np.testing.assert_allclose(getattr(two, part), getattr(one, part), atol=1e-9 * one.resolved.max())


@pytest.mark.slow
def test_a_simulation_outlives_a_restart_of_taichi():
    """Another precision starts Taichi anew, and every field is gone; a simulation made before runs again, and alike."""
    scene = replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=2e-3))
    double = Simulation(scene, Runtime(threads=1))
    first = double.run().resolved
    single = (
        Simulation(replace(scene, numerics=replace(scene.numerics, precision="f32")), Runtime(threads=1)).run().resolved
    )
    np.testing.assert_array_equal(double.run().resolved, first)
    np.testing.assert_allclose(single, first, atol=0.01 * first.max())
    assert (single != first).any()


@pytest.mark.slow
def test_many_simulations_wait_side_by_side():
    """A dozen scenes of different sizes are made before the first one runs."""
    lengths = np.linspace(0.03, 0.06, 12)
    food = BRITTLE.food
    scenes = [replace(BRITTLE, food=replace(food, shape=replace(food.shape, length=x))) for x in lengths]
    made = [Simulation(replace(s, motion=replace(s.motion, stroke=3e-4)), Runtime(threads=1)) for s in scenes]
    assert made[0].run().status == "done"


def test_fields_have_room_for_what_they_hold_and_come_in_few_sizes():
    """Up to 65,536 particles and 96 nodes there are three sizes each; beyond, no more than one step is empty. Tests
    have fewer sizes than users (``tests/conftest.py``), so the module is read anew."""
    fresh = runpy.run_module("mpm.discretisation.capacity")
    counts, nodes = range(1, 300_000, 501), range(3, 400)
    for of, sizes, whole, step in (
        (fresh["particle_capacity"], counts, 65_536, 65_536),
        (fresh["node_capacity"], nodes, 96, 32),
    ):
        assert all(of(n) >= n for n in sizes)
        assert len({of(n) for n in sizes if n <= whole}) == 3
        assert all(of(n) <= n + step + EXTRA_PARTICLES for n in sizes if n > whole)


@pytest.mark.slow
def test_scenes_of_a_class_share_kernels_and_keep_their_force():
    """Two sizes of food run with what was compiled once; the force of the first is the same before and after the
    second, and to 1e-9 that of fields without room to spare."""
    small = replace(PRISM, motion=replace(PRISM.motion, stroke=2e-3))
    shape = replace(PRISM.food.shape, width=1.3 * PRISM.food.shape.width, height=1.2 * PRISM.food.shape.height)
    one = Simulation(small, Runtime(threads=1))
    other = Simulation(replace(small, food=replace(PRISM.food, shape=shape)), Runtime(threads=1))
    assert one.setup.grid.nodes != other.setup.grid.nodes
    assert one.state is other.state
    force = one.run().resolved
    assert other.run().resolved.max() > 1.1 * force.max()
    with pytest.raises(RuntimeError, match="another simulation"):
        one.advance((1, 1, 1e-6, 0.0, 0.0, 0.0))
    np.testing.assert_array_equal(one.run().resolved, force)
    seeds, grid = one.setup.seeds, one.setup.grid
    tight = (len(seeds.x), grid.nodes, small.mirrors, len(grid.stations))
    ties = len(one.setup.ties())
    rows = small.numerics.layer_rows
    one.state = State(Configuration(*tight, threads=1, nodal=False, press=False, damage=False, ties=ties, rows=rows))
    np.testing.assert_allclose(one.run().resolved, force, atol=1e-9 * force.max())


def test_a_run_does_not_feel_the_one_before():
    """What a run left on the grid is gone before the next: the edge also reads nodes that no particle has reached."""
    sim = Simulation(replace(PRISM, motion=replace(PRISM.motion, stroke=1e-3)), Runtime(threads=1))
    sim.run()
    assert sim.state.u.to_numpy().any()
    sim.load(PRISM.food.material)
    assert not sim.state.u.to_numpy().any()


def test_food_without_resistance_is_cut():
    """R = 0: a cut starts before the edge has slipped in the food, and no force is divided by no slip."""
    soft = replace(PRISM.food.material, E=1e3, yield_stress=np.inf, R=0.0, R_initiation=0.0)
    scene = replace(PRISM, food=Food(PRISM.food.shape, soft), numerics=replace(PRISM.numerics, room=3.0))
    record = Simulation(replace(scene, motion=replace(PRISM.motion, stroke=6e-3)), Runtime(threads=1)).run()
    assert record.status == "done"
    assert np.abs(record.edge).max() < 1e-9


@pytest.mark.parametrize(("where", "value", "same"), [(0, np.nan, True), (1, 0.0, False)], ids=["elsewhere", "there"])
def test_a_moment_of_contact_is_read_where_there_is_one(where, value, same, monkeypatch):
    """Nonsense in the moments of particles that touch nothing changes no digit of forces and energies; those that there
    are count."""
    sim = Simulation(replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=3e-3)), Runtime(threads=1))
    plain, advance, touched = sim.run(), sim.advance, []

    def spoil(order):
        out = advance(order)
        lever, has = sim.state.contact_moment.to_numpy(), sim.state.visibility.to_numpy() > ALL_VISIBLE
        lever[has == where] = value
        sim.state.contact_moment.from_numpy(lever)
        touched.append(has[0, : sim.state.n[0]].mean())
        return out

    monkeypatch.setattr(sim, "advance", spoil)
    spoilt = sim.run()
    assert len(touched) > 3 and 0 < min(touched) and max(touched) < 0.9
    assert (np.array_equal(spoilt.face, plain.face) and np.array_equal(spoilt.kinetic, plain.kinetic)) is same


@ti.kernel
def most_friction(k: ti.template()) -> ti.f64:
    """Largest friction of the cut face under an endless pressure [N]."""
    total = ti.cast(0.0, ti.f64)
    for p in range(k.size[0, kn.COUNT]):
        if k.surface_volume[0, p][1] > 0:
            stiffness = k.par[0, kn.CONTACT] * k.par[0, kn.MASS] * k.volume_ratio[0, p]
            total += stiffness * friction_limit(k, 0, p, 1e9, 1e9)
    return total


def test_a_face_bears_its_yield_stress_in_shear_times_its_area():
    """The largest friction of all particles of the cut face, a quarter of them simulated, is that of the face."""
    sim = Simulation(PRISM, Runtime(threads=1))
    sim.load(replace(FLESH, mu=0.3))
    half_face = 0.012 * 0.024
    assert most_friction(sim.state) == pytest.approx(FLESH.yield_stress / np.sqrt(3) * half_face, rel=0.02)


def test_contact_is_as_stiff_at_any_time_step_and_loss_factor():
    """The contact's stiffness over mass belongs to layer and food, so half the step and a larger loss leave it."""
    found = []
    for safety, loss in ((0.7, 0.02), (0.35, 0.02), (0.7, 0.2)):
        scene = replace(PRISM, numerics=replace(PRISM.numerics, safety=safety)).with_material(loss_factor=loss)
        setup = Simulation(scene, Runtime(threads=1)).setup
        food = scene.food.material
        found.append(setup.contents(food).parameters[kn.CONTACT])
        assert found[-1] * setup.time_step(food) ** 2 <= 2.0
    assert found == [found[0]] * 3
    assert found[0] == pytest.approx(2 * (FLESH.p_wave / 1.5e-3) ** 2)


def test_the_copies_of_a_sum_are_added_up_and_begin_anew(monkeypatch):
    """A row of the report has what all copies of the losses hold, and the momentum of all particles, more than there
    are copies; the next row has the momentum again and no losses.
    """
    monkeypatch.setattr(Setup, "threads", lambda self: 0)
    simulation, rng = Simulation(PRISM, Runtime(threads=2)), np.random.default_rng(0)
    simulation.load(PRISM.food.material)
    state = simulation.state
    booked, velocities = rng.uniform(1, 2, state.losses.shape), rng.uniform(1, 2, (state.n[0], 3))
    assert 1 < state.copies < state.n[0]
    state.losses.from_numpy(booked)
    fill(state, state.v, velocities)
    momentum = state.par.to_numpy()[0, kn.MASS] * (state.volume_ratio.to_numpy()[0, : state.n[0]] @ velocities)
    for losses in (booked[0].sum(axis=0), np.zeros(kn.N_LOSSES)):
        out = np.zeros((1, 1, kn.N_REPORT))
        report_row(state, out)
        row = kn.parts_of_report(out[0, 0])
        np.testing.assert_allclose(row.sums[kn.PLASTIC : kn.PLASTIC + kn.N_LOSSES], losses, rtol=1e-12)
        np.testing.assert_allclose(row.particles[kn.MOMENTUM : kn.KINETIC], momentum, rtol=1e-12)
