"""Surfaces of the pieces of a food, at rest on the table, and of what is not simulated while one of them is cut."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from intsim.task.pieces import cut_ends, piece_shape
from intsim.task.targets import Item
from mpm.output.surface import half_of
from mpm.scene.shapes import Shape

OUTLINE_STEP = 3e-3  # distance of the rings of an outline [m]
AT_END = 1e-6  # distance from an end of a body within which a vertex lies on its face [m]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Attributes:
        points: Vertices [m], shape (m, 3).
        triangles: Vertices of each triangle, seen from outside against the clock, indices [-], shape (t, 3).
        flesh: Which vertices lie on the face of a cut, truth values [-], shape (m,).
    """

    points: np.ndarray
    triangles: np.ndarray
    flesh: np.ndarray

    @staticmethod
    def of(parts: list[Mesh]) -> Mesh:
        """Several as one; nothing of none."""
        parts = [*parts, Mesh(np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros(0, bool))]
        first = np.cumsum([0, *(len(part.points) for part in parts)])
        triangles = [part.triangles + start for part, start in zip(parts, first, strict=False)]
        points, flesh = (np.concatenate([getattr(part, name) for part in parts]) for name in ("points", "flesh"))
        return Mesh(points, np.concatenate(triangles), flesh)


def shape_mesh(shape: Shape, cut: tuple[bool, bool]) -> Mesh:
    """The surface of a body, its middle at y = 0.

    Args:
        shape: Its outline.
        cut: Whether its lower and its upper end along y is the face of a cut.

    Returns:
        The surface, x along the blade, z up.
    """
    shape = replace(shape, cut=0.0)
    halves = [half_of(shape, OUTLINE_STEP, side) for side in (-1.0, 1.0)]
    points = np.concatenate([half.points for half in halves])
    triangles = np.concatenate([halves[0].triangles, halves[1].triangles + len(halves[0].points)])
    low, high = shape.ends
    flesh = np.zeros(len(points), bool)
    for end, there in zip((low, high), cut, strict=True):
        flesh |= there & (np.abs(points[:, 1] - end) < AT_END)
    return Mesh(points, triangles, flesh)


def piece_mesh(item: Item, which: int) -> Mesh:
    """The surface of a piece on the table [m, world]; args: the food, and the number of the piece."""
    piece = item.pieces[which]
    own = shape_mesh(piece_shape(item, which), cut_ends(item, which))
    return replace(own, points=item.placed(own.points, (piece.low + piece.high) / 2 + piece.shift))


def item_mesh(item: Item, without: int | None = None) -> Mesh:
    """The surfaces of all pieces of a food on the table.

    Args:
        item: The food.
        without: Number of a piece that is left out.

    Returns:
        The surfaces [m, world]; empty where nothing is left.
    """
    return Mesh.of([piece_mesh(item, k) for k in range(len(item.pieces)) if k != without])


def standing_mesh(item: Item) -> Mesh:
    """The surfaces of all pieces of a food where it stands [m, world]: on the board or on the table beside it."""
    mesh = item_mesh(item)
    return replace(mesh, points=mesh.points + [0.0, 0.0, item.base or 0.0])


def rigid_motion(rest: np.ndarray, now: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The turn and shift that bring points nearest to where they are now (Kabsch 1976, Acta Cryst. A 32:922).

    Args:
        rest, now: Points before and after [m], shape (n, 3) each.

    Returns:
        Rotation (3, 3) and shift (3,) [m]: a point p has come to ``R @ p + shift``.
    """
    a, b = rest.mean(axis=0), now.mean(axis=0)
    u, _, vt = np.linalg.svd((rest - a).T @ (now - b))
    sign = np.sign(np.linalg.det(u @ vt))
    turn = vt.T @ np.diag([1.0, 1.0, sign]) @ u.T
    return turn, b - turn @ a


class Ends:
    """The ends of a long piece that are not simulated: each goes with the face of the simulated part beside it.

    Args:
        shape: What is simulated, of parallel sides, the blade at y = 0.
        whole: The piece, the blade at y = 0.
        cut: Whether the piece's lower and upper end is the face of a cut.
        rest: Vertices of the simulated surface at rest [m], shape (m, 3).
    """

    def __init__(self, shape: Shape, whole: Shape, cut: tuple[bool, bool], rest: np.ndarray) -> None:
        self._rest = rest
        self._parts: list[tuple[Mesh, np.ndarray]] = []
        for k, side in enumerate((-1.0, 1.0)):
            length = side * (whole.ends[k] - shape.ends[k])
            if length < AT_END:
                continue
            face = np.flatnonzero(np.abs(rest[:, 1] - shape.ends[k]) < AT_END)
            faces = (cut[0], False) if k == 0 else (False, cut[1])
            own = shape_mesh(replace(shape, length=max(length, 1e-3), cut=0.0), faces)
            middle = shape.ends[k] + side * max(length, 1e-3) / 2
            self._parts.append((replace(own, points=own.points + [0.0, middle, 0.0]), face))

    def now(self, points: np.ndarray) -> list[Mesh]:
        """Where they are, the simulated surface's vertices being at ``points`` (m, 3) [m]."""
        out = []
        for mesh, face in self._parts:
            turn, shift = rigid_motion(self._rest[face], points[face])
            out.append(replace(mesh, points=mesh.points @ turn.T + shift))
        return out
