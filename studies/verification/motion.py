"""Motions with closed forms: conservation, waves, vibration, a manufactured solution."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq
from scipy.special import spherical_jn

from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification import generalised_vortex
from studies.verification.case import Case, How, Row

DX = 2.5e-3
SOFT = Material(E=1e5, nu=0.0, rho=1000.0)
BLOCK = Shape("block", 0.03, 0.02, 0.025)
SHEAR = np.array([[0.2, 3.0, -1.0], [-2.0, 0.5, 0.7], [1.1, -0.4, -0.6]])


def numerics(dx: float = DX, gravity: float = 0.0, room: float = 0.5, safety: float = 0.7, ppc: int = 2) -> Numerics:
    """A grid for a whole body."""
    return Numerics(dx=dx, gravity=gravity, room=room, mirror=False, safety=safety, ppc=ppc)


def conserved(how: How) -> Iterator[Row]:
    """A block that spins and stretches keeps its momenta; an affine velocity is transferred unchanged."""
    body = how.body(
        BLOCK,
        SOFT,
        numerics(),
        velocity=lambda x: (x - [0, 0, BLOCK.height / 2]) @ SHEAR.T + 0.02,
        slope=lambda x: np.tile(SHEAR, (len(x), 1, 1)),
    )
    v0, l0 = body.v, body.spin()
    p0 = body.mass * v0.sum(axis=0)
    middle = (
        np.abs(body.start - [0, 0, BLOCK.height / 2])
        < np.array([BLOCK.width, BLOCK.length, BLOCK.height]) / 2 - 1.6 * DX
    )
    inner = middle.all(axis=1)
    body.step(1, dt=1e-9)  # so short that no stress has grown
    miss = max(
        np.abs(body.v - v0)[inner].max() / np.abs(v0).max(),
        np.abs(body.gradient - SHEAR)[inner].max() / np.abs(SHEAR).max(),
    )
    yield Row(
        "affine patch",
        "largest error of v and of its gradient [-]",
        0.0,
        float(miss),
        1e-6,
        "exact transfer of affine fields",
    )
    body.step(50 if how.quick else 150)
    p, turn = body.mass * body.v.sum(axis=0), body.spin()
    yield Row(
        "free block, momentum",
        "change over its size [-]",
        0.0,
        float(np.abs(p - p0).max() / np.abs(p0).max()),
        1e-11,
        "Newton",
    )
    yield Row(
        "free block, angular momentum",
        "change over its size [-]",
        0.0,
        float(np.abs(turn - l0).max() / np.abs(l0).max()),
        1e-10,
        "Euler; affine transfers keep it (Jiang et al. 2015)",
    )


def spinning(how: How) -> Iterator[Row]:
    """A body that turns rigidly carries no stress."""
    omega = 100.0
    turn = np.array([[0, -omega, 0], [omega, 0, 0], [0, 0, 0.0]])
    stiff = Material(E=1e7, nu=0.3, rho=1000.0)
    body = how.body(
        BLOCK, stiff, numerics(), velocity=lambda x: x @ turn.T, slope=lambda x: np.tile(turn, (len(x), 1, 1))
    )
    steps = math.ceil((0.02 if how.quick else 0.1) * 2 * math.pi / omega / body.dt)
    energy = body.mass * 0.5 * (body.v**2).sum()
    body.step(steps)
    radius = np.hypot(*(body.x[:, :2] - body.x[:, :2].mean(axis=0)).T) / np.hypot(
        *(body.start[:, :2] - body.start[:, :2].mean(axis=0)).T
    )
    # centrifugal strain rho omega^2 r^2 / E is below 1e-3
    yield Row("rigid spin", "mean radius over that at the start [-]", 1.0, float(radius.mean()), 2e-3, "rigid motion")
    yield Row("rigid spin, elastic energy", "over kinetic energy [-]", 0.0, body.elastic / energy, 0.01, "rigid motion")


def falling(how: How) -> Iterator[Row]:
    """Free fall, summed as the time steps sum it."""
    body = how.body(BLOCK, SOFT, numerics(gravity=9.81))
    n = 50
    body.step(n)
    fall = float((body.start - body.x)[:, 2].mean())
    yield Row(
        "free fall", "way [m]", 9.81 * body.dt**2 * n * (n + 1) / 2, fall, 1e-9, "symplectic sum g dt^2 n (n + 1) / 2"
    )


def vibrating(how: How) -> Iterator[Row]:
    """A free bar swings lengthwise in its first mode.

    Particles at random places make the bar softer by the noise of the sum over them, which falls with their number and
    not with the cells: the period is 1 % long with 8 particles a cell and 0.3 % with 27.
    """
    period, loss = _swing(how, 3e-3, 3, 2)
    yield Row(
        "free bar of 26 cells, 27 particles a cell",
        *period,
        0.005,
        "2 L / sqrt(E / rho), nu = 0 (de Vaucorbeil et al. 2020)",
    )
    if how.quick:
        return
    period, loss = _swing(how, 1.5e-3, 2, 4)
    yield Row("free bar of 52 cells, 8 particles a cell", *period, 0.02, "2 L / sqrt(E / rho), nu = 0")
    yield Row("free bar of 52 cells", "loss of amplitude in a period [-]", 0.0, loss, 0.005, "undamped")


def _swing(how: How, dx: float, ppc: int, swings: int) -> tuple[tuple[str, float, float], float]:
    """Period of a free bar of 78 mm, expected and got, and the part of its amplitude that a period takes."""
    bar = Shape("block", 0.078, 0.012, 0.012)
    k = math.pi / bar.length

    def velocity(x: np.ndarray) -> np.ndarray:
        return 0.02 * np.outer(-np.sin(k * x[:, 1]), [0.0, 1.0, 0.0])

    body = how.body(bar, SOFT, numerics(dx, room=0.1, ppc=ppc), velocity=velocity)
    mode = np.sin(k * body.start[:, 1])
    period = 2 * bar.length / math.sqrt(SOFT.E / SOFT.rho)
    times, amplitude = [], []
    for _ in range(math.ceil((swings + 0.4) * period / body.dt / 8)):
        body.step(8)
        times.append(body.time)
        amplitude.append(float(mode @ body.v[:, 1]))
    t, a = np.array(times), np.array(amplitude)
    got, zeros = _period(t, a)
    peaks = [np.abs(a[(t > z) & (t < z + period / 2)]).max() for z in zeros[:-1]]
    loss = 1 - (peaks[-1] / peaks[0]) ** (1 / (len(peaks) - 1)) if len(peaks) > 1 else math.nan
    return ("period [s]", period, got), float(loss)


def breathing(how: How) -> Iterator[Row]:
    """A ball swells and shrinks in its first radial mode: the only case in which the bulk modulus rules."""
    material, radius = Material(E=1e5, nu=0.4, rho=1000.0), 0.02
    ratio = material.shear / (material.lame + 2 * material.shear)  # of the squares of the wave speeds
    x = brentq(lambda s: math.sin(s) * (1 - s * s / (4 * ratio)) - s * math.cos(s), 0.6 * math.pi, 0.99 * math.pi)
    period = 2 * math.pi * radius / (x * material.p_wave)

    def velocity(places: np.ndarray) -> np.ndarray:
        r = places - [0.0, 0.0, radius]
        s = x * np.linalg.norm(r, axis=1, keepdims=True) / radius
        return 0.05 * r / np.linalg.norm(r, axis=1, keepdims=True) * spherical_jn(1, s)

    ball = Shape("sphere", 2 * radius, 2 * radius, 2 * radius)
    body = how.body(ball, material, numerics(2.5e-3 if how.quick else 1.67e-3, ppc=3), velocity=velocity)
    mode = velocity(body.start)
    times, amplitude = [], []
    while body.time < 2.4 * period:
        body.step(2)
        times.append(body.time)
        amplitude.append(float((mode * body.v).sum()))
    got = _period(np.array(times), np.array(amplitude))[0]
    source = "first radial mode of an elastic ball (Lamb 1882)"
    yield Row("ball breathes", "period [s]", period, got, 0.03 if how.quick else 0.02, source)


def _period(t: np.ndarray, a: np.ndarray) -> tuple[float, np.ndarray]:
    """Period of an oscillation and the times at which it crosses zero upwards [s]."""
    up = np.flatnonzero((a[:-1] < 0) & (a[1:] >= 0))
    zeros = t[up] - a[up] * (t[up + 1] - t[up]) / (a[up + 1] - a[up])
    return float(np.mean(np.diff(zeros))), zeros


def turning(how: How) -> Iterator[Row]:
    """The generalised vortex."""
    cells = (4, 8) if how.quick else (4, 8, 16)
    miss = [generalised_vortex.errors(how, n, angle=0.1) for n in cells]
    order = math.log(miss[0][0] / miss[-1][0]) / math.log(cells[-1] / cells[0])
    source = "generalised vortex (Kamojjala et al. 2015) with the corotated law"
    yield Row(
        f"vortex, {cells[0]} to {cells[-1]} cells across the ring",
        "order of the error of place [-]",
        1.0,
        order,
        0.0,
        source,
        least=True,
    )
    yield Row(
        f"vortex, {cells[-1]} cells across the ring",
        "largest error over the ring's radius [-]",
        0.0,
        miss[-1][1],
        0.03,
        source,
    )


def wave(how: How) -> Iterator[Row]:
    """A plate hits a bar: rho c v behind the front until it has come back from the free end."""
    bar = Shape("block", 0.012, 0.012, 0.06 if how.quick else 0.09)
    mach = 0.004
    c = math.sqrt(SOFT.E / SOFT.rho)
    dx = 2e-3
    way = 1.6 * bar.height * mach
    scene = Scene(
        Food(bar, SOFT),
        Press(),
        Motion(max(way, 1e-4), mach),
        Board(0.0),
        numerics=Numerics(dx=dx, gravity=0.0, output=way / 400, safety=0.5),
    )
    record = how.simulate(scene)
    f, t = record.face[:, 2], record.time
    begun = t[np.argmax(f > 0.3 * f.max())]
    plateau = f[(t - begun > 0.3 * bar.height / c) & (t - begun < 0.9 * bar.height / c)].mean()
    area = bar.width * bar.length
    yield Row(
        "plate hits a bar",
        "force until the wave is back [N]",
        SOFT.rho * c * mach * c * area,
        float(plateau),
        0.02,
        "rho c v A, nu = 0",
    )
    b = -record.board[:, 2]
    arrival = t[np.argmax(b > f.max() * 0.5)] - begun
    yield Row("plate hits a bar, arrival at the board", "time [s]", bar.height / c, float(arrival), 0.05, "L / c")


CASES = [
    Case("conservation", conserved),
    Case("spin", spinning),
    Case("fall", falling),
    Case("bar", vibrating, cost=20),
    Case("ball", breathing, cost=15),
    Case("vortex", turning, cost=60),
    Case("wave", wave, cost=12),
]
