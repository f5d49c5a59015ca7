"""The generalised vortex, a manufactured solution with large rotation and shear (Kamojjala et al. 2015).

A ring of material turns about its middle by an angle that depends on radius and time; inside and outside the ring
nothing moves. The motion keeps the volume, so that with the corotated law the flat ends stay free of stress and the
surroundings at rest: no boundary condition is needed. The body force is what the stress of that motion leaves over,
in polar axes that turn with the material::

    b_r = -r alpha_t^2 - (d tau_rr/dr + (tau_rr - tau_tt) / r) / rho
    b_t =  r alpha_tt  - (d tau_rt/dr + 2 tau_rt / r) / rho
"""

from __future__ import annotations

import math

import numpy as np

from mpm.scene import Numerics
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import How

INNER, OUTER = 0.75, 1.25  # radii of the ring, in units of its mean radius
TABLE = 4001  # radii at which the body force is tabulated


def profile(r: np.ndarray) -> np.ndarray:
    """Angle over radius, 1 in the middle of the ring and 0 with its slope on its rims [-]."""
    out = 1 - 32 * (r - 1) ** 2 + 256 * (r - 1) ** 4
    return np.where((r > INNER) & (r < OUTER), out, 0.0)


class Vortex:
    """The motion and its body force.

    Attributes: radius, mean radius of the ring [m]; material; angle, largest rotation [rad]; span, time of half a swing [s].
    """

    def __init__(self, radius: float, material: Material, angle: float, span: float) -> None:
        self.radius, self.material, self.angle, self.span = radius, material, angle, span
        self.r = np.linspace(0.6, 1.4, TABLE)
        self.h = profile(self.r)
        self.slope = np.gradient(self.h, self.r)

    def places(self, start: np.ndarray, t: float) -> np.ndarray:
        """Where material points are at a time [m], shape (n, 3)."""
        r = np.hypot(start[:, 0], start[:, 1]) / self.radius
        a = self.angle * math.sin(math.pi * t / self.span) * profile(r)
        c, s = np.cos(a), np.sin(a)
        return np.stack([c * start[:, 0] - s * start[:, 1], s * start[:, 0] + c * start[:, 1], start[:, 2]], axis=1)

    def force(self, start: np.ndarray, t: float) -> np.ndarray:
        """Body force per mass on material points [m/s^2], shape (n, 3)."""
        w = math.pi / self.span
        g = self.angle * math.sin(w * t)
        turning, speeding = self.angle * w * math.cos(w * t), -w * w * g
        mu, rho, big = self.material.shear, self.material.rho, self.radius
        gamma = self.r * g * self.slope
        # V of a shear gamma in (r, t), det = 1: sqrt(B) = (B + 1) / sqrt(tr B + 2)
        rr, rt, tt = np.ones_like(gamma), gamma, 1 + gamma**2
        root = np.sqrt(rr + tt + 2)
        trr, trt, ttt = (2 * mu * (b - v / root) for b, v in ((rr, rr + 1), (rt, rt), (tt, tt + 1)))
        pull_r = np.gradient(trr, self.r) + (trr - ttt) / self.r
        pull_t = np.gradient(trt, self.r) + 2 * trt / self.r
        br = -self.r * big * (turning * self.h) ** 2 - pull_r / (rho * big)
        bt = self.r * big * speeding * self.h - pull_t / (rho * big)
        at = np.hypot(start[:, 0], start[:, 1]) / big
        radial, across = np.interp(at, self.r, br, 0, 0), np.interp(at, self.r, bt, 0, 0)
        now = self.places(start, t)
        e = now[:, :2] / np.maximum(np.hypot(now[:, 0], now[:, 1]), 1e-12)[:, None]
        out = np.zeros_like(start)
        out[:, 0], out[:, 1] = radial * e[:, 0] - across * e[:, 1], radial * e[:, 1] + across * e[:, 0]
        return out


def errors(how: How, cells: int, *, angle: float = 0.5, swing: float = 0.5) -> tuple[float, float]:
    """Root-mean-square and largest error of place of the ring's particles, over its mean radius [-].

    Args:
        how: Seed and device.
        cells: Grid cells across the ring.
        angle: Largest rotation [rad].
        swing: Part of half a swing that is simulated, 0.5 up to the largest rotation.
    """
    radius = 0.04
    dx = (OUTER - INNER) * radius / cells
    material = Material(E=1e5, nu=0.3, rho=1000.0)
    span = 2 * radius / math.sqrt(material.E / material.rho)
    vortex = Vortex(radius, material, angle, span)
    side = 2 * math.ceil(1.4 * radius / dx) * dx
    grid = Numerics(dx=dx, gravity=0.0, room=0.1, mirror=False, safety=0.35)

    def velocity(x: np.ndarray) -> np.ndarray:
        rate = angle * math.pi / span * profile(np.hypot(x[:, 0], x[:, 1]) / radius)
        return np.stack([-rate * x[:, 1], rate * x[:, 0], 0 * rate], axis=1)

    def slope(x: np.ndarray) -> np.ndarray:
        d = 1e-6 * radius
        columns = [(velocity(x + d * e) - velocity(x - d * e)) / (2 * d) for e in np.eye(3)]
        return np.stack(columns, axis=2)

    body = how.body(Shape("block", side, side, 4 * dx), material, grid, velocity=velocity, slope=slope)
    steps = math.ceil(swing * span / body.dt)
    body.step(steps, dt=swing * span / steps, pull=lambda t: vortex.force(body.start, t))
    r = np.hypot(body.start[:, 0], body.start[:, 1]) / radius
    miss = np.linalg.norm(body.x - vortex.places(body.start, body.time), axis=1)[(r > INNER) & (r < OUTER)] / radius
    return float(np.sqrt((miss**2).mean())), float(miss.max())
