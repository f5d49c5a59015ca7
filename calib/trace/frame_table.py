"""pandas DataFrames as tables, with the same columns and the same errors as files."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pandas as pd

from calib.errors import TraceError
from calib.trace.table import Cells, Table, check_names


def table_of_frame(frame: pd.DataFrame, *, source: str, label: str) -> Table:
    """The table in a DataFrame.

    Its SHA-256 is that of ``frame.to_csv(index=False)`` in UTF-8, with an index that has a name as its first column.

    Args:
        frame: A row for each sample; an index with a name is a column too, and dates count in seconds.
        source: What errors call it.
        label: ``measured`` or ``reconstructed``.

    Returns:
        The table.

    Raises:
        TraceError: It is empty, or has a column name twice.
    """
    labels = list(frame.index)
    named = [name for name in frame.index.names if name is not None]
    names = [_name(name) for name in (*named, *frame.columns)]
    check_names(source, names)
    whole = frame.reset_index(level=named) if named else frame
    if not len(whole) or len(names) < 2:
        raise TraceError(f"{source}: {len(whole)} rows and {len(names)} columns; a time and a force are needed")
    columns, units = {}, {}
    for k, name in enumerate(names):
        columns[name], unit = _cells(whole.iloc[:, k])
        if unit:
            units[name] = unit
    return Table(
        source=source,
        columns=columns,
        rows=labels,
        row="row",
        sha256=hashlib.sha256(whole.to_csv(index=False).encode("utf-8", "backslashreplace")).hexdigest(),
        label=label,
        units=units,
    )


def _name(name: Any) -> str:
    """A column's name as text; the levels of a compound one joined by a point."""
    return ".".join(str(part) for part in name if str(part)) if isinstance(name, tuple) else str(name)


def _cells(column: pd.Series) -> tuple[Cells, str]:
    """Cells of a column, and ``s`` where they are dates or durations, which count from the first."""
    if pd.api.types.is_datetime64_any_dtype(column.dtype):
        column = column - column.iloc[0]
    if pd.api.types.is_timedelta64_dtype(column.dtype):
        return column.dt.total_seconds().to_numpy(), "s"
    if isinstance(column.dtype, np.dtype) and column.dtype.kind in "iuf":
        return column.to_numpy(), ""
    return [None if cell is pd.NA else cell for cell in column], ""
