"""Meshes that are drawn: triangles with a paint each, and simple bodies to make furniture of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from intsim.render.texture import PLAIN

CELL = 0.4  # largest side of a rectangle that is drawn as two triangles [m]: those behind a camera are left out


@dataclass(frozen=True)
class Paint:
    """How a surface looks.

    Attributes:
        first, second: Its colours, red, green, blue, as a screen shows them [-].
        kind: One of the kinds of :mod:`intsim.render.texture`.
        scale, b, c: Its numbers, as :func:`intsim.render.texture.part_of_second` reads them.
        gloss: How much it shines [-]; from 2 on it glows by itself.
    """

    first: tuple[float, float, float]
    second: tuple[float, float, float] = (0.0, 0.0, 0.0)
    kind: int = PLAIN
    scale: float = 0.0
    b: float = 0.0
    c: float = 0.0
    gloss: float = 0.0

    @property
    def row(self) -> list[float]:
        """As the kernels take it, (11,)."""
        return [float(self.kind), *self.first, *self.second, self.scale, self.b, self.c, self.gloss]


@dataclass(frozen=True, eq=False)
class Drawn:
    """A mesh that is drawn.

    Attributes:
        points: Vertices [m], shape (n, 3).
        triangles: Vertices of each, seen from outside against the clock, indices, shape (t, 3).
        paint_of: Row of ``paints`` of each triangle, shape (t,).
        paints: How they look.
        ref: Place of each vertex on the body [m], and on its section over half its width and height, shape (n, 5).
    """

    points: np.ndarray
    triangles: np.ndarray
    paint_of: np.ndarray
    paints: tuple[Paint, ...]
    ref: np.ndarray

    @staticmethod
    def of(points: np.ndarray, triangles: np.ndarray, paint: Paint) -> Drawn:
        """Of one paint; the place on the body is the place in space.

        Args:
            points: Vertices [m], shape (n, 3).
            triangles: Numbers of their vertices [-], shape (t, 3).
            paint: How it looks.

        Returns:
            The body.
        """
        ref = np.column_stack([points, np.zeros((len(points), 2))])
        return Drawn(np.asarray(points, float), triangles, np.zeros(len(triangles), int), (paint,), ref)

    @staticmethod
    def all(parts: list[Drawn]) -> Drawn:
        """Several as one.

        Args:
            parts: At least one.
        """
        vertex = np.cumsum([0, *(len(p.points) for p in parts)])
        paint = np.cumsum([0, *(len(p.paints) for p in parts)])
        return Drawn(
            np.concatenate([p.points for p in parts]),
            np.concatenate([p.triangles + k for p, k in zip(parts, vertex, strict=False)]),
            np.concatenate([p.paint_of + k for p, k in zip(parts, paint, strict=False)]),
            tuple(own for p in parts for own in p.paints),
            np.concatenate([p.ref for p in parts]),
        )

    def moved(self, place: tuple[float, float, float], yaw: float = 0.0) -> Drawn:
        """Turned about the vertical [rad] and then moved [m]; its looks go with it."""
        c, s = np.cos(yaw), np.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return replace(self, points=self.points @ turn.T + place)


def box(low: tuple[float, float, float], high: tuple[float, float, float], paint: Paint) -> Drawn:
    """A box, each side with vertices of its own.

    Args:
        low, high: Two corners x, y, z [m].
        paint: How it looks.

    Returns:
        The box.
    """
    a, b = np.array(low, float), np.array(high, float)
    points, triangles, first = [], [], 0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        n, m = (int(np.ceil((b - a)[k] / CELL)) for k in (u, v))
        grid = np.stack(np.meshgrid(np.linspace(a[u], b[u], n + 1), np.linspace(a[v], b[v], m + 1), indexing="ij"), -1)
        k = np.arange(n)[:, None] * (m + 1) + np.arange(m)
        quads = np.stack([k, k + m + 1, k + m + 2, k + 1], axis=-1).reshape(-1, 4)
        for at, turned in ((b[axis], False), (a[axis], True)):
            corner = np.empty((grid[..., 0].size, 3))
            corner[:, axis], corner[:, u], corner[:, v] = at, grid[..., 0].ravel(), grid[..., 1].ravel()
            own = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
            points.append(corner)
            triangles.append((own[:, ::-1] if turned else own) + first)
            first += len(corner)
    return Drawn.of(np.concatenate(points), np.concatenate(triangles), paint)


def lathe(profile: list[tuple[float, float]], paint: Paint, around: int = 16) -> Drawn:
    """A body of revolution about the vertical: bottles, bowls, pots.

    Args:
        profile: Radius and height [m] from below to above along its outside; a radius of 0 closes it.
        paint: How it looks.
        around: Vertices of a ring.

    Returns:
        The body.
    """
    angle = 2 * np.pi * np.arange(around) / around
    points = np.concatenate(
        [np.stack([r * np.cos(angle), r * np.sin(angle), np.full(around, z)], 1) for r, z in profile]
    )
    k = np.arange(around)
    after = np.roll(k, -1)
    rows = []
    for ring in range(len(profile) - 1):
        low, high = ring * around, (ring + 1) * around
        rows += [np.stack([low + k, low + after, high + after], 1), np.stack([low + k, high + after, high + k], 1)]
    return Drawn.of(points, np.concatenate(rows), paint)


def clustered(
    points: np.ndarray, triangles: np.ndarray, parts: np.ndarray, cell: float
) -> tuple[np.ndarray, np.ndarray]:
    """A coarser mesh: vertices in one cell of a lattice become one of them (Rossignac and Borrel 1993).

    Args:
        points: Vertices [m], shape (n, 3).
        triangles: Numbers of their vertices [-], shape (t, 3).
        parts: Number of the part of the surface that each vertex is of [-], shape (n,); those of two are kept apart.
        cell: Width of a cell [m].

    Returns:
        Which vertices are kept (m,), and triangles of these.
    """
    key = np.column_stack([parts, np.floor(points / cell).astype(int)])
    _, inverse = np.unique(key, axis=0, return_inverse=True)
    inverse = inverse.reshape(-1)
    count = np.bincount(inverse)
    middle = np.stack([np.bincount(inverse, points[:, k]) for k in range(3)], 1) / count[:, None]
    off = np.linalg.norm(points - middle[inverse], axis=1)
    order = np.lexsort((off, inverse))
    kept = order[np.concatenate([[0], np.cumsum(count)[:-1]])]
    coarse = inverse[triangles]
    whole = (coarse[:, 0] != coarse[:, 1]) & (coarse[:, 1] != coarse[:, 2]) & (coarse[:, 2] != coarse[:, 0])
    return kept, coarse[whole]
