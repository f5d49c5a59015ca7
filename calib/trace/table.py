"""Tables of measured columns as a file holds them; CSV, JSON and HDF5 have modules of their own."""

from __future__ import annotations

import difflib
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.io.wording import quoted

LABELS = ("measured", "reconstructed")
_JSON_SUFFIXES = (".json", ".jsonl", ".ndjson")
_JSON_START = re.compile(rb"(\xef\xbb\xbf)?\s*(\{|\[\s*[\[{])")
_HDF5_ADDRESS = re.compile(r"(.+\.(?:h5|hdf5|hdf|he5)):(.*)", re.IGNORECASE | re.DOTALL)
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5")


@dataclass(frozen=True)
class Table:
    """Named columns of one length.

    Attributes:
        source: What errors call the table: file name, with the group of an HDF5 file.
        columns: Cells of each column by name, as the file holds them: text, numbers or whatever else, n of each.
        rows: What the file calls each row: line of a CSV file, index of a JSON list or of a data set, n of them.
        row: What such a number is: ``row`` or ``index``.
        sha256: SHA-256 of the file.
        label: ``measured`` or ``reconstructed``, or what else the file says.
        units: Units that the file states beside the names of columns.
        left_out: Columns that the table cannot hold, and why.
        notes: What was done to read the file that its reader should know, one sentence each.
    """

    source: str
    columns: Mapping[str, Sequence[Any] | np.ndarray]
    rows: Sequence[Any]
    row: str
    sha256: str
    label: str = LABELS[0]
    units: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def read_table(path: str | Path) -> Table:
    """Read a table from a file; its content and suffix tell of what kind it is.

    Args:
        path: A CSV file with a header line, a JSON file of lists or records, or an HDF5 file (``file.h5``, or
            ``file.h5:/group`` for a group or data set in it).

    Raises:
        TraceError: There is no such file, or it holds no table.
    """
    file, address = split_address(path)
    raw = _content(file)
    if raw.startswith(_HDF5_SIGNATURE) or file.suffix.lower() in _HDF5_SUFFIXES:
        from calib.trace.hdf5_table import table_of_hdf5

        return table_of_hdf5(file, raw, address)
    if file.suffix.lower() in _JSON_SUFFIXES or _JSON_START.match(raw):
        from calib.trace.json_table import table_of_json

        return table_of_json(file.name, raw)
    from calib.trace.csv_table import table_of_csv

    return table_of_csv(file.name, raw)


def split_address(path: str | Path) -> tuple[Path, str]:
    """File and, for ``file.h5:/group``, the address in it; empty for none."""
    found = _HDF5_ADDRESS.fullmatch(str(path))
    if found is None or os.path.exists(path):
        return Path(path), ""
    return Path(found.group(1)), found.group(2).replace("\\", "/")


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


def decoded(source: str, raw: bytes, kind: str) -> str:
    """The text of a file.

    Raises:
        TraceError: It is not text.
    """
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TraceError(
            f"{source}: not a text {kind} file (byte {error.start} is not UTF-8); save the record as CSV, JSON or HDF5"
        ) from None
    if "\0" in text:
        raise TraceError(f"{source}: not a text {kind} file (it holds zero bytes)")
    return text


def check_names(source: str, names: Sequence[str]) -> None:
    """Refuse a name that occurs twice.

    Raises:
        TraceError: It does.
    """
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise TraceError(f"{source}: column name {quoted(twice)} occurs {names.count(twice)} times; rename one")


def _content(path: Path) -> bytes:
    """All bytes of a file.

    Raises:
        TraceError: There is none, or it cannot be read.
    """
    try:
        if path.is_dir():
            raise TraceError(f"{path} is a directory; name a CSV, JSON or HDF5 file")
        if not path.is_file():
            near = difflib.get_close_matches(path.name, _names_beside(path), n=3)
            hint = f"did you mean {' or '.join(near)}?" if near else "check the path"
            raise TraceError(f"{path}: no such file; {hint}")
        raw = path.read_bytes()
    except OSError as error:
        raise TraceError(f"{path}: cannot be read ({error.strerror})") from None
    if not raw.strip():
        raise TraceError(f"{path.name} is empty; check that the record was saved")
    return raw


def _names_beside(path: Path) -> list[str]:
    """File names in the folder where a missing file was looked for."""
    return [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
