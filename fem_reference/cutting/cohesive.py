"""A plane that parts with a traction-separation law, and an edge that pays on it what the opening has not."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from fem_reference.contact import Wedge
from fem_reference.solid import EquilibriumError
from fem_reference.surface import SurfacePoints


@dataclass(frozen=True)
class Cohesion:
    """Traction over half the opening v of a plane of symmetry: linear softening of area ``toughness`` for both halves.

    ``sigma(v) = stiffness v`` up to the strength and from there ``strength (1 - (v - v0) / (vf - v0))``, with
    ``v0 = strength / stiffness`` and ``vf = toughness / strength`` where nothing is carried any more. The stiffness
    stands for a rigid tie and does not change the area. Below the largest v so far the traction runs straight to the
    origin (damage: Camacho and Ortiz 1996). Closed halves press on each other with the same stiffness.

    Attributes:
        toughness: Work of new surface R [J/m^2], per area of the plane.
        strength: Largest traction [Pa].
        stiffness: Traction per half opening before the strength is reached [Pa/m].
    """

    toughness: float
    strength: float
    stiffness: float

    def __post_init__(self) -> None:
        if not self.first < self.last:
            raise EquilibriumError("cohesive law: the tie gives way before it is stretched; make it stiffer")

    @property
    def first(self) -> float:
        """Half opening at which the strength is reached [m]."""
        return self.strength / self.stiffness

    @property
    def last(self) -> float:
        """Half opening at which nothing is carried any more [m]."""
        return self.toughness / self.strength

    @property
    def slope(self) -> float:
        """Fall of the traction per half opening as it softens [Pa/m]."""
        return self.strength / (self.last - self.first)

    def envelope(self, v: np.ndarray) -> np.ndarray:
        """Traction at half openings that were never larger [Pa], shape (n,)."""
        soft = self.slope * (self.last - v)
        return np.where(v < self.first, self.stiffness * v, np.maximum(soft, 0.0))

    def work(self, v: np.ndarray) -> np.ndarray:
        """Area under the envelope up to v, of one half [J/m^2], shape (n,)."""
        left = np.maximum(self.last - v, 0.0) ** 2 * self.slope / 2
        return np.where(v < self.first, 0.5 * self.stiffness * v**2, self.toughness / 2 - left)

    def traction(self, v: np.ndarray, most: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Traction [Pa] and its derivative [Pa/m], shape (n,) each.

        Args:
            v: Half openings [m], shape (n,), 0 and more.
            most: Largest half openings before [m], shape (n,).

        Returns:
            Tractions; derivatives.
        """
        fresh = v >= most
        top = np.maximum(most, self.first)  # up to the first peak it is elastic whatever was before
        secant = self.envelope(top) / top
        slope = np.where(v < self.last, -self.slope, 0.0)
        slope = np.where(v < self.first, self.stiffness, slope)
        return np.where(fresh, self.envelope(v), secant * v), np.where(fresh, slope, secant)

    def paid(self, v: np.ndarray, most: np.ndarray) -> np.ndarray:
        """Work that one half of the tie has taken less what it gives back on closing from v [J/m^2], shape (n,).

        Args:
            v: Half openings [m], shape (n,).
            most: Largest half openings, of now as well [m], shape (n,).

        Returns:
            Work per area, shape (n,).
        """
        v, top = np.clip(v, 0.0, most), np.maximum(most, self.first)
        secant = self.envelope(top) / top
        return self.work(most) - 0.5 * secant * (most**2 - v**2)


@dataclass
class CutPlane:
    """The plane of symmetry y = 0 of a food under a blade: a cohesive tie, and the edge that cuts it.

    The energy of the plane is ``D = integral of R - (1 - c) (R - phi)`` over its area: phi is what the tie has taken
    and c, from 0 to 1, how far the edge has cut the point, a smooth step over ``band`` about the edge's height. All
    forces are derivatives of D: the tie pulls with (1 - c) sigma, and the edge presses a point down with (R - phi)
    dc/dz. So each point costs R in all, whoever pays it.

    Attributes:
        points: Points of the plane.
        law: Traction-separation law.
        edge: Wedge whose height is that of the edge; None for a plane that nothing cuts.
        band: Height over which the edge cuts [m].
        drag: Traction against each change of the half opening since the last equilibrium [Pa/m], 0 for none. With the
            softening's slope, ``law.slope``, the plane's energy is convex: a step of the proximal point method.
        most: Largest half openings so far [m], shape (n,).
        cut: How far each point is cut, from 0 to 1, shape (n,).
    """

    points: SurfacePoints
    law: Cohesion
    edge: Wedge | None
    band: float
    drag: float = 0.0
    most: np.ndarray = field(init=False)
    cut: np.ndarray = field(init=False)
    symmetric = True

    def __post_init__(self) -> None:
        self.most = np.zeros(len(self.points.areas))
        self.cut = np.zeros(len(self.points.areas))
        self._before = np.zeros(len(self.points.areas))

    @property
    def unknowns(self) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`."""
        return self.points.unknowns

    def _cut(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """How far points at heights z are cut, with the first and second derivative by z."""
        zero = np.zeros_like(z)
        if self.edge is None:
            return self.cut, zero, zero
        t = np.clip((z - self.edge.height) / self.band + 0.5, 0.0, 1.0)
        c, slope, bend = t**2 * (3 - 2 * t), 6 * t * (1 - t) / self.band, (6 - 12 * t) / self.band**2
        on = (c >= self.cut) & (t > 0) & (t < 1)
        return np.maximum(c, self.cut), np.where(on, slope, 0.0), np.where(on, bend, 0.0)

    def force(self, x: np.ndarray) -> np.ndarray:
        """See :class:`fem_reference.solid.Surface`; of one half."""
        return self.points.spread(self.tractions(x))

    def tractions(self, x: np.ndarray) -> np.ndarray:
        """Force on each point of one half [N], shape (n, 3): of the tie along y, of the edge along z."""
        _, v, z = self.points.at(x).T
        c, slope, _ = self._cut(z)
        open_ = np.maximum(v, 0.0)
        sigma, _ = self.law.traction(open_, self.most)
        left = self.law.toughness / 2 - self.law.paid(open_, np.maximum(self.most, open_))
        pull = np.where(v < 0, self.law.stiffness * v, (1 - c) * sigma) + self.drag * (v - self._before)
        return -self.points.areas[:, None] * np.stack([np.zeros_like(v), pull, left * slope], axis=1)

    def stiffness(self, x: np.ndarray) -> sp.csr_matrix:
        """See :class:`fem_reference.solid.Surface`."""
        _, v, z = self.points.at(x).T
        c, slope, bend = self._cut(z)
        open_ = np.maximum(v, 0.0)
        sigma, change = self.law.traction(open_, self.most)
        left = self.law.toughness / 2 - self.law.paid(open_, np.maximum(self.most, open_))
        blocks = np.zeros((len(v), 3, 3))
        blocks[:, 1, 1] = np.where(v < 0, self.law.stiffness, (1 - c) * change) + self.drag
        blocks[:, 1, 2] = blocks[:, 2, 1] = np.where(v < 0, 0.0, -slope * sigma)
        blocks[:, 2, 2] = left * bend
        return self.points.stiffness(self.points.areas[:, None, None] * blocks)

    def commit(self, x: np.ndarray) -> None:
        """Remember the largest openings and what is cut."""
        _, v, z = self.points.at(x).T
        self.cut, _, _ = self._cut(z)
        self.most, self._before = np.maximum(self.most, v), v

    def spent(self, x: np.ndarray) -> np.ndarray:
        """Work that the tie of both halves has taken at each point [J/m^2], shape (n,), whether cut or not."""
        v = self.points.at(x)[:, 1]
        return 2 * self.law.paid(v, np.maximum(self.most, v))
