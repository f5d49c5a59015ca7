"""A cut from its first step to its record: the commanded motion in orders of steps, and what is kept on the way."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mpm.output.record import BOARD, LIMIT, STROKE, ForceRecord
from mpm.output.recorder import Interval, Recorder
from mpm.output.section import SectionRecorder
from mpm.output.snapshot import Snapshot, SnapshotRecorder
from mpm.output.topology import Topology
from mpm.scene import Scene
from mpm.scene.motion import SLOWED_FROM
from mpm.setup.setup import Setup

STRETCH_ROWS = 4  # rows of the report in which a blade that slows down keeps its speed, at first
PATIENCE = 0.1  # time after which a run comes back from the device to say how far it is and to be stopped [s]
ON_BOARD = 1e-9  # height at which the edge is on the board [m]

Progress = Callable[[float, float], None]
"""Called with the part of the motion that is done [-] and the force on the knife [N]."""


class Order(NamedTuple):
    """Time steps that a cut is to make.

    Attributes:
        steps: How many.
        steps_per_row: After how many each a row of the report.
        dt: Time step [s].
        up: Velocity of the blade upwards [m/s].
        along: Velocity of the blade along its edge [m/s].
        tilt: Rate of its tilt [rad/s].
    """

    steps: int
    steps_per_row: int
    dt: float
    up: float
    along: float
    tilt: float = 0.0


REST = Order(0, 1, 0.0, 0.0, 0.0)
"""No step."""


class CutRun:
    """A cut from its first step to its record.

    Args:
        setup: The cut.
        scene: Its scene, with the material of this run.
        progress: Called after each output.
        sections: How often to keep the food across the blade's middle.
        snapshots: Keeps the particles at even parts of the run.
    """

    def __init__(
        self,
        setup: Setup,
        scene: Scene,
        progress: Progress | None = None,
        sections: int = 0,
        snapshots: SnapshotRecorder | None = None,
    ) -> None:
        self._scene, self._progress = scene, progress
        material = scene.food.material
        self._recorder = Recorder(setup, material)
        self._sections = SectionRecorder(setup.seeds, scene.mirrors, sections)
        self._kept = [one for one in (self._sections, snapshots) if one is not None and one.times > 0]
        motion = scene.motion
        self.dt = setup.time_step(material)
        speed = motion.mach * material.p_wave
        self._every = max(1, round(scene.numerics.output / (speed * self.dt)))
        self._phases = [  # steps, velocity upwards and along the blade of each
            *self._descent(speed, setup.gap),
            (math.ceil(motion.dwell / scene.time_scale / self.dt), 0.0, 0.0),
            (math.ceil(motion.retract / (speed * self.dt)), speed, 0.0),
        ]
        self._total = sum(steps for steps, _, _ in self._phases)
        self._limited = scene.arm.rigid and scene.arm.force_limit is not None
        self._left, self._batch, self._asked = self._phases[0][0], 1, 0.0
        self._rows_down: int | None = None
        self._began = clock.perf_counter()

    def _descent(self, speed: float, gap: float) -> list[tuple[int, float, float]]:
        """Phases of the way down from a gap [m] above the food, at first at a speed [m/s].

        One step more lets the food see where the edge ends. A blade that slows down does so from one to the next of
        some stretches, each of whole rows of the report.
        """
        scene, motion = self._scene, self._scene.motion
        height, way, phases = scene.food.shape.height, motion.stroke + gap, []
        even = (1 - SLOWED_FROM) * height + gap
        if scene.slows_down and way > even:
            stretches = math.ceil((way - even) / (STRETCH_ROWS * scene.numerics.output))
            length = (way - even) / stretches
            for k in range(stretches):
                pace = motion.pace(1 - (even - gap + (k + 0.5) * length) / height)
                steps = self._every * max(round(length / (pace * speed * self.dt * self._every)), 1)
                slow = length / (steps * self.dt)
                phases.append((steps, -slow, slow * motion.slice_ratio))
            way = even
        phases.insert(0, (math.ceil(way / (speed * self.dt)), -speed, speed * motion.slice_ratio))
        last = phases[-1]
        return [*phases[:-1], (last[0] + 1, *last[1:])]

    @property
    def status(self) -> str:
        """``done``, or why the run cannot go on."""
        return self._recorder.status

    @property
    def home(self) -> bool:
        """Whether a yielding arm has pressed the edge on the board."""
        return pressed_home(self._scene, self._recorder.intervals)

    @property
    def stopped(self) -> bool:
        """Whether a rigid arm has stopped at its force limit."""
        return beyond_limit(self._scene, self._recorder.intervals)

    @property
    def fraction(self) -> float:
        """Part of the motion that is done [-]."""
        return 1.0 if self.home and self.status == "done" else self._recorder.steps / self._total

    def order(self) -> Order | None:
        """The steps to do next; None at the end, or where the run cannot go on."""
        if self.status != "done" or self.home or self.stopped:
            return None
        while self._left == 0 and len(self._phases) > 1:
            del self._phases[0]
            self._left = self._phases[0][0]
        if self._left == 0:
            return None
        count = min(self._every * self._batch, self._left)
        for one in self._kept:
            due = max(one.due(self._total) - self._recorder.steps, 1)
            count = min(count, self._every * math.ceil(due / self._every))
        self._asked = clock.perf_counter()
        _, up, along = self._phases[0]
        return Order(count, self._every, self.dt, up, along)

    def take(
        self, reports: Sequence[np.ndarray] | np.ndarray, snapshot: Callable[[float, float, float], Snapshot]
    ) -> None:
        """Book what was done since :meth:`order`, and keep the particles where it is time.

        Args:
            reports: Rows of the report in SI units [-], shape (n, N_REPORT).
            snapshot: The particles now, at a simulated time [s], a stroke [m] and a way along the blade [m].
        """
        recorder = self._recorder
        if self._rows_down is None and self._phases[0][1] > 0:
            self._rows_down = len(recorder.intervals)
        for report in reports:
            steps = min(self._every, self._left)
            self._left -= steps
            recorder.book(report, steps, self.dt)
            if self.status != "done" or self.home or self.stopped:
                break
        # where a limit ends the motion, the food must not go on beyond the interval in which it does
        if clock.perf_counter() - self._asked < PATIENCE / 2 and not self._limited:
            self._batch *= 2
        if self._progress is not None and self.status == "done":
            self._progress(recorder.steps / self._total, float(recorder.force[2]))
        due = [one for one in self._kept if self.status == "done" and recorder.steps >= one.due(self._total)]
        if due:
            last = recorder.intervals[-1]
            now = snapshot(last.time, last.stroke, last.slide)
            for one in due:
                one.take(now)

    def record(self, topology: Callable[[], Topology]) -> ForceRecord:
        """The cut so far; one that broke down has its reason in ``status``, and its pieces are not asked for."""
        wall = clock.perf_counter() - self._began
        pieces = topology() if self.status == "done" else None
        record = self._recorder.record(pieces, dt=self.dt, fraction=self.fraction, wall=wall)
        ended = LIMIT if self.stopped else BOARD if self.home else STROKE
        return replace(record, section=self._sections.section(), ended=ended, rows_down=self._rows_down)


def pressed_home(scene: Scene, intervals: Sequence[Interval]) -> bool:
    """Whether an arm that yields presses the edge on the board, and nothing is left to cut nor to come back from."""
    motion, height = scene.motion, scene.food.shape.height - scene.floor
    down = len(intervals) > 1 and all(interval.stroke > height - ON_BOARD for interval in intervals[-2:])
    return down and motion.stroke > height and motion.retract == 0


def beyond_limit(scene: Scene, intervals: Sequence[Interval]) -> bool:
    """Whether the force on the knife is beyond what a rigid arm bears, its ripple over a cell of the way left out.

    The force on the edge is that of the last interval: a stone makes it rise within a few of them. That on the faces
    carries the ripple of the grid and is a mean over the last cell.
    """
    limit = scene.arm.force_limit
    if limit is None or not scene.arm.rigid or not intervals:
        return False
    last = intervals[-1]
    within = [one.face[2] for one in intervals if one.stroke > last.stroke - scene.numerics.dx]
    return bool(last.edge[2] + np.mean(within) > limit)
