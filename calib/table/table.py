"""A table of measured columns as a file holds it, and what the readers of all kinds of files share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.io.wording import quoted

MEASURED, RECONSTRUCTED = "measured", "reconstructed"
TRACE_LABELS = (MEASURED, RECONSTRUCTED)
"""What a trace is said to be; nothing fitted to a reconstruction is validated."""

Cells = Sequence[Any] | np.ndarray
"""Cells of a column as a file holds them: text, numbers or whatever else."""


@dataclass(frozen=True)
class Table:
    """Named columns of one length.

    Attributes:
        source: What errors call the table: file name, with the group of an HDF5 file.
        columns: Cells of each column by name, n of each.
        rows: What the file calls each row: line of a CSV file, index of a JSON list or of a data set, n of them.
        row: What such a number is: ``row`` or ``index``.
        sha256: SHA-256 of the file.
        label: ``measured`` or ``reconstructed``, or what else the file says.
        units: Units that the file states beside the names of columns.
        left_out: Columns that the table cannot hold, and why.
        notes: What was done to read the file that its reader should know, one sentence each.
        parts: Index of the first row of each part of a file that begins anew, as where each specimen has its header.
        clocks: Columns whose cells are dates or times of the day.
        hint: What to do where no column can be chosen, empty for the usual.
    """

    source: str
    columns: Mapping[str, Cells]
    rows: Sequence[Any]
    row: str
    sha256: str
    label: str = MEASURED
    units: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    parts: tuple[int, ...] = (0,)
    clocks: tuple[str, ...] = ()
    hint: str = ""

    def part(self, on: np.ndarray) -> Table:
        """The table with some of its rows.

        Args:
            on: Their indices, increasing, shape (m,) [-].
        """
        columns = {
            name: cells[on] if isinstance(cells, np.ndarray) else [cells[i] for i in on]
            for name, cells in self.columns.items()
        }
        parts = tuple(int(np.searchsorted(on, start)) for start in self.parts)
        return replace(self, columns=columns, rows=rows_at(self.rows, on), parts=parts)


def rows_at(rows: Sequence[Any], on: Sequence[int] | np.ndarray) -> Sequence[Any]:
    """What a file calls some of its rows. Where it is all of them it stays what it is: a range of ten million rows is
    nothing, and a list of as many numbers half a gigabyte.

    Args:
        rows: What it calls each row, n of them.
        on: Indices of those that are wanted, in the order that is wanted, shape (m,) [-].

    Returns:
        Their names, m of them.
    """
    whole = len(on) == len(rows) and bool(np.all(np.diff(on) > 0))
    return rows if whole else [rows[i] for i in on]


def as_float(cell: Any) -> float | None:
    """The number in a cell, or None; true and false are no numbers, nor is ``1_000``."""
    if isinstance(cell, (bool, np.bool_)) or not isinstance(cell, (str, int, float, np.number)):
        return None
    if isinstance(cell, str) and "_" in cell:
        return None
    try:
        return float(cell)
    except (ValueError, TypeError):
        return None
    except OverflowError:
        return float("inf")


def check_names(source: str, names: Sequence[str]) -> None:
    """Refuse a name that occurs twice.

    Raises:
        TraceError: It does.
    """
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise TraceError(f"{source}: column name {quoted(twice)} occurs {names.count(twice)} times; rename one")
