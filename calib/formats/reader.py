"""Reads a table of measured columns from a file of any kind that is known."""

from __future__ import annotations

import difflib
import hashlib
import os
import re
from dataclasses import replace
from pathlib import Path

from calib.errors import TraceError
from calib.formats.bundled import BUNDLED, bundled_or_same
from calib.formats.csv_table import table_of_csv
from calib.formats.json_table import table_of_json, table_of_yaml
from calib.formats.numpy_table import NPY, table_of_numpy
from calib.formats.packed import unpacked
from calib.table.clock_cells import with_clocks
from calib.table.table import Table
from mpm.files import read_regular

_JSON_SUFFIXES = (".json", ".jsonl", ".ndjson")
_YAML_SUFFIXES = (".yaml", ".yml")
_ECHO = re.compile(rb"(\xef\xbb\xbf)?\s*[A-Za-z_]\w*:.*\n(.*\n){0,400}?---[ \t]*\r?\n[ \t]*[A-Za-z_]\w*:")
"""How the messages of a topic begin that ROS has printed."""
_JSON_START = re.compile(rb"(\xef\xbb\xbf)?\s*(\{|\[\s*[\[{])")
_ADDRESS = re.compile(r"(.+\.(?:h5|hdf5|hdf|he5|mat|xlsx|xlsm|tdms)):(.*)", re.IGNORECASE | re.DOTALL)
_MATLAB_SIGNATURE = b"MATLAB "
_PARQUET_SIGNATURE = b"PAR1"
_ZIP_SIGNATURE = b"PK\x03\x04"
_TDMS_SIGNATURE = b"TDSm"
_BAG_SUFFIXES = (".bag", ".mcap", ".db3")
_NOT_READ = {
    b"\xd0\xcf\x11\xe0": "an .xls file or another document of Microsoft Office before 2007",
    b"ARROW1": "a file of Arrow or Feather",
    b"\x80\x04\x95": "objects of Python (pickle), which are not read as they may do anything",
    b"\x80\x05\x95": "objects of Python (pickle), which are not read as they may do anything",
    b"<html": "a web page, also where it is called .xls",
    b"<!DOCTYPE": "a web page, also where it is called .xls",
    b"<?xml": "an XML file",
}
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5")
LONG_BYTES = 32_000_000
"""Bytes of a CSV file from which on its numbers alone are read, a piece at a time: as text it takes 30 times that."""
HEAD_BYTES = 200_000  # of a long file, by which it is told what it is like


def read_table(path: str | Path, decimal: str | None = None) -> Table:
    """Read a table from a file; its content and suffix tell of what kind it is.

    Args:
        path: A text file of cells, a JSON or YAML file of lists or records, an HDF5 file (``file.h5``, or
            ``file.h5:/group`` for a group or data set in it), a MATLAB file, an .xlsx file (``file.xlsx:sheet``), a
            file of numpy, a Parquet or TDMS file (``file.tdms:group``), or a bag of ROS. The name of a trace of
            :mod:`calib.formats.bundled` will do.
        decimal: The mark before decimals in a text file, a point or a comma; None to tell it from the numbers.

    Returns:
        The table, its cells as the file holds them.

    Raises:
        TraceError: There is no such file, or it holds no table.
    """
    return with_clocks(_table(path, decimal))


def _table(path: str | Path, decimal: str | None) -> Table:
    """The table as the file holds it."""
    file, address = split_address(path)
    file = bundled_or_same(file)
    suffix = file.suffix.lower()
    if (file.is_dir() and (file / "metadata.yaml").is_file()) or (suffix in _BAG_SUFFIXES and file.is_file()):
        from calib.formats.bag_table import table_of_bag

        return table_of_bag(file)
    file, raw = unpacked(file, _content(file))
    suffix = file.suffix.lower()
    source = f"{file.name}:{address}" if address else file.name
    matlab = raw.startswith(_MATLAB_SIGNATURE)
    if raw.startswith(_HDF5_SIGNATURE) or suffix in _HDF5_SUFFIXES or (matlab and _HDF5_SIGNATURE in raw[:4096]):
        from calib.formats.hdf5_table import table_of_hdf5  # brings h5py, which is slow to import

        return table_of_hdf5(file, raw, address)
    if matlab or suffix == ".mat":
        from calib.formats.matlab_table import table_of_matlab

        return table_of_matlab(source, raw, address)
    if raw.startswith(_PARQUET_SIGNATURE):
        from calib.formats.sheet_table import table_of_parquet

        return table_of_parquet(file.name, raw)
    if raw.startswith(_ZIP_SIGNATURE) and suffix in (".xlsx", ".xlsm"):
        from calib.formats.sheet_table import table_of_sheet

        return table_of_sheet(source, raw, address)
    if raw.startswith(NPY) or (raw.startswith(_ZIP_SIGNATURE) and suffix == ".npz"):
        return table_of_numpy(file.name, raw)
    if raw.startswith(_TDMS_SIGNATURE):
        from calib.formats.tdms_table import table_of_tdms

        return table_of_tdms(source, raw, address)
    for signature, what in _NOT_READ.items():
        if raw.startswith(signature):
            raise TraceError(f"{file.name}: {what}; export the record as CSV or .xlsx")
    if suffix in _JSON_SUFFIXES or _JSON_START.match(raw):
        return table_of_json(file.name, raw)
    if suffix in _YAML_SUFFIXES or _ECHO.match(raw):
        return table_of_yaml(file.name, raw)
    return table_of_csv(file.name, raw, decimal) if len(raw) < LONG_BYTES else _long_csv(file.name, raw, decimal)


def _long_csv(source: str, raw: bytes, decimal: str | None) -> Table:
    """The columns of numbers of a long CSV file; what it is like is found in its first lines.

    Raises:
        TraceError: It is no CSV file with a header, or its rows are of several widths.
    """
    from calib.io.number_columns import number_columns

    head = table_of_csv(source, raw[: raw.rfind(b"\n", 0, HEAD_BYTES) + 1], decimal)
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
    found = _ADDRESS.fullmatch(str(path))
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
            near = difflib.get_close_matches(path.name, [*_names_beside(path), *BUNDLED], n=3)
            near = near or [name for name in BUNDLED if name.startswith(path.name)]
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
