"""Skin as a membrane: its area, its law against closed forms, and what it does to a body that it is drawn over."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from mpm.discretisation.particles import seed
from mpm.run import Order
from mpm.runtime import Runtime
from mpm.scene import Food, Motion, Numerics, Scene
from mpm.scene.material import SKIN_POISSON, Material
from mpm.scene.shapes import Shape
from mpm.scene.skin import skin_areas, tangents
from mpm.solver import Simulation
from mpm.state.host_transfer import particles
from tests.mpm.scenes import THIN

BALL = Shape("sphere", 0.03, 0.03, 0.03)
SOFT = Material(E=1e5, nu=0.3, rho=1000, loss_factor=1.0, skin_stiffness=200.0)


def scene(shape: Shape, material: Material = SOFT, dx: float = 3e-3) -> Scene:
    """A food that the blade does not reach yet."""
    return Scene(Food(shape, material), THIN, Motion(shape.height, 0.01), numerics=Numerics(dx=dx))


def areas(one: Scene) -> np.ndarray:
    """Area vectors of the skin of its particles [m^2], (n, 3)."""
    seeds = seed(one)
    return skin_areas(one.food.shape, seeds.spacing, seeds.x, one.mirrors)


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        (BALL, np.pi * 0.03**2 / 4),
        (Shape("hemisphere", 0.04, 0.04, 0.02), np.pi * 0.04**2 / 2 / 4),
        (Shape("cylinder", 0.06, 0.03, 0.03), np.pi * 0.03 * 0.06 / 4),
        (Shape("block", 0.06, 0.03, 0.024), (2 * 0.03 + 2 * 0.024) * 0.06 / 4),
    ],
    ids=lambda value: value.kind if isinstance(value, Shape) else "",
)
def test_skin_has_the_area_of_the_outline(shape, area):
    """All round; not on the flat face of a half, nor at the ends of a piece that was cut off. A quarter is modelled."""
    assert np.linalg.norm(areas(scene(shape)), axis=1).sum() == pytest.approx(area, rel=0.01)


def test_normals_of_a_ball_point_away_from_its_middle():
    """Their sum over a quarter is that of the closed surface: the section's area in each mirror plane."""
    total = areas(scene(BALL)).sum(axis=0)
    assert total == pytest.approx([np.pi * 0.015**2 / 2, -np.pi * 0.015**2 / 2, 0.0], abs=0.01 * np.pi * 0.015**2)


def test_tangents_are_across_the_normal_and_each_other():
    """Unit vectors, whatever the normal, one along an axis as well."""
    n = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.64, 0.48]])
    one, two = tangents(n)
    frame = np.stack([n, one, two], axis=1)
    assert frame @ frame.transpose(0, 2, 1) == pytest.approx(np.broadcast_to(np.eye(3), (3, 3, 3)), abs=1e-12)


def at_rest(shape: Shape, stretch: tuple[float, float], dx: float = 3e-3, material: Material = SOFT) -> np.ndarray:
    """Mean deformation gradient (3, 3) of a body at rest whose skin was stretched before it was drawn over it.

    The factors are those of the skin's two vectors.
    """
    one = scene(shape, material, dx)
    simulation = Simulation(one, Runtime(threads=1))
    simulation.load(material)
    skin = simulation.state.skin.to_numpy()
    simulation.state.skin.from_numpy(skin * np.reshape(stretch, (2, 1)))
    dt = simulation.setup.time_step(material)
    periods = 6 * 4 * shape.height / material.p_wave
    simulation.advance(Order(math.ceil(periods / dt), math.ceil(periods / dt), dt, 0.0, 0.0, 0.0))
    now, seeds = particles(simulation.state), simulation.setup.seeds
    return np.average(now.F, axis=0, weights=seeds.volume_ratio)


@pytest.mark.parametrize("dx", [3e-3, 2e-3])
def test_stretched_skin_compresses_a_ball(dx):
    """A skin stretched by a part all round presses on the ball like a balloon: p = 2 N / r, and 3 K e = -p.

    N is the line force E t / (1 - nu) times what of the stretch is left. The mean of the strain is known without
    solving for its field: the mean stress of a body is the virial of the forces on its surface.
    """
    stretch, shape = 1.05, BALL
    strain = np.trace(at_rest(shape, (stretch, stretch), dx)) / 3 - 1
    bulk = SOFT.E / (3 * (1 - 2 * SOFT.nu))

    def off(e: float) -> float:
        line = (
            SOFT.skin_stiffness / (1 - SKIN_POISSON) * 0.5 * ((stretch * (1 + e)) ** 2 - 1) * (stretch * (1 + e)) ** 2
        )
        j = (1 + e) ** 3
        mean = bulk * j * (j - 1)  # Kirchhoff
        return mean + 2 / 3 * line * (3 / 0.015) / 1.0

    assert strain == pytest.approx(brentq(off, -0.2, 0.0), rel=0.03)
