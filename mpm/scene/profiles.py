"""Foods with a form of their own, as tables: drawn after what they look like, and not measured on any specimen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

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
ROUNDNESS = 0.5
"""Roundness of a barrel of which nothing else is said (:func:`barrel_radius`)."""
BARRELS = ("barrel", "half_barrel")
"""Kinds between a cylinder and an ellipsoid."""
FAMILY = {
    "cylinder": "barrel",
    "ellipsoid": "barrel",
    "sphere": "barrel",
    "half_cylinder": "half_barrel",
    "hemisphere": "half_barrel",
    **{kind: kind for kind in BARRELS},
}
"""The barrel that stands for a kind of whatever roundness."""
KEPT = 32
"""Tables that are kept: a fit of the roundness asks for one after the other."""
TABLES = ("pear", "cone", "bent", *BARRELS)
"""Kinds of shapes that are made here."""


@lru_cache(maxsize=KEPT)
def profile(kind: str, roundness: float | None = None) -> Sections:
    """The table of a kind.

    Args:
        kind: One of :data:`TABLES`.
        roundness: How round a barrel is along its axis [-], from 0 to 1; None for :data:`ROUNDNESS`.

    Returns:
        The table.
    """
    if kind == "bent":
        return _banana()
    if kind in BARRELS:
        radius = barrel_radius(ROUNDNESS if roundness is None else roundness, places(ALONG))
        return revolved(radius, halved=kind == "half_barrel")
    return revolved(_radius(*(PEAR if kind == "pear" else CONE)))


def barrel_radius(roundness: float, v: np.ndarray) -> np.ndarray:
    """Radius of a barrel over its largest, along its axis: between a cylinder and an ellipsoid.

    With the radius r and the place v it is r^n + |v|^n = 1 (a superellipse), n = 2 / roundness.

    Args:
        roundness: 0 is a cylinder, 1 an ellipsoid, 0.5 has the exponent 4 [-].
        v: Places over the half length [-], any shape.

    Returns:
        The radius [-], same shape.
    """
    if roundness == 0.0:
        return np.ones_like(v)
    n = 2.0 / roundness
    return np.asarray((1.0 - np.abs(v) ** n) ** (1.0 / n))


def spread(kind: str) -> float:
    """Width over all over that of the widest section: more than 1 where a food is bent [-]."""
    if kind != "bent":
        return 1.0
    table = profile(kind)
    return 2.0 / float((table.right - table.left).max())


def _radius(at: tuple[float, ...], size: tuple[float, ...]) -> np.ndarray:
    """Radius at the places of a table, smooth through given ones; round at both ends."""
    from scipy.interpolate import CubicSpline  # takes long to import

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
