"""pandas DataFrames as tables, with the same columns and the same errors as files."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from calib.errors import TraceError
from calib.table.clock_cells import with_clocks
from calib.table.table import Cells, Table, check_names
from calib.table.units import is_unit


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
        unit = unit or _stated(frame, whole, k)
        if unit:
            units[name] = unit
    table = Table(
        source=source,
        columns=columns,
        rows=labels,
        row="row",
        sha256=hashlib.sha256(whole.to_csv(index=False).encode("utf-8", "backslashreplace")).hexdigest(),
        label=label,
        units=units,
    )
    return with_clocks(table)


def _stated(frame: pd.DataFrame, whole: pd.DataFrame, k: int) -> str:
    """The unit that a frame states of a column: in attributes, in the last level of a name, in the column's type."""
    label, column = whole.columns[k], whole.iloc[:, k]
    for units in (frame.attrs.get("units"), frame.attrs.get("unit")):
        if isinstance(units, Mapping) and isinstance(units.get(label, units.get(str(label))), str):
            return str(units.get(label, units.get(str(label))))
    own = column.attrs.get("unit") or column.attrs.get("units")
    if isinstance(own, str):
        return own
    if isinstance(label, tuple) and len(label) > 1 and is_unit(str(label[-1])):
        return str(label[-1]).strip("[]() ")
    typed = re.fullmatch(r"pint\[(.+?)\].*", str(column.dtype))
    return typed.group(1) if typed else ""


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
