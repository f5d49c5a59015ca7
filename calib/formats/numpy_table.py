"""Arrays of numpy with names as tables: those of an archive (``.npz``), and one whose parts have names (``.npy``)."""

from __future__ import annotations

import hashlib
import io
import zipfile
import zlib

import numpy as np

from calib.errors import TraceError
from calib.formats.packed import MOST_BYTES
from calib.io.wording import brief
from calib.table.table import Cells, Table
from calib.table.vector_fields import LONGEST_VECTOR, table_of_fields, without_common_group

NPY = b"\x93NUMPY"
"""How an array of numpy begins."""
_DAMAGED = (OSError, EOFError, ValueError, KeyError, TypeError, SyntaxError, zipfile.BadZipFile, zlib.error)


def table_of_numpy(source: str, raw: bytes) -> Table:
    """The table in a file of numpy.

    Args:
        source: What errors call the file.
        raw: Its content.

    Returns:
        The table, with a column for each array or each named part of the only one.

    Raises:
        TraceError: It is damaged, holds objects of Python, or an array without names.
    """
    try:
        held = _arrays(raw)
    except _DAMAGED as error:
        if raw.startswith(NPY):
            held = {}
        else:
            raise TraceError(
                f"{source}: damaged, or no arrays of numbers ({brief(str(error))}); save it again"
            ) from None
    fields = without_common_group(dict(_columns(held)))
    if not fields:
        raise TraceError(
            f"{source}: an array of numpy without names of columns; export the record as CSV or .xlsx, or save it with "
            "numpy.savez(file, time_s=..., force_N=...)"
        )
    return table_of_fields(source, fields, hashlib.sha256(raw).hexdigest())


def _arrays(raw: bytes) -> dict[str, np.ndarray]:
    """The arrays of a file by name; that of a file with one has none.

    Raises:
        ValueError: They are too large, or objects of Python.
    """
    if raw.startswith(NPY):
        return {"": np.load(io.BytesIO(raw), allow_pickle=False)}
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        if sum(item.file_size for item in archive.infolist()) > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES} bytes when unpacked")
    with np.load(io.BytesIO(raw), allow_pickle=False) as found:
        return {name: found[name] for name in found.files}


def _columns(held: dict[str, np.ndarray]) -> list[tuple[str, Cells]]:
    """Vectors by name, the named parts of an array with its name before theirs."""
    out: list[tuple[str, Cells]] = []
    for name, value in held.items():
        if value.dtype.names:
            flat = value.reshape(-1)
            out += [(f"{name}.{part}" if name else part, flat[part]) for part in value.dtype.names]
        elif name and value.dtype.kind in "iufbmMU" and value.size > 1:
            value = value.reshape(-1) if 1 in value.shape else value
            if value.ndim == 2 and value.shape[0] <= LONGEST_VECTOR < value.shape[1]:
                value = value.T
            if value.dtype.kind == "U" and value.ndim == 1:
                out.append((name, [str(cell) for cell in value]))
            else:
                out.append((name, value.astype(float) if value.dtype.kind == "b" else value))
    return out
