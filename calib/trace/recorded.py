"""From a table to the numbers of a record: which columns, on which rows, at which times, counted in which direction."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, TypeVar

import numpy as np

from calib.errors import TraceError
from calib.io.kinds import COLUMN, check_kind
from calib.io.wording import LONG, brief, listed, quoted
from calib.table.table import Table, rows_at
from calib.trace.clock import running_clock
from calib.trace.columns import Column, choose, is_sparse, numbers, without_empty
from calib.trace.names import COUNTERS, candidates, counted_either_way, meaning, named_like, not_measured, stem_of

Chosen = TypeVar("Chosen")
MIN_SAMPLES = 20
"""Fewest samples of a trace: below this, baseline, onset and ramp have under seven samples each."""
CLOCK_START_S = 1000.0
"""Time of the first sample from which on a clock has begun elsewhere [s], at the start of a robot or in 1970; the trace
then counts from its first sample."""
DISABLED = "none"
"""Value of ``position_col`` that leaves a position column unused."""
MOST_LETTERS = 450
"""Of an error that says two things at once; a longer one says the first alone."""
ROWS = "the rows"
"""What the time is called where rows are counted."""
OF_NUMERALS = ("follow a comma", "set off thousands")
"""Ends of notes on how numbers are written, which say nothing of whether a column is read."""
MOST_UNUSED = 5
"""Names that a note on unused columns shows of those that nothing is said of."""
RISING = 0.1
"""Part of a position's range by which it rises with the force if it is no height."""
BOTH_WAYS = 0.1
"""Part of its largest excursion by which a force goes to the other side of its level too if a food holds the knife."""
TURNED = 0.2
"""Part of a depth's range by which it must fall up to the load for it to be counted negative downwards."""


@dataclass(frozen=True)
class Reading:
    """How a record is to be read.

    Attributes:
        time_col: Column to use as time; without a unit in its name it is taken as seconds. A unit behind ``=`` says it.
        force_col: Column to use as force; without a unit in its name it is taken as newtons.
        position_col: Column to use as position (metres if its name has no unit); ``none`` uses no position.
        depth_col: The same where it holds the way down, which grows as the knife descends.
        sign: ``+`` or 1 if positive numbers mean resistance to the knife, ``-`` or -1 if negative ones do.
        rate: Rows a second [1/s], where the file has no clock or a counter in place of one.
        decimal: The mark before decimals in a text file, ``.`` or ``,``; None to tell it from the numbers.

    Raises:
        CutcalError: A name of a column that is no text.
        TraceError: A rate that is not positive, a mark that is none.
    """

    time_col: str | None = None
    force_col: str | None = None
    position_col: str | None = None
    depth_col: str | None = None
    sign: str | int | None = None
    rate: float | None = None
    decimal: str | None = None

    def __post_init__(self) -> None:
        for name in ("time_col", "force_col", "position_col", "depth_col"):
            if (column := getattr(self, name)) is not None:
                check_kind("record", name, column, *COLUMN)
        rate: Any = self.rate
        plain = isinstance(rate, Real) and not isinstance(rate, bool)
        if rate is not None and not (plain and np.isfinite(rate) and rate > 0.0):
            raise TraceError(f"rate {quoted(rate)} is not positive; give the rows a second (option --rate)")
        if self.decimal not in (None, ".", ","):
            raise TraceError(f"decimal mark {quoted(self.decimal)} is neither . nor , (option --decimal)")


@dataclass(frozen=True)
class Recorded:
    """The numbers of a record.

    Attributes:
        time: Time [s], strictly increasing, shape (n,).
        force: Force, resistance positive [N], shape (n,).
        position: Height of the knife [m], shape (n,), or None.
        rows: What the file calls each sample's row, n of them.
        columns: Name of the column of each role.
        start: Time of the first sample on a clock that began elsewhere [s], 0 for one that did not.
        time_sd: Standard uncertainty of a time that a repair of the clock leaves [s].
        breaks: Indices with which another record of the file begins.
        notes: What was done, one sentence each.
    """

    time: np.ndarray
    force: np.ndarray
    position: np.ndarray | None
    rows: Sequence[object]
    columns: Mapping[str, str]
    start: float
    time_sd: float
    breaks: tuple[int, ...]
    notes: tuple[str, ...]


def recorded(table: Table, how: Reading) -> Recorded:
    """The record in a table.

    Args:
        table: The table.
        how: How it is to be read.

    Returns:
        Its numbers.

    Raises:
        TraceError: A column or a cell cannot be used; the message names file, column and row.
    """
    time, said, force, position = _chosen(table, how)
    if how.sign is not None:
        force = replace(force, factor=abs(force.factor) * parse_sign(how.sign))
    table = without_empty(table, [column for column in (time, force, position) if column is not None])
    if len(table.rows) < MIN_SAMPLES:
        raise TraceError(f"{table.source}: {len(table.rows)} rows of data, at least {MIN_SAMPLES} are needed")
    t = numbers(table, time) if time.name != ROWS else time.factor * np.arange(len(table.rows))
    f = numbers(table, force, sparse=is_sparse(table, force.name))
    p = None if position is None else numbers(table, position, sparse=is_sparse(table, position.name))
    t, f, p, on, sparse = _on_the_forces_rows(table, (time, force), t, f, p)
    part = replace(table, rows=rows_at(table.rows, on), parts=_parts_of(table, on))
    clock = running_clock(part, (time, force), t, f, p)
    f, p = f[clock.kept], None if p is None else p[clock.kept]
    turned: tuple[str, ...] = ()
    if position is not None and p is not None and (position.depth or how.depth_col is not None):
        p, turned = _downwards(table, position, f, p)
    start = float(clock.time[0]) if abs(clock.time[0]) > CLOCK_START_S else 0.0
    used = {"time": time, "force": force} | ({} if position is None else {"position": position})
    notes = (*table.notes, *said, *(note for column in used.values() for note in column.notes), *sparse)
    notes += _unused(table, [column.name for column in used.values()], how, notes)
    return Recorded(
        time=clock.time - start,
        force=f,
        position=p,
        rows=rows_at(part.rows, clock.kept),
        columns={role: column.name for role, column in used.items()},
        start=start,
        time_sd=clock.sd,
        breaks=clock.breaks,
        notes=(*notes, *clock.notes, *turned),
    )


def parse_sign(sign: str | int) -> float:
    """The factor of a ``--sign`` option.

    Raises:
        TraceError: It is none.
    """
    signs = {"+": 1.0, "-": -1.0, "1": 1.0, "+1": 1.0, "-1": -1.0}
    if str(sign) not in signs:
        raise TraceError(f"sign {quoted(sign)} is not one of +, -, 1, -1 (option --sign)")
    return signs[str(sign)]


def _chosen(table: Table, how: Reading) -> tuple[Column, list[str], Column, Column | None]:
    """The columns of the time, of the force and of the knife's place, and what was said of the time.

    Raises:
        TraceError: One of them cannot be used, or several: it is then said of all at once, as far as it is short.
    """
    refused: list[TraceError] = []

    def tried(choice: Callable[[], Chosen]) -> Chosen | None:
        try:
            return choice()
        except TraceError as error:
            refused.append(error)
            return None

    time = tried(lambda: _time_column(table, how))
    force = tried(lambda: choose(table, "force", how.force_col))
    position = tried(lambda: _position_column(table, how))
    if refused or time is None or force is None:
        raise _at_once(table, refused)
    return *time, force, position


def _at_once(table: Table, refused: Sequence[TraceError]) -> TraceError:
    """Errors about several columns as one; what does not fit into ``MOST_LETTERS`` is left for the next try."""
    said = str(refused[0])
    for error in refused[1:]:
        known = re.split("; (?:and )?", said)
        more = [text for text in str(error).removeprefix(f"{table.source}: ").split("; ") if text not in known]
        both = f"{said}; and {'; '.join(more)}"
        if more and str(error) != str(refused[0]) and len(both) <= MOST_LETTERS:
            said = both
    return TraceError(said)


def _time_column(table: Table, how: Reading) -> tuple[Column, list[str]]:
    """The column of the time; with a rate, that of the counter, or the numbers of the rows.

    Raises:
        TraceError: There is none.
    """
    if how.rate is None:
        return choose(table, "time", how.time_col), []
    name = how.time_col
    if name is None:
        counters = [n for n in table.columns if stem_of(n) in COUNTERS and _counts(table, n)]
        name = counters[0] if len(counters) == 1 else None
    if name is not None and not _counts(table, name):
        raise TraceError(
            f"{table.source}, column {brief(name, LONG)}: not a counter that rises, so --rate {how.rate:g} says "
            "nothing of it; leave --time-col out to count the rows, or leave --rate out"
        )
    what = f"counted by {brief(name, LONG)}" if name is not None else "counted by rows"
    unused = [n for n in candidates(table, "time") if n != name]
    beside = f"; the clock {brief(unused[0], LONG)} is not used" if unused else ""
    said = [f"{table.source}: time is {what} at {how.rate:g} a second (--rate){beside}"]
    if name is None:
        return Column(ROWS, "time", 1.0 / how.rate), said
    return Column(name, "time", 1.0 / how.rate), said


def _counts(table: Table, name: str) -> bool:
    """Whether a column holds whole numbers that never fall."""
    if name not in table.columns:
        raise TraceError(f"{table.source}: no column {quoted(name)} (--time-col); check its name")
    try:
        values = numbers(table, Column(name, "time", 1.0))
    except TraceError:
        return False
    return len(values) > 1 and bool(np.all(values == np.round(values)) and np.all(np.diff(values) > 0))


def _position_column(table: Table, how: Reading) -> Column | None:
    """The column of the knife's place, None where there is none.

    Raises:
        TraceError: Two are named, or the named one cannot be used.
    """
    if how.depth_col is not None:
        if how.position_col is not None:
            raise TraceError(
                f"{table.source}: --position-col beside --depth-col; the knife's place is in one column, give one"
            )
        column = choose(table, "position", how.depth_col, "--depth-col")
        return replace(column, factor=-abs(column.factor), depth=True)
    if how.position_col == DISABLED or (how.position_col is None and not candidates(table, "position")):
        return None
    return choose(table, "position", how.position_col)


def _unused(table: Table, used: Sequence[str], how: Reading, said: Sequence[str]) -> tuple[str, ...]:
    """A sentence on the columns that are not read, with what could be the knife's place first, or nothing.

    Args:
        table: The table.
        used: Names of the columns that are read.
        how: How the record is read.
        said: What was said before: a column that it names is not named again. Numbers of rows are not named at all.

    Returns:
        The sentence, or nothing where all columns are read.
    """
    words = [note.removeprefix(f"{table.source}: ") for note in said if not note.endswith(OF_NUMERALS)]
    names = [
        name
        for name in table.columns
        if name not in used
        and not any(re.search(rf"(?<!\w){re.escape(brief(name, LONG))}(?!\w)", text) for text in words)
        and not (stem_of(name) in {*COUNTERS, "", "unnamed_0"} and _counts(table, name))
    ]
    asked = how.position_col is None and how.depth_col is None
    free = [name for name in names if not not_measured(name)] if asked and len(used) < 3 else []
    lengths = [name for name in free if (unit := meaning(table, name).measure) and unit.fits("position")]
    bare = [name for name in free if not meaning(table, name).unit and named_like(stem_of(name), "position")]
    parts = []
    if lengths:
        what = ("a length", "it") if len(lengths) == 1 else ("lengths", "one")
        hint = f"{what[0]}; --position-col takes {what[1]} as the knife's height, --depth-col as its depth"
        parts.append(f"{listed(lengths, LONG)} ({hint})")
    if bare:
        hint = f"no unit; if it is the knife's place: --position-col {quoted(f'{brief(bare[0])}=mm')}"
        parts.append(f"{listed(bare, LONG)} ({hint})")
    others = [name for name in names if name not in (*lengths, *bare)]
    if others:
        more = len(others) - MOST_UNUSED
        parts.append(listed(others[:MOST_UNUSED], LONG) + (f" and {more} more columns" if more > 0 else ""))
    return (f"{table.source}: not used: {', '.join(parts)}",) if parts else ()


def _on_the_forces_rows(
    table: Table, columns: tuple[Column, Column], t: np.ndarray, f: np.ndarray, p: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray, list[str]]:
    """The record on those rows of a table of several topics that hold a force, the position interpolated there.

    Raises:
        TraceError: Forces and positions are not at the same time.
    """
    held = ~np.isnan(f)
    places = np.ones(len(f), dtype=bool) if p is None else ~np.isnan(p)
    if held.all() and places.all():
        return t, f, p, np.arange(len(f)), []
    if np.any(np.diff(t) < 0.0):
        i = int(np.argmax(np.diff(t) < 0.0)) + 1
        raise TraceError(
            f"{table.source}, {table.row} {brief(table.rows[i])}, column {brief(columns[0].name, LONG)}: time falls in "
            "a table of several topics; sort its rows by time"
        )
    said = []
    if p is not None:
        inside = (t >= t[places][0]) & (t <= t[places][-1])
        edge = 2.0 * float(np.median(np.diff(t[places])))
        inside |= (t >= t[places][0] - edge) & (t <= t[places][-1] + edge)
        if not held.all() and np.count_nonzero(held & inside) < MIN_SAMPLES:
            raise TraceError(
                f"{table.source}: forces and positions are not at the same time; name a position of the same record "
                "with --position-col, or none and give --speed"
            )
        held &= inside
        p = np.interp(t, t[places], p[places])
        said.append(
            f"{table.source}: position and force are in rows of their own; the position was interpolated at the times "
            "of the force"
        )
    else:
        said.append(f"{table.source}: {np.count_nonzero(~held)} rows without a force, of other topics, were left out")
    on = np.flatnonzero(held)
    return t[on], f[on], None if p is None else p[on], on, said


def _parts_of(table: Table, on: np.ndarray) -> tuple[int, ...]:
    """Where the parts of a table begin among some of its rows."""
    return tuple(int(np.searchsorted(on, start)) for start in table.parts)


def rises_with_the_force(f: np.ndarray, p: np.ndarray | None) -> bool:
    """Whether a height [m], shape (n,), rises while the force [N], shape (n,), comes from a tenth to nine tenths of its
    largest, so that it is none."""
    loaded = f - np.median(f[: max(5, len(f) // 20)])
    least, most = np.percentile(loaded, (2, 98))
    main = loaded if most >= -least else -loaded
    if min(most, -least) > BOTH_WAYS * max(most, -least):  # what comes first is the cut, what comes later is adhesion
        main = loaded * np.sign(loaded[int(np.argmax(np.abs(loaded) >= 0.5 * min(most, -least)))])
    loaded = main
    top = float(np.percentile(loaded, 98))
    late = int(np.argmax(loaded >= 0.9 * top))
    low = np.flatnonzero(loaded[:late] < 0.1 * top)
    return p is not None and len(low) > 0 and float(p[late] - p[low[-1]]) > RISING * float(np.ptp(p))


def _downwards(table: Table, column: Column, f: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
    """The height of a knife whose depth may be counted negative downwards: it must be lower under load than before."""
    loaded = np.abs(f - np.median(f[: max(5, len(f) // 20)]))
    high = loaded >= 0.5 * np.percentile(loaded, 98)
    risen = float(np.mean(p[high]) - p[0])
    falls = risen > TURNED * np.ptp(p)
    name = f"{table.source}: {brief(column.name, LONG)}"
    if counted_either_way(table, column.name):
        moves, kind = ("falls", "height") if falls else ("rises", "depth")
        return (-p if falls else p), (f"{name} {moves} as the knife descends, so it is taken for its {kind}",)
    if not falls:
        return p, ()
    return -p, (f"{name} falls as the knife descends, so it is taken as negative downwards",)
