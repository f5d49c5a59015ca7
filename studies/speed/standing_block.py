"""An elastic block whose weight is put on at once: what other codes do as well, with a force in closed form.

The block has no Poisson's ratio, so that it is a bar: a wave goes up and down in it, and the force on the floor rises
from nothing to twice the weight and falls again, in straight lines. A code need not tell the force on its floor: the
mean velocity of the particles does, by Newton's second law.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpm.arrays import FloatArray
from mpm.runtime import Runtime
from mpm.scene import Numerics
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.free_body import FreeBody

ELASTIC = Material(E=1e6, nu=0.0, rho=1000.0)
GRAVITY = 9.81
MARGIN = 6
"""Cells beside and above the block in another code's grid, which keeps some for itself."""
FLOOR = 4
"""Node on which the block stands in another code."""
WINDOW = 10
"""Steps that are timed together, and over which a force is the mean."""


@dataclass(frozen=True)
class Standing:
    """How the solver did.

    Attributes:
        seconds: Least time of a step [s].
        particles: Particles.
        force_error: Root mean square difference of the force on the floor from the closed form over a period, over its
            peak [-].
    """

    seconds: float
    particles: int
    force_error: float

    @property
    def rate(self) -> float:
        """Particle steps a second [1/s]."""
        return self.particles / self.seconds


@dataclass(frozen=True)
class StandingBlock:
    """The block, its cells and its time steps.

    Attributes:
        size: Width, length and height [m].
        dx: Cell size [m].
        ppc: Particles along the edge of a cell.
        dt: Time step [s].
    """

    size: tuple[float, float, float]
    dx: float
    ppc: int
    dt: float

    @property
    def period(self) -> float:
        """Time in which a wave goes up and down twice [s]."""
        return 4 * self.size[2] / ELASTIC.p_wave

    @property
    def windows(self) -> int:
        """Whole windows in a period."""
        return math.floor(self.period / (WINDOW * self.dt))

    def task(self, device: str) -> dict[str, Any]:
        """What another code is told; see :func:`studies.speed.peers.measure`."""
        cells = [round(s / self.dx) for s in self.size]
        return {
            "device": device,
            "dx": self.dx,
            "nodes": [n + 2 * MARGIN for n in cells],
            "low": [MARGIN * self.dx, MARGIN * self.dx, FLOOR * self.dx],
            "counts": [n * self.ppc for n in cells],
            "dt": self.dt,
            "rho": ELASTIC.rho,
            "E": ELASTIC.E,
            "gravity": GRAVITY,
            "floor": FLOOR,
            "steps": WINDOW,
            "windows": self.windows,
        }

    def force_error(self, velocity: Sequence[float]) -> float:
        """Error of the force on the floor.

        Args:
            velocity: Mean velocity upwards at the end of each window [m/s].

        Returns:
            Root mean square difference from the closed form, over its peak [-].
        """
        span = WINDOW * self.dt
        force = 1 + np.diff([0.0, *velocity]) / (GRAVITY * span)  # over the weight
        expected = np.diff(self._impulse(span * np.arange(len(force) + 1, dtype=np.float64))) / span
        return float(np.sqrt(np.mean((force - expected) ** 2)) / 2)

    def _impulse(self, at: FloatArray) -> FloatArray:
        """Impulse on the floor over the weight [s] up to some times [s] within a period."""
        half = self.period / 2
        return np.where(at < half, at**2 / half, 4 * at - at**2 / half - 2 * half)


def stand(shape: Shape, numerics: Numerics, runtime: Runtime) -> tuple[StandingBlock, Standing]:
    """Let the solver do it.

    Args:
        shape: Size of the block.
        numerics: Cells, particles and precision.
        runtime: Device and threads.

    Returns:
        The block, with the time step that other codes are to take as well, and how the solver did.
    """
    body = FreeBody(shape, ELASTIC, numerics, board=0.0, runtime=runtime)
    block = StandingBlock((shape.width, shape.length, shape.height), numerics.dx, numerics.ppc, body.dt)
    least, velocity = math.inf, []
    for _ in range(block.windows):
        began = time.perf_counter()
        body.step(WINDOW)
        least = min(least, (time.perf_counter() - began) / WINDOW)
        velocity.append(float(body.v[:, 2].mean(dtype=float)))
    return block, Standing(least, len(body.start), block.force_error(velocity))
