"""Blade motion: slicing, tilt, retraction, arm, rate, adhesion, and what is left of the food."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.output.record import ForceRecord
from mpm.run import CutRun
from mpm.runtime import Runtime
from mpm.scene import Arm, Board, Food, Motion
from mpm.scene.errors import SceneError
from mpm.scene.shapes import Shape
from mpm.setup.setup import Setup
from mpm.solver import Simulation
from tests.mpm import scenes
from tests.mpm.scenes import WEDGE, cut

FLESH = replace(scenes.FLESH, loss_factor=0.1)
PRISM = replace(scenes.PRISM, food=replace(scenes.PRISM.food, material=FLESH))
# rough board, wide and low: or the food slides along with the blade, or tips over
HELD = replace(PRISM, food=Food(Shape("block", 0.03, 0.072, 0.024), FLESH), board=Board(mu=9.0))
HELD = replace(HELD, numerics=replace(HELD.numerics, damper_mass=0.4))
R_W = 300 * 0.072


def between(record: ForceRecord, values: np.ndarray, low: float = 8e-3, high: float = 15e-3) -> float:
    """Mean of a column over a part of the stroke on the way down."""
    n = int(record.stroke.argmax()) + 1
    inside = (record.stroke[:n] > low) & (record.stroke[:n] < high)
    return float(values[:n][inside].mean())


@pytest.fixture(scope="module")
def sliding() -> Simulation:
    """A prism held on a rough board, whose blade may also move along its edge; the ratio is changed run by run."""
    return Simulation(replace(HELD, motion=replace(PRISM.motion, slice_ratio=1.0)), Runtime(threads=1))


@pytest.mark.slow
@pytest.mark.parametrize("xi", [0.0, 0.5, 1.0, 2.0])
def test_slicing_lowers_the_push_as_atkins_says(sliding, xi):
    """Frictionless: V/(R w) = 1/(1 + xi^2) and H/(R w) = xi/(1 + xi^2) (Atkins, Xu and Jeronimidis 2004), within 3 %.

    With dampers: the food swings sideways when a blade at twice its speed sets off along it.
    """
    motion = replace(PRISM.motion, slice_ratio=max(xi, 1e-9))  # a ratio of 0 would be mirrored
    sliding.setup.scene = replace(HELD, motion=motion)
    record = sliding.run()
    push, pull = (between(record, record.edge[:, axis], 11e-3, 16e-3) for axis in (2, 0))
    assert push == pytest.approx(R_W / (1 + xi**2), rel=0.03)
    assert -pull == pytest.approx(R_W * xi / (1 + xi**2), abs=0.03 * R_W)
    assert record.momentum_residual < 1e-10


@pytest.mark.slow
def test_tilted_edge_needs_the_same_work_per_area():
    """A thin edge tilted by 20 degrees and pressed straight down cuts R w per way once all of it is in the food."""
    motion = Motion(0.017, 0.01, tilt=np.deg2rad(20.0))
    record = cut(replace(PRISM, motion=motion))
    assert between(record, record.knife[:, 2], 10e-3, 16e-3) == pytest.approx(7.2, rel=0.05)
    assert record.pieces is not None and not record.severed


@pytest.mark.slow
@pytest.mark.parametrize("turn", [pytest.param(15.0, marks=pytest.mark.long), 45.0])
def test_grid_may_lie_at_any_angle(turn):
    """Food and blade turned against the grid: peak and work as on it, within 2 %; momentum balances, with dampers."""
    damped = replace(PRISM, numerics=replace(PRISM.numerics, damper_mass=0.4))
    straight = cut(damped)
    turned = cut(replace(damped, numerics=replace(damped.numerics, grid_turn=np.deg2rad(turn))))
    assert max(straight.momentum_residual, turned.momentum_residual) < 1e-10
    assert np.abs(np.diff(turned.dampers, axis=0)).max() > 0
    assert turned.peak == pytest.approx(straight.peak, rel=0.02)
    assert turned.work == pytest.approx(straight.work, rel=0.02)


@pytest.mark.slow
def test_retracting_blade_is_dragged_by_friction_and_leaves_the_slit_open():
    """On the way up friction drags the faces down, nothing is cut, and the uncut area stays what it was.

    The edge gives back its elastic slip within 2 mm. The halves spring back on the blade and hold it, with so much
    friction more firmly than the food is heavy: it is made as heavy as ten, or it would be lifted.
    """
    flesh, heavy = replace(FLESH, mu=0.4), replace(PRISM.numerics, gravity=98.1)
    food = replace(PRISM.food, material=flesh)
    scene = replace(PRISM, food=food, knife=WEDGE, motion=Motion(0.015, 0.01), numerics=heavy)
    down = cut(scene)
    both = cut(replace(scene, motion=replace(scene.motion, retract=0.03)))
    n = len(down.stroke)
    np.testing.assert_allclose(both.knife[:n, 2], down.knife[:n, 2], rtol=1e-9, atol=1e-9)
    assert both.stroke[-1] == pytest.approx(-0.015, abs=1e-3)
    drag, late = both.face[n + 2 :, 2], both.knife[n + 8 :, 2]
    assert drag.min() < -0.05 * both.peak and drag.max() < 0.01 * both.peak
    assert np.abs(late[-8:]).max() < 0.02 * both.peak
    assert both.edge[n + 8 :, 2].max() < 0.01 * both.peak
    assert both.pieces.uncut_area == pytest.approx(down.pieces.uncut_area, rel=0.1)


def test_cut_leaves_two_pieces_of_the_whole_volume():
    """A stroke to the board leaves two halves whose volumes add up to the food's within 1 %."""
    record = cut(replace(PRISM, knife=WEDGE, motion=Motion(0.024, 0.01)))
    assert record.severed and len(record.pieces.volumes) == 2
    assert sum(record.pieces.volumes) == pytest.approx(0.03 * 0.024 * 0.024, rel=0.01)
    assert record.pieces.volumes[0] == pytest.approx(record.pieces.volumes[1], rel=0.02)
    assert record.severed_area == pytest.approx(0.024 * 0.024, rel=0.01)


def test_arm_that_is_too_weak_does_not_sever_and_says_so():
    """With the arm's force limited to half the peak the blade stops in the food; with enough force it goes through."""
    rigid = cut(replace(PRISM, motion=Motion(0.024, 0.01)))
    arm = Arm(stiffness=3000.0, force_limit=0.5 * rigid.peak)
    weak = cut(replace(PRISM, motion=Motion(0.024, 0.01), arm=arm))
    assert not weak.severed
    assert weak.stroke.max() < 0.5 * weak.command.max()
    stalled = weak.knife[len(weak.stroke) // 2 :, 2]  # it rattles on the food, about the limit
    assert stalled.mean() == pytest.approx(arm.force_limit, rel=0.1)
    assert "not severed" in weak.summary()["cut"] and "mm^2" in weak.summary()["cut"]
    strong = cut(replace(PRISM, motion=Motion(0.024 + rigid.peak / 3000, 0.01), arm=Arm(3000.0, 2 * rigid.peak)))
    assert strong.severed
    middle = (strong.stroke > 8e-3) & (strong.stroke < 15e-3)
    lag = (strong.command - strong.stroke)[middle].mean()
    assert lag == pytest.approx(7.2 / 3000, rel=0.05)


def test_an_edge_that_is_commanded_into_the_board_stops_on_it():
    """Two centimetres below: the run ends there. Without the board the blade took the halves along, and went on as they
    flew off the grid."""
    over = cut(replace(PRISM, motion=Motion(0.044, 0.01), arm=Arm(3000.0)))
    assert over.severed and over.pieces is not None and len(over.pieces.volumes) == 2
    assert over.fraction == 1.0 and 0.024 < over.command.max() < 0.03
    assert over.stroke.max() == pytest.approx(0.024, abs=1e-9)


@pytest.mark.slow
def test_prony_series_needs_the_real_speed_and_softens_a_slow_cut():
    """Without a real speed the scene is refused; a cut slow against the relaxation time opens at the relaxed modulus,
    a fast one at the instantaneous one."""
    relaxing = replace(FLESH, prony=((0.6, 1.0),))
    with pytest.raises(SceneError, match=r"motion\.speed"):
        replace(PRISM, food=replace(PRISM.food, material=relaxing))
    elastic = replace(FLESH, yield_stress=np.inf)
    work = {}
    for name, prony, speed in (
        ("fast", ((0.6, 1.0),), 100.0 * 0.99),
        ("slow", ((0.6, 1.0),), 1e-5),
        ("none", (), 0.02),
    ):
        food = replace(PRISM.food, material=replace(elastic, prony=prony))
        record = cut(replace(PRISM, food=food, knife=WEDGE, motion=Motion(0.015, 0.01, speed=speed)))
        work[name] = float(record.face[:, 2] @ np.diff(record.stroke, prepend=0.0))
    assert work["fast"] == pytest.approx(work["none"], rel=0.02)
    assert work["slow"] < 0.85 * work["fast"]  # what opens ahead of the edge is a part of R and does not relax


def test_a_stiffer_candidate_relaxes_in_the_same_real_time():
    """A blade that is faster in a stiffer food shortens its relaxation times as much: what a step relaxes is the same
    in a scene of its own and as another candidate of one; share and time by name are a branch like any other."""
    soft = replace(FLESH, relaxing_share=0.6, relaxation_time=0.5)
    scene = replace(PRISM, food=replace(PRISM.food, material=soft), motion=Motion(0.015, 0.01, speed=0.02))
    stiff = replace(soft, E=9 * soft.E)
    setup = Setup(scene, Runtime(threads=1))
    own = Setup(scene.with_material(E=stiff.E), Runtime(threads=1))
    np.testing.assert_allclose(setup.contents(stiff).relaxation, own.contents(stiff).relaxation, rtol=1e-12)
    share, part = setup.contents(soft).relaxation
    assert share == [0.6] and 0.0 < part[0] < 0.01
    plain = scene.with_material(relaxing_share=0.0, prony=((0.6, 0.5),))
    named = scene.with_material(relaxing_share=0.0)
    np.testing.assert_array_equal(
        Setup(plain, Runtime(threads=1)).contents(plain.food.material).relaxation, [[0.6], part]
    )
    assert not named.food.material.rate_dependent and "relaxing_share" not in named.as_dict()["food"]["material"]


@pytest.mark.slow
def test_dwell_relaxes_the_force_and_needs_a_speed():
    """Holding the blade still lets a viscoelastic food relax; a pause without a real speed is refused."""
    with pytest.raises(SceneError, match="real speed"):
        Motion(0.015, dwell=1.0)
    food = replace(PRISM.food, material=replace(FLESH, yield_stress=np.inf, prony=((0.6, 0.1),)))
    record = cut(replace(PRISM, food=food, knife=WEDGE, motion=Motion(0.015, 0.01, speed=0.05, dwell=0.4)))
    end = int(np.argmax(record.stroke >= record.stroke.max() - 1e-9))
    assert record.face[-3:, 2].mean() < 0.9 * record.face[end - 2 : end + 1, 2].mean()


def test_a_blade_may_slow_down_towards_the_board():
    """Below three fifths of the height its speed falls to half; it arrives where it was told to, and returns fast."""
    steady = replace(PRISM, motion=Motion(0.02, 0.02, retract=4e-3))
    eased = replace(steady, motion=replace(steady.motion, end_speed=0.5))
    setup = Setup(eased, Runtime(threads=1))
    even, slowed = (np.array(CutRun(setup, scene)._phases) for scene in (steady, eased))
    dt, speed = CutRun(setup, eased).dt, -even[0, 1]
    way, pace = -slowed[:-2, 0] * dt * slowed[:-2, 1], slowed[:-2, 1] / even[0, 1]
    assert way.sum() == pytest.approx(even[0, 0] * dt * speed, abs=3 * speed * dt)
    high = 1 - (np.cumsum(way) - way / 2 - setup.gap) / PRISM.food.shape.height
    assert pace[0] == 1 and pace[-1] == pytest.approx(0.5, rel=0.05) and (np.diff(pace) < 1e-9).all()
    assert pace[1:] == pytest.approx(np.clip(high[1:] / 0.6, 0.5, 1.0), rel=0.13)  # whole rows of the report
    assert (slowed[-1] == even[-1]).all()


def test_ripple_of_a_cell_is_taken_out_of_a_slowing_blade_too():
    """The mean is over a cell of the way and not of the time, also where the blade has slowed down or stands."""
    record = cut(replace(PRISM, motion=Motion(1e-3, 0.02)))
    told = np.concatenate([np.arange(1, 161) / 160 * 0.01, 0.01 + np.arange(1, 321) / 320 * 0.01])
    time = np.arange(1, 481) / 160 * 0.01 / record.speed
    face = np.zeros((480, 3))
    face[:, 2] = 5 + np.sin(2 * np.pi * told / record.cell)
    slowed = replace(record, command=told, stroke=told, time=time, face=face, slowed=True)
    inner = (told > record.cell) & (told < 0.02 - record.cell)
    np.testing.assert_allclose(slowed.resolved_face[inner], 5, atol=0.03)
    assert np.abs(replace(slowed, slowed=False).resolved_face[inner] - 5).max() > 0.5


def test_a_rate_dependent_food_is_not_cut_more_slowly():
    """Its stress follows the time that passes, so that the blade keeps its speed."""
    motion = Motion(0.01, 0.02, speed=0.02, end_speed=0.5)
    slow = replace(PRISM, motion=motion).with_material(prony=((0.5, 0.1),))
    assert not slow.slows_down and replace(PRISM, motion=motion).slows_down
    assert "end_speed" not in replace(PRISM, motion=Motion(0.01)).as_dict()["motion"]


def test_sticky_faces_hold_the_knife_back():
    """Adhesion holds a retracting blade more firmly than dry faces do, by less than strength x faces."""
    pull = {}
    for name, extra in (("dry", {}), ("sticky", {"adhesion": 5e3, "adhesion_energy": 0.5})):
        food = replace(PRISM.food, material=replace(FLESH, mu=0.4, **extra))
        heavy = replace(PRISM.numerics, gravity=98.1)  # or the halves that hold the blade would be lifted
        motion = Motion(0.015, 0.01, retract=0.006)
        record = cut(replace(PRISM, food=food, knife=WEDGE, motion=motion, numerics=heavy))
        up = record.stroke.argmax()
        rising = (record.stroke[up:] < 13.5e-3) & (record.stroke[up:] > 9.5e-3)
        pull[name] = -record.knife[up:][rising, 2].mean()
    assert pull["dry"] > 0.0  # the halves spring back on the blade and rub on it
    assert pull["sticky"] > pull["dry"] + 0.1
    assert pull["sticky"] - pull["dry"] < 5e3 * 2 * 0.015 * 0.024


def test_half_adhesion_is_refused():
    """Adhesion without its energy is a typo, not a choice."""
    with pytest.raises(SceneError, match="adhesion"):
        replace(FLESH, adhesion=1e4)


def test_blunt_edge_needs_more_force():
    """A tip of 0.8 mm radius needs more force than a sharp one of the same blade."""
    sharp = cut(replace(PRISM, knife=WEDGE))
    blunt = cut(replace(PRISM, knife=replace(WEDGE, radius=0.8e-3)))
    assert blunt.work > 1.1 * sharp.work
