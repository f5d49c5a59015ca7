"""A cut to be drawn: what was seen of it, and where things are in its pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mpm.discretisation.particles import Seeds
from mpm.output.record import ForceRecord
from mpm.output.section import Section, section_of
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.scene import Knife, Scene

if TYPE_CHECKING:
    from mpm.solver import Simulation

COLOURS = "YlOrRd"  # falls evenly in lightness, so it can be read in grey and by the colour-blind
SHOWN = 0.98  # part of the food's surface whose stress is within the colours when it is largest
FRAME = 1.15  # of the board beside the blade, in heights or widths of the food, whichever is larger
EYE = np.array([1.0, -0.8, 0.55])  # from where it is seen
BLADE = 1.4  # length of the blade that is drawn, in widths of the food, where it is longer
APART = 1.05  # by which the pieces are drawn apart, in widths of the food: the blade hides nothing of the face then
ROOM = 1.06  # of the picture around what it shows, as a factor
STEPS = 3  # between the numbers at the scale of colours
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # what a step may begin with
MOMENTS = ("contact", "peak", "end")


def round_up(value: float) -> float:
    """The next round number that is no smaller.

    >>> round_up(23.9), round_up(0.61), round_up(4.0)
    (25.0, 0.8, 4.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    return next(one * power for one in ROUND if one * power >= value * (1.0 - 1e-9))


@dataclass(frozen=True, eq=False)
class Film:
    """A cut to be drawn.

    Attributes:
        food: Name of the food, which its colours go by.
        scene: What was simulated.
        surface: The food's surface.
        seeds: Its particles at rest.
        looks: What was seen of it, in the order of time: at contact, and from then on.
        time: Simulated time of the record [s], shape (n,).
        stroke: Stroke of the record [m], shape (n,).
        force: Upward force on the knife [N], shape (n,).
        down: Rows of the record before the blade is withdrawn; None where it is not.
    """

    food: str
    scene: Scene
    surface: Surface
    seeds: Seeds
    looks: Sequence[Snapshot]
    time: np.ndarray
    stroke: np.ndarray
    force: np.ndarray
    down: int | None = None

    @staticmethod
    def of(food: str, simulation: Simulation, looks: Sequence[Snapshot], record: ForceRecord) -> Film:
        """That of a run that has ended.

        Args:
            food: Name of the food.
            simulation: What has run.
            looks: What was kept of it, one look at least.
            record: Its forces.

        Returns:
            What is drawn of it, with the food at rest when the blade touches it.
        """
        scene, seeds = simulation.scene, simulation.setup.seeds
        surface = Surface(scene.food.shape, seeds, scene.mirrors)
        way = np.concatenate([[-simulation.setup.gap], record.stroke[: record.cut_rows]])
        time = float(np.interp(0.0, way, np.concatenate([[0.0], record.time[: record.cut_rows]])))
        calm = np.zeros(len(seeds.x))
        contact = Snapshot(time, 0.0, 0.0, seeds.x, calm, calm > 0.0)
        looks = [contact, *(look for look in looks if look.time > time)]
        return Film(food, scene, surface, seeds, looks, record.time, record.stroke, record.resolved, record.cut_rows)

    @cached_property
    def section(self) -> Section:
        """The food across the blade's middle at each of the looks."""
        return section_of(self.looks, self.seeds, self.scene.mirrors)

    @cached_property
    def largest(self) -> float:
        """Stress at the end of the colours [Pa]: three steps of a round number."""
        values = [float(np.quantile(self.surface.values(look.mises), SHOWN)) for look in self.looks]
        return STEPS * round_up(max([*values, 1.0]) / STEPS)

    def force_at(self, look: Snapshot) -> float:
        """Upward force on the knife at a look [N]."""
        return float(np.interp(look.time, self.time, self.force, left=0.0))

    @property
    def peak(self) -> tuple[float, float, float]:
        """Time [s], stroke [m] and value [N] of the largest force on the way down."""
        k = int(np.argmax(self.force[: self.down]))
        return float(self.time[k]), float(self.stroke[k]), float(self.force[k])

    def parted(self, look: Snapshot) -> bool:
        """Whether the cut has passed all of the food's section."""
        return bool(np.all(self.surface.cut(look)[self.surface.face]))

    def apart(self, look: Snapshot) -> np.ndarray:
        """Vertices (m, 3) [m] of the surface with the piece behind the blade drawn back, so that its cut face is
        seen."""
        points = self.surface.points(look)
        points[self.surface.second :, 1] += APART * self.scene.food.shape.width
        return points

    def moments(self) -> dict[str, Snapshot]:
        """The looks at contact, nearest to the largest force, and at the end, by these words."""
        peak, times = self.peak[0], np.array([look.time for look in self.looks])
        chosen = (self.looks[0], self.looks[int(np.argmin(np.abs(times - peak)))], self.looks[-1])
        return dict(zip(MOMENTS, chosen, strict=True))


def blade(knife: Knife, length: float) -> tuple[np.ndarray, np.ndarray]:
    """A blade whose edge lies along x through the origin.

    Args:
        knife: The blade.
        length: How much of its length [m].

    Returns:
        Corners (10, 3) [m], and triangles (t, 3).
    """
    half, high = knife.spine / 2, knife.spine / 2 / math.tan(knife.angle / 2)
    outline = np.array([[0.0, 0.0], [half, high], [half, knife.height], [-half, knife.height], [-half, high]])
    ends = [np.column_stack([np.full(5, x), outline]) for x in (-length / 2, length / 2)]
    around, after = np.arange(5), np.roll(np.arange(5), -1)
    sides = np.concatenate([np.stack([around, after + 5, after], 1), np.stack([around, around + 5, after + 5], 1)])
    fan = np.array([[0, k, k + 1] for k in range(1, 4)])
    return np.concatenate(ends), np.concatenate([sides, fan, fan[:, ::-1] + 5])[:, ::-1]


def blade_at(scene: Scene, look: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """The same where the blade is at a look: lowered, slid along its edge and tilted."""
    assert isinstance(scene.knife, Knife)  # a press has no blade
    points, triangles = blade(scene.knife, min(scene.knife.length, BLADE * scene.food.shape.width))
    c, s = math.cos(scene.motion.tilt), math.sin(scene.motion.tilt)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    place = np.array([look.slide, 0.0, scene.food.shape.height - look.stroke])
    return points @ turn.T + place, triangles


@dataclass(frozen=True)
class View:
    """A picture without perspective: which place of the scene is where in it.

    Attributes:
        middle: What its middle shows, along the picture's width and height and towards the eye [m], shape (3,).
        scale: Pixels in a metre.
        size: Its width and height [pixels].
    """

    middle: np.ndarray
    scale: float
    size: tuple[int, int]

    @staticmethod
    def around(points: np.ndarray, size: tuple[int, int]) -> View:
        """The one that shows all of some places (n, 3) [m], as large as it can."""
        seen = points @ AXES.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        scale = float(np.min(np.array(size) / (high - low)[:2])) / ROOM
        return View((low + high) / 2, scale, size)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Where places (n, 3) [m] are, from the picture's lower left corner [pixels], shape (n, 2)."""
        out: np.ndarray = (points @ AXES.T - self.middle)[:, :2] * self.scale + np.array(self.size) / 2
        return out


def _axes() -> np.ndarray:
    """Directions of a picture's width and height and towards the eye, shape (3, 3)."""
    back = EYE / np.linalg.norm(EYE)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


AXES = _axes()


def board(film: Film, *, apart: bool = True) -> tuple[float, float, float, float, float, float]:
    """Ends of the board along x, y and z [m]: as large as the food, with room to draw the pieces apart or without."""
    shape = film.scene.food.shape
    near, room = FRAME * max(shape.width, shape.height), 0.15 * shape.width
    low, high = shape.ends
    back = high + room + (APART * shape.width if apart else 0.0)
    return -0.7 * near, 0.85 * near, low - room, back, -0.12 * near, -1e-5


def corners(ends: tuple[float, float, float, float, float, float]) -> np.ndarray:
    """Corners (8, 3) of a box with given ends along x, y and z [m]."""
    x, y, z = np.array(ends).reshape(3, 2)
    return np.stack(np.meshgrid(x, y, z), axis=-1).reshape(-1, 3)
