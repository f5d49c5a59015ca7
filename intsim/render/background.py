"""Procedural backgrounds of the pictures: colours of table, board and walls, and the light; needs no simulator."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import numpy as np

from intsim.task.targets import TaskError

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
        table, board, wall = (rng.uniform(low, 0.95, 3) for low in (0.15, 0.2, 0.2))
        ambient = float(rng.uniform(0.2, 0.5))
        direction = _direction(rng.uniform(0, 2 * np.pi), -rng.uniform(0.6, 2.0))
        return Background(number, table, board, wall, ambient, direction, float(rng.uniform(0.6, 1.6)))


def _direction(azimuth: float, down: float) -> np.ndarray:
    """Direction of a lamp that shines towards an azimuth [rad] and down."""
    return np.array([np.cos(azimuth), np.sin(azimuth), down])
