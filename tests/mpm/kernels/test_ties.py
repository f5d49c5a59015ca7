"""Ties across the cut plane: their law, and that R is all the work of new surface whoever pays it."""

from dataclasses import replace

import numpy as np
import pytest
import taichi as ti

from mpm.batch import simulate_together
from mpm.kernels.signed_distance import passed_part
from mpm.kernels.ties import passing_weight, pull_tie, softened_tension, work_spent
from mpm.output.record import ENERGIES, ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import COHESIVE_ZONE, Material
from mpm.scene.shapes import Shape
from mpm.setup.setup import Setup
from mpm.solver import Simulation
from mpm.state import host_transfer
from mpm.state.host_transfer import fill
from mpm.state.tables import CONTACT, TIE_WORK
from tests.mpm.scenes import FLESH, PRISM, WEDGE, cut
from tests.mpm.test_cut import with_images

TUBER = Material(E=9.5e6, nu=0.3, rho=1000, R=87.0, loss_factor=0.02)
FLOWS = replace(TUBER, yield_stress=0.14e6, mu=0.17)
EDC = Knife("edc", 2e-3, np.deg2rad(11.0), 0.0104, 0.2)
KITCHEN = Knife("kitchen", 2e-3, np.deg2rad(2.5), 0.045, 0.2)
SPLIT = Scene(
    Food(Shape("block", 0.036, 0.012, 0.048), TUBER),
    EDC,
    Motion(0.048, 0.01),
    Board(0.0),
    EdgeLaw(zone=4e-3),
    Numerics(dx=3e-3, gravity=0.0),
)
SHORT = replace(SPLIT, food=replace(SPLIT.food, shape=Shape("block", 0.024, 0.012, 0.012)), motion=Motion(0.006, 0.02))


@pytest.fixture(scope="module")
def law():
    """The functions of the law at one argument each: tension, work, weight, part that is cut."""
    Simulation(PRISM, Runtime(threads=1))
    out = ti.field(ti.f64, 4)

    @ti.kernel
    def run(a: float):
        out[0], out[1], out[2], out[3] = softened_tension(a, 2.0), work_spent(a, 2.0), passing_weight(a), passed_part(a)

    def values(a: float) -> np.ndarray:
        run(a)
        return out.to_numpy()

    return values


def test_the_work_of_a_tie_is_the_area_under_its_tension(law):
    """Twice the integral of the tension over the half opening, over strength times its end, and whole at the end."""
    at = np.linspace(0.0, 3.0, 601)
    tension, work = np.array([law(a)[:2] for a in at]).T
    assert tension[0] == 1.0 and (tension[at >= 2.0] == 0.0).all()
    area = np.concatenate([[0.0], np.cumsum((tension[1:] + tension[:-1]) / 2 * np.diff(at))])
    np.testing.assert_allclose(work, 2 * area / 2.0, atol=1e-9)


def test_the_edge_pays_for_a_tie_what_it_cuts_of_it(law):
    """The part that is cut grows by the weight with which the edge pays, from nothing to all of it."""
    at = np.linspace(-1.5, 1.5, 601)
    weight, gone = np.array([law(a)[2:] for a in at]).T
    grown = np.concatenate([[0.0], np.cumsum((weight[1:] + weight[:-1]) / 2 * np.diff(at))])
    np.testing.assert_allclose(gone, grown, atol=1e-5)
    assert gone[0] == 0.0 and gone[-1] == 1.0


@pytest.mark.parametrize("mirror", [True, False])
def test_ties_join_particles_that_face_each_other(mirror):
    """Each particle beside the plane has one tie; in a whole food its two are mirror images of each other."""
    setup = Simulation(replace(PRISM, numerics=replace(PRISM.numerics, mirror=mirror)), Runtime(threads=1)).setup
    ties, x = setup.ties(), setup.seeds.x
    beside = np.flatnonzero(setup.seeds.beside)
    if mirror:
        assert (np.sort(ties[:, 0]) == beside).all() and (ties[:, 1] == -1).all()
    else:
        assert (np.sort(ties.ravel()) == beside).all()
        np.testing.assert_allclose(x[ties[:, 0]] * [1, -1, 1], x[ties[:, 1]], atol=1e-15)


def test_nodal_contact_has_no_ties():
    """No field and no energy of a cut by plain projection knows of ties: there the food parts as the nodes do."""
    nodal = replace(PRISM, numerics=replace(PRISM.numerics, contact="nodal"), motion=Motion(0.002, 0.02))
    simulation = Simulation(nodal, Runtime(threads=1))
    assert not nodal.tied and not hasattr(simulation.state, "tie_ends") and len(simulation.setup.ties()) == 0
    record = simulation.run()
    assert record.cohesion is None and record.energies == ENERGIES and "cohesion_J" not in record.columns()
    assert record.surface is record.parting


def test_a_food_without_resistance_parts_for_nothing():
    """With R = 0 nothing holds the halves together, and neither edge nor ties take energy."""
    record = cut(replace(SHORT, food=replace(SHORT.food, material=replace(FLOWS, R=0.0))))
    assert record.surface[-1] == pytest.approx(0.0, abs=1e-6 * record.work)


def test_impossible_cracks_are_refused():
    """In one line: a food without strength."""
    with pytest.raises(SceneError, match="tensile_strength"):
        replace(TUBER, tensile_strength=0.0)


def test_ties_are_no_stronger_than_the_grid_resolves():
    """A food whose crack is sharper than its ties is weakened until its process zone spans three of them; R stays."""
    strong = SPLIT.with_material(tensile_strength=3e6)
    food = strong.food.material
    assert strong.weakened and not SPLIT.weakened and TUBER.tie_strength(1.5e-3, 3.0) == TUBER.cohesion
    assert food.E * food.R / food.tie_strength(1.5e-3, 3.0) ** 2 == pytest.approx(4.5e-3)
    assert food.tie_opening(1.5e-3, 3.0) * food.tie_strength(1.5e-3, 3.0) == pytest.approx(food.R)


def test_the_strength_of_a_food_that_has_none_is_derived():
    """Eight tenths of the yield stress, or what makes a process zone of ten millimetres if that is less."""
    assert FLOWS.cohesion == pytest.approx(0.8 * FLOWS.yield_stress)
    assert TUBER.E * TUBER.R / TUBER.cohesion**2 == pytest.approx(COHESIVE_ZONE)
    assert replace(TUBER, tensile_strength=1.5e5).cohesion == 1.5e5


def surface(record: ForceRecord) -> float:
    """Energy of new surface over the area that the edge has passed [J/m^2]."""
    return float(record.surface[-1]) / record.severed_area


def test_energies_of_a_split_are_booked():
    """What the opening takes is an energy of the record, and with it the books close as before."""
    record = cut(replace(SPLIT, motion=Motion(0.015, 0.02)))
    assert record.cohesion is not None and record.cohesion[-1] > 0.2 * record.parting[-1]
    assert (np.diff(record.cohesion) >= 0).all()
    assert sum(record.budget.values()) == pytest.approx(record.work + record.weighing[-1], rel=1e-12)
    assert list(record.budget) == [*ENERGIES[:-1], "cohesion", "unbooked"]
    assert record.columns()["cohesion_J"] is record.cohesion
    assert record.fracture is not None and record.fracture["opening_J_m2"] == record.cohesion[-1] / record.severed_area
    assert abs(record.unbooked[-1]) < 0.1 * record.work


@pytest.mark.parametrize("flows", [False, True], ids=["elastic", "flows"])
@pytest.mark.slow
def test_new_surface_costs_the_same_under_a_thick_and_a_thin_blade(flows):
    """R to 3 %, although the thick blade opens most of it ahead of its edge and the thin one hardly any."""
    scene = replace(SPLIT, food=replace(SPLIT.food, material=FLOWS if flows else TUBER))
    thick = cut(scene)
    thin = cut(replace(scene, knife=KITCHEN))
    assert surface(thick) == pytest.approx(TUBER.R, rel=0.03)
    assert surface(thin) == pytest.approx(TUBER.R, rel=0.03)
    assert thick.cohesion is not None and thick.cohesion[-1] > (0.45 if flows else 0.6) * thick.surface[-1]
    assert thin.cohesion is not None and thin.cohesion[-1] < 0.2 * thin.surface[-1]
    assert abs(thin.unbooked[-1]) < 0.01 * thin.work


def test_the_edge_cuts_what_it_passes_and_not_what_lies_below():
    """Work of a stiff food that rubs against finite elements whose edge has no band: half a cell of lead takes 14 %.

    Theirs is that of ``fem_reference.cutting.wedge`` on elements of 1 mm, from 2 to 10 mm deep (``cutcal verify --only
    "cut by finite elements"`` computes it).
    """
    food = replace(TUBER, mu=0.17, tensile_strength=0.3e6, initiation_depth=0.2e-3)
    block = Food(Shape("block", 0.03, 0.012, 0.03), food)
    record = cut(replace(SPLIT, food=block, knife=replace(EDC, height=0.06), motion=Motion(0.0105, 5e-3)))
    done = np.interp([2e-3, 10e-3], np.append(0.0, record.stroke), np.append(0.0, record.work_done))
    assert (done[1] - done[0]) / 0.012 == pytest.approx(3.4136, rel=0.03)


def test_a_thin_blade_does_not_rub_on_what_lies_behind_its_edge():
    """Twice the band of the edge, which the blade opens and rubs on, moves the work of a strong food by 0.4 %.

    The wedge presses on a tie with its work over tan(angle / 2), so it rubs for 12 times that work here. Over half a
    cell, as the band was once, doubling it moved the work by 7 %.
    """
    strong = Material(E=9.35e6, nu=0.3, rho=1000, R=303.0, tensile_strength=0.61e6, mu=0.24, loss_factor=0.02)
    food = replace(SPLIT.food, shape=Shape("block", 0.018, 0.012, 0.018), material=strong)
    thin = replace(SPLIT, food=food, knife=replace(EDC, angle=np.deg2rad(2.3)), motion=Motion(0.012, 0.02))
    wider = replace(thin, numerics=replace(thin.numerics, edge_band=2 * thin.numerics.edge_band))
    assert cut(wider).work == pytest.approx(cut(thin).work, rel=0.01)


def test_the_edge_cuts_a_row_of_ties_point_by_point():
    """Where the edge stands in a row, the points of the ties above it are cut and those below are whole."""
    simulation = Simulation(SHORT, Runtime(threads=1))
    simulation.run()
    gone = simulation.state.cut_part.to_numpy()[0, : len(simulation.setup.ties())]
    assert ((gone[:, -1] == 1.0) & (gone[:, 0] == 0.0)).any()
    assert (np.diff(gone, axis=1) >= 0.0).all()


@ti.kernel
def pull_one(s: ti.template(), n: int, dt: float):
    """One tie alone."""
    for _ in range(1):
        pull_tie(s, 0, n, dt)


def test_a_tie_turns_a_face_that_leans():
    """A face that leans over by a little about its middle is pulled at its upper half and pressed at its lower one.

    Nothing moves it as a whole. The moment is that of springs at the four points: their places along the face, squared,
    have the mean 0.078125.
    """
    sim = Simulation(SHORT, Runtime(threads=1))
    sim.load(TUBER)
    sim.set_pose(1.0)
    s, lean, dt = sim.state, 1e-5, 1e-6
    p, h = sim.setup.ties()[0, 0], sim.setup.seeds.spacing
    fill(s, s.face_rise, np.tile([0.0, lean, 1.0], (s.n[0], 1)))
    fill(s, s.v, np.zeros((s.n[0], 3)))
    sim.state.visibility.fill(0)
    pull_one(s, 0, dt)
    lift, wide = s.contact_moment.to_numpy()[0, p]
    pull = s.par.to_numpy()[0, CONTACT] * dt * lean * h * 0.078125
    assert np.abs(s.v.to_numpy()[0, p]).max() < 1e-9 * abs(pull)
    np.testing.assert_allclose(lift, [0.0, -4 * h * pull / SHORT.numerics.dx**2, 0.0, 0.0], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(wide[1], lean * lift[1], rtol=1e-6)


def test_rows_that_pass_a_thick_shoulder_give_back_what_pressed_them():
    """Elastic halves on a smooth wedge of 30 degrees: the work goes into new surface and bending, and no more.

    With a distance from the centres of particles, which is no potential, 15 to 19 % were lost on cells of 3 mm.
    """
    food, numerics = replace(SPLIT.food, shape=Shape("block", 0.03, 0.008, 0.024)), replace(SPLIT.numerics, dx=2e-3)
    wide = replace(SPLIT, food=food, motion=Motion(0.012, 2e-3), numerics=numerics)
    record = cut(replace(wide, knife=replace(EDC, angle=np.deg2rad(30.0))))
    assert record.unbooked[-1] == pytest.approx(0.0, abs=0.045 * record.work)


@pytest.mark.slow
@pytest.mark.parametrize("shift", [(0.0, 0.5, 0.0), (0.3, 0.25, 0.5)], ids=str)
def test_a_split_does_not_see_where_its_plane_lies_in_the_grid(shift):
    """Half a cell aside peak and work are the same to 2 % in a stiff food, of which the blade opens most."""
    shape = replace(SPLIT.food.shape, length=0.03, height=0.024)
    scene = replace(SPLIT, food=replace(SPLIT.food, shape=shape), motion=Motion(0.018, 0.01))
    base, moved = cut(scene), cut(replace(scene, numerics=replace(scene.numerics, grid_shift=shift)))
    assert moved.peak == pytest.approx(base.peak, rel=0.02)
    assert moved.work == pytest.approx(base.work, rel=0.02)


def test_ties_of_a_whole_food_pull_as_those_of_its_quarter():
    """A split, where the ties carry the load, needs the force of its quarter to rounding when its particles are the
    quarter's images."""
    scene = replace(SHORT, numerics=replace(SHORT.numerics, grid_shift=(0.5, 0.0, 0.0)))
    part = Simulation(scene, Runtime(threads=1))
    whole = Simulation(replace(scene, numerics=replace(scene.numerics, mirror=False)), Runtime(threads=1))
    whole.setup.seeds = with_images(part.setup.seeds)
    a, b = part.run(), whole.run()
    assert a.cohesion is not None and a.cohesion[-1] > 0
    np.testing.assert_allclose(a.knife[:, 2], b.knife[:, 2], atol=1e-8 * b.peak)
    np.testing.assert_allclose(a.cohesion, b.cohesion, atol=1e-8 * a.cohesion[-1])


@pytest.mark.slow
def test_a_food_that_is_not_cut_hangs_together():
    """Pulled apart at less than its strength a block stays whole and takes no energy; beyond it the plane parts and
    takes R."""
    soft = replace(FLESH, E=1e5, R=20.0, R_initiation=20.0, yield_stress=np.inf, tensile_strength=5e3, loss_factor=0.1)
    numerics = replace(PRISM.numerics, mirror=False, gravity=0.0, room=1.5)
    scene = replace(PRISM, numerics=numerics, board=Board(0.0), knife=WEDGE, food=replace(PRISM.food, material=soft))
    sim = Simulation(scene, Runtime(threads=1))
    dt, area = sim.setup.time_step(soft), 0.024 * 0.024
    taken = []
    for speed in (0.01, 3.0):
        sim.load(soft)
        sim.set_pose(1.0)
        sim.state.board_gap.fill(-1.0)
        v = np.zeros_like(sim.setup.seeds.x)
        v[:, 1] = np.where(sim.setup.seeds.x[:, 1] > 0, speed, -speed)
        fill(sim.state, sim.state.v, v)
        taken.append(float(sim.advance((1500, 20, dt, 0.0, 0.0, 0.0))[:, TIE_WORK].sum()) / area)
    assert taken[0] == 0.0
    assert taken[1] == pytest.approx(20.0, rel=0.02)


@pytest.mark.long
def test_other_ways_to_compute_a_split_give_the_same(monkeypatch):
    """A food cut beside another, in single precision, turned in the grid and by two threads."""
    flesh = replace(SHORT.food, material=FLOWS)
    scene = replace(SHORT, food=flesh)
    alone = cut(scene)
    one, two = simulate_together([scene, scene.with_material(R=60.0)], runtime=Runtime(threads=2))
    np.testing.assert_array_equal(one.knife, alone.knife)
    assert one.cohesion is not None and alone.cohesion is not None and two.surface[-1] < one.surface[-1]
    np.testing.assert_array_equal(one.cohesion, alone.cohesion)
    single = Simulation(replace(scene, numerics=replace(scene.numerics, precision="f32")), Runtime(threads=1)).run()
    assert single.work == pytest.approx(alone.work, rel=1e-3)
    assert single.surface[-1] == pytest.approx(alone.surface[-1], rel=1e-3)
    turned = cut(replace(scene, numerics=replace(scene.numerics, grid_turn=0.3)))
    assert turned.work == pytest.approx(alone.work, rel=0.03)
    monkeypatch.setattr(Setup, "threads", lambda self: 2)
    shared = Simulation(scene, Runtime(threads=2)).run()
    np.testing.assert_allclose(shared.knife[:, 2], alone.knife[:, 2], atol=1e-6 * alone.peak)
    np.testing.assert_allclose(shared.cohesion, alone.cohesion, atol=1e-6 * alone.cohesion[-1])


def test_a_large_loss_factor_makes_no_energy():
    """Ties answer the elastic stress of the food alone; the viscous one made 26 times the work of this cut."""
    lossy = replace(FLESH, loss_factor=0.3)
    ball = replace(PRISM, food=Food(Shape("sphere", 0.02, 0.02, 0.02), lossy), motion=Motion(2e-3, 0.01))
    record = cut(replace(ball, edge=EdgeLaw(zone=2e-3), numerics=Numerics(dx=1.5e-3)))
    assert record.viscous[-1] < 0.1 * record.work
    assert abs(record.lost) < 0.1


DENTED = Material(
    E=1e6, nu=0.36, rho=1000, yield_stress=3e5, R=100.0, R_initiation=600.0, tensile_strength=2e5,
    initiation_depth=8e-3, mu=0.1,
)  # fmt: skip
"""A food that gives way under the edge by 8 mm before its cut starts."""


def dent(food: Material, motion: Motion) -> Scene:
    """A block of it under a wedge."""
    knife = Knife("wedge", 3e-3, 0.2, 0.05, 0.1)
    block = Food(Shape("block", 0.03, 0.012, 0.02), food)
    return Scene(block, knife, motion, Board(0.5), EdgeLaw(zone=4e-3), Numerics(dx=3e-3, room=1.0))


def test_no_tie_holds_through_the_blade_before_the_cut_starts():
    """A wedge in a food that it only dents has the food on its faces, as one in a cut has."""
    of = dent(DENTED, Motion(8e-3, 0.02))
    simulation = Simulation(of, Runtime(threads=1))
    record = simulation.run()
    faces, state = simulation.setup.ties()[:, 0], simulation.state
    x = simulation.setup.to_scene_axes(host_transfer.particles(state, simulation.place).x)[faces]
    above = x[:, 2] - (of.food.shape.height - record.stroke[-1])
    half = np.minimum(above * np.tan(of.knife.angle / 2), of.knife.spine / 2)
    opened = (np.abs(x[:, 1]) - state.tool_gap.to_numpy().ravel()[faces]) / half
    assert not state.cut_part.to_numpy().any() and (above > 1.5e-3).sum() > 10
    np.testing.assert_allclose(opened[above > 1.5e-3], 1.0, atol=0.05)


@pytest.mark.parametrize(
    "food",
    [DENTED, replace(DENTED, yield_stress=np.inf, mu=0.0), replace(DENTED, yield_stress=3e4)],
    ids=["yields", "elastic", "under a zone that widens"],
)
def test_a_dent_and_its_withdrawal_make_no_energy(food):
    """Ties that let go of the blade and hold again as it is withdrawn take energy at most, and so does a process zone
    that widens with the edge's force and narrows again: nothing is cut by then."""
    simulation = Simulation(dent(food, Motion(6e-3, 0.02, retract=7e-3)), Runtime(threads=1))
    record = simulation.run()
    work = record.work_done.max()
    assert record.status == "done" and not simulation.state.cut_part.to_numpy().any()
    assert record.unbooked.min() > -1e-3 * work and record.unbooked.max() < 0.05 * work
    assert record.momentum_residual < 1e-10
