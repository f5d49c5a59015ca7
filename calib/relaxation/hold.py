"""A hold: the plate goes to a place and stays there, and the load relaxes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.relaxation.contact import line_contact, rise_of, way_before_contact
from calib.texture.bites import TRIGGER_PART, moving_mean
from calib.texture.plate_record import PlateRecord
from calib.texture.prony_series import PronySeries
from calib.trace.recorded import MIN_SAMPLES
from mpm.arrays import FloatArray

STAYS = 0.02
"""Part of the way within which the plate stays [-]."""
REACHED = 0.002
"""Part of the way that is left where the hold begins [-]; more where the way is noisier."""
LEAST_TIMES = 3.0
"""Least duration of a hold over that of its ramp [-]: shorter ones show no more than the ramp."""
BINS = 150
"""Samples of the hold: as many means over equal steps of the logarithm of time."""
RAMP = 200
"""Samples of the ramp: as many means over equal steps of time."""
SMOOTH = 3
"""Degree of the polynomial in the logarithm of time by which the noise of the hold's second half is found."""


@dataclass(frozen=True, eq=False)
class Hold:
    """Ramp and hold of one record, from contact on.

    Attributes:
        name: Name of the record.
        time: Time from contact [s], shape (n,); few samples, of the hold in equal steps of the logarithm of time.
        way: Way of the plate from contact [m], shape (n,).
        load: Load [N], shape (n,).
        start: First sample of the hold.
        noise: Standard deviation of the loads of the hold, which are means of one sample or of many [N], shape
            (n - start,).
        rise: Samples of the ramp by which contact is found.
    """

    name: str
    time: FloatArray
    way: FloatArray
    load: FloatArray
    start: int
    noise: FloatArray
    rise: slice

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

    def touched(self, series: PronySeries) -> Hold:
        """The same hold from the contact that a load of this series has.

        Args:
            series: The Prony series.

        Returns:
            The hold; its way is less by what the straight line had counted too much.
        """
        before = way_before_contact(self.time, self.way, self.load, self.rise, series)
        way = np.maximum(self.way - before, 0.0)
        touches = float(np.interp(before, np.maximum.accumulate(self.way), self.time))
        return replace(self, time=self.time - touches, way=way)


def find_hold(record: PlateRecord, trigger: float | None = None) -> Hold:
    """Ramp and hold of a record.

    The hold begins where the way has come to the place at which it stays, and lasts until the plate has left it or the
    record ends. Contact is where the load, continued by a straight line from just above the trigger, is zero.

    Args:
        record: The record.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the largest load.

    Returns:
        Ramp and hold, from contact on.

    Raises:
        TraceError: The plate does not stay, the load does not reach the trigger, or too few samples show the hold.
    """
    name = record.file.name
    start, last = _place(record)
    if last - start < MIN_SAMPLES:
        raise TraceError(
            f"{name}: {last - start} samples from the end of the ramp until the plate leaves its place, at least "
            f"{MIN_SAMPLES} are needed; a relaxation test holds the plate (cutcal press tpa reads two bites)"
        )
    ramp = float(record.time[start] - record.time[int(np.argmax(record.way > STAYS * record.way[start]))])
    smooth = moving_mean(record.time, record.load, 0.05 * max(ramp, 0.0))
    peak = float(smooth[:last].max())
    level = trigger if trigger is not None else TRIGGER_PART * peak
    if not peak > level:
        raise TraceError(
            f"{name}: the hold reaches {peak:.4g} N, which is not above the trigger of {level:.4g} N; give a smaller "
            "--trigger"
        )
    hold = _thinned(record, rise_of(smooth, level, start), start, last)
    if hold.duration < LEAST_TIMES * float(hold.time[hold.start]):
        raise TraceError(
            f"{name}: the hold of {hold.duration:.3g} s is shorter than {LEAST_TIMES:g} times its ramp of "
            f"{hold.time[hold.start]:.3g} s, so the ramp has relaxed already; press faster, or hold for longer"
        )
    return hold


def _place(record: PlateRecord) -> tuple[int, int]:
    """First sample at which the plate is at the place where it stays, and the first behind its longest stay."""
    way = record.way
    deep = float(way.max())
    turns = np.diff(np.concatenate([[0], (way >= (1.0 - STAYS) * deep).astype(int), [0]]))
    begins, ends = np.flatnonzero(turns > 0), np.flatnonzero(turns < 0)
    longest = int(np.argmax(record.time[ends - 1] - record.time[begins]))
    first, last = int(begins[longest]), int(ends[longest])
    stay = way[first:last]
    place = float(np.median(stay))
    scatter = 1.4826 * float(np.median(np.abs(stay - place)))  # standard deviation by the median deviation
    reached = stay >= place - min(max(REACHED * deep, 3.0 * scatter), STAYS * deep)
    return first + int(np.argmax(reached)), last


def _thinned(record: PlateRecord, rise: slice, start: int, last: int) -> Hold:
    """Ramp and hold with few samples.

    Args:
        record: The record.
        rise: Samples of the loading behind the trigger.
        start: First sample of the hold.
        last: Sample behind the hold.

    Returns:
        Means of the samples of the ramp over equal steps of time, and of those of the hold over equal steps of log
        time.
    """
    touch, zero = line_contact(record, rise)
    first = int(np.searchsorted(record.time[: rise.start], touch, side="right"))
    # a bin for each part: before the rise, the rise, and behind it
    parts = [_even(record.time[a:b], touch, float(record.time[start])) for a, b in
             ((first, rise.start), (rise.start, rise.stop), (rise.stop, start))]  # fmt: skip
    since = record.time[start:last] - record.time[start]
    parts.append(np.searchsorted(np.geomspace(since[1], since[-1], BINS)[:-1], since, side="right"))
    sizes = [len(np.unique(part)) for part in parts]
    bins = np.concatenate([
        np.unique(part, return_inverse=True)[1] + sum(sizes[:k]) for k, part in enumerate(parts)
    ])  # fmt: skip
    counts = np.bincount(bins)

    def column(values: FloatArray, contact: float) -> FloatArray:
        return np.concatenate([[contact], np.bincount(bins, weights=values[first:last]) / counts])

    begins = 1 + sum(sizes[:3])
    noise = _noise(since, record.load[start:last]) / np.sqrt(counts[begins - 1 :])
    on = slice(1 + sizes[0], 1 + sizes[0] + sizes[1])
    time, way = column(record.time, touch) - touch, column(record.way, zero) - zero
    return Hold(record.name, time, way, column(record.load, 0.0), begins, noise, on)


def _even(time: FloatArray, touch: float, end: float) -> FloatArray:
    """Number of the step of the ramp in which each time lies; shape (n,) [-]."""
    return np.floor((time - touch) / max(end - touch, 1e-300) * RAMP).astype(int)


def _noise(since: FloatArray, load: FloatArray) -> float:
    """Standard deviation of one load about the smooth course of the second half of a hold [N].

    Args:
        since: Times from the start of the hold [s], shape (n,).
        load: Loads [N], shape (n,).

    Returns:
        The standard deviation, at least a billionth of the largest load.
    """
    half = len(load) // 2
    x = np.log(since[half:] / since[-1])
    degree = min(SMOOTH, len(x) // 4)
    residual = load[half:] - np.polynomial.Polynomial.fit(x, load[half:], degree)(x)
    spread = float(np.sqrt(residual @ residual / max(len(x) - degree - 1, 1)))
    return max(spread, 1e-9 * float(np.abs(load).max()))
