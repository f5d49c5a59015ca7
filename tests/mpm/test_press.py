"""A plate or wedge that presses: its force balances, mirrors and grid change nothing, and it cuts nothing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation

SOFT = Material(E=1e5, nu=0.35, rho=1000.0, loss_factor=0.1)
SCENE = Scene(
    Food(Shape("block", 0.02, 0.016, 0.016), SOFT),
    Press("plate", mu=0.4),
    Motion(2e-3, 5e-3),
    Board(0.4),
    numerics=Numerics(dx=2e-3, gravity=9.81),
)


def pressed(scene: Scene) -> ForceRecord:
    """Run to a sound end."""
    record = Simulation(scene, Runtime(threads=1)).run()
    assert record.status == "done"
    return record


@pytest.mark.parametrize("half_angle", [math.pi / 2, math.radians(60)])
@pytest.mark.parametrize("mirror", [True, False])
def test_what_the_press_gives_the_board_takes(half_angle, mirror):
    """Press + board + weight = change of momentum to rounding in every interval, also with friction and a wedge; at the
    end the board carries the press's force and the weight within 2 %."""
    numerics = replace(SCENE.numerics, mirror=mirror)
    record = pressed(replace(SCENE, knife=Press("tool", half_angle, 0.4), numerics=numerics))
    assert record.momentum_residual < 1e-10
    late = record.stroke > 1.5e-3
    down = record.face[late, 2].mean() - record.gravity[late, 2].mean()
    assert -record.board[late, 2].mean() == pytest.approx(down, rel=0.02)
    assert record.face[late, 2].min() > 0


def test_a_quarter_is_the_whole():
    """Mirrors change the force by less than other particles do: 2 %."""
    quarter, whole = (pressed(replace(SCENE, numerics=replace(SCENE.numerics, mirror=m))) for m in (True, False))
    late = whole.stroke > 1e-3
    assert quarter.images == 4
    np.testing.assert_allclose(quarter.face[late, 2].mean(), whole.face[late, 2].mean(), rtol=0.02)


def test_a_press_cuts_nothing():
    """Whatever the resistance, the edge carries no force and the food stays in one piece."""
    record = pressed(SCENE.with_material(R=0.0))
    np.testing.assert_array_equal(record.edge, 0.0)
    assert not record.severed


@pytest.mark.slow
@pytest.mark.parametrize("changed", [{}, {"dx": 1e-3}, {"safety": 0.35}])
def test_a_sliding_block_has_the_force_of_uniaxial_compression(changed):
    """Between slippery plates a block is in uniaxial compression: the law's force within 1 % on 8 cells, on 16, and
    with half the time step. The contact gives way by nothing that the grid or the time step decides."""
    numerics = Numerics(**{"dx": 2e-3, "gravity": 0.0, "output": 1e-5, **changed})
    record = pressed(replace(SCENE, knife=Press(), board=Board(0.0), motion=Motion(1.8e-3, 3e-3), numerics=numerics))
    middle = 0.5 * (record.stroke[1:] + record.stroke[:-1])
    near = abs(middle - 1.6e-3) < 0.2e-3  # a tenth of the height, without the ringing
    force = np.polyfit(middle[near] - 1.6e-3, record.face[1:, 2][near], 2)[2]
    assert force == pytest.approx(uniaxial(0.9, SOFT) * 0.02 * 0.016, rel=0.01)


def all_relaxes(share: float, tau: float, duration: float) -> np.ndarray:
    """The same where the volume relaxes as the shape does: one spring and one Maxwell branch."""
    time = duration * np.arange(1, 401) / 400 / tau
    return 1 - share + share * -np.expm1(-time) / time


def relaxed_part(share: float, tau: float, duration: float, nu: float, steps: int = 400) -> np.ndarray:
    """Load of a uniaxial compression at a constant speed over that without relaxation, small strains: the deviator
    relaxes and the pressure does not (Simo 1987)."""
    shear, bulk = 1 / (2 * (1 + nu)), 1 / (3 * (1 - 2 * nu))
    step = duration / steps / tau
    decay, mean = math.exp(-step), -math.expm1(-step) / step
    before = held = 0.0
    out = []
    for k in range(1, steps + 1):
        # deviator a (along - wide) and its branch; free sides: the pressure is half the stress of the deviator
        fixed, gain = decay * held - share * mean * before, 1 - share + share * mean
        along, a = k / steps, 4 / 3 * shear
        wide = (0.5 * (a * along * gain + fixed) - bulk * along) / (2 * bulk + 0.5 * a * gain)
        now = a * (along - wide)
        held, before = fixed + share * mean * now, now
        out.append(1.5 * ((1 - share) * now + held))
    return np.array(out) * steps / np.arange(1, steps + 1)


@pytest.mark.slow
@pytest.mark.parametrize("bulk", [0.0, 1.0])
def test_a_block_relaxes_as_linear_viscoelasticity(bulk):
    """Between slippery plates, pressed in twice its relaxation time, a block has the closed form's part of the force
    of one that does not relax, within 1 %; the ratio does not see the grid. So where the volume relaxes, too."""
    numerics = Numerics(dx=4e-3, gravity=0.0, output=1e-5)
    shape = Shape("block", 0.02, 0.02, 0.02)
    force = {}
    for share in (0.0, 0.6):
        material = Material(E=1e5, nu=0.35, rho=1000.0, loss_factor=0.05, relaxing_share=share, relaxation_time=0.5,
                            relaxing_bulk=bulk)  # fmt: skip
        motion = Motion(1e-3, 4e-3, speed=1e-3)
        record = pressed(Scene(Food(shape, material), Press(), motion, Board(0.0), numerics=numerics))
        middle = 0.5 * (record.stroke[1:] + record.stroke[:-1])
        force[share] = [
            np.polyfit(middle[near] - way, record.face[1:, 2][near], 1)[1]
            for way in (5e-4, 7e-4, 9e-4)
            for near in [abs(middle - way) < 1e-4]
        ]
    found = np.array(force[0.6]) / np.array(force[0.0])
    closed = all_relaxes(0.6, 0.5, 1.0) if bulk else relaxed_part(0.6, 0.5, 1.0, 0.35)
    want = np.interp([0.5, 0.7, 0.9], np.arange(1, 401) / 400, closed)
    assert relaxed_part(0.0, 1.0, 1.0, 0.35) == pytest.approx(1.0)
    np.testing.assert_allclose(found, want, rtol=0.01)


def test_two_branches_relax_as_their_closed_form():
    """A block between slippery plates whose shape and volume relax by two branches, one five times as fast as the
    press and one as slow as it: the ramp of the closed form, 1 less the shares and each share times
    (1 - e^(-t/tau)) tau / t, within 1 % of the force without relaxation."""
    branches = ((0.3, 0.2), (0.3, 1.0))
    numerics = Numerics(dx=4e-3, gravity=0.0, output=1e-5)
    shape = Shape("block", 0.02, 0.02, 0.02)
    force = []
    for prony in ((), branches):
        material = Material(E=1e5, nu=0.35, rho=1000.0, loss_factor=0.05, prony=prony, relaxing_bulk=1.0)
        scene = Scene(Food(shape, material), Press(), Motion(1e-3, 4e-3, speed=1e-3), Board(0.0), numerics=numerics)
        record = pressed(scene)
        middle = 0.5 * (record.stroke[1:] + record.stroke[:-1])
        ways = np.array([5e-4, 7e-4, 9e-4])
        force.append([np.polyfit(middle[near] - way, record.face[1:, 2][near], 1)[1] for way in ways
                      for near in [abs(middle - way) < 1e-4]])  # fmt: skip
    time = ways / 1e-3
    gone = np.array([share * (1.0 + np.expm1(-time / tau) * tau / time) for share, tau in branches])
    np.testing.assert_allclose(np.array(force[1]) / np.array(force[0]), 1.0 - gone.sum(axis=0), rtol=0.01)
    assert gone.min() > 0.05  # so that either branch counts


@pytest.mark.parametrize("bulk", [0.0, 1.0])
def test_what_relaxes_is_booked(bulk):
    """In a glued block what is stored and what has been lost are the work of the plate within 2.5 %, whether the volume
    relaxes or not; where it does, more is lost. Without relaxation it is within 1 %."""
    quiet = replace(SCENE.numerics, gravity=0.0)
    scene = replace(SCENE, motion=Motion(2e-3, 3e-3, speed=4e-3), numerics=quiet, board=Board(9.0), knife=Press(mu=9.0))
    lost = {}
    for share, within in ((0.0, 0.01), (0.6, 0.025)):
        material = replace(SOFT, loss_factor=0.0, relaxing_share=share, relaxation_time=0.3, relaxing_bulk=bulk)
        record = pressed(replace(scene, food=replace(SCENE.food, material=material)))
        total = record.elastic[-1] + record.kinetic[-1] + record.viscous[-1]
        assert total == pytest.approx(record.work_done[-1], rel=within)
        lost[share] = record.viscous[-1] / record.work_done[-1]
    assert lost[0.0] < 1e-9 and lost[0.6] == pytest.approx(0.288 if bulk else 0.239, abs=0.01)


def test_the_contact_keeps_no_energy():
    """What the plate does is in the food: elastic energy is the work within 1.5 %, nothing is left in the contact."""
    food = replace(SCENE.food, material=replace(SOFT, loss_factor=0.0))
    quiet = replace(SCENE.numerics, gravity=0.0)
    record = pressed(
        replace(SCENE, food=food, motion=Motion(2e-3, 3e-3), numerics=quiet, board=Board(9.0), knife=Press(mu=9.0))
    )
    assert record.elastic[-1] == pytest.approx(record.work_done[-1], rel=0.015)


def uniaxial(stretch: float, material: Material) -> float:
    """Nominal stress of the corotated law under uniaxial compression, by its least energy over the lateral stretch
    [Pa]."""

    def energy(lateral: float, axial: float) -> float:
        size = (axial - 1) ** 2 + 2 * (lateral - 1) ** 2
        return material.shear * size + 0.5 * material.lame * (axial * lateral**2 - 1) ** 2

    def least(axial: float) -> float:
        return float(minimize_scalar(energy, bounds=(0.8, 1.3), args=(axial,), options={"xatol": 1e-10}).fun)

    step = 1e-4
    return (least(stretch - step) - least(stretch + step)) / (2 * step)


def test_friction_stiffens():
    """Plate and board that hold the food's ends make it stiffer."""
    slippery = pressed(replace(SCENE, knife=Press(), board=Board(0.0)))
    rough = pressed(replace(SCENE, knife=Press(mu=5.0), board=Board(5.0)))
    assert rough.face[-5:, 2].mean() > 1.05 * slippery.face[-5:, 2].mean()


def test_what_a_press_cannot_do():
    """A tilted press, nodal contact, and an angle that is none."""
    with pytest.raises(SceneError, match="a press is level"):
        replace(SCENE, motion=replace(SCENE.motion, tilt=0.1))
    with pytest.raises(SceneError, match="a press is level"):
        replace(SCENE, numerics=replace(SCENE.numerics, contact="nodal"))
    with pytest.raises(SceneError, match="press tool: half_angle"):
        Press("tool", 2.0)


def test_section_stands_under_the_stress_of_uniaxial_compression():
    """Between slippery plates the von Mises stress of a section is that of the law, over the area as it is then (1
    %)."""
    numerics = replace(SCENE.numerics, gravity=0.0)
    scene = replace(SCENE, knife=Press(mu=0.0), board=Board(0.0), motion=Motion(2e-3, 2e-3), numerics=numerics)
    section = Simulation(scene, Runtime(threads=1)).run(sections=2).section
    assert section is not None
    np.testing.assert_allclose(section.stroke, [1e-3, 2e-3], atol=0.1e-3)
    for stroke, mises in zip(section.stroke, section.mises, strict=True):
        stretch = 1 - stroke / 0.016
        area = (1 + SOFT.nu * (1 - stretch)) ** 2
        assert np.median(mises) == pytest.approx(uniaxial(stretch, SOFT) / area, rel=0.01)
