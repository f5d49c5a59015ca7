"""The particles of a run at one moment, and who keeps them as it goes on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.discretisation.particles import Particles


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


def snapshot(time: float, stroke: float, slide: float, now: Particles, x: np.ndarray) -> Snapshot:
    """What there is to see now.

    Args:
        time: Simulated time [s].
        stroke: Way of the edge below the food's top [m].
        slide: Way of the blade along its edge [m].
        now: The particles.
        x: Their places in the scene's axes [m], shape (n, 3).

    Returns:
        Their von Mises stress and which of them the cut has passed.
    """
    cauchy = now.tau / np.linalg.det(now.F)[:, None]
    xx, yy, zz, yz, xz, xy = cauchy.T
    mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (yz**2 + xz**2 + xy**2))
    return Snapshot(time, stroke, slide, x, mises, now.side > 0)


class SnapshotRecorder:
    """Keeps the particles at even parts of a run and at its end.

    Args:
        times: How often.
    """

    def __init__(self, times: int) -> None:
        self.times = times
        self.taken: list[Snapshot] = []

    def due(self, total: int) -> int:
        """Step at which to keep them next, of a run of ``total`` steps."""
        return math.ceil((len(self.taken) + 1) * total / self.times)

    def take(self, now: Snapshot) -> None:
        """Keep the particles."""
        self.taken.append(now)
