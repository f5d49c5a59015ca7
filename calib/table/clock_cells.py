"""Clocks that are written as dates and times of the day, as durations, or as whole seconds beside nanoseconds."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib.table.table import Cells, Table, as_float

DAY = 86400.0
"""Seconds of a day."""
_CLOCK = re.compile(
    r"""\s*(?:[A-Za-z]{3},?\ +)?(?P<date>\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}[- ][A-Za-z]{3}[- ]\d{2,4}|\d{8}|
    \d+\ days?|[A-Za-z]{3,9}\.?\ +\d{1,2}(?:,?\ +\d{4}(?=[ ,]))?)?[T ,_]*
    (?P<sign>-?)(?P<h>\d{1,3}):(?P<m>\d{2})(?::(?P<s>\d{2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp]\.?[Mm]\.?)?
    \s*(?:Z|UTC|[-+]\d{2}:?\d{2}|\ \d{4})?\s*""",
    re.VERBOSE,
)
_COMPACT = re.compile(r"\s*(?P<date>\d{8})[T _-](?P<h>\d{2})(?P<m>\d{2})(?P<s>\d{2}(?:[.,]\d+)?)Z?\s*")
"""A stamp without marks between its parts, as in the names of files."""
_MINUTES = re.compile(r"\s*(?P<m>\d{1,3}):(?P<s>\d{2}[.,]\d+)\s*")
"""Minutes and seconds, as spreadsheets show a time of the day."""
_SECONDS = re.compile(r"(?P<stamp>.*stamp[._/]|.*header[._/]|)secs?", re.IGNORECASE)
_NANOS = ("nanosec", "nsec", "nsecs", "nanosecs")


def with_clocks(table: Table) -> Table:
    """A table whose dates and times of the day are seconds, and whose stamps in two columns are one.

    Args:
        table: The table as the file holds it.

    Returns:
        The same where it has no such clock.
    """
    columns, units, clocks = dict(table.columns), dict(table.units), []
    for name, cells in table.columns.items():
        seconds = seconds_of(cells)
        if seconds is not None:
            columns[name], units[name] = seconds, "s"
            clocks.append(name)
    return replace(table, columns=_joined(columns, units), units=units, clocks=tuple(clocks))


def seconds_of(cells: Cells) -> np.ndarray | None:
    """A column of dates, times of the day or durations as seconds since its first, None where it is none.

    The day is counted up where the date changes, or where the time of the day begins anew. What stands for the date is
    not read: whether it is the third of April or the fourth of March does not matter to a cut.

    Args:
        cells: The cells, n of them.

    Returns:
        Seconds [s], shape (n,).
    """
    if isinstance(cells, np.ndarray):
        if cells.dtype.kind not in "mM" or np.isnat(cells).any():
            return None
        return np.asarray((cells - cells[0]) / np.timedelta64(1, "ns") * 1e-9, dtype=float)
    if not len(cells) or not isinstance(cells[0], (str, datetime.datetime, datetime.time, datetime.timedelta)):
        return None
    if not isinstance(cells[0], str):
        return _of_objects(cells)
    pattern = next((one for one in (_MINUTES, _COMPACT, _CLOCK) if one.fullmatch(cells[0])), None)
    if pattern is None:
        return None
    found = [pattern.fullmatch(cell) if isinstance(cell, str) else None for cell in cells]
    return _counted(_padded([match.groupdict() for match in found if match])) if all(found) else None


def _padded(parts: list[dict[str, str | None]]) -> list[dict[str, str | None]]:
    """Times of the day with three digits of milliseconds where those behind a colon lack zeros (``12:00:00:5``)."""
    ends = [(part.get("s") or "").partition(":") for part in parts]
    widths = {len(end[2]) for end in ends}
    if len(widths) == 1 or not all(end[1] for end in ends) or max(widths) > 3:
        return parts
    return [part | {"s": f"{whole}:{part_of:0>3}"} for part, (whole, _, part_of) in zip(parts, ends, strict=True)]


def _counted(parts: Sequence[Mapping[str, str | None]]) -> np.ndarray | None:
    """Seconds since the first of times of the day, with the days between them."""
    out = np.empty(len(parts))
    days, last, before = 0, parts[0].get("date"), -np.inf
    for i, part in enumerate(parts):
        seconds = _of_day(part)
        if seconds is None:
            return None
        if part.get("date") != last:
            days, last = days + 1, part.get("date")
        elif part.get("date") is None and before - seconds > DAY / 2:
            days += 1
        before = seconds
        out[i] = days * DAY + seconds
    return out - out[0]


def _of_day(part: Mapping[str, str | None]) -> float | None:
    """Seconds since midnight, None for a time that no clock shows."""
    hours, minutes = int(part.get("h") or 0), int(part["m"] or 0)
    text = (part.get("s") or "0").replace(",", ".").replace(":", ".")
    half = (part.get("half") or "").lower()[:1]
    if half:
        hours = hours % 12 + (12 if half == "p" else 0)
    if ("h" in part and minutes > 59) or float(text) >= 61.0:
        return None
    total = 3600.0 * hours + 60.0 * minutes + float(text)
    return -total if part.get("sign") else total


def _of_objects(cells: Sequence[Any]) -> np.ndarray | None:
    """Seconds since the first of Python's dates and times, None where a cell is none."""
    kinds = (datetime.datetime, datetime.time, datetime.timedelta)
    if not all(isinstance(cell, kinds) and type(cell) is type(cells[0]) for cell in cells):
        return None
    if isinstance(cells[0], datetime.time):
        parts = [{"h": str(c.hour), "m": str(c.minute), "s": f"{c.second:02d}.{c.microsecond:06d}"} for c in cells]
        return _counted(parts)
    return np.array([(cell - cells[0]).total_seconds() for cell in cells])


def _joined(columns: Mapping[str, Cells], units: dict[str, str]) -> dict[str, Cells]:
    """The columns, with those of seconds and nanoseconds of one stamp as one column of seconds."""
    out = dict(columns)
    for name, cells in columns.items():
        found = _SECONDS.fullmatch(name)
        tail = re.search(r"secs?$", name, re.IGNORECASE)
        if not found or not tail:
            continue
        nanos = next((name[: tail.start()] + word for word in _NANOS if name[: tail.start()] + word in columns), None)
        if nanos is None:
            continue
        whole, part = _floats(cells), _floats(columns[nanos])
        if whole is not None and part is not None:
            stamp = found.group("stamp").rstrip("._/")
            stamp = stamp if stamp.endswith("stamp") else f"{stamp}.stamp".lstrip(".")
            out[stamp], units[stamp] = whole + 1e-9 * part, "s"
            del out[name], out[nanos]
    return out


def _floats(cells: Cells) -> np.ndarray | None:
    values = [as_float(cell) for cell in cells]
    return None if any(value is None for value in values) else np.array(values, dtype=float)


def is_clock(cell: str) -> bool:
    """Whether a cell holds a time of the day, with a date or without."""
    return any(pattern.fullmatch(cell) for pattern in (_CLOCK, _MINUTES, _COMPACT))
