"""Who looks at a run as it goes on, and what there is to see."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The particles of a run at one moment, in the scene's axes.

    Attributes:
        time: Simulated time [s].
        stroke: Way of the edge below the food's top [m].
        slide: Way of the blade along its edge [m].
        x: Places of the particles [m], shape (n, 3); mirror images are not among them.
        mises: Von Mises stress [Pa], shape (n,).
        severed: Whether the cut has passed a particle, shape (n,).
    """

    time: float
    stroke: float
    slide: float
    x: np.ndarray
    mises: np.ndarray
    severed: np.ndarray


def snapshot(time: float, stroke: float, slide: float, fields: Any, x: np.ndarray, place: int = 0) -> Snapshot:
    """What there is to see now.

    Args:
        time: Simulated time [s].
        stroke: Way of the edge below the food's top [m].
        slide: Way of the blade along its edge [m].
        fields: The fields of the run.
        x: Places of its particles in the scene's axes [m], shape (n, 3).
        place: Of the run among the cuts of the fields.
    """
    cauchy = fields.stresses(place) / np.linalg.det(fields.deformation(place))[:, None]
    xx, yy, zz, yz, xz, xy = cauchy.T
    mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (yz**2 + xz**2 + xy**2))
    return Snapshot(time, stroke, slide, x, mises, fields.of_particles(fields.side, place) > 0)


class Watch:
    """Looks at a run at even parts of it and at its end.

    Args:
        times: How often.
    """

    def __init__(self, times: int) -> None:
        self.times = times
        self.taken: list[Snapshot] = []

    def due(self, total: int) -> int:
        """Step at which to look next, of a run of ``total`` steps."""
        return math.ceil((len(self.taken) + 1) * total / self.times)

    def take(self, now: Snapshot) -> None:
        """Look."""
        self.taken.append(now)
