"""Procedural backgrounds of the pictures: colours of table, board and walls, and the light; needs no simulator."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from intsim.task.targets import TaskError

WOODS = ((0.72, 0.53, 0.34), (0.56, 0.39, 0.25), (0.82, 0.68, 0.48), (0.42, 0.28, 0.19), (0.87, 0.76, 0.60))
STONES = ((0.30, 0.30, 0.31), (0.76, 0.72, 0.67), (0.55, 0.52, 0.50), (0.88, 0.87, 0.84), (0.35, 0.40, 0.38))
PLASTICS = ((0.91, 0.91, 0.88), (0.42, 0.60, 0.46), (0.38, 0.50, 0.66), (0.68, 0.32, 0.28), (0.22, 0.23, 0.25))
WALLS = (
    (0.88, 0.86, 0.80),
    (0.72, 0.78, 0.74),
    (0.70, 0.76, 0.83),
    (0.84, 0.72, 0.62),
    (0.60, 0.60, 0.62),
    (0.86, 0.80, 0.58),
)
"""Colours that kitchens are of, red, green and blue; a kitchen's own are beside one of them."""
NEARBY = 0.06  # how far, of each colour [-]
BACKGROUNDS = 15
"""How many there are; 0 is plain, the others are drawn from their number."""


@dataclass(frozen=True, eq=False)
class Background:
    """One background.

    Attributes:
        number: Which, from 0 to 14.
        table, board, wall: Colours, red, green and blue from 0 to 1, shape (3,) each.
        ambient: Ambient light, of each colour [-].
        direction: In which the lamp shines, world axes, shape (3,).
        strength: Of the lamp, of each colour [-].
    """

    number: int
    table: np.ndarray
    board: np.ndarray
    wall: np.ndarray
    ambient: float
    direction: np.ndarray
    strength: float

    @staticmethod
    def of(number: int) -> Background:
        """The background of a number.

        Raises:
            TaskError: There is none of this number.
        """
        if not 0 <= number < BACKGROUNDS:
            raise TaskError(f"scenery {number}: give a number from 0 to {BACKGROUNDS - 1}")
        if number == 0:
            grey, wood, wall = (np.array(c) for c in ((0.75, 0.72, 0.68), (0.72, 0.53, 0.34), (0.82, 0.84, 0.86)))
            return Background(number, grey, wood, wall, 0.35, _direction(np.pi / 4, -1.0), 1.0)
        rng = np.random.default_rng([number, zlib.crc32(b"scenery")])
        table, board, wall = (
            beside(rng, colours) for colours in ((*WOODS, *STONES, *STONES), (*WOODS, *PLASTICS), WALLS)
        )
        ambient = float(rng.uniform(0.2, 0.5))
        direction = _direction(rng.uniform(0, 2 * np.pi), -rng.uniform(0.6, 2.0))
        return Background(number, table, board, wall, ambient, direction, float(rng.uniform(0.6, 1.6)))


def beside(rng: np.random.Generator, colours: Sequence[tuple[float, float, float]]) -> np.ndarray:
    """A colour (3,) beside one of several."""
    return np.clip(np.array(colours[int(rng.integers(len(colours)))]) + rng.uniform(-NEARBY, NEARBY, 3), 0.03, 0.97)


def _direction(azimuth: float, down: float) -> np.ndarray:
    """Direction of a lamp that shines towards an azimuth [rad] and down."""
    return np.array([np.cos(azimuth), np.sin(azimuth), down])
