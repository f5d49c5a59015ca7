"""Who looks at a run as it goes on, and what there is to see."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class Particles(NamedTuple):
    """Particles of a cut after some steps.

    Attributes:
        x: Places in the grid's axes [m], shape (n, 3).
        side: 0 where the cut has not passed, else 1 or 2 for the half.
        F: Deformation gradients, shape (n, 3, 3).
        tau: Kirchhoff stresses [Pa], xx, yy, zz, yz, xz, xy, shape (n, 6).
        kappa: Largest equivalent strain that has acted on bulk damage so far; 0 without it.
    """

    x: np.ndarray
    side: np.ndarray
    F: np.ndarray
    tau: np.ndarray
    kappa: np.ndarray


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
    """
    cauchy = now.tau / np.linalg.det(now.F)[:, None]
    xx, yy, zz, yz, xz, xy = cauchy.T
    mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (yz**2 + xz**2 + xy**2))
    return Snapshot(time, stroke, slide, x, mises, now.side > 0)


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
