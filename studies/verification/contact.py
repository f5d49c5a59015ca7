"""Bodies that touch: weight, friction on a level and a tilted board, impact on the board and of two discs, Hertz."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from fem_reference.press import Elements, press
from mpm.arrays import FloatArray
from mpm.scene import Board, Food, Motion, Press, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.free_body import InitialState
from studies.verification.motion import BLOCK, SOFT, numerics
from studies.verification.result import Comparison

G = 9.81
DAMPED = replace(SOFT, loss_factor=0.5)
CONTACT_SHARE = 0.1
"""Half the width of a Hertzian contact over the radius [-]. Hertz's formula is 2.2 % above the finite elements there.
See docs/theory.md, "Measured choices"."""
CONTACT_ELEMENTS = (6, 9)
"""Elements over the radius of the cylinder in the two meshes from which its force is carried on to elements of no
size."""


def resting(options: SuiteOptions) -> Iterator[Comparison]:
    """What stands on the board weighs its weight; what slides is slowed by mu g.

    The contact has no damping of its own, and with the default stiffness the block still rocks on it: 0.6 % of its
    weight and 6 % of the energy of friction are missed. The contact is four times as stiff here.
    """
    stiff = replace(numerics(gravity=G), contact_stiffness=8.0)
    body = options.body(BLOCK, DAMPED, stiff, board=0.0)
    period = 4 * BLOCK.height / DAMPED.p_wave
    body.step(math.ceil((6 if options.quick else 12) * period / body.dt))
    before, since = body.impulse.copy(), body.time
    body.step(math.ceil(4 * period / body.dt))
    weight = DAMPED.rho * BLOCK.width * BLOCK.length * BLOCK.height * G
    yield Comparison(
        "block at rest",
        "force on the board [N]",
        -weight,
        float((body.impulse - before)[2] / (body.time - since)),
        0.005,
        "m g",
    )
    mu, v0 = 0.4, 0.15
    slide = options.body(BLOCK, DAMPED, replace(stiff, room=1.0), board=mu)
    slide.step(math.ceil(6 * period / slide.dt))
    slide.kick(np.array([v0, 0.0, 0.0]))
    slide.step(math.ceil(2 * period / slide.dt))
    t0, u0, x0, rubbed = slide.time, slide.v[:, 0].mean(), slide.x[:, 0].mean(), slide.friction
    slide.step(math.ceil(0.5 * v0 / (mu * G) / slide.dt))
    slowed = (slide.v[:, 0].mean() - u0) / (slide.time - t0)
    yield Comparison("block slides on the board", "acceleration [m/s^2]", -mu * G, float(slowed), 0.02, "Coulomb: mu g")
    work, way = slide.friction - rubbed, float(slide.x[:, 0].mean() - x0)
    yield Comparison(
        "block slides on the board", "energy of friction [J]", mu * weight * way, work, 0.03, "mu m g times the way"
    )


def bouncing(options: SuiteOptions) -> Iterator[Comparison]:
    """A ball bounces back from the board."""
    ball = Shape("sphere", 0.03, 0.03, 0.03)
    body = options.body(
        ball,
        Material(E=1e5, nu=0.3, rho=1000.0),
        numerics(1.5e-3 if not options.quick else 2e-3),
        InitialState(velocity=lambda x: np.tile([0.0, 0.0, -0.3], (len(x), 1)), lift=1e-3),
        board=0.0,
    )
    body.step(1)
    start = body.kinetic
    for _ in range(4000):
        body.step(10)
        up = float(body.v[:, 2].mean())
        if up > 0 and body.x[:, 2].min() > 1.5e-3:
            break
    yield Comparison(
        "ball bounces",
        "speed after over before [-]",
        0.9,
        up / 0.3,
        0.0,
        "elastic impact: above 0.9 (Sulsky et al. 1994)",
        least=True,
    )
    energy = (body.kinetic + body.elastic) / start
    yield Comparison("ball bounces, energy", "after over before [-]", 1.0, energy, 0.10, "elastic impact")


def tilted(options: SuiteOptions) -> Iterator[Comparison]:
    """A block on a tilted board sticks below the angle of friction and slides with a known acceleration above it."""
    mu = 0.4
    for slope in (0.3, 0.6):
        angle = math.atan(slope)
        down = np.array([G * math.sin(angle), 0.0, 0.0])
        body = options.body(BLOCK, DAMPED, numerics(gravity=G * math.cos(angle), room=1.0), board=mu)
        period = 4 * BLOCK.height / DAMPED.p_wave
        body.step(math.ceil(6 * period / body.dt))
        pull = partial(_constant, np.tile(down, (len(body.start), 1)))
        body.step(math.ceil(4 * period / body.dt), pull=pull)
        since, v0, before = body.time, float(body.v[:, 0].mean()), body.impulse.copy()
        body.step(math.ceil(4 * period / body.dt), pull=pull)
        gained = (float(body.v[:, 0].mean()) - v0) / (body.time - since)
        force = (body.impulse - before) / (body.time - since)
        name = f"block on a board tilted by {math.degrees(angle):.0f} degrees"
        normal = DAMPED.rho * BLOCK.width * BLOCK.length * BLOCK.height * G * math.cos(angle)
        if slope < mu:
            yield Comparison(
                name, "acceleration over g [-]", 0.0, gained / G, 0.01, "sticks: tan of the angle below mu = 0.4"
            )
            yield Comparison(
                name, "friction over normal force [-]", slope, float(-force[0] / force[2]), 0.02, "tan of the angle"
            )
        else:
            want = G * (math.sin(angle) - mu * math.cos(angle))
            yield Comparison(name, "acceleration [m/s^2]", want, gained, 0.02, "g (sin - mu cos)")
        yield Comparison(name, "force on the board [N]", -normal, float(force[2]), 0.01, "m g cos")


def _constant(pull: FloatArray, time: float) -> FloatArray:
    return pull


def discs(options: SuiteOptions) -> Iterator[Comparison]:
    """Two discs that meet on a shared grid feel each other before they touch; the transfers take energy from them."""
    source = "two discs (Sulsky, Chen and Schreyer 1994)"
    losses = []
    for cells in (20,) if options.quick else (20, 40):
        dx = 40e-3 / cells
        gap, momentum, energy = _meet(options, dx)
        losses.append(1 - energy)
        name = f"two discs of {cells} cells"
        yield Comparison(name, "momentum gained over that of one disc [-]", 0.0, momentum, 1e-10, source)
        yield Comparison(name, "energy after over before [-]", 1.0, energy, 0.10, "elastic impact")
        # a quadratic kernel reaches 1.5 cells from either body (early contact, Bardenhagen et al. 2000)
        yield Comparison(name, "gap at which they feel each other, in cells [-]", 0.0, gap / dx, 3.0, source)
    if not options.quick:
        ratio = losses[0] / losses[1]
        yield Comparison(
            "two discs", "loss of energy over that on half the cells [-]", 2.0, ratio, 0.1, "first order", least=True
        )


def _meet(options: SuiteOptions, dx: float) -> tuple[float, float, float]:
    """Gap when the first disc has lost 1 % of its speed [m], change of momentum and energy after the impact [-]."""
    radius, thick, apart, speed = 0.02, 0.01, 0.016, 0.5
    material = Material(E=1e5, nu=0.3, rho=1000.0)

    def place(x: FloatArray) -> FloatArray:
        upper = x[:, 2] > thick
        return x + np.where(upper[:, None], [apart, apart, -thick], [-apart, -apart, 0.0])

    def velocity(x: FloatArray) -> FloatArray:
        return np.where(x[:, :1] + x[:, 1:2] > 0, [-speed, -speed, 0.0], [speed, speed, 0.0])

    body = options.body(
        Shape("upright_cylinder", 2 * radius, 2 * radius, 2 * thick),
        material,
        numerics(dx, room=1.0),
        InitialState(place, velocity),
    )
    first = body.start[:, 0] + body.start[:, 1] < 0
    p0 = body.mass * body.v.sum(axis=0)
    size = body.mass * speed * first.sum()
    body.step(1)
    before, gap = body.kinetic + body.elastic, math.nan
    for _ in range(400):
        body.step(2)
        x, v = body.x, body.v
        along = float(v[first, :2].sum(axis=1).mean() - v[~first, :2].sum(axis=1).mean()) / (4 * speed)
        distance = float(np.linalg.norm((x[first] - x[~first].mean(axis=0)).mean(axis=0)[:2]))
        if math.isnan(gap) and along < 0.99:
            gap = distance - 2 * radius
        if along < 0 and distance > 2 * radius + 2 * dx:
            break
    momentum = float(np.abs(body.mass * body.v.sum(axis=0) - p0).max()) / size
    return gap, momentum, (body.kinetic + body.elastic) / before


def hertz(options: SuiteOptions) -> Iterator[Comparison]:
    """A plate on half a lying cylinder of nu = 0, for which plane strain and free ends are the same.

    Hertz's formula says how far the plate goes. It takes the cylinder for a half-space, which is too stiff, so that the
    force is compared with that of finite elements. See docs/theory.md, "Measured choices".
    """
    radius, share = 0.04, CONTACT_SHARE
    half = share * radius  # half the width of the contact
    line = math.pi * SOFT.E * half**2 / (4 * radius)
    way = line / (math.pi * SOFT.E) * (2 * math.log(4 * radius / half) - 1)
    force = between_plates(radius, way)
    for cells in (4,) if options.quick else (4, 8):
        dx = half / cells
        scene = Scene(
            Food(Shape("half_cylinder", 4 * dx, 2 * radius, radius), replace(SOFT, loss_factor=0.05)),
            Press(),
            Motion(1.1 * way, 0.002),
            Board(0.0),
            numerics=replace(numerics(dx), mirror=True, output=way / 200),
        )
        record = options.simulate(scene)
        stroke, simulated = 0.5 * (record.stroke[1:] + record.stroke[:-1]), record.face[1:, 2] / (4 * dx)
        near = np.abs(stroke - way) < 0.1 * way
        got = float(np.polyval(np.polyfit(stroke[near], simulated[near], 1), way))
        yield Comparison(
            f"plate on a cylinder, contact of {2 * cells} cells",
            "force on its length [N/m]",
            force,
            got,
            0.05 if cells < 8 else 0.03,
            "finite elements of a cylinder between two plates, carried on to elements of no size",
        )


def between_plates(radius: float, way: float) -> float:
    """Force of finite elements on a cylinder between two plates, of which each goes a way [N/m].

    Args:
        radius: Of the cylinder [m].
        way: Of each plate [m]; half of the cylinder on a board is pressed alike.

    Returns:
        The force on the cylinder's length, carried on to elements of no size: of order 2 in the size.
    """
    whole = Shape("cylinder", radius / 10, 2 * radius, 2 * radius)
    strokes = [2 * way * k / 4 for k in range(1, 5)]
    coarse, fine = (
        float(press(whole, SOFT, strokes, elements=Elements(cells=n, order=2, grade=2.0)).force[-1])
        for n in CONTACT_ELEMENTS
    )
    few, many = CONTACT_ELEMENTS
    return (fine + (fine - coarse) / ((many / few) ** 2 - 1)) / whole.length


CASES = [
    VerificationCase("rest and friction", resting, cost=30),
    VerificationCase("tilted board", tilted, cost=30),
    VerificationCase("bounce", bouncing, cost=12),
    VerificationCase("two discs", discs, cost=45),
    VerificationCase("Hertz", hertz, fast=False, cost=200),
]
