"""Where upright lines cross a closed outline, and whether each enters it once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import ShapeError
from mpm.arrays import FloatArray

RIM = 1e-6
"""The outermost lines of a table lie this part of its half width inside the outline: on the rim a line only touches."""


@dataclass(frozen=True, eq=False)
class Crossings:
    """What some upright lines cross.

    Attributes:
        low: The lowest crossing of each [m], shape (m,), NaN where it crosses nothing.
        high: The highest.
        hollow: The longest way between the two that lies outside [m], shape (m,).
        within: Most surfaces that a line has entered and not left, shape (m,): 1 unless the outline crosses itself.
    """

    low: FloatArray
    high: FloatArray
    hollow: FloatArray
    within: FloatArray


def crossings(segments: FloatArray, x: FloatArray, entering: FloatArray | None = None) -> Crossings:
    """Cross a closed outline by upright lines.

    Args:
        segments: Its pieces [m], from (x, z) to (x, z), shape (k, 2, 2); their order does not matter.
        x: Where the lines are [m], shape (m,).
        entering: 1 where a line upwards enters through a piece, -1 where it leaves [-], shape (k,); None where each
            crossing is taken for the other of the one before.

    Returns:
        What they cross.
    """
    low, high, hollow, within = (np.full(len(x), np.nan) for _ in range(4))
    first, last = segments[:, 0, 0], segments[:, 1, 0]
    for k, place in enumerate(x):
        cut = np.flatnonzero((first <= place) != (last <= place))
        if len(cut) == 0:
            continue
        a, b = segments[cut, 0], segments[cut, 1]
        z = a[:, 1] + (place - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
        order = np.argsort(z, kind="stable")
        z = z[order]
        sign = (-1.0) ** np.arange(len(z)) if entering is None else entering[cut][order]
        depth = np.cumsum(sign)
        low[k], high[k], within[k] = z[0], z[-1], depth.max()
        outside = depth[:-1] < 0.5
        hollow[k] = np.diff(z)[outside].max(initial=0.0)
    return Crossings(low, high, hollow, within)


def of_polygon(points: FloatArray) -> FloatArray:
    """The segments (k, 2, 2) of a closed polygon with the corners (k, 2)."""
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def lines(low: float, high: float, at: FloatArray) -> FloatArray:
    """Places of lines across an outline, the outermost a little within.

    Args:
        low: Where it begins [m].
        high: Where it ends [m].
        at: Parts of the way, -1 to 1 [-], shape (m,).

    Returns:
        The places [m], shape (m,).
    """
    return (low + high) / 2 + (high - low) / 2 * np.clip(at, -1 + RIM, 1 - RIM)


def check_once(where: str, found: Crossings, x: FloatArray, allowed: float, what: str) -> None:
    """Refuse an outline that a line enters more than once.

    Args:
        where: What is read, for the error.
        found: What the lines crossed.
        x: Where they are [m], shape (m,).
        allowed: Longest way outside that is taken for roughness [m].
        what: What the lines are, such as ``vertical line``.

    Raises:
        ShapeError: There is such a line.
    """
    k = int(np.nanargmax(np.nan_to_num(found.hollow)))
    if found.hollow[k] > allowed:
        raise ShapeError(
            f"{where}: a {what} enters the food twice, at {x[k] * 1e3:.1f} mm: the food is hollow or hangs over there "
            f"by {found.hollow[k] * 1e3:.1f} mm, which cannot be simulated; turn it, or fill it"
        )
