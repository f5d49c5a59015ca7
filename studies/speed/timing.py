"""Simulations that are timed: kept with their kernels, and run in turns.

All ratios are of runs that take turns in one process, the least time of each: a machine that is slow for a while is
slow for both. Compilation is not counted; the time of the first run, with it, is given apart.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mpm.arrays import FloatArray
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.solver import Simulation

PARTS = 8  # of a cut that are timed by themselves

Say = Callable[[str], None]


class SimulationCache:
    """Simulations that are kept, with their kernels, until they are dropped: before a runtime that stops theirs."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Scene, Runtime], Simulation] = {}

    def get(self, scene: Scene, runtime: Runtime) -> Simulation:
        """The simulation of a scene, made where there is none yet."""
        key = (scene, runtime)
        if key not in self._kept:
            self._kept[key] = Simulation(scene, runtime)
        return self._kept[key]

    def drop(self) -> None:
        """Forget all of them."""
        self._kept.clear()


@dataclass(frozen=True)
class Session:
    """What all measurements share.

    Attributes:
        runtime: Device and threads.
        repeats: Turns that each of two runs takes.
        say: Called with a line after each measurement.
        kept: Simulations that are kept between measurements.
    """

    runtime: Runtime
    repeats: int
    say: Say
    kept: SimulationCache = field(default_factory=SimulationCache)


class RateMeter:
    """Rate of a simulation; each part of its cut counts with the least time of its turns.

    The other codes and the textbook are timed over ten steps, the least of some turns: a whole cut would have to find
    the machine undisturbed for as many seconds as those need tenths.

    Attributes:
        rate: Particle steps a second [1/s].
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._least: FloatArray | None = None
        self.rate = 0.0

    def run(self, turns: int = 1) -> float:
        """Take some turns; returns ``rate``."""
        for _ in range(turns):
            parts: list[float] = []
            ticks: list[float] = []

            def tick(part: float, _: float, parts: list[float] = parts, ticks: list[float] = ticks) -> None:
                parts.append(part)
                ticks.append(time.perf_counter())

            record = self._simulation.run(progress=tick)
            # even parts: small scenes come back less and less often, and not always at the same places
            shares = np.linspace(parts[0], parts[-1], PARTS + 1)
            spent = np.diff(np.interp(shares, parts, ticks))
            self._least = spent if self._least is None else np.minimum(self._least, spent)
            work = record.particles * record.steps * (parts[-1] - parts[0])
            self.rate = work / float(self._least.sum())
        return self.rate


def node_count(simulation: Simulation) -> int:
    """Nodes of the grid of a simulation."""
    return math.prod(simulation.nodes)
