"""MATLAB files of version 5 to 7 as tables: variables of one length, also in a structure. Those of 7.3 are HDF5."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from calib.errors import TraceError
from calib.io.wording import brief
from calib.table.table import Cells, Table
from calib.table.vector_fields import LONGEST_VECTOR, table_of_fields, without_common_group


def table_of_matlab(source: str, raw: bytes, address: str) -> Table:
    """The table in a MATLAB file before version 7.3.

    Args:
        source: What errors call the file.
        raw: Its content.
        address: Variable that holds the table, such as a structure, empty for the whole file.

    Returns:
        The table; a variable of a structure has the name of the structure before its own, where not all are in one.

    Raises:
        TraceError: It is damaged, or holds no numbers.
    """
    try:
        content = loadmat(io.BytesIO(raw), simplify_cells=True)
    except (MatReadError, NotImplementedError, ValueError, TypeError, OSError, KeyError, IndexError, EOFError) as error:
        raise TraceError(f"{source}: damaged, or not a MATLAB file ({brief(str(error))}); save it with -v7.3") from None
    held: Any = {name: value for name, value in content.items() if not name.startswith("__")}
    for part in filter(None, address.strip("/").split("/")):
        if not isinstance(held, Mapping) or part not in held:
            raise TraceError(f"{source}: nothing is called {address} in the file; it holds {', '.join(held)}")
        held = held[part]
    fields = without_common_group(dict(_columns("", held)))
    if not fields:
        raise TraceError(f"{source}: no variables with numbers; save time, force and position as vectors of one length")
    units = {}
    for name in ("units", "unit"):
        if isinstance(content.get(name), Mapping):
            units = {k: v for k, v in content[name].items() if isinstance(v, str)}
    stated = {name: unit for name in fields for key, unit in units.items() if name.rpartition(".")[2] == key}
    digest = hashlib.sha256(raw)
    if address:
        digest.update(address.encode())
    return table_of_fields(source, fields, digest.hexdigest(), stated=stated)


def _columns(name: str, value: Any) -> Iterator[tuple[str, Cells]]:
    """The vectors of a variable, those of a structure with its name before theirs."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _columns(f"{name}.{key}" if name else str(key), inner)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "iufb" and value.size > 1:
        if value.ndim == 2 and value.shape[0] <= LONGEST_VECTOR < value.shape[1]:
            value = value.T
        yield name, value.astype(float) if value.dtype.kind == "b" else value
    elif isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "OU":
        yield name, [str(item) for item in value]
