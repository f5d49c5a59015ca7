"""The clock of a record: what can be wrong with it, what of that is repaired, and what is refused with its place."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.io.wording import LONG, brief, quoted
from calib.table.table import Table
from calib.table.units import SI_OF_ROLE
from calib.trace.columns import Column
from calib.trace.names import COUNTERS, stem_of

SLOWEST_S, FASTEST_S = 0.5, 2e-5
"""Median sampling intervals outside are taken for a unit mix-up [s]: a clock of a kilohertz in milliseconds read as
seconds has 1 s, one of 50 Hz in seconds read as milliseconds 2e-5 s."""
CLOCK_JITTER = 0.5
"""Largest deviation of a step from the mean step for a column that looks like a clock [-]."""
STANDING = 0.3
"""Part of the rows that repeat the time before them from which on the clock ticks more slowly than rows are written."""
JUMP = 5.0
"""Steps of the clock, in median steps, from which on it has jumped, or samples are missing."""
MOST_JUMPS = 5
"""Jumps of a clock that are repaired; more of them leave nothing of it."""
MOST_AGAIN = 0.1
"""Part of the rows that may repeat earlier ones, as where pieces of a record overlap; a record that is there twice has
more."""
MOST_UNORDERED, LATEST_ROWS = 0.05, 10
"""Part of the rows after which time falls, and rows by which one is away from its place, in a record that is sorted."""
FEWEST_ROWS = 20
"""Rows from which on what follows a restart of the clock is a record of its own."""
_PREFIXES = {1e-3: "milliseconds", 1e-6: "microseconds", 1e-9: "nanoseconds"}
_SHORT = {1e-3: "ms", 1e-6: "us", 1e-9: "ns"}


@dataclass(frozen=True)
class Clock:
    """A time that increases.

    Attributes:
        time: Time of each kept sample [s], shape (m,).
        kept: Indices of the samples that were kept, shape (m,).
        sd: Standard uncertainty of a time that the repair leaves [s].
        breaks: Indices, among the kept, with which another record begins.
        notes: What was done, one sentence each.
    """

    time: np.ndarray
    kept: np.ndarray
    sd: float = 0.0
    breaks: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


def running_clock(
    table: Table, columns: tuple[Column, Column], t: np.ndarray, f: np.ndarray, p: np.ndarray | None
) -> Clock:
    """The clock of a record, repaired where that is sound.

    A clock that ticks more slowly than rows are written is spread over the rows between its ticks. Rows that repeat the
    row before them are left out. A jump that the knife's position shows to be none of the motion is taken out. A clock
    that starts again begins another record.

    Args:
        table: Where the record comes from.
        columns: Columns of the time and of the force.
        t: Time [s], shape (n,).
        f: Force [N], shape (n,).
        p: Height of the knife [m], shape (n,), or None.

    Returns:
        The clock.

    Raises:
        TraceError: It cannot be repaired; the message names row and column.
    """
    time, force = columns
    end = _filled(t, f, p)
    unfilled = []
    if end < len(t):
        first = f"{table.row} {brief(table.rows[end])}"
        unfilled = [f"{table.source}: {len(t) - end} rows of zeros from {first} to the end are no samples; left out"]
        t, f, p = t[:end], f[:end], None if p is None else p[:end]
        table = table.part(np.arange(end))
    _check_swapped(table, time, force, t, f)
    order, ordered = _in_order(table, time, (t, f) if p is None else (t, f, p))
    if ordered:
        t, f, p = t[order], f[order], None if p is None else p[order]
        table = replace(table, rows=[table.rows[i] for i in order])
    steps = np.diff(t)
    if np.any(steps < 0.0) or np.mean(steps == 0.0) < STANDING:
        clock = _without_repeats(table, t, f, p)
    else:
        clock = _spread(table, time, t)
    clock = replace(clock, notes=(*unfilled, *ordered, *clock.notes))
    clock = _restarted(table, time, clock, p)
    clock = _without_jumps(table, time, clock, p)
    bad = np.flatnonzero(np.diff(clock.time) <= 0.0)
    if len(bad):
        i = int(bad[0])
        raise TraceError(
            f"{_place(table, time, clock.kept[i + 1])}: time does not increase ({clock.time[i]:.10g} s, then "
            f"{clock.time[i + 1]:.10g} s); remove repeated rows, cut the file where the clock restarts, or give --rate "
            "where rows are written at a known rate"
        )
    _check_rate(table, time, clock.time, t)
    return replace(clock, kept=order[clock.kept])


def _filled(t: np.ndarray, f: np.ndarray, p: np.ndarray | None) -> int:
    """Rows before the zeros at the end of an array that was longer than the record."""
    held = (t != 0.0) | (f != 0.0) | (False if p is None else p != 0.0)
    end = len(t) - int(np.argmax(held[::-1]))
    return end if held.any() and end < len(t) and t[end - 1] > 0.0 else len(t)


def _place(table: Table, column: Column, i: int) -> str:
    """The place of a cell, as the file counts its rows."""
    return f"{table.source}, {table.row} {brief(table.rows[i])}, column {brief(column.name, LONG)}"


def _check_swapped(table: Table, time: Column, force: Column, t: np.ndarray, f: np.ndarray) -> None:
    """Refuse a force that rises like a clock beside a time that does not.

    Raises:
        TraceError: They are so.
    """
    rises = np.diff(f)
    if not np.any(np.diff(t) <= 0.0) or not (np.all(rises > 0.0) or np.all(rises < 0.0)):
        return
    mean = float(np.abs(rises).mean())
    if np.all(np.abs(np.abs(rises) - mean) <= CLOCK_JITTER * mean):
        raise TraceError(
            f"{table.source}: columns {brief(time.name)} and {brief(force.name)} look swapped ({brief(force.name)} "
            f"rises in equal steps like a clock, {brief(time.name)} does not); exchange their names or use "
            "--time-col and --force-col"
        )


def _in_order(table: Table, time: Column, columns: tuple[np.ndarray, ...]) -> tuple[np.ndarray, list[str]]:
    """The samples in the order of their times, and what was done, one sentence each.

    A file that begins with the last sample is turned round before anything else. Rows that say again what an earlier
    row says are left out. A few rows that came late, as over a network, are put where they belong. A lone time that is
    far from both of its neighbours is left out.
    """
    t = columns[0]
    order, notes = np.arange(len(t)), []
    steps = np.diff(t)
    if len(t) < FEWEST_ROWS or len(table.parts) > 1 or np.all(steps > 0.0):
        return order, []
    if np.any(steps < 0.0) and np.count_nonzero(steps > 0.0) <= MOST_UNORDERED * np.count_nonzero(steps):
        turned = replace(table, rows=[table.rows[i] for i in order[::-1]])
        kept, more = _in_order(turned, time, tuple(numbers[::-1] for numbers in columns))
        return order[::-1][kept], [f"{table.source}: time falls from row to row; the record was turned round", *more]
    falls = np.flatnonzero(steps < 0.0)
    if not len(falls) or len(falls) > MOST_UNORDERED * len(t):
        return order, []
    rows = np.column_stack(columns)
    _, first = np.unique(rows, axis=0, return_index=True)
    again = np.setdiff1d(order, first)
    within = t < np.maximum.accumulate(t)
    if (
        len(again)
        and len(again) <= len(t) / 2
        and np.all(within[again] | np.isin(again - 1, again) | _same(rows, again))
    ):
        order = np.sort(first)
        if np.all(np.diff(t[order]) > 0.0):
            row = f"{table.row} {brief(table.rows[again[0]])}"
            return order, [f"{table.source}: {len(again)} rows, the first is {row}, repeat earlier ones; left out"]
        order = np.arange(len(t))
    usual = float(np.median(np.abs(steps)))
    middle = 0.5 * (t[:-2] + t[2:])
    lone = 1 + np.flatnonzero(
        (np.abs(t[2:] - t[:-2] - 2.0 * usual) <= usual) & (np.abs(t[1:-1] - middle) > JUMP * usual)
    )
    if 0 < len(lone) <= MOST_JUMPS:
        order = np.delete(order, lone)
        notes = [
            f"{_place(table, time, int(lone[0]))}: {len(lone)} of the times stand out alone; those rows were left out"
        ]
    late = np.argsort(t[order], kind="stable")
    moved = np.abs(late - np.arange(len(late)))
    if moved.any() and moved.max() <= LATEST_ROWS and np.all(np.diff(t[order][late]) > 0.0):
        place = _place(table, time, int(order[int(np.argmax(moved > 0))]))
        notes.append(f"{place}: {np.count_nonzero(moved)} rows are not in the order of their times; they were sorted")
        order = order[late]
    return order, notes


def _same(rows: np.ndarray, again: np.ndarray) -> np.ndarray:
    """Whether rows repeat the row just before them."""
    return np.array([bool(i) and bool(np.all(rows[i] == rows[i - 1])) for i in again], dtype=bool)


def _without_repeats(table: Table, t: np.ndarray, f: np.ndarray, p: np.ndarray | None) -> Clock:
    """The record without rows that say again what the row before them says."""
    same = (np.diff(t) == 0.0) & (np.diff(f) == 0.0) & (True if p is None else np.diff(p) == 0.0)
    kept = np.flatnonzero(np.r_[True, ~same])
    notes: tuple[str, ...] = ()
    if same.any() and len(kept) >= FEWEST_ROWS:
        i = int(np.argmax(same)) + 1
        notes = (
            f"{table.source}: {np.count_nonzero(same)} rows that repeat the row before them were left out, the first "
            f"is {table.row} {brief(table.rows[i])}",
        )
    else:
        kept = np.arange(len(t))
    return Clock(t[kept], kept, notes=notes)


def _spread(table: Table, time: Column, t: np.ndarray) -> Clock:
    """A clock that stands for several rows, with those rows spread evenly from one tick to the next.

    Raises:
        TraceError: It ticks too seldom, or nothing like evenly.
    """
    starts = np.flatnonzero(np.r_[True, np.diff(t) > 0.0])
    counts = np.diff(np.r_[starts, len(t)])
    inner = counts[1:-1]
    typical = float(np.median(inner)) if len(inner) else 0.0
    if len(inner) < 3 or np.mean(np.abs(inner - typical) > max(1.0, 0.5 * typical)) > 0.2:
        i = int(np.argmax(np.diff(t) == 0.0)) + 1
        raise TraceError(
            f"{_place(table, time, i)}: time does not increase ({t[i]:.10g} s twice); remove repeated rows, or give "
            "--rate where rows are written at a known rate"
        )
    tick = float(np.median(np.diff(t[starts])))
    index = np.arange(len(t), dtype=float)
    anchors = np.r_[starts.astype(float), starts[-1] + typical]
    whole = np.interp(index, anchors, np.r_[t[starts], t[starts[-1]] + tick])
    step = tick / typical
    late = index > anchors[-1]
    whole[late] = t[starts[-1]] + tick + step * (index[late] - anchors[-1])
    note = (
        f"{table.source}: the clock {brief(time.name, LONG)} ticks every {tick:.4g} s and stands for about {typical:g} "
        f"rows each time; they were spread evenly, which leaves times open by {tick / 12**0.5:.2g} s (give --rate "
        "where the rate of the rows is known)"
    )
    return Clock(whole, np.arange(len(t)), sd=tick / 12**0.5, notes=(note,))


def _restarted(table: Table, time: Column, clock: Clock, p: np.ndarray | None) -> Clock:
    """The record with the times after a restart counted on, and the places of restarts and of parts of the file.

    Where the knife moves on through a restart as before it, the record does not begin anew: the clock has jumped.
    """
    t = clock.time
    steps = np.diff(t)
    step = float(np.median(steps))
    begin = np.flatnonzero(steps < 0.0) + 1
    near = max(JUMP * step, 0.02 * np.ptp(t))
    goes_on = [int(i) for i in begin if np.all(np.abs(steps[i : i + 3]) <= JUMP * step)]
    restarts = [i for i in goes_on if abs(t[i] - t[0]) <= near]
    parts = [int(np.searchsorted(clock.kept, start)) for start in table.parts[1:]]
    parts = [i for i in parts if not 0.0 < steps[i - 1] <= JUMP * step]  # the clock goes on: one record in pieces
    if p is not None:
        height = p[clock.kept]
        restarts = [i for i in restarts if not _moves_on(height, i)]
    ends = sorted({*restarts, *parts})
    if not ends or min(np.diff([0, *ends, len(t)])) < FEWEST_ROWS:
        return clock
    out = t.copy()
    for i in restarts:
        out[i:] += out[i - 1] - out[i] + step
    for i in parts:
        if out[i] <= out[i - 1]:
            out[i:] += out[i - 1] - out[i] + step
    rows = ", ".join(f"{table.row} {brief(table.rows[clock.kept[i]])}" for i in ends[:3])
    note = f"{table.source}: the record begins anew at {rows}; times are counted on from there"
    return Clock(out, clock.kept, clock.sd, tuple(ends), (*clock.notes, note))


def _moves_on(height: np.ndarray, i: int) -> bool:
    """Whether the knife moves from one sample to the next as it does around them [m], shape (n,)."""
    near = np.diff(height[max(i - 8, 0) : i + 8])
    step, usual = float(height[i] - height[i - 1]), float(np.median(near))
    return abs(usual) > 0.0 and 0.0 < step / usual < 3.0 and float(np.std(near)) < abs(usual)


def _without_jumps(table: Table, time: Column, clock: Clock, p: np.ndarray | None) -> Clock:
    """The record with the jumps of its clock taken out that the knife's motion shows to be none of it."""
    if p is None or len(clock.time) < FEWEST_ROWS:
        return clock
    t, height = clock.time.copy(), p[clock.kept]
    steps = np.diff(t)
    step = float(np.median(steps))
    if not step > 0.0:
        return clock
    usual = (steps > 0.0) & (steps <= JUMP * step)
    places = [int(i) for i in np.flatnonzero(~usual) if int(i) + 1 not in clock.breaks]
    if len(places) > MOST_JUMPS:
        return clock
    notes = []
    moves = np.abs(np.diff(height))
    for i in places:
        near = np.r_[max(i - 10, 0) : i, i + 1 : min(i + 11, len(steps))].astype(int)
        near = near[usual[near]]
        speed = float(np.median(moves[near] / steps[near])) if len(near) > 4 else 0.0
        lone = i + 1 < len(steps) and steps[i] * steps[i + 1] < 0.0 and not usual[i + 1]
        as_one_step = moves[i] <= 3.0 * speed * step
        if lone or speed * step <= 0.0 or not as_one_step or abs(steps[i]) * speed <= 2.0 * moves[i]:
            continue
        t[i + 1 :] -= steps[i] - step
        ahead = "ahead" if steps[i] > 0 else "back"
        notes.append(
            f"{_place(table, time, clock.kept[i + 1])}: the clock jumps {ahead} by {abs(steps[i] - step):.4g} s, but "
            "the knife moves on by one sample; the jump was taken out"
        )
    sd = float(np.hypot(clock.sd, step)) if notes else clock.sd
    return Clock(t, clock.kept, sd, clock.breaks, (*clock.notes, *notes))


def _check_rate(table: Table, time: Column, t: np.ndarray, raw: np.ndarray) -> None:
    """Refuse a sampling interval that only another unit, or a counter, explains.

    Raises:
        TraceError: It is so.
    """
    median = float(np.median(np.diff(t)))
    where = f"{table.source}, column {brief(time.name, LONG)}: samples are {median:g} s apart"
    if median >= SLOWEST_S:
        factor = 10.0 ** round(np.log10(abs(time.factor)))
        finer = next((f for f in _PREFIXES if f < factor and median * f / factor < SLOWEST_S), None)
        counts = raw / time.factor
        counting = bool(np.all(counts == np.round(counts)) and np.median(np.diff(counts)) == 1.0)
        if counting and stem_of(time.name) in COUNTERS:
            raise TraceError(f"{where}; it counts rows: give their rate in Hz with --rate")
        counter = ", or counts rows: give their rate with --rate" if counting else ""
        if finer is None:
            raise TraceError(f"{where}, less than {1 / SLOWEST_S:g} a second; check the unit of the column{counter}")
        name = quoted(f"{brief(time.name)}={_SHORT[finer]}")
        raise TraceError(f"{where}; this looks like {_PREFIXES[finer]}: say --time-col {name}{counter}")
    if median < FASTEST_S:
        name = quoted(f"{brief(time.name)}={SI_OF_ROLE['time']}")
        raise TraceError(
            f"{where}, more than {1 / FASTEST_S:g} a second; check the unit of the column, and say it, as in "
            f"--time-col {name}"
        )
