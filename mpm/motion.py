"""The commanded motion of one cut, interval by interval, and who looks at it on the way."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mpm.arm import pressed_home
from mpm.output.record import ForceRecord
from mpm.output.recorder import Ledger
from mpm.output.section import Looks
from mpm.output.snapshot import Watch
from mpm.scene import Scene

if TYPE_CHECKING:
    from mpm.solver import Simulation

PATIENCE = 0.1  # time after which a run comes back from the device to say how far it is and to be stopped [s]

Progress = Callable[[float, float], None]
Order = tuple[int, int, float, float, float, float]
"""Steps, after how many each a row of the report, time step [s], velocity upwards and along the blade [m/s], rate of its turn [rad/s]."""
REST: Order = (0, 1, 0.0, 0.0, 0.0, 0.0)
"""No step."""


class Course:
    """A cut from its first step to its record.

    Args:
        simulation: The cut, whose fields are loaded.
        scene: Its scene, with the material of this run.
        progress: Called after each output with (part of the motion done, knife force [N]).
        sections: How often to keep the food across the blade's middle.
        watch: Who else looks at it.
    """

    def __init__(
        self,
        simulation: Simulation,
        scene: Scene,
        progress: Progress | None = None,
        sections: int = 0,
        watch: Watch | None = None,
    ) -> None:
        self._simulation, self._scene, self._progress = simulation, scene, progress
        material = scene.food.material
        self._ledger = Ledger(simulation, material)
        self._looks = Looks(simulation.seeds, scene.mirrors, sections)
        self._watches = [one for one in (self._looks, watch) if one is not None and one.times > 0]
        motion, gap = scene.motion, simulation.gap
        self.dt = simulation.time_step(material)
        speed = motion.mach * material.p_wave
        self._every = max(1, round(scene.numerics.output / (speed * self.dt)))
        # steps, velocity upwards and along the blade of each phase; one step more lets the food see where the edge ends
        self._phases = [
            (math.ceil((motion.stroke + gap) / (speed * self.dt)) + 1, -speed, speed * motion.slice_ratio),
            (math.ceil(motion.dwell / scene.time_scale / self.dt), 0.0, 0.0),
            (math.ceil(motion.retract / (speed * self.dt)), speed, 0.0),
        ]
        self._total = sum(steps for steps, _, _ in self._phases)
        self._left, self._batch, self._asked = self._phases[0][0], 1, 0.0
        self._began = clock.perf_counter()

    @property
    def status(self) -> str:
        """``done``, or why the run cannot go on."""
        return self._ledger.status

    @property
    def home(self) -> bool:
        """Whether a yielding arm has pressed the edge on the board."""
        return pressed_home(self._scene, self._ledger.rows)

    @property
    def fraction(self) -> float:
        """Part of the motion that is done [-]."""
        return 1.0 if self.home and self.status == "done" else self._ledger.steps / self._total

    def order(self) -> Order | None:
        """The steps to do next; None at the end, or where the run cannot go on."""
        if self.status != "done" or self.home:
            return None
        while self._left == 0 and len(self._phases) > 1:
            del self._phases[0]
            self._left = self._phases[0][0]
        if self._left == 0:
            return None
        count = min(self._every * self._batch, self._left)
        for one in self._watches:
            due = max(one.due(self._total) - self._ledger.steps, 1)
            count = min(count, self._every * math.ceil(due / self._every))
        self._asked = clock.perf_counter()
        return (count, self._every, self.dt, *self._phases[0][1:], 0.0)

    def take(self, reports: Sequence[np.ndarray] | np.ndarray) -> None:
        """Book what was done since :meth:`order`, rows of the report (n, N_REPORT)."""
        for report in reports:
            steps = min(self._every, self._left)
            self._left -= steps
            self._ledger.book(report, steps, self.dt)
            if self.status != "done" or self.home:
                break
        if clock.perf_counter() - self._asked < PATIENCE / 2:
            self._batch *= 2
        if self._progress is not None and self.status == "done":
            self._progress(self._ledger.steps / self._total, float(self._ledger.force[2]))
        due = [one for one in self._watches if self.status == "done" and self._ledger.steps >= one.due(self._total)]
        if due:
            stroke, _, slide, at = self._ledger.rows[-1][:4]
            now = self._simulation.look(at, stroke, slide)
            for one in due:
                one.take(now)

    def record(self) -> ForceRecord:
        """The cut so far; one that broke down has its reason in ``status``."""
        wall = clock.perf_counter() - self._began
        record = self._ledger.record(dt=self.dt, fraction=self.fraction, wall=wall)
        return replace(record, section=self._looks.section())
