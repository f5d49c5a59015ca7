"""Contact of a plate with a food: where the load would begin, by what lies just above the trigger."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from calib.texture.plate_record import PlateRecord
from calib.texture.prony_series import PronySeries
from mpm.arrays import FloatArray

RISE = 2.0
"""Load up to which the rise behind the trigger is taken, over that of the trigger [-]: as short as noise allows, as a
food stiffens."""
LEAST_RISE = 5
"""Least samples of the rise."""


def rise_of(smooth: FloatArray, level: float, start: int) -> slice:
    """Samples of the loading from the trigger up to twice that load.

    Args:
        smooth: Load whose ringing is evened out [N], shape (n,).
        level: Load of the trigger [N].
        start: First sample of the hold.

    Returns:
        The samples, none of the hold.
    """
    below = np.flatnonzero(smooth[:start] < level)
    first = int(below[-1]) + 1 if len(below) else 0
    above = np.flatnonzero(smooth[first:start] > RISE * max(level, float(smooth[first])))
    last = first + int(above[0]) if len(above) else start
    return slice(first, min(max(last, first + LEAST_RISE), start))


def line_contact(record: PlateRecord, rise: slice) -> tuple[float, float]:
    """Contact by the straight line through the rise, as standards of compression correct a toe (ASTM D695, annex A1).

    Args:
        record: The record.
        rise: Samples of the loading behind the trigger.

    Returns:
        Time [s] and way [m] at which the load would begin. Where the rise is no line that grows, those of the last
        sample before it.
    """
    time, way, load = record.time[rise], record.way[rise], record.load[rise]
    first = rise.start
    from_mean = way - way.mean() if len(way) else way
    slope = float(from_mean @ load) / float(from_mean @ from_mean) if len(way) > 1 and way[-1] > way[0] else 0.0
    if not slope > 0.0:
        last = max(first - 1, 0)
        return float(record.time[last]), float(record.way[last])
    zero = min(float(way.mean() - load.mean() / slope), float(way[0]))
    before = np.flatnonzero(record.way[:first] <= zero)
    if len(before):
        k = int(before[-1])
        part = (zero - record.way[k]) / max(float(record.way[k + 1] - record.way[k]), 1e-300)
        return float(record.time[k] + min(part, 1.0) * (record.time[k + 1] - record.time[k])), zero
    speed = float(way[-1] - way[0]) / float(time[-1] - time[0])
    return float(time[0]) - (float(way[0]) - zero) / speed, zero


def way_before_contact(time: FloatArray, way: FloatArray, load: FloatArray, rise: slice, series: PronySeries) -> float:
    """Way that a straight line counts too much, as a load that relaxes while it rises is no line.

    The load of the series, times a factor, is put through the rise; it begins at contact.

    Args:
        time: Times of the loading [s], shape (n,).
        way: Way from the contact of the straight line [m], shape (n,).
        load: Load [N], shape (n,).
        rise: Samples of the rise.
        series: The Prony series.

    Returns:
        Way from the contact of the line to that of the series, none below zero [m].
    """
    target = load[rise]
    if len(target) < 2 or not way[rise.start] > 0.0:
        return 0.0

    def miss(before: float) -> float:
        """Sum of squares that the series leaves of the rise [N^2]."""
        shape = series.stress(time[: rise.stop], np.maximum(way[: rise.stop] - before, 0.0))[rise]
        square = float(shape @ shape)
        return float(target @ target) - float(shape @ target) ** 2 / square if square > 0.0 else float(target @ target)

    most = float(way[rise.start])
    found = minimize_scalar(miss, bounds=(0.0, 0.99 * most), method="bounded", options={"xatol": 1e-5 * most})
    return float(found.x) if found.fun < miss(0.0) else 0.0
