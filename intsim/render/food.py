"""Foods in a picture: what skin and flesh of each look like, and meshes whose looks stay where they are on the food."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from intsim.render.mesh import Drawn, Paint, clustered
from intsim.render.texture import CITRUS, FLESH, SEEDED, SKIN, SPOTTED, STRIPED
from intsim.task.targets import Item
from mpm.scene.shapes import half_width

SECTIONS = 65  # places along a food at which its width is found
FINEST = 10  # cells over the smaller of width and height of a food at least


@dataclass(frozen=True)
class FoodLooks:
    """What a food looks like, for the eye only. Attributes: skin; flesh, the face of a cut."""

    skin: Paint
    flesh: Paint


FOOD_LOOKS = {
    "banana": FoodLooks(
        Paint((0.93, 0.80, 0.22), (0.40, 0.26, 0.10), SPOTTED, 120, 0.25, 0.12, gloss=0.15),
        Paint((0.98, 0.94, 0.76), (0.72, 0.60, 0.38), SEEDED, 3, 0.16, 0.06),
    ),
    "cucumber": FoodLooks(
        Paint((0.13, 0.36, 0.13), (0.33, 0.55, 0.22), STRIPED, 9, 0.55, 0.25, gloss=0.4),
        Paint((0.80, 0.90, 0.62), (0.95, 0.96, 0.80), SEEDED, 12, 0.45, 0.10, gloss=0.3),
    ),
    "apple": FoodLooks(
        Paint((0.75, 0.10, 0.12), (0.90, 0.70, 0.28), SKIN, 60, 0.25, 0.55, gloss=0.6),
        Paint((0.98, 0.95, 0.80), (0.36, 0.20, 0.10), SEEDED, 5, 0.24, 0.07, gloss=0.2),
    ),
    "peach": FoodLooks(
        Paint((0.97, 0.68, 0.40), (0.80, 0.22, 0.20), SKIN, 45, 0.65, 0.35),
        Paint((0.99, 0.82, 0.50), (0.72, 0.25, 0.18), FLESH, 0, 0.42, 0.75, gloss=0.2),
    ),
    "melon": FoodLooks(
        Paint((0.72, 0.76, 0.46), (0.88, 0.86, 0.70), SKIN, 160, 0.85, 0.15, gloss=0.1),
        Paint((0.98, 0.72, 0.42), (0.96, 0.86, 0.58), FLESH, 0, 0.40, 0.85, gloss=0.2),
    ),
    "orange": FoodLooks(
        Paint((0.97, 0.52, 0.08), (0.80, 0.36, 0.04), SPOTTED, 420, 0.8, 0.25, gloss=0.35),
        Paint((0.99, 0.60, 0.12), (0.99, 0.90, 0.72), CITRUS, 10, 0.88, 0.0, gloss=0.4),
    ),
    "strawberry": FoodLooks(
        Paint((0.85, 0.08, 0.12), (0.95, 0.80, 0.40), SPOTTED, 260, 0.85, 0.05, gloss=0.5),
        Paint((0.96, 0.36, 0.36), (0.99, 0.86, 0.82), FLESH, 0, 0.45, 0.9, gloss=0.3),
    ),
    "pear": FoodLooks(
        Paint((0.74, 0.78, 0.28), (0.55, 0.42, 0.18), SPOTTED, 260, 0.5, 0.4, gloss=0.3),
        Paint((0.98, 0.96, 0.84), (0.50, 0.34, 0.18), SEEDED, 5, 0.22, 0.06, gloss=0.2),
    ),
    "kiwi": FoodLooks(
        Paint((0.46, 0.34, 0.18), (0.30, 0.21, 0.10), SKIN, 300, 0.9, 0.3),
        Paint((0.50, 0.74, 0.22), (0.08, 0.08, 0.05), SEEDED, 22, 0.42, 0.05, gloss=0.4),
    ),
    "tomato": FoodLooks(
        Paint((0.85, 0.13, 0.08), (0.93, 0.36, 0.12), SKIN, 40, 0.3, 0.25, gloss=0.8),
        Paint((0.92, 0.33, 0.25), (0.97, 0.72, 0.42), SEEDED, 7, 0.55, 0.20, gloss=0.6),
    ),
    "lemon": FoodLooks(
        Paint((0.96, 0.86, 0.16), (0.82, 0.70, 0.08), SPOTTED, 420, 0.8, 0.2, gloss=0.35),
        Paint((0.98, 0.92, 0.52), (0.99, 0.98, 0.86), CITRUS, 9, 0.84, 0.0, gloss=0.4),
    ),
    "grape": FoodLooks(
        Paint((0.32, 0.10, 0.32), (0.52, 0.36, 0.52), SKIN, 120, 0.6, 0.2, gloss=0.5),
        Paint((0.74, 0.76, 0.48), (0.45, 0.30, 0.16), SEEDED, 2, 0.22, 0.09, gloss=0.5),
    ),
    "shine_muscat": FoodLooks(
        Paint((0.64, 0.78, 0.28), (0.82, 0.88, 0.50), SKIN, 120, 0.6, 0.2, gloss=0.6),
        Paint((0.88, 0.92, 0.66), (0.72, 0.80, 0.46), FLESH, 0, 0.3, 0.7, gloss=0.5),
    ),
    "plum": FoodLooks(
        Paint((0.36, 0.08, 0.26), (0.58, 0.42, 0.58), SKIN, 70, 0.6, 0.35, gloss=0.4),
        Paint((0.92, 0.70, 0.28), (0.62, 0.32, 0.18), FLESH, 0, 0.40, 0.8, gloss=0.4),
    ),
    "cherry": FoodLooks(
        Paint((0.52, 0.02, 0.08), (0.70, 0.10, 0.14), SKIN, 120, 0.5, 0.2, gloss=1.0),
        Paint((0.78, 0.20, 0.26), (0.80, 0.62, 0.46), FLESH, 0, 0.45, 0.8, gloss=0.5),
    ),
    "potato": FoodLooks(
        Paint((0.70, 0.56, 0.36), (0.45, 0.33, 0.20), SPOTTED, 150, 0.5, 0.6),
        Paint((0.96, 0.91, 0.68), (0.90, 0.82, 0.52), FLESH, 0, 0.7, 0.4, gloss=0.2),
    ),
}
OTHER_LOOKS = FoodLooks(Paint((0.80, 0.60, 0.40), (0.6, 0.42, 0.26), SKIN, 90, 0.6, 0.2), Paint((0.95, 0.90, 0.80)))


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
            triangles: Shape (t, 3).
            flesh: Which vertices lie on the face of a cut, shape (m,).
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
