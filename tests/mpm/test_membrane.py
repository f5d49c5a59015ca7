"""Skin as a membrane: its area, its law and what it does to a body that it is drawn over, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from mpm.output.record import ForceRecord
from mpm.run import Order
from mpm.runtime import Runtime
from mpm.scene import Food, Motion, Numerics, Press, Scene
from mpm.scene.material import SKIN_POISSON, Material
from mpm.scene.shapes import Shape
from mpm.scene.skin import skin_points, tangents
from mpm.solver import Simulation
from mpm.state.host_transfer import particles
from tests.mpm.scenes import PRISM, THIN, cut

BALL = Shape("sphere", 0.03, 0.03, 0.03)
SMALL = Shape("sphere", 0.022, 0.022, 0.022)
BAR = Shape("cylinder", 0.09, 0.021, 0.021)
SOFT = Material(E=1e5, nu=0.3, rho=1000, loss_factor=0.5, skin_stiffness=100.0)
BULK = SOFT.E / (3 * (1 - 2 * SOFT.nu))
QUARTER = (True, True)


def areas(shape: Shape) -> np.ndarray:
    """Area vectors of the skin of a quarter of a food [m^2], (m, 3)."""
    skin = skin_points(shape, 1.5e-3, QUARTER)
    return skin.areas[:, None] * skin.normals


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (BALL, math.pi * 0.03**2),
        (Shape("hemisphere", 0.04, 0.04, 0.02), math.pi * 0.04**2 / 2),
        (Shape("cylinder", 0.06, 0.03, 0.03), math.pi * 0.03 * 0.054),
        (Shape("half_cylinder", 0.06, 0.03, 0.015), math.pi * 0.015 * 0.054),
    ],
    ids=lambda value: value.kind if isinstance(value, Shape) else "",
)
def test_skin_has_the_area_of_the_outline(shape, area):
    """All round; not on the flat face of a half, and not within a cell of an end that was cut off."""
    assert np.linalg.norm(areas(shape), axis=1).sum() == pytest.approx(area / 4, rel=0.01)


def test_normals_of_a_ball_point_away_from_its_middle():
    """Their sum over a quarter is that of the closed surface: the half section in each mirror plane."""
    half = math.pi * 0.015**2 / 2
    assert areas(BALL).sum(axis=0) == pytest.approx([half, -half, 0.0], abs=0.02 * half)


def test_points_lie_a_spacing_behind_the_outline():
    """Further out the nodes have hardly any mass."""
    skin = skin_points(BALL, 1.5e-3, QUARTER)
    radius = np.linalg.norm(skin.x - [0, 0, 0.015], axis=1)
    assert np.average(radius, weights=skin.areas) == pytest.approx(0.0135, abs=5e-5)
    assert np.average(np.abs(radius - 0.0135), weights=skin.areas) < 1e-4


def test_tangents_are_across_the_normal_and_each_other():
    """Unit vectors, whatever the normal, one along an axis as well."""
    n = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.64, 0.48]])
    frame = np.stack([n, *tangents(n)], axis=1)
    assert frame @ frame.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), (3, 3, 3)), abs=1e-12)


def at_rest(shape: Shape, stretch: np.ndarray, *, cut_plane: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """A body at rest in a skin that was stretched by a matrix (3, 3) before it was drawn over it.

    Args:
        shape: The body.
        stretch: What the skin was stretched by [-], (3, 3).
        cut_plane: Whether ties hold it together across a cut plane, under a blade that does not reach it.

    Returns:
        Deformation gradients (n, 3, 3), and places at first [m], (n, 3).
    """
    numerics = Numerics(dx=3e-3, gravity=0.0)
    held = replace(SOFT, R=1e3, tensile_strength=1e6) if cut_plane else SOFT
    one = Scene(Food(shape, held), THIN if cut_plane else Press(), Motion(shape.height / 2, 0.01), numerics=numerics)
    simulation = Simulation(one, Runtime(threads=1))
    simulation.load(held)
    sides = simulation.state.skin_sides.to_numpy()
    simulation.state.skin_sides.from_numpy(sides @ stretch.T)
    dt = simulation.setup.time_step(held)
    steps = math.ceil(2 * 4 * max(shape.length, shape.height) / SOFT.p_wave / dt)
    simulation.advance(Order(steps, steps, dt, 0.0, 0.0, 0.0))
    return particles(simulation.state).F, simulation.setup.seeds.x


def test_stretched_skin_squeezes_a_ball_like_a_balloon():
    """p = 2 N / r with the line force N = E t / (1 - nu) times what of the stretch is left, within 3 % of the strain.

    The mean stress of a body is the virial of the forces on it, so no field has to be solved for.
    """
    f, _ = at_rest(BALL, 1.05 * np.eye(3))

    def mean_stress(e: float) -> float:
        stretch = 1.05 * (1 + e)
        line = SOFT.skin_stiffness / (1 - SKIN_POISSON) * (stretch**2 - 1) / 2 * stretch**2
        return BULK * (1 + e) ** 3 * ((1 + e) ** 3 - 1) + 2 / 3 * line * 3 / 0.015

    assert f.trace(axis1=1, axis2=2).mean() / 3 - 1 == pytest.approx(brentq(mean_stress, -0.2, 0.0), rel=0.03)


def test_ties_hold_a_stretched_skin_across_the_cut_plane():
    """Beside the plane the ball is squeezed as in its middle, within 3 %; without the skin's share it is 6 % less."""
    f, x = at_rest(BALL, 1.05 * np.eye(3), cut_plane=True)
    beside = np.abs(x[:, 1]) < 3e-3
    assert f[beside, 0, 0].mean() - 1 == pytest.approx(f[:, 0, 0].mean() - 1, rel=0.03)


def test_stretched_skin_shortens_a_bar():
    """A skin stretched along a round bar shortens it and lets it swell: equilibrium of flesh and skin along and across.

    Both strains are within 3 % of the larger one.
    """
    f, x = at_rest(BAR, np.diag([1.0, 1.02, 1.0]))
    middle = np.abs(x[:, 1]) < BAR.length / 4
    along, across = f[middle, 1, 1].mean() - 1, f[middle, 0, 0].mean() - 1
    plane, faces = SOFT.skin_stiffness / (1 - SKIN_POISSON**2), 2 / BAR.width

    def balance(e: np.ndarray) -> list[float]:
        pressure, drawn = SOFT.lame * (e[0] + 2 * e[1]), 0.0202 + e[0]
        line = plane * np.array([drawn + SKIN_POISSON * e[1], e[1] + SKIN_POISSON * drawn])
        return [
            pressure + 2 * SOFT.shear * e[0] + 2 * faces * line[0],
            pressure + 2 * SOFT.shear * e[1] + faces * line[1],
        ]

    expected = fsolve(balance, [0.0, 0.0])
    assert along == pytest.approx(expected[0], rel=0.03)
    assert across == pytest.approx(expected[1], abs=0.03 * abs(expected[0]))


def test_shortened_skin_is_slack():
    """It does not push: a skin that is too large for its ball leaves it as it is."""
    f, _ = at_rest(BALL, 0.95 * np.eye(3))
    assert np.abs(f - np.eye(3)).max() < 1e-9


@pytest.fixture(scope="module")
def fruits() -> dict[str, ForceRecord]:
    """A small ball cut with and without its skin, and whole in place of a quarter."""
    flesh = replace(PRISM.food.material, E=5e5, R=150.0, R_initiation=300.0, loss_factor=0.1)
    bare = replace(PRISM, food=Food(SMALL, flesh), motion=Motion(SMALL.height, 0.02))
    skinned = bare.with_material(skin_stiffness=3000.0)
    whole = replace(skinned, numerics=replace(skinned.numerics, mirror=False))
    return {"bare": cut(bare), "skinned": cut(skinned), "whole": cut(whole)}


def test_skin_balances_momentum_and_energy(fruits):
    """:func:`cut` insists on the momentum; no law loses more of the work than without a skin."""
    assert abs(fruits["skinned"].lost) < abs(fruits["bare"].lost) + 0.01
    assert fruits["skinned"].severed


def test_skin_hardly_changes_a_cut_but_stiffens_a_press(fruits):
    """The edge goes through it, and what is left is slack; between plates it is stretched all round."""
    assert fruits["skinned"].work == pytest.approx(fruits["bare"].work, rel=0.1)
    soft = replace(SOFT, skin_stiffness=1000.0)
    pressed = replace(PRISM, food=Food(SMALL, soft), knife=Press(), motion=Motion(SMALL.height / 5, 0.01))
    bare = pressed.with_material(skin_stiffness=0.0)
    assert cut(pressed).peak > 1.07 * cut(bare).peak


def test_half_a_skin_mirrors_the_whole(fruits):
    """The ties of the flesh hold the skin across the cut plane, of a mirror image or of the other half."""
    assert fruits["whole"].work == pytest.approx(fruits["skinned"].work, rel=0.01)
    assert fruits["whole"].peak == pytest.approx(fruits["skinned"].peak, rel=0.02)
