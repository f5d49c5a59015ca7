"""HDF5 files as tables: data sets of one group, or one structured data set, with units in names or attributes."""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import TraceError
from calib.io.wording import brief, listed
from calib.table.table import MEASURED, Cells, Table
from calib.table.vector_fields import LONGEST_VECTOR, table_of_fields

UNIT_ATTRIBUTES = ("unit", "units", "Unit", "Units", "UNITS", "unit_string", "NX_units")
MOST_VALUES = 10**8
"""Values of a data set, or of all columns together, from which on it is no record of a cut: days at a kilohertz. Data
sets of zeros are small in a file: 20 kB unpack to that."""
# What h5py raises on a damaged file, a type that NumPy does not have, or a filter that is not installed.
_UNREADABLE = (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError)


def table_of_hdf5(path: Path, raw: bytes, address: str) -> Table:
    """The table in an HDF5 file.

    Its columns are the data sets of one group, or the fields of one structured data set. Without an address that is the
    root, or the only group that has any. Units come from an attribute ``unit`` or ``units`` of a data set, else from
    its name.

    Args:
        path: The file.
        raw: Its bytes.
        address: Group or data set, empty to look for one.

    Returns:
        The table; its SHA-256 is that of the file and of the address, if one was given; and of the values where they
        come from another file, which the bytes of this one do not tell.

    Raises:
        TraceError: The file is damaged, has no such group, or several that could be meant.
    """
    source = f"{path.name}:{address}" if address else path.name
    try:
        with h5py.File(path, "r") as file:
            node = _node(source, path.name, file, address)
            fields, units = _fields(node)
            foreign = _comes_from_elsewhere(node, file)
            label = _text(node.attrs.get("label", file.attrs.get("label"))) or MEASURED
    except _UNREADABLE as error:
        raise TraceError(f"{source}: damaged, or not an HDF5 file ({brief(str(error))})") from None
    digest = hashlib.sha256(raw)
    if address:
        digest.update(address.encode())
    if foreign:
        for name, cells in fields.items():
            digest.update(repr((name, np.asarray(cells).tolist())).encode())
    return table_of_fields(source, fields, digest.hexdigest(), label=label.lower(), stated=units)


def _node(source: str, name: str, file: h5py.File, address: str) -> h5py.Group | h5py.Dataset:
    """The group or data set of the table.

    Raises:
        TraceError: There is none, or several could be meant.
    """
    places = _places(file)
    if address:
        node = file.get(address)
        if node is None:
            raise TraceError(f"{source}: nothing of that name in the file{_hint(name, places)}")
        if not _is_table(node) and not _is_one_record(node):
            raise TraceError(f"{source}: no columns there{_hint(name, places)}")
        return node
    if _is_table(file):
        return file
    if len(places) == 1 and not (_is_one_record(file) and not _has_clock(file[places[0]])):
        return file[places[0]]
    if _is_one_record(file):
        return file
    if not places:
        raise TraceError(
            f"{source}: no data sets of numbers; write one for each column, with units in names or attributes"
        )
    raise TraceError(f"{source}: several groups could be the record{_hint(name, places)}")


def _is_one_record(node: Any) -> bool:
    """Whether the data sets in all groups of a node are as long as each other: groups of one record, as of robots."""
    if not isinstance(node, h5py.Group):
        return False
    deep = _deep(node)
    lengths = Counter(len(item) for item in deep.values())
    if len(lengths) != 1 or sum(lengths.values()) < 2:
        return False
    groups: dict[str, list[str]] = {}
    for name in deep:
        group, _, own = name.rpartition("/")
        groups.setdefault(group, []).append(own)
    alike = Counter(tuple(sorted(names)) for names in groups.values())
    return min(alike.values()) == 1  # else each group has a twin: records of their own


def _has_clock(node: Any) -> bool:
    """Whether a column of a table is called a time, or a stamp."""
    names = node.dtype.names if isinstance(node, h5py.Dataset) else list(node)
    return any(word in name.lower() for name in names for word in ("time", "stamp")) or "t_s" in names


def _deep(group: h5py.Group) -> dict[str, h5py.Dataset]:
    """The columns in a group and in the groups in it, with the names of the groups before their own."""
    found: dict[str, h5py.Dataset] = {}

    def look(name: str, item: Any) -> None:
        if _is_column(item):
            found[name] = item

    group.visititems(look)
    return found


def _hint(name: str, places: list[str]) -> str:
    """What can be named instead."""
    return f"; name one: {listed([f'{name}:{place}' for place in places])}" if places else ""


def _places(file: h5py.File) -> list[str]:
    """Addresses of all tables below the root; a structured data set counts where its group is no table."""
    found: list[str] = []

    def look(name: str, node: Any) -> None:
        if _is_table(node) and f"/{name}".rpartition("/")[0] not in found:
            found.append(f"/{name}")

    file.visititems(look)
    return found


def _is_table(node: Any) -> bool:
    """Whether a node is a structured data set, or a group with at least two columns beside each other."""
    if isinstance(node, h5py.Dataset):
        return node.ndim == 1 and node.dtype.names is not None
    return isinstance(node, h5py.Group) and sum(_is_column(item) for item in _items(node)) > 1


def _items(group: h5py.Group) -> list[Any]:
    """What lies in a group itself; a link that leads nowhere is left out."""
    return [item for item in (group.get(name) for name in group) if item is not None]


def _is_column(node: Any) -> bool:
    """Whether a node is a data set with a number, a text or a short vector a row."""
    if not isinstance(node, h5py.Dataset) or node.dtype.names is not None or not 0 < node.size <= MOST_VALUES:
        return False
    if node.ndim != 2:
        return bool(node.ndim == 1)
    return 0 < min(node.shape) <= LONGEST_VECTOR


def _fields(node: h5py.Group | h5py.Dataset) -> tuple[dict[str, Cells], dict[str, str]]:
    """Cells and stated units of each column by name."""
    if isinstance(node, h5py.Group):
        own = {name: item for name in node if _is_column(item := node.get(name))}
        sets = own if len(own) > 1 and not _is_one_record(node) else _deep(node) if _is_one_record(node) else own
        _check_size(sum(item.size for item in sets.values()))
        units = {name: unit for name, item in sets.items() if (unit := _unit(item))}
        return {name: _values(item[()]) for name, item in sets.items()}, units
    _check_size(node.size * len(node.dtype.names))
    content = node[()]
    units = {}
    for attribute in UNIT_ATTRIBUTES:
        stated = node.attrs.get(attribute)
        if isinstance(stated, np.ndarray) and stated.shape == (len(content.dtype.names),):
            units = {
                name: unit for name, item in zip(content.dtype.names, stated, strict=True) if (unit := _text(item))
            }
    return {name: _values(content[name]) for name in content.dtype.names}, units


def _check_size(values: int) -> None:
    """Refuse more values than a record of a cut can have.

    Raises:
        ValueError: There are.
    """
    if values > MOST_VALUES:
        raise ValueError(f"{values} values, at most {MOST_VALUES} are read; cut the file to the one record")


def _comes_from_elsewhere(node: h5py.Group | h5py.Dataset, file: h5py.File) -> bool:
    """Whether values lie in another file: behind an external link, in external storage, or in a virtual data set."""
    items = _items(node) if isinstance(node, h5py.Group) else [node]
    sets = [item for item in [node, *items] if isinstance(item, h5py.Dataset)]
    return any(item.file.filename != file.filename for item in [node, *items]) or any(
        item.external is not None or item.is_virtual for item in sets
    )


def _values(values: np.ndarray) -> Cells:
    """The numbers of a column, or its texts."""
    if values.ndim == 2 and values.shape[0] <= LONGEST_VECTOR < values.shape[1]:  # as MATLAB writes columns
        values = values.T
    if values.ndim == 2 and values.shape[1] == 1 < len(values):
        values = values[:, 0]
    if values.dtype.kind in "iuf":
        return values
    if values.ndim == 1:
        return [item.decode("utf-8", "replace") if isinstance(item, bytes) else item for item in values.tolist()]
    return values.tolist()


def _unit(item: h5py.Dataset) -> str:
    """The unit that a data set states, empty without one."""
    return next((unit for name in UNIT_ATTRIBUTES if (unit := _text(item.attrs.get(name)))), "")


def _text(value: Any) -> str:
    """An attribute as text, empty where it is none."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value.strip() if isinstance(value, str) else ""
