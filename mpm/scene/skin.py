"""Where the skin of a food lies: points on its outline, with the area and the normal that each stands for.

The outline is sampled on a lattice finer than that of the particles. The gradient of its smoothed inside test is the
surface's area with its normal, whatever the outline is. The skin is all round; the flat face of a half food has none,
for there it was halved, and the ends of a food with parallel sides have none, for there it goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.scene.shapes import FLAT_DOWN, Shape, inside

SUBSAMPLES = 3  # samples along each side of a particle's cell
SMOOTHING = 1.0  # standard deviation of the filter [samples]: wide enough for the gradient of a step
MARGIN = 4  # samples beyond the outline, beyond the reach of the filter
LEAST_AREA = 1e-6  # of a sample over that of its face, below which there is no surface
INSET = 1.0  # of the points behind the outline [spacings]: nodes further out have hardly any mass, so short steps
END = 2.0  # of the skin before an end that was cut off [spacings], for the same reason


@dataclass(frozen=True, eq=False)
class SkinPoints:
    """Points of the skin, each of which stands for a part of it.

    Attributes:
        x: Places in the uncut food [m], shape (m, 3).
        areas: Area of each part [m^2], shape (m,).
        normals: Its outward normal, shape (m, 3).
    """

    x: np.ndarray
    areas: np.ndarray
    normals: np.ndarray

    def __len__(self) -> int:
        return len(self.areas)


def skin_points(shape: Shape, spacing: float, mirrors: tuple[bool, bool]) -> SkinPoints:
    """Points of the skin, one for each cell of a lattice that the outline passes.

    Args:
        shape: The outline.
        spacing: Of the lattice [m].
        mirrors: Whether there are mirror planes x = 0 and y = 0; only x > 0 and y < 0 are modelled then.

    Returns:
        The points.
    """
    from scipy.ndimage import gaussian_filter  # these take long to import
    from scipy.special import ndtri

    step = spacing / SUBSAMPLES
    near, far = shape.ends
    low = np.array([0.0 if mirrors[0] else -shape.width / 2, near, 0.0])
    high = np.array([shape.width / 2, 0.0 if mirrors[1] else far, shape.height])
    first = np.floor(low / step + 1e-9).astype(int) - MARGIN
    last = np.ceil(high / step - 1e-9).astype(int) + MARGIN
    axes = [(np.arange(a, b) + 0.5) * step for a, b in zip(first, last, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    there = _skinned_inside(shape, points.reshape(-1, 3)).reshape(points.shape[:-1])
    smooth = gaussian_filter(there.astype(float), SMOOTHING)
    vectors = -np.stack(np.gradient(smooth, step), -1) * step**3
    kept = np.linalg.norm(vectors, axis=-1) > LEAST_AREA * step**2
    for axis, mirrored, sign in ((0, mirrors[0], 1.0), (1, mirrors[1], -1.0)):
        if mirrored:
            kept &= sign * points[..., axis] > 0
    if _cut_off(shape):
        kept &= (points[..., 1] > near + END * spacing) & (points[..., 1] < far - END * spacing)
    if _halved(shape):
        kept &= points[..., 2] > 0
    normals = vectors[kept] / np.linalg.norm(vectors[kept], axis=-1, keepdims=True)
    outside = -SMOOTHING * step * ndtri(np.clip(smooth[kept], 1e-9, 1 - 1e-9))  # a filtered step tells the distance
    return _gathered(points[kept] - outside[:, None] * normals, vectors[kept], spacing)


def _gathered(points: np.ndarray, vectors: np.ndarray, spacing: float) -> SkinPoints:
    """Samples (k, 3) and their area vectors (k, 3) gathered by the cells of a lattice."""
    _, cell = np.unique(np.floor(points / spacing).astype(int), axis=0, return_inverse=True)
    cell, size = cell.ravel(), np.linalg.norm(vectors, axis=1)
    areas = np.bincount(cell, size)
    x = np.stack([np.bincount(cell, size * along) for along in points.T], axis=1) / areas[:, None]
    normals = np.stack([np.bincount(cell, along) for along in vectors.T], axis=1)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return SkinPoints(x - INSET * spacing * normals, areas, normals)


def _halved(shape: Shape) -> bool:
    """Whether the food lies on the face where it was halved."""
    return shape.kind in FLAT_DOWN if shape.table is None else shape.table.halved


def _cut_off(shape: Shape) -> bool:
    """Whether its ends are cut from a longer food: those of parallel sides, but for a capsule's."""
    return shape.prism and shape.kind != "capsule"


def _skinned_inside(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Which points (n, 3) lie in the food, were it whole: not halved, and without ends where it was cut off."""
    x, y, z = points.T
    if _halved(shape):
        z = np.abs(z)
    if _cut_off(shape):
        y = np.full_like(y, -shape.cut)
    return inside(shape, np.column_stack([x, y, z]))


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each unit normal (n, 3) and across each other, (n, 3) each."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, least)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.cross(normals, one)
