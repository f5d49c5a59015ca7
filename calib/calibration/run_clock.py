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

FIRST_GUESS = 79.0
"""Wall time of a calibration over that of a default simulation of a worker, where no earlier one is known [-]: 73 and
85 in two calibrations of the bundled banana on two workers."""
LAST_RUNS = 24.0
"""Time of the simulations after the search, in default ones [-]: 16 checks, of which that on cells of two thirds takes
five, the literature's values and the record."""
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

    def search(self, p: Progress) -> None:
        """A simulation of the search is done."""
        rest = p.budget - p.spent
        if math.isfinite(p.eta_s) and rest > 0.0:
            self._each = p.eta_s / rest
        self._last = p
        self._tell(p, p.eta_s + LAST_RUNS * self._each)

    def stage(self, words: str, done: int = 0, whole: int = 1) -> None:
        """A stage after the search has begun, or one of its simulations is done.

        Args:
            words: What it is.
            done: Its simulations that are done.
            whole: All its simulations.
        """
        if self._last is not None:
            left = LAST_RUNS * self._each * (1.0 - done / whole)
            self._tell(replace(self._last, stage=words), left)

    def _tell(self, p: Progress, most: float) -> None:
        if self._progress is None:
            return
        took = self._now() - self._began
        typical = min(max(self._typical * self._each - took, 0.0), most)
        if math.isfinite(typical) and took + typical > 0.0:
            self._part = max(self._part, took / (took + typical))
        known = typical if typical > 0.0 else math.nan
        self._progress(replace(p, eta_s=most, typical_s=known, part=min(self._part, 0.99)))
