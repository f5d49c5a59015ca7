"""A hold: the plate goes to a place and stays there, and the load relaxes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError
from calib.texture.bites import TRIGGER_PART, moving_mean
from calib.texture.plate_record import PlateRecord
from calib.trace.recorded import MIN_SAMPLES
from mpm.arrays import FloatArray

STAYS = 0.02
"""Part of the way within which the plate stays [-]."""
LEAST_TIMES = 3.0
"""Least duration of a hold over that of its ramp [-]: shorter ones show no more than the ramp."""
BINS = 150
"""Samples of the hold: as many means over equal steps of the logarithm of time."""
RAMP = 200
"""Samples of the ramp."""


@dataclass(frozen=True, eq=False)
class Hold:
    """Ramp and hold of one record, from contact on.

    Attributes:
        name: Name of the record.
        time: Time from contact [s], shape (n,); few samples, of the hold in equal steps of the logarithm of time.
        way: Way of the plate from contact [m], shape (n,).
        load: Load [N], shape (n,).
        start: First sample of the hold.
    """

    name: str
    time: FloatArray
    way: FloatArray
    load: FloatArray
    start: int

    @property
    def duration(self) -> float:
        """Time of the hold [s]."""
        return float(self.time[-1] - self.time[self.start])

    @property
    def first_step(self) -> float:
        """Time between the first two samples of the hold [s]."""
        return float(self.time[self.start + 1] - self.time[self.start])

    @property
    def held(self) -> slice:
        """Samples of the hold."""
        return slice(self.start, None)


def find_hold(record: PlateRecord, trigger: float | None = None) -> Hold:
    """Ramp and hold of a record.

    The hold begins with the largest load, and lasts until the plate has left its place or the record ends.

    Args:
        record: The record.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the largest load.

    Returns:
        Ramp and hold, from contact on.

    Raises:
        TraceError: The plate does not stay, or too few samples show the ramp or the hold.
    """
    name, top = record.file.name, int(np.argmax(record.load))
    deep = float(record.way.max())
    level = trigger if trigger is not None else TRIGGER_PART * float(record.load[top])
    ramp = record.time[top] - record.time[int(np.argmax(record.way > STAYS * deep))]
    smooth = moving_mean(record.time, record.load, 0.05 * max(float(ramp), 0.0))
    below = np.flatnonzero(smooth[: top + 1] < level)
    first = int(below[-1]) if len(below) else 0
    near = np.abs(record.way - record.way[top:].max()) <= STAYS * deep
    left = np.flatnonzero(~near[top:])
    last = top + (int(left[0]) if len(left) else len(near) - top)
    if last - top < MIN_SAMPLES:
        raise TraceError(
            f"{name}: {last - top} samples from the largest load on until the plate leaves its place, at least "
            f"{MIN_SAMPLES} are needed; a relaxation test holds the plate (cutcal press tpa reads two bites)"
        )
    hold = _thinned(record, first, top, last)
    if hold.duration < LEAST_TIMES * float(hold.time[hold.start]):
        raise TraceError(
            f"{name}: the hold of {hold.duration:.3g} s is shorter than {LEAST_TIMES:g} times its ramp of "
            f"{hold.time[hold.start]:.3g} s, so the ramp has relaxed already; press faster, or hold for longer"
        )
    return hold


def _thinned(record: PlateRecord, first: int, top: int, last: int) -> Hold:
    """Ramp and hold with few samples.

    Args:
        record: The record.
        first: Sample of contact.
        top: Sample of the largest load.
        last: Sample behind the hold.

    Returns:
        Samples of the ramp at equal times, and means of those of the hold over equal steps of log time.
    """
    time = record.time - record.time[first]
    ramp = np.linspace(0.0, time[top], min(RAMP, top - first + 1))[:-1]
    since = time[top:last] - time[top]
    edges = np.geomspace(since[1], since[-1], BINS)
    _, of = np.unique(np.searchsorted(edges, since), return_inverse=True)
    counts = np.bincount(of)

    def column(values: FloatArray) -> FloatArray:
        held = np.bincount(of, weights=values[top:last]) / counts
        return np.concatenate([np.interp(ramp, time[first : top + 1], values[first : top + 1]), held])

    return Hold(record.name, column(time), column(record.way - record.way[first]), column(record.load), len(ramp))
