"""The finite-element reference itself: manufactured solution, benchmarks with known answers, Hertz, a punch."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem_reference.laws import Corotated, Law, Plastic
from fem_reference.meshes import bent, box, surface
from fem_reference.press import Elements, press
from fem_reference.solid import Solid
from mpm.arrays import FloatArray
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.result import Comparison

STEEL = Material(E=210e9, nu=0.3, rho=7800.0)
SIZE = 0.08  # amplitude of the manufactured displacement on the unit cube [m]


def manufactured(cells: int, order: int, law: Law) -> tuple[float, float]:
    """Errors of the displacement and of its gradient in the mean square on a unit cube with a body force.

    u = size sin(pi x) sin(pi y) sin(pi z) (1, -0.5, 0.7), zero on the faces; the force is the divergence of the law's
    stress by central differences.

    Args:
        cells: Hexahedra along each edge of the cube.
        order: Order of the elements.
        law: The law.

    Returns:
        Error of the displacement [m], and of its gradient [-].
    """
    direction = np.array([1.0, -0.5, 0.7])

    def gradient(x: FloatArray) -> FloatArray:
        s, c = np.sin(math.pi * x), math.pi * np.cos(math.pi * x)
        slope = SIZE * np.stack([c[0] * s[1] * s[2], s[0] * c[1] * s[2], s[0] * s[1] * c[2]])
        return direction.reshape(3, 1, *[1] * (x.ndim - 1)) * slope

    line = np.linspace(0, 1, cells + 1)
    solid = Solid(box(line, line, line), law, order)
    x = np.asarray(solid.basis.global_coordinates())
    eye = np.eye(3).reshape(3, 3, 1, 1)
    h = 1e-5
    divergence = np.zeros_like(x)
    for j in range(3):
        d = np.zeros((3, 1, 1))
        d[j] = h
        high, low = (law.stress(eye + gradient(x + k * d), None)[0] for k in (1, -1))
        divergence += (high - low)[:, j] / (2 * h)
    solid.body = -divergence
    outside = np.flatnonzero(((solid.nodes < 1e-9) | (solid.nodes > 1 - 1e-9)).any(axis=1))
    solid.hold(outside, [0, 1, 2])
    solid.solve()
    local = solid.u[solid.cells]
    u = np.einsum("aei,aeq->ieq", local, solid.values)
    exact = direction[:, None, None] * SIZE * np.prod(np.sin(math.pi * x), axis=0)
    slope = solid.deformation(solid.u) - eye - gradient(x)
    return (
        math.sqrt(float((((u - exact) ** 2).sum(axis=0) * solid.weights).sum())),
        math.sqrt(float(((slope**2).sum(axis=(0, 1)) * solid.weights).sum())),
    )


def orders(options: SuiteOptions) -> Iterator[Comparison]:
    """Errors on two meshes, for both orders of the elements."""
    law = Corotated(1.0, 1.5)
    for order, (coarse, fine), cap in ((1, (4, 8), 2e-3), (2, (2, 4), 5e-4)):
        a, b = manufactured(coarse, order, law), manufactured(fine, order, law)
        source = "manufactured solution, finite strain"
        name = f"hexahedra of order {order}"
        for k, (quantity, want) in enumerate(
            (("order of the displacement [-]", order + 1), ("order of its gradient [-]", order))
        ):
            rate = math.log(a[k] / b[k]) / math.log(fine / coarse)
            yield Comparison(name, quantity, want, rate, 0.1, source, least=True)
        yield Comparison(name, f"error of the displacement on {fine}^3 [m]", 0.0, b[0], cap, source)


def _elliptic(thickness: float, layers: int, cells: int) -> Solid:
    """Quarter of the elliptic plate of the NAFEMS cases LE1 and LE10."""

    def place(p: FloatArray) -> FloatArray:
        a, b = 2.0 + 1.25 * p[0], 1.0 + 1.75 * p[0]
        return np.stack([a * np.cos(p[1]), b * np.sin(p[1]), p[2]])

    mesh = bent(
        np.linspace(0, 1, cells + 1),
        np.linspace(0, math.pi / 2, cells + 1),
        np.linspace(0, thickness, layers + 1),
        place,
    )
    solid = Solid(mesh, Corotated(STEEL.shear, STEEL.lame), 2)
    for axis in (0, 1):
        solid.hold(np.flatnonzero(np.abs(solid.nodes[:, axis]) < 1e-9), [axis])
    return solid


def _outline(x: FloatArray) -> FloatArray:
    return np.hypot(x[0] / 3.25, x[1] / 2.75)


def _stress_at_d(solid: Solid, height: float) -> float:
    """sigma_yy at the point (2, 0) of the inner rim [Pa]."""
    p, _ = solid.law.stress(solid.deformation(solid.u), None)
    at = np.argmin(np.linalg.norm(solid.nodes - [2.0, 0.0, height], axis=1))
    return float(solid.project(p[1, 1])[at])


def nafems(options: SuiteOptions) -> Iterator[Comparison]:
    """Elliptic membrane under outward pressure, thick plate under normal pressure."""
    cells = 5 if options.quick else 8
    thin = _elliptic(0.05, 1, cells)
    thin.hold(np.flatnonzero(np.abs(thin.nodes[:, 2]) < 1e-9), [2])
    thin.press(surface(thin.mesh, lambda x: _outline(x) > 0.98), -10e6)
    thin.solve()
    yield Comparison(
        "NAFEMS LE1, elliptic membrane", "stress at D [Pa]", 92.7e6, _stress_at_d(thin, 0.0), 0.02, "NAFEMS (1990)"
    )
    thick = _elliptic(0.6, 2 if options.quick else 4, cells)
    rim = np.flatnonzero(_outline(thick.nodes.T) > 1 - 1e-6)
    thick.hold(rim, [0, 1])
    thick.hold(rim[np.abs(thick.nodes[rim, 2] - 0.3) < 1e-9], [2])
    thick.press(surface(thick.mesh, lambda x: x[2] > 0.6 - 1e-6), 1e6)
    thick.solve()
    yield Comparison(
        "NAFEMS LE10, thick plate",
        "stress at D [Pa]",
        -5.38e6,
        _stress_at_d(thick, 0.6),
        0.05 if options.quick else 0.02,
        "NAFEMS (1990)",
    )


def beams(options: SuiteOptions) -> Iterator[Comparison]:
    """Cook's tapered panel, and a slender beam bent far."""
    n = 6 if options.quick else 10

    def place(p: FloatArray) -> FloatArray:
        low, high = 44 * p[0] / 48, 44 + 16 * p[0] / 48
        return np.stack([p[0], low + (high - low) * p[1], p[2]])

    mesh = bent(np.linspace(0, 48, n + 1), np.linspace(0, 1, n + 1), np.linspace(0, 0.5, 2), place)
    panel = Material(E=1.0, nu=1 / 3, rho=1.0)
    solid = Solid(mesh, Corotated(panel.shear, panel.lame), 2)
    solid.hold(np.flatnonzero(solid.nodes[:, 0] < 1e-9), [0, 1])
    solid.hold(np.flatnonzero(solid.nodes[:, 2] < 1e-9), [2])
    nodes, areas = solid.areas(surface(mesh, lambda x: x[0] > 48 - 1e-6))
    load = 1e-5
    solid.load[nodes, 1] = 0.5 * load * areas / areas.sum()
    solid.solve()
    tip = np.argmin(np.linalg.norm(solid.nodes - [48.0, 52.0, 0.0], axis=1))
    yield Comparison(
        "Cook's membrane",
        "deflection of the end's middle over the load [-]",
        23.96,
        float(solid.u[tip, 1] / load),
        0.01,
        "plane stress, E = 1, nu = 1/3",
    )
    length, depth = 1.0, 0.02
    mesh = box(np.linspace(0, length, 21), np.linspace(0, depth, 2), np.linspace(0, depth, 2))
    beam = Solid(mesh, Corotated(0.5, 0.0), 2)  # E = 1, nu = 0
    beam.hold(np.flatnonzero(beam.nodes[:, 0] < 1e-9), [0, 1, 2])
    nodes, areas = beam.areas(surface(mesh, lambda x: x[0] > length - 1e-6))
    end = np.flatnonzero(beam.nodes[:, 0] > length - 1e-9)
    for k in range(1, 6):
        beam.load[nodes, 1] = k / 5 * (depth**4 / 12) / length**2 * areas / areas.sum()
        beam.solve()
    yield Comparison(
        "slender beam, P L^2 / EI = 1",
        "deflection over length [-]",
        0.30172,
        float(beam.u[end, 1].mean()),
        0.005,
        "elastica (Mattiasson 1981)",
    )
    yield Comparison(
        "slender beam, P L^2 / EI = 1",
        "shortening over length [-]",
        0.05643,
        -float(beam.u[end, 0].mean()),
        0.01,
        "elastica (Mattiasson 1981)",
    )


def hertz(options: SuiteOptions) -> Iterator[Comparison]:
    """A ball and a cylinder between two plates."""
    ball, food = Shape("sphere", 0.04, 0.04, 0.04), Material(E=1e5, nu=0.35, rho=1000.0)
    way = 0.3e-3  # contact radius over radius 0.09: Hertz holds where that is small
    curve = press(ball, food, [way / 2, way], elements=Elements(cells=9, grade=2.0))
    modulus = food.E / (1 - food.nu**2)
    want = 4 / 3 * modulus * math.sqrt(0.02) * (way / 2) ** 1.5
    yield Comparison(
        "ball between plates",
        f"force at {way * 1e3:g} mm [N]",
        want,
        float(curve.force[-1]),
        0.05,
        "Hertz, each contact half the way",
    )
    balance = abs(float(curve.force[-1] - curve.board[-1]))
    yield Comparison(
        "ball between plates", "force of the plate less that on the board [N]", 0.0, balance, 1e-4 * want, "balance"
    )
    # of the contact, of the cylinder: nu = 0, for which plane strain and free ends are the same
    half, radius = 0.002, 0.02
    line = math.pi * food.E * half**2 / (4 * radius)
    way = 2 * line / (math.pi * food.E) * (2 * math.log(4 * radius / half) - 1)
    round_ = Shape("cylinder", 0.002, 2 * radius, 2 * radius)
    soft = replace(food, nu=0.0)
    elements = Elements(cells=6, order=2, grade=2.0)
    curve = press(round_, soft, [way / 4, way / 2, 3 * way / 4, way], elements=elements)
    yield Comparison(
        "cylinder between plates",
        f"force on its length at {way * 1e3:.2g} mm [N/m]",
        line,
        float(curve.force[-1]) / round_.length,
        0.03,
        "Hertz, against the middle of the cylinder (Johnson 1985, eq. 5.57)",
    )


def punch(options: SuiteOptions) -> Iterator[Comparison]:
    """A flat punch of half width 1 on a deep block in plane strain that flows: the load at which it sinks in."""
    n, wide, depth, steps = 4, 3.0, 0.03, 6
    food, flow = Material(E=1e3, nu=0.3, rho=1.0), 1.0
    shrink = np.linspace(0, 1, 2 * n + 1) ** 2  # elements become small at the punch's edge
    across = np.concatenate([1 - np.linspace(1, 0, n + 1) ** 2, 1 + (wide - 1) * shrink[1:]])
    block = box(np.linspace(0, 0.25, 2), across, -wide * shrink[::-1])
    solid = Solid(block, Plastic(food.shear, food.lame, flow), 2)
    _, y, z = solid.nodes.T
    near = 1e-9
    solid.hold(np.arange(len(y)), [0])
    solid.hold(np.flatnonzero((y < near) | (y > wide - near)), [1])
    solid.hold(np.flatnonzero(z < near - wide), [2])
    under = np.flatnonzero((z > -near) & (y < 1 + near))
    for k in range(1, steps + 1):
        solid.hold(under, [2], -depth * k / steps)
        solid.solve()
    got = float(-solid.reaction(under)[2]) / 0.25
    want = (2 + math.pi) / math.sqrt(3) * flow
    yield Comparison(
        "flat punch, J2", "mean pressure over yield stress [-]", want, got, 0.05, "Prandtl 1921, plane strain"
    )


CASES = [
    VerificationCase("finite elements: orders", orders),
    VerificationCase("finite elements: NAFEMS", nafems),
    VerificationCase("finite elements: beams", beams),
    VerificationCase("finite elements: Hertz", hertz, fast=False, cost=120),
    VerificationCase("finite elements: punch", punch, fast=False, cost=140),
]
