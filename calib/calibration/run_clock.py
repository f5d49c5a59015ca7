"""How long a calibration takes: typically, from earlier ones beside it, and at most; one bar over all its stages."""

from __future__ import annotations

import json
import math
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from calib.errors import OutputError
from calib.io.progress import Progress
from calib.simulation.evaluation_frame import evaluation_frame

FIRST_GUESS = 115.0
"""Wall time of a calibration over that of a default simulation of a worker, where no earlier one is known [-]: 105 to
123 in four calibrations of the bundled banana on two workers."""
LAST_RUNS = 24.0
"""Time of the simulations after the search, in default ones [-]: 16 checks, of which that on cells of two thirds takes
five, the literature's values and the record."""
INTERVAL_RUNS = 60.0
"""Time of the intervals at most, in default simulations of a worker [-]: both ends of nine parameters in three rounds
are 54 of them, and as many coarse ones."""
CLOSING_S = 8.0
"""Time that figures and report take [s]: 4 on two quiet cores, 15 on busy ones."""
SLOWER = 2.0
"""How much slower than the simulations so far the rest may be: another job may take the machine [-]."""
MOST_CLOSING_S = SLOWER * CLOSING_S
"""Time that they take at most [s]."""
ALMOST = 0.99
"""Part of a bar that is shown at most while something is left to do [-]."""
MOST_READ = 8
"""Earlier calibrations that are looked at, the newest first."""


def earlier_runs(out: Path, batch: int) -> list[float]:
    """Wall time of finished calibrations beside a folder, over that of a default simulation of a worker [-].

    Args:
        out: The folder of this calibration; others are looked for in the same place.
        batch: Simulations at a time.

    Returns:
        The numbers, none where there are none; folders that cannot be read are left out.
    """
    found = sorted(out.parent.glob("*/summary.json"), key=_changed, reverse=True)
    beside = [path for path in found if path.parent.name != out.name]
    return [taken * batch for path in beside[:MOST_READ] for taken in _taken(path)]


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _taken(path: Path) -> Iterator[float]:
    """Wall time over the mean time of a default simulation, of one folder; nothing where it has none."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        runs = evaluation_frame(path.parent)
    except (OSError, ValueError, OutputError):
        return
    seconds = runs["seconds"][runs["fidelity"] == "fine"].mean()
    wall = said.get("wall_s") if isinstance(said, dict) and said.get("status") == "done" else None
    if isinstance(wall, float) and seconds > 0:
        yield wall / float(seconds)


class RunClock:
    """Tells of all stages of a calibration as parts of one.

    Args:
        progress: Who is told; None for nobody.
        earlier: Wall times of earlier calibrations over that of a default simulation of a worker [-].
        now: Clock [s].
    """

    def __init__(
        self,
        progress: Callable[[Progress], None] | None,
        earlier: list[float],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._progress, self._now, self._began = progress, now, now()
        self._typical = statistics.median(earlier) if earlier else FIRST_GUESS
        self._last: Progress | None = None
        self._each = math.nan
        self._part = 0.0
        self._more = self._round = 0  # simulations of the intervals in earlier rounds, and in this one
        self._lasting = 0  # simulations among the last that are done
        self._searched = self._last_began = math.nan  # when the search has ended, and the last simulations have begun

    def begin(self, budget: float) -> None:
        """The first simulations have begun: nothing tells yet how long they take.

        Args:
            budget: Budget of the search, in simulations on the fine grid [-].
        """
        words = "compiling for the first simulations"
        self._tell(Progress(0, 0.0, budget, 0, math.inf, math.nan, words), math.nan, math.nan)

    def search(self, p: Progress) -> None:
        """A simulation of the search is done."""
        rest = p.budget - p.spent
        if math.isfinite(p.eta_s) and rest > 0.0:
            self._each = p.eta_s / rest
        self._last = p
        self._tell(p, self._typically(), p.eta_s + (INTERVAL_RUNS + LAST_RUNS) * self._each + MOST_CLOSING_S)

    def analysis(self) -> None:
        """The search has ended, and what the trace bounds is worked out without simulations."""
        self.intervals("profiles of the parameters")

    def intervals(self, words: str, done: int = 0) -> None:
        """A round of the intervals has begun, or one of its simulations is done.

        Args:
            words: What it is.
            done: Simulations of the round that are done.
        """
        self._more += self._round if done < self._round else 0
        self._round = done
        if math.isnan(self._searched):
            self._searched = self._now()
        rest = max(INTERVAL_RUNS * self._each - (self._now() - self._searched), 0.0)
        self._stage(words, self._typically(), rest + LAST_RUNS * self._each + MOST_CLOSING_S)

    def last(self, words: str, done: int, whole: int) -> None:
        """The last simulations have begun, or one of them is done.

        Args:
            words: What they are.
            done: How many are done.
            whole: All of them.
        """
        if not done:
            self._last_began = self._now()
            self._more, self._round = self._more + self._round + self._lasting, 0
        self._lasting = done
        expected = LAST_RUNS * self._each * (1.0 - done / whole)
        if done == whole:  # more of them may follow
            self._stage(words, math.nan, math.nan)
            return
        took = self._now() - self._last_began
        longest = took * (whole - done) / done if done else expected  # were they all as long: the longest come first
        usual = min(longest, max(expected, took))
        self._stage(words, usual + CLOSING_S, max(expected, longest) * SLOWER + MOST_CLOSING_S)

    def closing(self, words: str) -> None:
        """All simulations are done; figures and report are left.

        Args:
            words: What is being done.
        """
        self._stage(words, CLOSING_S, MOST_CLOSING_S)

    def _typically(self) -> float:
        """Time left in a typical run [s]: never less than the last simulations and the report take."""
        return max(self._typical * self._each - (self._now() - self._began), LAST_RUNS * self._each + CLOSING_S)

    def _stage(self, words: str, typical: float, most: float) -> None:
        if self._last is not None:
            made = self._last.done + self._more + self._round + self._lasting
            self._tell(replace(self._last, stage=words, done=made), typical, most)

    def _tell(self, p: Progress, typical: float, most: float) -> None:
        if self._progress is None:
            return
        took = self._now() - self._began
        if math.isfinite(typical) and took + typical > 0.0:
            self._part = max(self._part, took / (took + typical))
        self._progress(replace(p, eta_s=most, typical_s=min(typical, most), part=min(self._part, ALMOST)))
