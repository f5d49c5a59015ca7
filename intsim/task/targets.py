"""Foods on a table, cameras that look at them, and where a cut asked for in words has to go."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

import numpy as np

from mpm.scene.errors import CutcalError
from mpm.scene.shapes import Shape, half_width, section_area, span, surface

SIDES = ("left", "right", "centre")
MIN_VIEW_ANGLE = math.radians(15.0)
"""Least angle between a food's axis and the direction in which the camera looks, seen from above [rad].

Nearer to it the two ends lie behind each other, and left and right say nothing.
"""
VOLUME_SECTIONS = 64  # sections from which the volume of a piece is found
CUT_OPENING = 4e-3  # way that the two sides of a cut slide apart [m]
BOARD_SIZE, BOARD_THICKNESS = (0.4, 0.5), 0.02
"""Sizes of the cutting board along x and y, its middle at the origin and its top at z = 0, and its thickness [m]."""


class TaskError(CutcalError):
    """A task that cannot be set."""


@dataclass(frozen=True)
class Camera:
    """A camera with a name, as ManiSkill places it: x away from the robot, y to its left, z up.

    Attributes: name; eye, where it is; target, what it looks at [m], each (x, y, z).
    """

    name: str
    eye: tuple[float, float, float]
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def right(self) -> np.ndarray:
        """Direction to the right of its picture, horizontal, shape (2,)."""
        look = np.subtract(self.target, self.eye)[:2]
        return np.array([look[1], -look[0]]) / np.hypot(*look)


CAMERAS = {
    c.name: c
    for c in (Camera("front", (0.6, 0.0, 0.4)), Camera("side", (0.0, -0.6, 0.4)), Camera("robot", (-0.6, 0.0, 0.5)))
}
"""Cameras by name: in front of the robot and looking back at it, at its right, and at its own place."""


@dataclass(frozen=True)
class Piece:
    """A part of a food along its axis.

    Attributes:
        low, high: From where to where in the uncut food [m].
        shift: How far it has slid along the axis [m].
    """

    low: float
    high: float
    shift: float = 0.0

    @property
    def length(self) -> float:
        """Its length along the axis [m]."""
        return self.high - self.low


@dataclass(frozen=True)
class Item:
    """A food on the table.

    Attributes:
        name: Food in ``materials.yaml``.
        shape: Its outline; the length lies along its axis.
        x, y: Where its middle is [m].
        yaw: Direction of its axis against the x axis [rad].
        pieces: What cuts have made of it, in order along the axis.
    """

    name: str
    shape: Shape
    x: float = 0.0
    y: float = 0.0
    yaw: float = math.pi / 2
    pieces: tuple[Piece, ...] = field(default=())

    def __post_init__(self) -> None:
        if not self.pieces:
            object.__setattr__(self, "pieces", (Piece(-self.shape.length / 2, self.shape.length / 2),))

    @property
    def whole(self) -> Item:
        """The food before any cut."""
        return replace(self, pieces=())

    @property
    def axis(self) -> np.ndarray:
        """Direction of its axis, shape (2,)."""
        return np.array([math.cos(self.yaw), math.sin(self.yaw)])

    @property
    def across(self) -> np.ndarray:
        """Direction across its axis, along the blade that cuts it, shape (2,)."""
        return np.array([self.axis[1], -self.axis[0]])

    @property
    def box(self) -> tuple[float, float]:
        """Sizes of its bounding box along x and y [m]: of a box as long and as wide turned by its yaw."""
        c, s = abs(math.cos(self.yaw)), abs(math.sin(self.yaw))
        long, wide = self.shape.length, self.shape.width
        return c * long + s * wide, s * long + c * wide

    @property
    def base(self) -> float | None:
        """Height of what it stands on [m]: 0 on the board, less its thickness beside it, None across its rim."""
        gaps = [abs(at) - half / 2 for at, half in zip((self.x, self.y), BOARD_SIZE, strict=True)]
        if all(gap + own / 2 <= 0 for gap, own in zip(gaps, self.box, strict=True)):
            return 0.0
        return -BOARD_THICKNESS if any(gap - own / 2 >= 0 for gap, own in zip(gaps, self.box, strict=True)) else None

    def along(self, point: np.ndarray) -> float:
        """Where a point (2,) of the table lies along the axis, from the middle of the food [m]."""
        return float((np.asarray(point) - [self.x, self.y]) @ self.axis)

    def at(self, along: float) -> np.ndarray:
        """The point (2,) of the table that lies there along its axis [m]."""
        return np.array([self.x, self.y]) + along * self.axis

    def placed(self, points: np.ndarray, along: float) -> np.ndarray:
        """Points of a cut's scene on the table.

        Args:
            points: In the scene: x along the blade, y along the food's axis, z up [m], shape (n, 3).
            along: Where along the food's axis the blade is [m].

        Returns:
            The same points in the world [m], shape (n, 3).
        """
        plane = self.at(along) + points[:, :1] * self.across + points[:, 1:2] * self.axis
        return np.column_stack([plane, points[:, 2]])

    def piece_at(self, along: float) -> int | None:
        """Which piece lies there, None between pieces and beside them."""
        for k, p in enumerate(self.pieces):
            if p.low + p.shift < along < p.high + p.shift:
                return k
        return None

    def cut_at(self, along: float) -> Item:
        """The food after a cut there [m]; its pieces slide apart. Unchanged where there is nothing to cut."""
        k = self.piece_at(along)
        if k is None:
            return self
        old = self.pieces[k]
        place = along - old.shift
        halves = (Piece(old.low, place, old.shift), Piece(place, old.high, old.shift))
        parts = (*self.pieces[:k], *halves, *self.pieces[k + 1 :])
        moved = tuple(
            replace(p, shift=p.shift + (CUT_OPENING / 2 if i > k else -CUT_OPENING / 2)) for i, p in enumerate(parts)
        )
        return replace(self, pieces=moved)

    def half_width(self, along: float) -> float:
        """Half of its width there [m], 0 where there is nothing."""
        k = self.piece_at(along)
        return 0.0 if k is None else half_width(self.shape, along - self.pieces[k].shift)

    def top(self, along: float) -> float:
        """Height of its upper surface above its axis there [m], 0 where there is nothing."""
        k = self.piece_at(along)
        if k is None:
            return 0.0
        place = along - self.pieces[k].shift
        left, right = span(self.shape, place)
        return float(np.nan_to_num(surface(self.shape, np.array((left + right) / 2), np.array(place))[1]))

    def volumes(self) -> list[float]:
        """Volumes of its pieces [m^3], from sections."""
        out = []
        for p in self.pieces:
            places = p.low + (np.arange(VOLUME_SECTIONS) + 0.5) / VOLUME_SECTIONS * p.length
            areas = [section_area(replace(self.shape, cut=float(y))) for y in places]
            out.append(float(np.mean(areas)) * p.length)
        return out


@dataclass(frozen=True)
class CutSpec:
    """What is asked for.

    Attributes:
        item: Name of the food.
        ratio: Part of the food that is cut off, between 0 and 1; a Fraction where it was said as one.
        side: From where it is measured: left or right in the picture of the camera, or centre for a half.
        camera: Name of that camera.
        pieces: Into how many equal pieces, in place of ratio and side; 0 for one cut.
    """

    item: str
    ratio: Fraction | float = Fraction(1, 2)
    side: str = "centre"
    camera: str = "front"
    pieces: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.ratio < 1:
            raise TaskError(f"task: a ratio of {float(self.ratio):g}; give one between 0 and 1")
        if self.side not in SIDES:
            raise TaskError(f"task: side {self.side!r} is none of {', '.join(SIDES)}")
        if self.side == "centre" and self.ratio != Fraction(1, 2):
            raise TaskError(f"task: {self.ratio} of a food has a side it is measured from; say left or right")
        if self.camera not in CAMERAS:
            raise TaskError(f"task: no camera {self.camera!r}; known: {', '.join(CAMERAS)}")
        if self.pieces == 1 or self.pieces < 0:
            raise TaskError(f"task: into {self.pieces} pieces; give 2 or more")

    @property
    def cuts(self) -> int:
        """How many cuts it takes."""
        return max(self.pieces - 1, 1)


def from_left(spec: CutSpec, item: Item) -> float:
    """+1 where the food's axis points to the right in the picture of the spec's camera, -1 where it points to the left.

    Raises:
        TaskError: The axis lies along the direction of view, so that neither end is the left one.
    """
    across = float(item.axis @ CAMERAS[spec.camera].right)
    if spec.side != "centre" and abs(across) < math.sin(MIN_VIEW_ANGLE):
        raise TaskError(
            f"task: the {item.name} points to the camera {spec.camera!r} "
            f"({math.degrees(math.asin(abs(across))):.0f} degrees across its view), "
            "which sees no left and right end; name another camera"
        )
    return 1.0 if across >= 0 else -1.0


def target(spec: CutSpec, item: Item) -> float:
    """Where along the axis the next cut has to go, from the middle of the food [m].

    One cut is measured on the whole food. To make equal pieces, the largest that is left is cut so that what comes off
    is one of as many equal parts as are still to be made of it: from what it has become, not from what was planned for
    the whole.

    Raises:
        TaskError: As :func:`from_left`, or there is nothing more to cut.
    """
    if spec.pieces:
        if len(item.pieces) >= spec.pieces:
            raise TaskError(f"task: the {item.name} is in {len(item.pieces)} pieces already")
        big = max(item.pieces, key=lambda p: p.length)
        parts = spec.pieces - len(item.pieces) + 1
        return big.low + big.shift + big.length / parts
    ratio = float(spec.ratio)
    direction = from_left(spec, item) * (-1.0 if spec.side == "right" else 1.0)
    return direction * (ratio - 0.5) * item.shape.length


def boxed_target(spec: CutSpec, item: Item) -> tuple[np.ndarray, float]:
    """Where a planner cuts that knows no more than the food's bounding box, as the published one does.

    It measures the ratio along the side of the box that the camera sees across its view, and cuts across that side. The
    box of a food that is turned is longer or shorter than the food, and its cut is as oblique as the food lies.

    Returns:
        Point of the table (2,) [m], and the direction of the edge [rad].

    Raises:
        TaskError: As :func:`target`.
    """
    right = CAMERAS[spec.camera].right
    along_y = abs(right[1]) >= abs(right[0])
    size = item.box[1 if along_y else 0]
    whole = replace(item, yaw=math.pi / 2 if along_y else 0.0, shape=replace(item.shape, length=size), pieces=())
    return whole.at(target(replace(spec, pieces=0), whole)), 0.0 if along_y else math.pi / 2


def coefficient_of_variation(values: Sequence[float]) -> float:
    """Standard deviation over the mean [-]: 0 for equal pieces."""
    a = np.asarray(values, float)
    return float(a.std() / a.mean())
