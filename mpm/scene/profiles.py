"""Foods with a form of their own, as tables: drawn after what they look like, and not measured on any specimen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicSpline

from mpm.scene.outline import ALONG, Sections, bent, places, revolved

PEAR = (
    (-1.0, -0.95, -0.8, -0.5, -0.2, 0.1, 0.4, 0.7, 0.9, 1.0),
    (0.0, 0.4, 0.75, 0.98, 1.0, 0.84, 0.58, 0.42, 0.3, 0.0),
)
"""Radius of a pear over its largest along its half length: body, waist and neck, the stem's end at y > 0."""
CONE = ((-1.0, -0.92, -0.75, -0.5, 0.0, 0.5, 0.8, 0.95, 1.0), (0.0, 0.62, 0.93, 1.0, 0.86, 0.56, 0.33, 0.16, 0.0))
"""Radius of a strawberry: shoulders at y < 0, tip at y > 0."""
BEND = 0.15
"""Rise of a banana's middle above the line between its ends, over its length."""
SLENDER = 0.22
"""Its largest diameter over its length."""
TAPER = 0.55
"""Part of its half length at each end over which it tapers."""
FULL = 4
"""Exponent of a barrel along its axis: 2 is an ellipsoid, and a cylinder has no end to it."""
TABLES = ("pear", "cone", "bent", "barrel", "half_barrel")
"""Kinds of shapes that are made here."""


@lru_cache(maxsize=len(TABLES))
def profile(kind: str) -> Sections:
    """The table of a kind, one of :data:`TABLES`."""
    if kind == "bent":
        return _banana()
    if kind in ("barrel", "half_barrel"):
        return revolved((1 - np.abs(places(ALONG)) ** FULL) ** (1 / FULL), halved=kind == "half_barrel")
    return revolved(_radius(*(PEAR if kind == "pear" else CONE)))


def spread(kind: str) -> float:
    """Width over all over that of the widest section: more than 1 where a food is bent [-]."""
    if kind != "bent":
        return 1.0
    table = profile(kind)
    return 2.0 / float((table.right - table.left).max())


def _radius(at: tuple[float, ...], size: tuple[float, ...]) -> np.ndarray:
    """Radius at the places of a table, smooth through given ones; round at both ends."""
    v = places(ALONG)
    squared = CubicSpline(at, np.square(size))(v)
    radius = np.sqrt(np.maximum(squared, 0.0))
    return np.asarray(radius / radius.max())


def _banana() -> Sections:
    """Round sections about an arc in the plan, tapered to both ends; the arc's middle lies at x > 0."""
    v = places(ALONG)
    near_end = np.clip((1 - np.abs(v)) / TAPER, 0.0, 1.0)
    half = SLENDER / 2 * np.sqrt(near_end * (2 - near_end))
    middle = BEND * (1 - v**2)
    left, right = middle - half, middle + half
    centre, reach = (left.min() + right.max()) / 2, (right.max() - left.min()) / 2
    return bent((left - centre) / reach, (right - centre) / reach)
