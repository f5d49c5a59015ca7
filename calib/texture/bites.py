"""The bites of a record between two plates: where each touches the food, where it peaks and where the load has gone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.errors import TraceError
from calib.texture.plate_record import PlateRecord
from calib.trace.recorded import MIN_SAMPLES
from mpm.arrays import FloatArray

PRESSED, FREE = 0.5, 0.2
"""Parts of the largest way above which the plate presses, and below which it has come back [-]."""
TRIGGER_PART = 0.05
"""Trigger of contact, part of the first bite's peak [-], where none is given."""
SMOOTHING = 0.1
"""Length of the moving mean by which contact is found, part of the time of the first descent [-]. It evens out the
ringing of fast plates; peaks and areas are those of the load as it was recorded."""
MIDDLE = (0.25, 0.75)
"""Parts of the largest way between which the speed of a descent is taken [-]."""
DESCENT = (0.05, 0.95)
"""Parts of the largest way between which a descent is timed [-]."""


@dataclass(frozen=True)
class Bite:
    """One bite of a record.

    Attributes:
        contact: Time of contact: the last before the peak at which the smoothed load rises through the trigger [s].
        peak: Time of the largest load [s].
        end: Time after the peak at which the smoothed load falls through the trigger, or the end of the bite [s].
        hardness: Largest load [N].
        way: Way of the plate between contact and peak [m].
        descent: Time from contact to the peak [s].
    """

    contact: float
    peak: float
    end: float
    hardness: float
    way: float

    @property
    def descent(self) -> float:
        """Time from contact to the peak [s]."""
        return self.peak - self.contact


def presses(record: PlateRecord) -> list[tuple[int, int]]:
    """First and last sample of each press: from the highest place of the plate before it to that after it.

    Args:
        record: The record.

    Returns:
        A pair of indices for each press.
    """
    part = record.way / record.way.max()
    cores: list[list[int]] = []
    down = False
    for k, x in enumerate(part):
        if not down and x > PRESSED:
            cores.append([k, k])
            down = True
        elif down and x < FREE:
            down = False
        if down:
            cores[-1][1] = k
    edges = [0]
    for (_, last), (first, _) in zip(cores, cores[1:], strict=False):
        between = part[last : first + 1]
        edges.append(last + _middle(np.flatnonzero(between <= between.min() + 1e-12)))
    edges.append(len(part) - 1)
    return list(zip(edges, edges[1:], strict=False))


def _middle(places: np.ndarray) -> int:
    """The middle one of the indices."""
    return int(places[len(places) // 2])


def find_bites(record: PlateRecord, trigger: float | None = None) -> list[Bite]:
    """The bites of a record.

    Args:
        record: The record.
        trigger: Load from which the plate touches the food [N]; None for 5 % of the first peak.

    Returns:
        The bites, in their order.

    Raises:
        TraceError: A bite has too few samples, or its load does not reach the trigger.
    """
    out: list[Bite] = []
    smooth = smoothed(record)
    for number, (first, last) in enumerate(presses(record), start=1):
        load = record.load[first : last + 1]
        top = first + int(np.argmax(load))
        level = trigger if trigger is not None else TRIGGER_PART * (out[0].hardness if out else float(load.max()))
        if record.load[top] <= level:
            raise TraceError(
                f"{record.file.name}: bite {number} reaches {record.load[top]:.4g} N, which is not above the trigger "
                f"of {level:.4g} N; give a smaller --trigger"
            )
        bite = _bite(record, smooth, (first, top, last), level)
        inside = (record.time >= bite.contact) & (record.time <= bite.peak)
        if np.count_nonzero(inside) < MIN_SAMPLES:
            raise TraceError(
                f"{record.file.name}: {np.count_nonzero(inside)} samples between contact and peak of bite {number}, at "
                f"least {MIN_SAMPLES} are needed; record at a higher rate"
            )
        out.append(bite)
    return out


def _bite(record: PlateRecord, smooth: FloatArray, on: tuple[int, int, int], level: float) -> Bite:
    """The bite between two places of the plate.

    Args:
        record: The record.
        smooth: Its smoothed load [N], shape (n,).
        on: Samples at which it begins, peaks and ends.
        level: Trigger of contact [N].

    Returns:
        The bite.
    """
    first, top, last = on
    below = np.flatnonzero(smooth[first:top] < level)
    contact = float(record.time[first])
    if len(below):
        k = first + int(below[-1])
        contact = crossing(record.time[k : k + 2], smooth[k : k + 2], level) if k + 1 < top else float(record.time[k])
    end = float(record.time[last])
    for load in (smooth, record.load):  # a load that falls at once is below the trigger in its mean at the peak
        gone = np.flatnonzero(load[top : last + 1] < level)
        if len(gone) and gone[0] > 0:
            k = top + int(gone[0])
            end = crossing(record.time[k - 1 : k + 1], load[k - 1 : k + 1], level)
            break
    peak = float(record.time[top])
    ways = np.interp([contact, peak], record.time, record.way)
    return Bite(contact, peak, end, float(record.load[top]), float(ways[1] - ways[0]))


def crossing(time: FloatArray, load: FloatArray, level: float) -> float:
    """Time at which the line between two samples passes a load.

    Args:
        time: Two times [s], shape (2,).
        load: The loads at them [N], shape (2,).
        level: The load [N].

    Returns:
        The time [s].
    """
    if load[1] == load[0]:
        return float(time[1])
    part = (level - load[0]) / (load[1] - load[0])
    return float(time[0] + min(max(part, 0.0), 1.0) * (time[1] - time[0]))


def smoothed(record: PlateRecord) -> FloatArray:
    """Moving mean of the load over 10 % of the time of the first descent, which contact is found on [N], shape (n,)."""
    part = record.way / record.way.max()
    deep = int(np.argmax(part >= DESCENT[1]))
    shallow = deep - int(np.argmax(part[deep::-1] <= DESCENT[0]))
    length = SMOOTHING * float(record.time[deep] - record.time[shallow])
    return moving_mean(record.time, record.load, length)


def moving_mean(time: FloatArray, load: FloatArray, length: float) -> FloatArray:
    """Mean of the line through samples over a window about each of them; the window is shorter at the ends.

    Args:
        time: Times [s], shape (n,).
        load: Loads at them [N], shape (n,).
        length: Length of the window [s].

    Returns:
        The means [N], shape (n,).
    """
    if length <= 0.0:
        return load
    total = np.concatenate([[0.0], np.cumsum(0.5 * (load[1:] + load[:-1]) * np.diff(time))])
    half = np.minimum(length / 2, np.minimum(time - time[0], time[-1] - time))

    def upto(t: FloatArray) -> FloatArray:
        """Integral of the load from the start to these times [N s]."""
        k = np.clip(np.searchsorted(time, t, side="right") - 1, 0, len(time) - 2)
        into = t - time[k]
        slope = (load[k + 1] - load[k]) / (time[k + 1] - time[k])
        return total[k] + into * (load[k] + 0.5 * slope * into)

    wide = half > 0.0
    out = load.astype(float).copy()
    at, near = time[wide], half[wide]
    out[wide] = (upto(at + near) - upto(at - near)) / (2 * near)
    return out


def plate_descent(record: PlateRecord) -> float:
    """Time in which the plate goes down for the first time, from the speed of its middle half [s]."""
    part = record.way / record.way.max()
    deep = int(np.argmax(part >= MIDDLE[1]))
    shallow = deep - int(np.argmax(part[deep::-1] <= MIDDLE[0]))
    return float((record.time[deep] - record.time[shallow]) / (part[deep] - part[shallow]))
