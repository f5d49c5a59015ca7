"""Spreadsheets and Parquet files as tables."""

from __future__ import annotations

import csv
import datetime
import hashlib
import io
import json
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.formats.csv_table import table_of_csv
from calib.formats.extras import needed
from calib.io.wording import brief, listed
from calib.table.table import MEASURED, Cells, Table
from calib.table.vector_fields import table_of_fields

FEWEST_ROWS = 20
"""Rows from which on a sheet is a record where another one is too short to be one."""


def table_of_sheet(source: str, raw: bytes, address: str) -> Table:
    """The table in a sheet of an .xlsx file, with words above its header and units below it as in a CSV file.

    Args:
        source: What errors call the file.
        raw: Its content.
        address: Name of the sheet, empty for the only one that holds a table.

    Returns:
        The table; its rows are those of the sheet.

    Raises:
        TraceError: It is damaged, has no such sheet, or several that hold a table.
    """
    openpyxl = needed(source, "openpyxl", "an .xlsx file")
    try:
        book = openpyxl.load_workbook(io.BytesIO(raw), read_only=True, data_only=True)
        sheets = {sheet.title: _as_text(sheet.iter_rows(values_only=True)) for sheet in book.worksheets}
    except (OSError, ValueError, KeyError, TypeError, EOFError, SyntaxError) as error:
        raise TraceError(f"{source}: damaged, or not an .xlsx file ({brief(str(error))})") from None
    except Exception as error:  # noqa: BLE001 - zipfile and the XML parser raise their own kinds
        raise TraceError(f"{source}: damaged, or not an .xlsx file ({brief(str(error))})") from None
    if address and address.strip("/") not in sheets:
        raise TraceError(f"{source}: no sheet {brief(address)}; it holds {listed(list(sheets))}")
    wanted = {address.strip("/"): sheets[address.strip("/")]} if address else sheets
    found: dict[str, Table] = {}
    why = TraceError(f"{source}: no sheet holds a table")
    for name, text in wanted.items():
        try:
            table = table_of_csv(source, text.encode())
        except TraceError as error:
            why = error
            continue
        if not table.hint:
            found[name] = table
    long = {name: table for name, table in found.items() if len(table.rows) >= FEWEST_ROWS}
    found = long or found  # what is shorter is a list of settings
    if len(found) > 1:
        raise TraceError(f"{source}: several sheets hold a table, {listed(list(found))}; name one as {source}:SHEET")
    if not found:
        raise why
    digest = hashlib.sha256(raw + address.encode()).hexdigest()
    return replace(next(iter(found.values())), sha256=digest)


def _as_text(rows: Iterable[tuple[Any, ...]]) -> str:
    """A sheet as lines of cells; an empty row is an empty line."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter="\t", lineterminator="\n")
    for row in rows:
        cells = [_cell(value) for value in row]
        while cells and not cells[-1]:
            cells.pop()
        width = len(row) if cells else 0
        if cells:
            writer.writerow([*cells, *[""] * (width - len(cells))])
        else:
            out.write("\n")
    return out.getvalue()


def _cell(value: Any) -> str:
    """A cell as text."""
    if value is None:
        return ""
    if isinstance(value, datetime.datetime):
        return value.isoformat(sep=" ", timespec="microseconds")
    if isinstance(value, datetime.time):
        return value.isoformat(timespec="microseconds")
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    return str(value).replace("\n", " ")


def table_of_parquet(source: str, raw: bytes) -> Table:
    """The table in a Parquet file, with units from the metadata of its columns.

    Args:
        source: What errors call the file.
        raw: Its content.

    Returns:
        The table; a list in each row becomes columns.

    Raises:
        TraceError: It is damaged.
    """
    needed(source, "pyarrow", "a Parquet file")
    parquet, arrow = needed(source, "pyarrow.parquet", "a Parquet file"), needed(source, "pyarrow", "a Parquet file")
    try:
        content = parquet.read_table(io.BytesIO(raw))
        fields = {name: _column(content.column(name)) for name in content.column_names}
    except (arrow.ArrowException, OSError, ValueError, TypeError) as error:
        raise TraceError(f"{source}: damaged, or not a Parquet file ({brief(str(error))})") from None
    units = {}
    for field in content.schema:
        stated = (field.metadata or {}).get(b"unit") or (field.metadata or {}).get(b"units")
        if stated:
            units[field.name] = stated.decode("utf-8", "replace")
    attributes = json.loads((content.schema.metadata or {}).get(b"PANDAS_ATTRS", b"{}"))
    if isinstance(attributes, dict) and isinstance(attributes.get("units"), dict):
        units |= {name: unit for name, unit in attributes["units"].items() if isinstance(unit, str)}
    return table_of_fields(source, fields, hashlib.sha256(raw).hexdigest(), label=MEASURED, stated=units)


def _column(column: Any) -> Cells:
    """The numbers, times or texts of a column."""
    values = column.to_pandas()
    if values.dtype.kind in "iufmM" and getattr(values.dt, "tz", None) is None if values.dtype.kind in "mM" else False:
        return np.asarray(values.to_numpy())
    if values.dtype.kind in "iuf":
        return np.asarray(values.to_numpy())
    return [item.tolist() if isinstance(item, np.ndarray) else item for item in column.to_pylist()]
