"""Outlines of foods: inside test, volume, and the top and bottom surface. Plain NumPy."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.scene.errors import SceneError, check_number
from mpm.scene.outline import Outline, Sections
from mpm.scene.profiles import BARRELS, ROUNDNESS, TABLES, profile
from mpm.scene.surface_distance import surface_distance

SHAPE_KINDS = (
    "block",
    "cylinder",
    "half_cylinder",
    "upright_cylinder",
    "sphere",
    "hemisphere",
    "ellipsoid",
    "capsule",
    *TABLES,
)
OUTLINE = "outline"  # kind of a shape whose outline was measured
PRISMS = ("block", "cylinder", "half_cylinder", "capsule")  # shapes with parallel sides, alike all along y
FLAT_DOWN = ("half_cylinder", "hemisphere")
FLAT_TOP = ("block", "upright_cylinder")


@dataclass(frozen=True)
class Shape:
    """Outline of the food, standing on z = 0 with the plane of the blade at y = 0.

    A cylinder lies along y, an upright one stands on its end.

    Attributes:
        kind: One of :data:`SHAPE_KINDS`, or ``outline`` where it was measured.
        length: Along y [m].
        width: Along x, over all [m].
        height: Along z [m].
        cut: Place of the blade along y from the food's middle [m].
        outline: What was measured, None for the other kinds.
        roundness: Of a barrel, 0 for a cylinder to 1 for an ellipsoid along its length [-]; None for
            ``mpm.scene.profiles.ROUNDNESS``.
    """

    kind: str
    length: float
    width: float
    height: float
    cut: float = 0.0
    outline: Outline | None = None
    roundness: float | None = None

    def __post_init__(self) -> None:
        if (self.kind == OUTLINE) != (self.outline is not None):
            raise SceneError(f"shape: kind {self.kind!r}; a measured outline, and nothing else, has the kind {OUTLINE}")
        if self.kind not in (*SHAPE_KINDS, OUTLINE):
            raise SceneError(f"shape: unknown kind {self.kind!r}; one of {', '.join(SHAPE_KINDS)}")
        for name in ("length", "width", "height"):
            check_number("shape", name, getattr(self, name), 1e-3, 1.0, "m")
        if self.roundness is not None:
            if self.kind not in BARRELS:
                raise SceneError(f"shape: a {self.kind} has no roundness; {' and '.join(BARRELS)} have one")
            if not 0.0 <= self.roundness <= 1.0:
                raise SceneError(f"shape: roundness {self.roundness:g}; it goes from 0 (cylinder) to 1 (ellipsoid)")
        if not abs(self.cut) < self.length / 2:
            raise SceneError(
                f"shape: the blade at {self.cut * 1e3:g} mm from the middle misses a food {self.length * 1e3:g} mm long"
            )

    @property
    def ends(self) -> tuple[float, float]:
        """Where the food begins and ends along y [m], the blade being at 0."""
        return -self.length / 2 - self.cut, self.length / 2 - self.cut

    @property
    def table(self) -> Sections | None:
        """Its tabulated sections, None where it has a closed form."""
        if self.outline is not None:
            return self.outline.sections
        return profile(self.kind, self.roundness) if self.kind in TABLES else None

    @property
    def symmetric(self) -> tuple[bool, bool]:
        """Whether x = 0 and the plane of the blade are mirrors of it."""
        table = self.table
        along, across = (True, True) if table is None else table.symmetric
        return along, across and self.cut == 0

    @property
    def words(self) -> str:
        """What it is called: its kind and roundness, or the file of a measured outline and how that was read."""
        if self.roundness is not None:
            return f"{self.kind} of roundness {self.roundness:.2g}"
        return self.kind if self.outline is None else f"{self.kind} of {self.outline.source} ({self.outline.how})"

    @property
    def prism(self) -> bool:
        """Whether its sides are parallel, so that its sections are alike all along y."""
        return self.kind in PRISMS if self.table is None else self.table.prism

    @property
    def stands(self) -> bool:
        """Whether it stands on a flat face, as a half food does, and not on a line or a point."""
        return self.kind in (*FLAT_DOWN, *FLAT_TOP) if self.table is None else self.table.halved

    @property
    def walled(self) -> bool:
        """Whether its flanks are upright."""
        return self.kind in FLAT_TOP if self.table is None else self.table.walled


def named(text: str) -> tuple[str, float | None]:
    """The kind that a text names, and its roundness where it says one.

    >>> named("sphere"), named("half_barrel:0.3")
    (('sphere', None), ('half_barrel', 0.3))

    Args:
        text: One of :data:`SHAPE_KINDS`; a barrel may have its roundness after a colon.

    Returns:
        Kind and roundness [-].

    Raises:
        SceneError: There is no such kind, or no such roundness.
    """
    kind, colon, part = text.partition(":")
    if kind not in SHAPE_KINDS:
        raise SceneError(f"shape: unknown kind {kind!r}; one of {', '.join(SHAPE_KINDS)}")
    if not colon:
        return kind, None
    try:
        roundness = float(part)
    except ValueError:
        roundness = math.nan
    if kind not in BARRELS or not 0.0 <= roundness <= 1.0:
        raise SceneError(
            f"shape: {text!r}; only {' and '.join(BARRELS)} have a roundness, from 0 (cylinder) to 1 (ellipsoid), such "
            f"as half_barrel:{ROUNDNESS:g}"
        )
    return kind, roundness


def radius2(shape: Shape, x: np.ndarray, y: np.ndarray, thinner: float = 0.0) -> np.ndarray:
    """Squared distance from the axis or plane over that of the rim.

    Args:
        shape: The outline.
        x: Positions along the blade [m], any shape.
        y: Positions across the blade [m], same shape.
        thinner: By how much the outline is thinner on all sides [m].

    Returns:
        The ratio [-], same shape; beyond 1 a point is not in the food.
    """
    a, b = (max(size / 2 - thinner, 5e-10) for size in (shape.width, shape.length))
    y = y + shape.cut
    if shape.kind in ("cylinder", "half_cylinder"):
        return np.where(np.abs(y) <= b, (x / a) ** 2, np.inf)
    if shape.kind == "capsule":
        cap = min(a, b)
        return (x / a) ** 2 + (np.maximum(np.abs(y) - (b - cap), 0.0) / cap) ** 2
    return (x / a) ** 2 + (y / b) ** 2


def span(shape: Shape, y: float) -> tuple[float, float]:
    """Where the section at y begins and ends along the blade [m], both 0 where there is none."""
    if shape.table is None:
        half = half_width(shape, y)
        return -half, half
    left, right = (float(side) for side in shape.table.span(_along(shape, np.array(y))))
    return (shape.width / 2 * left, shape.width / 2 * right) if right > left else (0.0, 0.0)


def half_width(shape: Shape, y: float) -> float:
    """Half of the width about x = 0 that holds the section at y [m], 0 where there is none."""
    if shape.table is not None:
        return max(abs(side) for side in span(shape, y))
    if shape.kind == "block":
        return shape.width / 2 if abs(y + shape.cut) <= shape.length / 2 else 0.0
    r2 = float(radius2(shape, np.zeros(1), np.array([y]))[0])
    return shape.width / 2 * math.sqrt(max(1.0 - r2, 0.0))


def surface(shape: Shape, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Height of the lower and upper surface over points (x, y).

    Args:
        shape: The outline.
        x: Positions along the blade [m], any shape.
        y: Positions across the blade [m], same shape.

    Returns:
        ``(bottom, top)`` [m], NaN where there is no food above the point.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    if shape.table is not None:
        bottom, top = shape.table.surface(x / (shape.width / 2), _along(shape, y))
        return shape.height * bottom, shape.height * top
    if shape.kind == "block":
        inside = (np.abs(x) <= shape.width / 2) & (np.abs(y + shape.cut) <= shape.length / 2)
        return np.where(inside, 0.0, np.nan), np.where(inside, shape.height, np.nan)
    r2 = radius2(shape, x, y)
    if shape.kind == "upright_cylinder":
        return np.where(r2 <= 1, 0.0, np.nan), np.where(r2 <= 1, shape.height, np.nan)
    rise = np.sqrt(np.where(r2 <= 1, 1 - r2, np.nan))
    if shape.kind in FLAT_DOWN:
        return 0.0 * rise, shape.height * rise
    half = shape.height / 2
    return half * (1 - rise), half * (1 + rise)


def inside(shape: Shape, points: np.ndarray) -> np.ndarray:
    """Which points lie in the food. Args: points [m], shape (n, 3). Returns: bool, shape (n,)."""
    bottom, top = surface(shape, points[:, 0], points[:, 1])
    with np.errstate(invalid="ignore"):
        return (points[:, 2] >= bottom) & (points[:, 2] <= top)


def depth(shape: Shape, points: np.ndarray, most: float = math.inf) -> np.ndarray:
    """How deep points of a tabulated food lie below its surface; the face where a food was halved is none.

    Args:
        shape: The outline.
        points: Places in the food [m], shape (n, 3).
        most: Depth that is asked for [m]; what lies deeper may be given as infinite.

    Returns:
        Distances [m], shape (n,).
    """
    assert shape.table is not None  # other kinds are shrunk in closed form
    distance = surface_distance(shape.table, shape.length, shape.width, shape.height)
    return distance(points + np.array([0.0, shape.cut, 0.0]), most)


def volume(shape: Shape) -> float:
    """Volume of the food [m^3], in closed form where there is one."""
    box = shape.length * shape.width * shape.height
    if shape.table is not None:
        return box * shape.table.volume
    if shape.kind == "block":
        return box
    if shape.kind in ("cylinder", "half_cylinder", "upright_cylinder"):
        return math.pi / 4 * box
    if shape.kind == "capsule":
        cap = min(shape.width, shape.length) / 2
        section = math.pi / 4 * shape.width * shape.height
        return section * (shape.length - 2 * cap) + section * 4 / 3 * cap
    return math.pi / 6 * box


def section_area(shape: Shape) -> float:
    """Area of the section in the blade plane y = 0 [m^2]: what a complete cut severs."""
    if shape.table is not None:
        return shape.width * shape.height * shape.table.area(2 * shape.cut / shape.length)
    width = 2 * half_width(shape, 0.0)
    if shape.kind in FLAT_TOP:
        return width * shape.height
    return math.pi / 4 * width * shape.height * (width / shape.width)


def skin_path(shape: Shape, x: np.ndarray, thickness: float) -> np.ndarray:
    """Vertical way of the edge through the upper skin in the blade plane.

    The skin is the layer between the outline and the outline shrunk by its thickness, so the way grows towards the
    flanks, where the edge meets the skin at a slant, up to the whole height where only skin is left.

    Args:
        shape: The outline.
        x: Positions along the blade [m], shape (n,).
        thickness: Skin thickness [m].

    Returns:
        Way through the skin [m], shape (n,), 0 where there is no food.
    """
    x = np.asarray(x, float)
    if shape.table is not None:
        return _skin_above(shape, x, thickness)
    bottom, top = surface(shape, x, np.zeros_like(x))
    inner_width = max(shape.width - 2 * thickness, 1e-9)
    r2 = radius2(shape, x, np.zeros_like(x), thickness)
    lift = 0.0 if shape.kind in (*FLAT_DOWN, *FLAT_TOP) else thickness
    inner_height = max(shape.height - thickness - lift, 1e-9)
    if shape.kind in FLAT_TOP:
        inner_top = np.where(np.abs(x) <= inner_width / 2, inner_height, bottom)
    else:
        rise = np.sqrt(np.maximum(1 - r2, 0.0))
        inner_top = inner_height * rise if shape.kind in FLAT_DOWN else shape.height / 2 + inner_height / 2 * rise
        inner_top = np.where(r2 <= 1, inner_top, bottom)
    return np.nan_to_num(np.maximum(top - inner_top, 0.0))


def _skin_above(shape: Shape, x: np.ndarray, thickness: float) -> np.ndarray:
    """The same of a tabulated food: the way from its top to where it is as deep as the skin is thick."""
    bottom, top = surface(shape, x, np.zeros_like(x))
    way = (top - bottom)[:, None] * np.linspace(0.0, 1.0, SKIN_SAMPLES)
    there = np.isfinite(way)
    points = np.stack(np.broadcast_arrays(x[:, None], 0.0, top[:, None] - way), -1)
    deep = np.zeros_like(way)
    deep[there] = np.minimum(depth(shape, points[there], 2 * thickness), 2 * thickness)
    out = np.nan_to_num(way[:, -1])
    rows = np.flatnonzero((deep >= thickness).any(axis=1))
    k = np.maximum((deep[rows] >= thickness).argmax(axis=1), 1)
    before, after = deep[rows, k - 1], deep[rows, k]
    part = np.clip((thickness - before) / np.maximum(after - before, 1e-12), 0.0, 1.0)
    out[rows] = way[rows, k - 1] + part * (way[rows, k] - way[rows, k - 1])
    return out


def _along(shape: Shape, y: np.ndarray) -> np.ndarray:
    """Places across the blade [m] over the half length, from the food's middle [-]."""
    return np.asarray((y + shape.cut) / (shape.length / 2))


SKIN_SAMPLES = 200  # points down a food at which its skin is looked for
SLICE_SAMPLES = 64
"""Points at which a slice's outline is looked up: an even number, so that none lies where the rim of a food of whole or
half cells does. There the last bit would decide whether it counts (docs/theory.md, "Measured choices")."""


def slices(shape: Shape, x: np.ndarray, dx: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Outline in the blade plane, slice by slice.

    Args:
        shape: The outline.
        x: Middle of each slice [m], shape (n,).
        dx: Width of a slice [m].

    Returns:
        Highest and lowest height of the upper surface over each slice [m], the part of the slice that has food [-], and
        the highest and lowest height of the lower surface [m], each of shape (n,); a slice without food is 0 high and
        has the part 0. The highest is above the lowest.
    """
    bottom, top = _slice_samples(shape, x, dx)
    there = np.isfinite(top)
    some = there.any(axis=1)
    out = []
    for heights in (top, bottom):
        high = np.where(some, np.where(there, heights, -np.inf).max(axis=1), 0.0)
        low = np.where(some, np.where(there, heights, np.inf).min(axis=1), 0.0)
        out += [high, np.minimum(low, high - 1e-6 * dx)]
    return out[0], out[1], there.mean(axis=1), out[2], out[3]


def slice_powers(shape: Shape, x: np.ndarray, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """How the part of a slice that an edge has reached grows on its way from the first point of a surface to the last.

    The part is a power of the way, such that the area of the section between the two is right: 1 where the outline is
    straight, less on the flank of a round food.

    Args:
        shape: The outline.
        x: Middle of each slice [m], shape (n,).
        dx: Width of a slice [m].

    Returns:
        The powers for the upper and for the lower surface [-], each of shape (n,).
    """
    out = []
    for heights in _slice_samples(shape, x, dx)[::-1]:
        there = np.isfinite(heights)
        count = np.maximum(there.sum(axis=1), 1)
        low = np.where(there, heights, np.inf).min(axis=1, initial=np.inf)
        high = np.where(there, heights, -np.inf).max(axis=1, initial=-np.inf)
        sloped = high - low > 1e-6 * dx
        rise = np.where(there & sloped[:, None], heights - np.where(sloped, low, 0.0)[:, None], 0.0).sum(axis=1) / count
        out.append(np.where(sloped, np.where(sloped, high - low, 1.0) / np.where(sloped, rise, 1.0) - 1.0, 1.0))
    return out[0], out[1]


def _slice_samples(shape: Shape, x: np.ndarray, dx: float) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper surface at some points of each slice [m], (n, SLICE_SAMPLES), NaN where there is no food."""
    points = x[:, None] + dx * ((np.arange(SLICE_SAMPLES) + 0.5) / SLICE_SAMPLES - 0.5)
    return surface(shape, points, np.zeros_like(points))
