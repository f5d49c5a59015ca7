"""Several cuts in one record: found, counted, and one of them chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.errors import TraceError
from calib.trace.mending import noise_of
from calib.trace.recorded import MIN_SAMPLES
from calib.trace.trace import Trace

WHOLE = "whole"
"""Says that a record is one cut although its force is released in it."""
PRESSED = 0.5
"""Part of the largest force from which on a knife that comes down is under load [-]."""
TOUCHED, RELEASED = 0.12, 0.06
"""Parts of the largest force above which a knife may cut, and below which it is released, by the force alone [-]."""
AS_LONG = 0.3
"""Part of the longest load's time that a load lasts to be a cut: skin that gives way and a start are shorter."""
RAISED = 0.5
"""Part of the position's range by which a knife goes up again between two cuts [-]."""
CLEAR_SD = 10.0
"""Noise standard deviations that a load has."""
SLIGHT = 0.04
"""Part of the largest force above which a knife touches something, where the force is all there is [-]."""
FEWEST_LOADED = 5
"""Samples under load of a way down on which the knife cuts."""
REST = 0.25
"""Part of a cut's time for which the force is released before another one begins [-]."""


def find_cuts(trace: Trace) -> list[tuple[int, int]]:
    """First sample and the one after the last of each cut of a record.

    A cut ends where the file begins anew. Where there is a position, another cut begins when the knife was raised by
    half its way and comes down to a load again; else when the force was released for a quarter of a cut's time.

    Args:
        trace: The record.

    Returns:
        The cuts, in order; the whole record for one. A way down without a load, such as one in the air, is none of
        them.
    """
    ends = [0, *trace.breaks, len(trace.time)]
    found: list[tuple[int, int]] = []
    for start, stop in zip(ends[:-1], ends[1:], strict=True):
        force = trace.force[start:stop]
        if trace.position is None:
            edges = [0, *_released(force), stop - start]
            spans = list(zip(edges[:-1], edges[1:], strict=True))
        else:
            spans = _loaded(force, trace.position[start:stop])
        found += [(start + a, start + b) for a, b in spans]
    return found


def single_cut(trace: Trace, cut: int | str | None) -> Trace:
    """One cut of a record.

    Args:
        trace: The record.
        cut: Its number from 1, ``whole`` for a record that is one cut although its force is released in it, None for a
            record that holds one.

    Returns:
        The part of the record with that cut, on the record's clock.

    Raises:
        TraceError: It holds several and none is chosen, or not as many.
    """
    if cut == WHOLE:
        return replace(trace, breaks=(), whole=True)
    if trace.whole:
        return trace
    cuts = find_cuts(trace)
    if cut is None:
        if len(cuts) == 1:
            return _without_others(trace, _main_load(trace.force) if trace.position is None else cuts[0])
        places = ", ".join(trace.where(_first_load(trace, *span)) for span in cuts[:4])
        more = f" and {len(cuts) - 4} more" if len(cuts) > 4 else ""
        raise TraceError(
            f"{trace.source}: the record holds {len(cuts)} cuts, which are under load at {places}{more}; choose one "
            f"with --cut 1 to --cut {len(cuts)}, fit them all with --all, or say --cut {WHOLE} if it is one"
        )
    if not 1 <= int(cut) <= len(cuts):
        raise TraceError(f"{trace.source}: there is no cut {cut}, the record holds {len(cuts)} (option --cut)")
    start, stop = cuts[int(cut) - 1]
    if stop - start < MIN_SAMPLES:
        raise TraceError(f"{trace.source}: cut {cut} has {stop - start} samples, at least {MIN_SAMPLES} are needed")
    part = trace.part(np.arange(start, stop))
    note = f"{trace.source}: cut {cut} of {len(cuts)}, from {trace.where(start)} to {trace.where(stop - 1)}"
    return replace(part, breaks=(), whole=True, notes=(*trace.notes, note) if len(cuts) > 1 else trace.notes)


def _level(force: np.ndarray) -> float:
    """The force without load: that of the record's start [N]."""
    return float(np.median(force[: max(5, len(force) // 20)]))


def _first_load(trace: Trace, start: int, stop: int) -> int:
    """The first sample of a cut that is under half its load."""
    part = np.abs(trace.force[start:stop] - _level(trace.force[start:stop]))
    return start + int(np.argmax(part >= PRESSED * np.percentile(part, 98)))


def _smooth(force: np.ndarray) -> np.ndarray:
    """Median of three, so that a lone value is no cut."""
    inner = np.median(np.stack([force[:-2], force[1:-1], force[2:]]), axis=0)
    return np.concatenate([force[:1], inner, force[-1:]])


def _released(force: np.ndarray) -> list[int]:
    """Where the force is released between two loads, by the force alone."""
    loads, top = _loads(force)
    if top < CLEAR_SD * noise_of(force):
        return []
    stretches = _stretches(loads, TOUCHED * top, RELEASED * top)
    longest = max((b - a for a, b in stretches), default=0)
    cuts = [(a, b) for a, b in stretches if b - a >= AS_LONG * longest]
    marks = []
    for (start, end), (begin, stop) in zip(cuts[:-1], cuts[1:], strict=True):
        free = end + np.flatnonzero(loads[end:begin] < RELEASED * top)
        if len(free) >= max(REST * min(end - start, stop - begin), 5):
            marks.append(int(free[0] + free[-1]) // 2)
    return marks


def _loads(force: np.ndarray) -> tuple[np.ndarray, float]:
    """The force without its level, in the direction in which it goes further [N], and how far it goes [N]."""
    away = _smooth(force) - _level(force)
    low, top = np.percentile(away, (0.5, 99.5))
    return (away, float(top)) if top >= -low else (-away, -float(low))


def _main_load(force: np.ndarray) -> tuple[int, int]:
    """First sample and the one after the last of the part of a force with its largest load.

    Another load that is less than half of it, and lies apart by a quarter of its time, is none of the cut: a knife that
    touched before, or was wiped behind it.
    """
    loads, top = _loads(force)
    least = max(SLIGHT * top, CLEAR_SD * noise_of(force))
    stretches = _stretches(loads, least, 0.5 * least) if top > least else []
    if len(stretches) < 2:
        return 0, len(force)
    largest = [float(loads[a : b + 1].max()) for a, b in stretches]
    main = int(np.argmax(largest))
    begin, end = stretches[main]
    rest = max(REST * (end - begin), 5)
    start, stop = 0, len(force)
    for (a, b), load in zip(stretches, largest, strict=True):
        if load < PRESSED * top and b - a >= FEWEST_LOADED:
            if begin - b >= rest:
                start = max(start, (b + begin) // 2)
            elif a - end >= rest:
                stop = min(stop, (end + a) // 2)
    return start, stop


def _stretches(loads: np.ndarray, high: float, low: float) -> list[tuple[int, int]]:
    """First and last sample above ``high`` of each stretch that does not go below ``low``."""
    found: list[tuple[int, int]] = []
    pressed = False
    for i, x in enumerate(loads):
        if x > high:
            found = [*found[:-1], (found[-1][0], i)] if pressed else [*found, (i, i)]
            pressed = True
        elif x < low:
            pressed = False
    return found


def _loaded(force: np.ndarray, position: np.ndarray) -> list[tuple[int, int]]:
    """First sample and the one after the last of each way down and up again on which the knife is under load."""
    edges = [0, *_tops(position), len(position)]
    load = np.abs(_smooth(force) - _level(force))
    least = max(TOUCHED * float(np.percentile(load, 99.5)), CLEAR_SD * noise_of(force))
    ways = list(zip(edges[:-1], edges[1:], strict=True))
    found = [(a, b) for a, b in ways if np.count_nonzero(load[a:b] > least) >= FEWEST_LOADED]
    return found if found and len(ways) > 1 else [(0, len(position))]


def _tops(position: np.ndarray) -> list[int]:
    """Where the knife is highest between two ways down, each of half its range."""
    span = float(np.ptp(position))
    marks: list[int] = []
    low, high, at, falling = float(position[0]), float(position[0]), 0, False
    fallen = False
    for i, z in enumerate(map(float, position)):
        if falling:
            low = min(low, z)
            if z > low + RAISED * span:
                falling, high, at = False, z, i
        elif z >= high:
            high, at = z, i
        elif z < high - RAISED * span:
            if fallen:
                marks.append(at)
            falling, fallen, low = True, True, z
    return marks


def _without_others(trace: Trace, span: tuple[int, int]) -> Trace:
    """The part of a record with its only cut, without the touches that are none; with a note where there are such."""
    start, stop = span
    if (start, stop) == (0, len(trace.time)) or stop - start < MIN_SAMPLES:
        return trace
    where = f"from {trace.where(start)} to {trace.where(stop - 1)}"
    what = "is under little load" if trace.position is None else "comes down under no load"
    note = f"{trace.source}: only {where} is taken for the cut; the knife {what} elsewhere (--cut {WHOLE} if not)"
    return replace(trace.part(np.arange(start, stop)), breaks=(), notes=(*trace.notes, note))
