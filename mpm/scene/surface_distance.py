"""How deep a point lies below the surface of a food whose outline is a table."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mpm.scene.outline import FLAT, Sections

FINER = 2  # points of the surface on each interval of the table
LEVELS = 33  # points up an end that is cut off, or a flank that is upright


class SurfaceDistance:
    """Distances from the surface that has a skin: all of it but the faces where a food was halved or cut off.

    The surface is sampled with its normals. The distance from the plane through the nearest sample is exact to second
    order in their spacing.

    Args:
        sections: The table.
        size: Length, width and height of the food [m].
    """

    def __init__(self, sections: Sections, size: tuple[float, float, float]) -> None:
        from scipy.spatial import cKDTree  # takes long to import

        self._scale = np.array([size[1] / 2, size[0] / 2, size[2]])
        n, m = (FINER * (count - 1) + 1 for count in sections.bottom.shape)
        n = max(n, m)  # a prism has three sections
        self._points, self._normals = self._sampled(sections, n, m)
        self._tree = cKDTree(self._points)
        self._reach = float(np.pi / 2 * np.hypot(size[0] / (n - 1), max(size[1:]) / (m - 1)))

    def __call__(self, points: np.ndarray, most: float = np.inf) -> np.ndarray:
        """Distance of points in the food from its surface [m].

        Args:
            points: Along x, along y from the food's middle, and up [m], shape (n, 3).
            most: Distance that is asked for [m]; what is deeper may be given as infinite, which takes less time.

        Returns:
            Distances [m], shape (n,).
        """
        far, which = self._tree.query(points, distance_upper_bound=most + 2 * self._reach)
        out, near = far.copy(), np.isfinite(far)
        place = which[near]
        flat = np.abs(np.einsum("nk,nk->n", self._normals[place], points[near] - self._points[place]))
        least = np.sqrt(np.maximum(far[near] ** 2 - self._reach**2, 0.0))
        out[near] = np.where(np.isfinite(flat), np.maximum(flat, least), far[near])
        return out

    def _sampled(self, sections: Sections, n: int, m: int) -> tuple[np.ndarray, np.ndarray]:
        """Points of the surface at n by m places and the normals there, (k, 3) each; NaN where there is none."""
        v, s = (np.clip(-np.cos(np.pi * (np.arange(k) / (k - 1))), -1.0, 1.0) for k in (n, m))
        left, right = sections.span(v)
        u = (left + right)[:, None] / 2 + (right - left)[:, None] / 2 * s
        inner = (left + right)[:, None] / 2 + (right - left)[:, None] / 2 * s * (1 - 1e-12)
        bottom, top = sections.surface(inner, np.broadcast_to(v[:, None], u.shape))
        sheets = [_sheet(u, v, top)]
        if not sections.halved:
            sheets.append(_sheet(u, v, bottom))
        elif (bottom >= FLAT).any():
            sheets.append(_sheet(u, v, np.where(bottom < FLAT, np.nan, bottom)))
        up = np.linspace(0.0, 1.0, LEVELS)
        for rim in (0, -1):  # upright flanks
            gap = (top - bottom)[:, rim]
            walled = np.where(gap > FLAT, gap, np.nan)[:, None] * up + bottom[:, [rim]]
            sheets.append(np.stack(np.broadcast_arrays(u[:, [rim]], v[:, None], walled), -1))
        for end, bare in zip((0, -1), sections.bare, strict=True):  # ends that are upright
            if bare:
                continue
            gap = np.where(right[end] - left[end] > FLAT, (top - bottom)[end], np.nan)
            face = bottom[end][:, None] + gap[:, None] * up
            sheets.append(np.stack(np.broadcast_arrays(u[end][:, None], v[end], face), -1))
        points = [sheet * self._scale for sheet in sheets if np.isfinite(sheet[..., 2]).any()]
        normals = [_normals(sheet) for sheet in points]
        flat, across = (np.concatenate([a.reshape(-1, 3) for a in part]) for part in (points, normals))
        there = np.isfinite(flat).all(axis=1)
        return flat[there], across[there]


def _sheet(u: np.ndarray, v: np.ndarray, z: np.ndarray) -> np.ndarray:
    """A surface over the plan, (n, m, 3)."""
    return np.stack([u, np.broadcast_to(v[:, None], u.shape), z], axis=-1)


def _normals(sheet: np.ndarray) -> np.ndarray:
    """Unit normals of a sheet of points (n, m, 3), NaN where it is no surface."""
    across = np.cross(np.gradient(sheet, axis=0), np.gradient(sheet, axis=1))
    size = np.linalg.norm(across, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(across / np.where(size > 0, size, np.nan))


@lru_cache(maxsize=8)
def surface_distance(sections: Sections, length: float, width: float, height: float) -> SurfaceDistance:
    """The distances of a food; kept, because layers and skin ask for them again.

    Args:
        sections: Its table.
        length: Across the blade [m].
        width: Along the blade [m].
        height: Upwards [m].

    Returns:
        The distances.
    """
    return SurfaceDistance(sections, (length, width, height))
