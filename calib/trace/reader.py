"""Reads a table of measured columns from a file of any kind that is known: CSV, JSON or HDF5."""

from __future__ import annotations

import difflib
import hashlib
import os
import re
from dataclasses import replace
from pathlib import Path

from calib.errors import TraceError
from calib.trace.csv_table import table_of_csv
from calib.trace.json_table import table_of_json
from calib.trace.table import Table
from mpm.files import read_regular

_JSON_SUFFIXES = (".json", ".jsonl", ".ndjson")
_JSON_START = re.compile(rb"(\xef\xbb\xbf)?\s*(\{|\[\s*[\[{])")
_HDF5_ADDRESS = re.compile(r"(.+\.(?:h5|hdf5|hdf|he5)):(.*)", re.IGNORECASE | re.DOTALL)
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5")
LONG_BYTES = 32_000_000
"""Bytes of a CSV file from which on its numbers alone are read, a piece at a time: as text it takes 30 times that."""
HEAD_BYTES = 200_000  # of a long file, by which it is told what it is like


def read_table(path: str | Path) -> Table:
    """Read a table from a file; its content and suffix tell of what kind it is.

    Args:
        path: A CSV file with a header line, a JSON file of lists or records, or an HDF5 file (``file.h5``, or
            ``file.h5:/group`` for a group or data set in it).

    Returns:
        The table, its cells as the file holds them.

    Raises:
        TraceError: There is no such file, or it holds no table.
    """
    file, address = split_address(path)
    raw = _content(file)
    if raw.startswith(_HDF5_SIGNATURE) or file.suffix.lower() in _HDF5_SUFFIXES:
        from calib.trace.hdf5_table import table_of_hdf5  # brings h5py, which is slow to import

        return table_of_hdf5(file, raw, address)
    if file.suffix.lower() in _JSON_SUFFIXES or _JSON_START.match(raw):
        return table_of_json(file.name, raw)
    return table_of_csv(file.name, raw) if len(raw) < LONG_BYTES else _table_of_long_csv(file.name, raw)


def _table_of_long_csv(source: str, raw: bytes) -> Table:
    """The columns of numbers of a long CSV file; what it is like is found in its first lines.

    Raises:
        TraceError: It is no CSV file with a header, or its rows are of several widths.
    """
    from calib.io.number_columns import number_columns

    head = table_of_csv(source, raw[: raw.rfind(b"\n", 0, HEAD_BYTES) + 1])
    first = int(head.rows[0])
    try:
        found = number_columns(raw, first, list(head.columns))
    except ValueError as e:
        raise TraceError(f"{source}: {e}") from None
    return replace(
        head,
        columns=found.columns,
        rows=range(first, first + found.rows),
        sha256=hashlib.sha256(raw).hexdigest(),
        left_out={**head.left_out, **found.left_out},
    )


def split_address(path: str | Path) -> tuple[Path, str]:
    """File and, for ``file.h5:/group``, the address in it; empty for none."""
    found = _HDF5_ADDRESS.fullmatch(str(path))
    if found is None or os.path.exists(path):
        return Path(path), ""
    return Path(found.group(1)), found.group(2).replace("\\", "/")


def _content(path: Path) -> bytes:
    """All bytes of a file.

    Raises:
        TraceError: There is none, or it cannot be read.
    """
    try:
        if path.is_dir():
            raise TraceError(f"{path} is a directory; name a CSV, JSON or HDF5 file")
        if not path.exists():
            near = difflib.get_close_matches(path.name, _names_beside(path), n=3)
            hint = f"did you mean {' or '.join(near)}?" if near else "check the path"
            raise TraceError(f"{path}: no such file; {hint}")
        raw = read_regular(path)
    except OSError as error:
        raise TraceError(f"{path}: cannot be read ({error.strerror})") from None
    if not raw.strip():
        raise TraceError(f"{path.name} is empty; check that the record was saved")
    return raw


def _names_beside(path: Path) -> list[str]:
    """File names in the folder where a missing file was looked for."""
    return [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
