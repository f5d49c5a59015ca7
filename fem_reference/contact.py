"""Unilateral contact of surface nodes with rigid obstacles, without friction, by an augmented Lagrangian."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np


class Obstacle(Protocol):
    """A rigid body. Its place is an attribute that the caller moves."""

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance [m], shape (n,), negative inside, and its gradient, shape (n, 3), of points (n, 3)."""
        ...


@dataclass
class Plane:
    """A half space. Attributes: point on its surface [m]; outward normal, a unit vector."""

    point: tuple[float, float, float]
    normal: tuple[float, float, float]

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :class:`Obstacle`."""
        n = np.array(self.normal)
        return (points - np.array(self.point)) @ n, np.broadcast_to(n, points.shape)


@dataclass
class Wedge:
    """A symmetric wedge along x that points down: both faces at ``half`` to the vertical, blunt up to half ``spine``.

    Attributes:
        height: Of its edge [m].
        half: Angle between a face and the vertical [rad].
        spine: Thickness above the shoulder [m], ``inf`` for none.
        fillet: Radius that rounds the shoulder [m], at most half the thickness; the faces stay tangents of it.
        single: Whether only the face at y > 0 is there, for half a body, whose points at y = 0 may be a little beyond
            it.
    """

    height: float
    half: float
    spine: float = np.inf
    fillet: float = 0.0
    single: bool = False

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See :class:`Obstacle`; below the edge it is the distance to the edge."""
        side = np.where((points[:, 1] < 0) & (not self.single), -1.0, 1.0)
        y, above = side * points[:, 1], points[:, 2] - self.height
        c, s = np.cos(self.half), np.sin(self.half)
        d = y * c - above * s
        n = np.stack([np.zeros_like(y), side * c, np.full_like(y, -s)], axis=1)
        below = y * s + above * c < 0
        size = np.hypot(y, above)
        tip = np.stack([np.zeros_like(y), side * y, above], axis=1) / np.maximum(size, 1e-300)[:, None]
        d, n = np.where(below, size, d), np.where(below[:, None], tip, n)
        flat = y - self.spine / 2
        shoulder = flat > d
        n = np.where(shoulder[:, None], np.stack([np.zeros_like(y), side, np.zeros_like(y)], axis=1), n)
        d = np.where(shoulder, flat, d)
        if self.fillet == 0:
            return d, n
        out = flat + self.fillet  # from the middle of the fillet's circle, outwards and upwards
        up = above - (self.spine / 2 - self.fillet + self.fillet / c) * c / s
        arc, size = (up < 0) & (out * s + up * c > 0), np.maximum(np.hypot(out, up), 1e-300)
        round_ = np.stack([np.zeros_like(y), side * out, up], axis=1) / size[:, None]
        return np.where(arc, size - self.fillet, d), np.where(arc[:, None], round_, n)


@dataclass
class Contact:
    """Nodes that may touch an obstacle.

    Attributes:
        obstacle: The rigid body.
        nodes: Nodes of the solid, shape (n,).
        areas: Reference area of each [m^2], shape (n,).
        penalty: Pressure per penetration [Pa/m]; it decides the number of iterations, not the result.
        tolerance: Penetration that is small enough [m].
        pressure: Multipliers: pressure on the reference area [Pa], shape (n,).
    """

    obstacle: Obstacle
    nodes: np.ndarray
    areas: np.ndarray
    penalty: float
    tolerance: float

    def __post_init__(self) -> None:
        self.pressure = np.zeros(len(self.nodes))

    def _pressure(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        d, n = self.obstacle.distance(x[self.nodes])
        return np.maximum(self.pressure - self.penalty * d, 0.0), n

    def force(self, x: np.ndarray) -> np.ndarray:
        """Force of the obstacle on each of its nodes [N], shape (n, 3), the solid's nodes being at ``x``."""
        p, n = self._pressure(x)
        return (self.areas * p)[:, None] * n

    def stiffness(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes in contact and what they add to the tangent [N/m], shape (m, 3, 3)."""
        p, n = self._pressure(x)
        on = p > 0
        return self.nodes[on], (self.areas[on] * self.penalty)[:, None, None] * n[on, :, None] * n[on, None, :]

    def penetration(self, x: np.ndarray) -> float:
        """Deepest penetration [m]."""
        return float(max(-self.obstacle.distance(x[self.nodes])[0].min(), 0.0))

    def settle(self, x: np.ndarray, part: float = 1.0) -> bool:
        """Whether penetration, and gaps that still carry pressure, are within tolerance; if not, renew the pressures.

        ``part`` is the part of the way from the old pressures to the new that is gone.
        """
        p, _ = self._pressure(x)
        d = self.obstacle.distance(x[self.nodes])[0]
        if np.abs(np.where(p > 0, d, np.minimum(d, 0.0))).max(initial=0.0) <= self.tolerance:
            return True
        self.pressure = self.pressure + part * (p - self.pressure)
        return False
