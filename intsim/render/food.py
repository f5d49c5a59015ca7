"""Foods in a picture: what skin and flesh of each look like, and meshes whose looks stay where they are on the food."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from intsim.render.mesh import Drawn, Paint, clustered
from intsim.render.texture import CITRUS, FLESH, PLAIN, SEEDED, SKIN, SPOTTED, STRIPED
from intsim.task.targets import Item
from mpm.output.food_colours import food_colours
from mpm.scene.shapes import half_width

SECTIONS = 65  # places along a food at which its width is found
FINEST = 10  # cells over the smaller of width and height of a food at least


@dataclass(frozen=True)
class FoodLooks:
    """What a food looks like, for the eye only. Attributes: skin; flesh, the face of a cut."""

    skin: Paint
    flesh: Paint


def _looks(name: str, skin: tuple[float, ...], flesh: tuple[float, ...]) -> FoodLooks:
    """Looks of a food from its colours and the patterns of skin and flesh: kind, scale, b, c and gloss of a paint."""
    own = food_colours(name)
    return FoodLooks(
        Paint(own.skin, own.skin_marks, int(skin[0]), *skin[1:]),
        Paint(own.flesh, own.flesh_marks, int(flesh[0]), *flesh[1:]),
    )


FOOD_LOOKS = {
    "banana": _looks("banana", (SPOTTED, 120, 0.25, 0.12, 0.15), (SEEDED, 3, 0.16, 0.06)),
    "cucumber": _looks("cucumber", (STRIPED, 9, 0.55, 0.25, 0.4), (SEEDED, 12, 0.45, 0.10, 0.3)),
    "apple": _looks("apple", (SKIN, 60, 0.25, 0.55, 0.6), (SEEDED, 5, 0.24, 0.07, 0.2)),
    "peach": _looks("peach", (SKIN, 45, 0.65, 0.35), (FLESH, 0, 0.42, 0.75, 0.2)),
    "melon": _looks("melon", (SKIN, 160, 0.85, 0.15, 0.1), (FLESH, 0, 0.40, 0.85, 0.2)),
    "orange": _looks("orange", (SPOTTED, 420, 0.8, 0.25, 0.35), (CITRUS, 10, 0.88, 0.0, 0.4)),
    "strawberry": _looks("strawberry", (SPOTTED, 260, 0.85, 0.05, 0.5), (FLESH, 0, 0.45, 0.9, 0.3)),
    "pear": _looks("pear", (SPOTTED, 260, 0.5, 0.4, 0.3), (SEEDED, 5, 0.22, 0.06, 0.2)),
    "kiwi": _looks("kiwi", (SKIN, 300, 0.9, 0.3), (SEEDED, 22, 0.42, 0.05, 0.4)),
    "tomato": _looks("tomato", (SKIN, 40, 0.3, 0.25, 0.8), (SEEDED, 7, 0.55, 0.20, 0.6)),
    "lemon": _looks("lemon", (SPOTTED, 420, 0.8, 0.2, 0.35), (CITRUS, 9, 0.84, 0.0, 0.4)),
    "grape": _looks("grape", (SKIN, 120, 0.6, 0.2, 0.5), (SEEDED, 2, 0.22, 0.09, 0.5)),
    "shine_muscat": _looks("shine_muscat", (SKIN, 120, 0.6, 0.2, 0.6), (FLESH, 0, 0.3, 0.7, 0.5)),
    "plum": _looks("plum", (SKIN, 70, 0.6, 0.35, 0.4), (FLESH, 0, 0.40, 0.8, 0.4)),
    "cherry": _looks("cherry", (SKIN, 120, 0.5, 0.2, 1.0), (FLESH, 0, 0.45, 0.8, 0.5)),
    "potato": _looks("potato", (SPOTTED, 150, 0.5, 0.6), (FLESH, 0, 0.7, 0.4, 0.2)),
}
OTHER_LOOKS = _looks("", (SKIN, 90, 0.6, 0.2), (PLAIN,))


@dataclass(frozen=True, eq=False)
class FoodMesh:
    """A food whose surface moves.

    Attributes:
        drawn: Its mesh as it was at first.
        kept: Which of the vertices that it was made of are drawn, shape (n,).
    """

    drawn: Drawn
    kept: np.ndarray

    @staticmethod
    def of(item: Item, points: np.ndarray, triangles: np.ndarray, flesh: np.ndarray, cell: float) -> FoodMesh:
        """A food as it lies at first.

        Args:
            item: The food.
            points: Vertices in the world [m], shape (m, 3).
            triangles: Numbers of their vertices [-], shape (t, 3).
            flesh: Which vertices lie on the face of a cut [-], shape (m,).
            cell: Width of the cells in which vertices become one [m].

        Returns:
            Its mesh: skin and flesh have vertices of their own, so that the rim of a cut is sharp.
        """
        cell = min(cell, min(item.shape.width, item.shape.height) / FINEST)
        inside = flesh[triangles].all(axis=1)
        surfaces = [_surface(points, triangles[which], cell) for which in (~inside, inside)]
        kept = np.concatenate([k for k, _ in surfaces])
        first = len(surfaces[0][0])
        joined = np.concatenate([surfaces[0][1], surfaces[1][1] + first])
        paint_of = np.repeat([0, 1], [len(t) for _, t in surfaces])
        looks = FOOD_LOOKS.get(item.name, OTHER_LOOKS)
        drawn = Drawn(points[kept], joined, paint_of, (looks.skin, looks.flesh), _places(item, points[kept]))
        return FoodMesh(drawn, kept)

    def at(self, points: np.ndarray) -> Drawn:
        """The same with its vertices (m, 3) elsewhere [m]."""
        return replace(self.drawn, points=points[self.kept])


def _surface(points: np.ndarray, triangles: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """A part of a surface, coarser; bodies that only lie beside each other are kept apart."""
    n = len(points)
    if not len(triangles):
        return np.zeros(0, int), triangles
    edges = np.concatenate([triangles[:, :2], triangles[:, 1:]])
    _, body = connected_components(
        coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), (n, n)), directed=False
    )
    used = np.unique(triangles)
    index = np.full(n, -1)
    index[used] = np.arange(len(used))
    kept, coarse = clustered(points[used], index[triangles], body[used], cell)
    return used[kept], coarse


def _places(item: Item, points: np.ndarray) -> np.ndarray:
    """Where on the food points of the world are [m], and on its section over half its width and height, (n, 5)."""
    off = points[:, :2] - [item.x, item.y]
    x, y = off @ item.across, off @ item.axis
    half, tall = item.shape.length / 2, item.shape.height / 2
    at = np.linspace(-half, half, SECTIONS)
    wide = np.array([half_width(item.shape, float(place)) for place in at[1:-1]])
    width = np.interp(y, at[1:-1], wide)
    z = points[:, 2] - points[:, 2].min() - tall
    part = width / max(item.shape.width / 2, 1e-9)
    return np.column_stack([x, y, z, x / np.maximum(width, 1e-4), z / np.maximum(tall * part, 1e-4)])
