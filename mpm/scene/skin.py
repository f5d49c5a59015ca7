"""Where the skin of a food lies: the area and the direction of its surface that each particle stands for.

The outline is sampled on a lattice finer than that of the particles. The gradient of its smoothed inside test is the
surface's area with its normal, whatever the outline is. The skin is all round; the flat face of a half food has none,
for there it was halved, and the ends of a food with parallel sides have none, for there it goes on.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from mpm.scene.shapes import FLAT_DOWN, Shape, inside

SUBSAMPLES = 3  # samples along each side of a particle's cell
SMOOTHING = 1.0  # standard deviation of the filter [samples]: wide enough for the gradient of a step
MARGIN = 4  # samples beyond the outline, beyond the reach of the filter
CUT_ENDS = ("block", "cylinder", "half_cylinder")  # shapes whose ends are cut from a longer food


def skin_areas(shape: Shape, spacing: float, places: np.ndarray, mirrors: tuple[bool, bool]) -> np.ndarray:
    """Skin that each particle stands for: that which is nearest to it.

    Args:
        shape: The outline.
        spacing: Distance of the particles [m].
        places: Where they are in the uncut food [m], shape (n, 3).
        mirrors: Whether there are mirror planes x = 0 and y = 0; only x > 0 and y < 0 are modelled then.

    Returns:
        Area vectors [m^2], shape (n, 3): their length is the area, their direction that of the outward normal.
    """
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
    areas = -np.stack(np.gradient(smooth, step), -1) * step**3
    kept = np.linalg.norm(areas, axis=-1) > 1e-6 * step**2
    for axis, mirrored, sign in ((0, mirrors[0], 1.0), (1, mirrors[1], -1.0)):
        if mirrored:
            kept &= sign * points[..., axis] > 0
    ends = (points[..., 1] > near) & (points[..., 1] < far) if shape.kind in CUT_ENDS else True
    kept &= ends & ((points[..., 2] > 0) if shape.kind in FLAT_DOWN else True)
    _, owner = cKDTree(places).query(points[kept])
    return np.stack([np.bincount(owner, axis, len(places)) for axis in areas[kept].T], axis=1)


def _skinned_inside(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Which points (n, 3) lie in the food, were it whole: not halved, and without ends where it was cut off."""
    x, y, z = points.T
    if shape.kind in FLAT_DOWN:
        z = np.abs(z)
    if shape.kind in CUT_ENDS:
        y = np.full_like(y, -shape.cut)
    return inside(shape, np.column_stack([x, y, z]))


def tangents(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across each unit normal (n, 3) and across each other, (n, 3) each."""
    least = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, least)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return one, np.cross(normals, one)
