"""Bending under weight: particles against finite elements of the same law."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem_reference.laws import Corotated
from fem_reference.meshes import box
from fem_reference.solid import Solid
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import Case, How, Row
from studies.verification.motion import numerics

FOOD = Material(E=1e5, nu=0.35, rho=1000.0)
DEPTH, WIDTH = 6e-3, 3e-3  # of the section [m]
HALF, GRIP = 36e-3, 6e-3  # half the length, half the length that is held up [m]
WEIGHT = 8.0  # acceleration downwards of what hangs [m/s^2]
PERIODS = 2.0  # of the lowest bending, critically damped, after which the beam is at rest


def _lift(y: np.ndarray) -> np.ndarray:
    """Acceleration upwards [m/s^2]: a body force holds the middle, so that nothing is clamped and nothing falls."""
    return np.where(np.abs(y) < GRIP, WEIGHT * (HALF - GRIP) / GRIP, -WEIGHT)


def elements() -> tuple[np.ndarray, np.ndarray]:
    """Sag of the finite elements' axis: places from the middle [m] and way down against the middle [m], shape (n,)."""
    mesh = box(np.linspace(0, WIDTH / 2, 2), np.linspace(0, HALF, 25), np.linspace(0, DEPTH, 5))
    solid = Solid(mesh, Corotated(FOOD.shear, FOOD.lame), 2)
    x, y, z = solid.nodes.T
    near = 1e-9
    solid.hold(np.flatnonzero(x < near), [0])
    solid.hold(np.flatnonzero(y < near), [1])
    solid.hold(np.flatnonzero((x < near) & (y < near) & (z < near)), [2])  # carries nothing
    at = np.asarray(solid.basis.global_coordinates())[1]
    pull = FOOD.rho * np.stack([0 * at, 0 * at, _lift(at)])
    for part in np.arange(1, 9) / 8:
        solid.body = part * pull
        solid.solve()
    axis = np.flatnonzero((x < near) & (np.abs(z - DEPTH / 2) < near))
    axis = axis[np.argsort(y[axis])]
    return y[axis], solid.u[axis[0], 2] - solid.u[axis, 2]


def particles(how: How, dx: float, ppc: int) -> tuple[float, float]:
    """A section near the end: its place from the middle [m] and its way down against the middle [m].

    The beam lies across the blade and bends along x, where the grid has room; a quarter of a cell takes the mirror across x away.
    """
    grid = replace(numerics(dx, room=1.5, ppc=ppc), mirror=True, grid_shift=(0.25, 0.0, 0.0))
    body = how.body(Shape("block", 2 * HALF, DEPTH, WIDTH), FOOD, grid)
    y = np.abs(body.start[:, 1])
    stiffness, line = FOOD.E * WIDTH * DEPTH**3 / 12, FOOD.rho * WIDTH * DEPTH
    omega = 3.516 / (HALF - GRIP) ** 2 * math.sqrt(stiffness / line)  # of a thin cantilever
    lift = np.stack([_lift(y), 0 * y, 0 * y], axis=1)
    steps = math.ceil(PERIODS * 2 * math.pi / omega / body.dt)
    body.step(steps, pull=lambda _: lift - 2 * omega * body.v)
    down = (body.start - body.x)[:, 0]
    end, middle = y > HALF - dx, y < dx
    return float(y[end].mean()), float(down[end].mean() - down[middle].mean())


def sagging(how: How) -> Iterator[Row]:
    """A beam held in its middle, whose ends hang down.

    Of a food that is bent far, the sum over the particles is noisier than at rest and the beam softer: less so with more.
    """
    places, sag = elements()
    dx = DEPTH / 8
    for ppc, tolerance in ((2, 0.05), (3, 0.03)):
        place, got = particles(how, dx, ppc)
        want = float(np.interp(place, places, sag))
        source = f"finite elements of the same law, {want / (place - GRIP):.2f} of what hangs"
        name = f"beam held in its middle, 8 cells deep, {ppc**3} particles a cell"
        yield Row(name, "sag of the end [m]", want, got, tolerance, source)


CASES = [Case("sag", sagging, fast=False, cost=200)]
