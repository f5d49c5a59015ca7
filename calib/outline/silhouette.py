"""From a silhouette to the food that it is of: turned about its axis, bent, or as long as it was made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import ShapeError
from calib.outline.crossings import check_once, crossings, lines, of_polygon
from mpm.arrays import FloatArray
from mpm.scene.outline import ACROSS, ALONG, Sections, bent, extruded, places, revolved

REVOLVED, HALF, BENT, EXTRUDED = "revolved", "half", "bent", "extruded"
WAYS = (REVOLVED, HALF, BENT, EXTRUDED)
"""How a silhouette becomes a food."""
ROUGH = 2.5
"""Unevenness of an outline that is taken for the picture's [pixels]."""
LEVEL = 0.01
"""The same over the height."""
FOLD = 0.03
"""A line across may leave the food for this part of the silhouette's height and enter it again: hairs, a rough edge."""
CURVED = 0.05
"""A middle line that leaves its axis by more than this part of the length is said to be bent."""
ROUND = 1.02
"""Least ratio of the two radii of gyration of a silhouette that has a long axis."""
RESTS = 0.05
"""The centre of mass may lie this part of the width beside what a food stands on."""


@dataclass(frozen=True, eq=False)
class Sized:
    """A food with its sizes.

    Attributes:
        sections: Its table.
        length: Across the blade [m], None where the outline does not say it.
        width: Along the blade [m].
        height: Upwards [m].
        said: What must be known of it, one sentence each.
    """

    sections: Sections
    length: float | None
    width: float
    height: float
    said: tuple[str, ...] = ()


def food_of(path: Path, points: FloatArray, pixel: float, way: str) -> Sized:
    """The food of a silhouette.

    Args:
        path: Its file, for errors.
        points: Corners of the silhouette, to the right and upwards [m], shape (k, 2).
        pixel: Size of a pixel [m].
        way: One of :data:`WAYS`.

    Returns:
        The food.

    Raises:
        ShapeError: The silhouette cannot become one in this way.
    """
    if way == EXTRUDED:
        return _extruded(path, points, pixel)
    if way == HALF:
        return _half(path, points, pixel)
    points = _level(points)
    low, high, lower, upper = _flanks(path, points, pixel, places(ALONG))
    widths = upper - lower
    if way == BENT:
        left, right = -upper, -lower
        middle, reach = float(left.min() + right.max()) / 2, float(right.max() - left.min()) / 2
        return Sized(
            bent((left - middle) / reach, (right - middle) / reach), high - low, 2 * reach, float(widths.max())
        )
    half = float(widths.max()) / 2
    centre = (lower + upper) / 2
    off = float(np.ptp(centre[widths > half])) / 2
    said: tuple[str, ...] = ()
    if off > CURVED * (high - low):
        said = (
            f"{path.name}: the middle of the silhouette lies up to {off * 1e3:.1f} mm beside its axis, and is taken "
            f"for straight; --outline-as {BENT} follows it",
        )
    return Sized(revolved(widths / 2 / half), high - low, 2 * half, 2 * half, said)


def _level(points: FloatArray) -> FloatArray:
    """The polygon with its long axis level; what was on the left stays there, of an upright one what was below."""
    x, z = points.T
    x1, z1 = np.roll(points, -1, axis=0).T
    cross = x * z1 - x1 * z
    area = cross.sum() / 2
    centre = np.array([((x + x1) * cross).sum(), ((z + z1) * cross).sum()]) / (6 * area)
    x, z, x1, z1 = x - centre[0], z - centre[1], x1 - centre[0], z1 - centre[1]
    cross = x * z1 - x1 * z
    xx, zz = (((a * a + a * b + b * b) * cross).sum() / (12 * area) for a, b in ((x, x1), (z, z1)))
    xz = ((x * z1 + 2 * x * z + 2 * x1 * z1 + x1 * z) * cross).sum() / (24 * area)
    size, axes = np.linalg.eigh(np.array([[xx, xz], [xz, zz]]))
    if size[1] < ROUND**2 * size[0]:
        return points
    long = axes[:, 1]
    upright = abs(long[1]) > abs(long[0])
    long = long * np.sign(long[1] if upright else long[0])
    return np.asarray((points - centre) @ np.column_stack([long, [-long[1], long[0]]]))


def _flanks(
    path: Path, points: FloatArray, pixel: float, at: FloatArray
) -> tuple[float, float, FloatArray, FloatArray]:
    """Where a silhouette begins and ends, and its lower and upper flank at parts -1 to 1 of the way between [m]."""
    low, high = float(points[:, 0].min()), float(points[:, 0].max())
    x = lines(low, high, at)
    found = crossings(of_polygon(points), x)
    allowed = max(ROUGH * pixel, FOLD * float(np.ptp(points[:, 1])))
    check_once(str(path), found, x - low, allowed, "line across the silhouette")
    return low, high, found.low, found.high


def _half(path: Path, points: FloatArray, pixel: float) -> Sized:
    """A food halved along its axis, seen from the side, on its flat face."""
    low, high, lower, upper = _flanks(path, points, pixel, places(ALONG))
    base, top = float(np.quantile(lower, 0.25)), float(upper.max())
    uneven = np.abs(lower - base)[np.abs(places(ALONG)) < 0.95]
    allowed = max(ROUGH * pixel, LEVEL * (top - base))
    if float(uneven.max()) > allowed:
        raise ShapeError(
            f"{path}: the lower edge of a half food is level, but this one is off by {uneven.max() * 1e3:.1f} mm; turn "
            f"the picture until the flat face lies below and level, or say --outline-as {REVOLVED}"
        )
    radius = np.maximum(upper - base, 0.0)
    return Sized(revolved(radius / radius.max(), halved=True), high - low, 2 * (top - base), top - base)


def _extruded(path: Path, points: FloatArray, pixel: float) -> Sized:
    """A food whose section in the plane of the cut is the silhouette, as it stands in the picture."""
    at = places(ACROSS)
    low, high, lower, upper = _flanks(path, points, pixel, at)
    base, top = float(lower.min()), float(upper.max())
    weight = (upper - lower) * np.sqrt(1 - at**2)
    x = lines(low, high, at)
    mass = float((weight * x).sum() / weight.sum())
    rests = x[lower <= base + max(ROUGH * pixel, LEVEL * (top - base))]
    beside = max(rests.min() - mass, mass - rests.max(), 0.0)
    if beside > RESTS * (high - low):
        raise ShapeError(
            f"{path}: the food does not stand as it is in the picture: its middle lies {beside * 1e3:.1f} mm beside "
            "what touches the board; turn the picture until it does"
        )
    return Sized(extruded((lower - base) / (top - base), (upper - base) / (top - base)), None, high - low, top - base)
