"""JSON logs as tables: lists per channel, lists of records, both in groups, and vectors per sample."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator
from typing import Any

from calib.errors import TraceError
from calib.io.wording import brief, quoted
from calib.table.encoding import decode
from calib.table.table import MEASURED, Table, check_names
from calib.table.vector_fields import LONGEST_VECTOR, row_count, table_of_fields, width_of

_UNITS = ("unit", "units")
_VALUES = ("values", "value", "data", "samples")
"""Names of a unit and of the numbers it belongs to, in a group that is one column."""
_HEADS, _ROWS = ("columns", "header", "headers", "names"), ("data", "rows", "values")
"""Names of a list of names, and of the rows below them, in a group that is a table."""


def table_of_json(source: str, raw: bytes) -> Table:
    """The table in a JSON file.

    A list of values is a column, a list of records one for each of their fields, and a list of vectors one for each
    part (see :func:`calib.table.vector_fields.parts`). The name of a group stands before the names in it, with a point
    between, but for a group that all columns are in. Lists that are not as long as the others are left out, and single
    values are not part of the record. One record a line (JSON Lines) is a list of records.

    Units come from names, from ``"units": {"force": "kN"}`` beside the lists, from ``"force_unit": "kN"``, or from
    ``"force": {"values": [...], "unit": "kN"}``.

    Args:
        source: Name of the file.
        raw: Its bytes.

    Returns:
        The table.

    Raises:
        TraceError: It is not JSON, or holds no lists.
    """
    try:
        content, stated = _units_apart(_parsed(source, decode(source, raw, "JSON")[0]))
        found = list(_fields(source, "", content))
    except RecursionError:
        raise TraceError(f"{source}: lists or groups are nested too deeply for a record of a cut") from None
    if not found:
        raise TraceError(
            f"{source}: no lists of values with names; write lists of one length by name, or a list of records, with "
            "units in the names such as time_s and force_N"
        )
    check_names(source, [name for name, _ in found])
    fields = _common_group_removed(dict(found))
    units = {name: unit for name in fields for key, unit in stated.items() if f".{name}".endswith(f".{key}")}
    return table_of_fields(source, fields, hashlib.sha256(raw).hexdigest(), label=_label(content), stated=units)


def _units_apart(content: Any) -> tuple[Any, dict[str, str]]:
    """A document whose columns are lists, and the units that it states beside them, by name."""
    units: dict[str, str] = {}

    def plain(name: str, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        lists = [key for key in value if key.lower() in _VALUES and isinstance(value[key], list)]
        unit = next((value[key] for key in value if key.lower() in _UNITS and isinstance(value[key], str)), None)
        if name and unit is not None and len(lists) == 1:
            units[name] = unit
            return value[lists[0]]
        for key, inner in value.items():
            if key.lower() in _UNITS and isinstance(inner, dict):
                units.update({of: text for of, text in inner.items() if isinstance(text, str)})
            found = re.fullmatch(r"(.+)_units?", key, re.IGNORECASE)
            if found and isinstance(inner, str) and found.group(1) in value:
                units[found.group(1)] = inner
        return {key: plain(key, inner) for key, inner in value.items() if key.lower() not in _UNITS}

    return plain("", content), units


def _parsed(source: str, text: str) -> Any:
    """The JSON document, or the list of documents where each line is one.

    Raises:
        TraceError: It is neither.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        check_names(source, [name for name, _ in pairs])
        return dict(pairs)

    try:
        return json.loads(text, object_pairs_hook=unique)
    except ValueError as error:
        lines = [(i, line) for i, line in enumerate(text.split("\n"), start=1) if line.strip()]
        if len(lines) < 2 or not lines[0][1].rstrip().endswith("}"):
            raise TraceError(f"{source}: not JSON ({brief(str(error))}); is the file complete?") from None
    records = []
    for i, line in lines:
        try:
            records.append(json.loads(line, object_pairs_hook=unique))
        except ValueError as error:
            raise TraceError(f"{source}, row {i}: not JSON ({brief(str(error))}); remove or repair the row") from None
    return records


def _fields(source: str, name: str, value: Any) -> Iterator[tuple[str, list[Any]]]:
    """Every list of values in a document, with the names of its groups before its own."""
    if isinstance(value, dict):
        value = _rows_below_names(value)
        if value and all(key.isdecimal() for key in value):  # rows by number, as pandas writes a column
            value = list(value.values())
        else:
            for key, inner in value.items():
                yield from _fields(source, f"{name}.{key}" if name else key, inner)
            return
    if not isinstance(value, list) or not value:
        return
    if any(isinstance(item, dict) for item in value):
        if not all(item is None or isinstance(item, dict) for item in value):
            raise TraceError(f"{source}: the list {quoted(name)} holds records and other values; write records only")
        keys = dict.fromkeys(key for item in value if item for key in item)
        for key in keys:
            inner = [item.get(key) if item else None for item in value]
            yield from _fields(source, f"{name}.{key}" if name else key, inner)
    elif name:
        width = width_of(value)
        if width is not None and len(value) <= LONGEST_VECTOR < width:  # a list for each part, not for each sample
            value = [list(sample) for sample in zip(*value, strict=True)]
        yield name, value


def _rows_below_names(group: dict[str, Any]) -> dict[str, Any]:
    """A group of names and rows (pandas calls it split) as lists by name; any other as it is."""
    head = next((group[key] for key in group if key.lower() in _HEADS and isinstance(group[key], list)), None)
    rows = next((group[key] for key in group if key.lower() in _ROWS and isinstance(group[key], list)), None)
    if not head or not rows or not all(isinstance(name, str) for name in head) or len(set(head)) < len(head):
        return group
    if not all(isinstance(row, list) and len(row) == len(head) for row in rows):
        return group
    return dict(zip(head, map(list, zip(*rows, strict=True)), strict=True))


def _common_group_removed(fields: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """The same fields without a first group that all columns are in."""
    rows = row_count(fields)
    while True:
        groups = {name.rpartition(".")[0].partition(".")[0] for name, values in fields.items() if len(values) == rows}
        group = groups.pop()
        if groups or not group:
            return fields
        renamed = {name.removeprefix(f"{group}."): values for name, values in fields.items()}
        if len(renamed) < len(fields):
            return fields
        fields = renamed


def _label(content: Any) -> str:
    """The label that a document states, ``measured`` without one."""
    label = content.get("label") if isinstance(content, dict) else None
    return label.lower() if isinstance(label, str) else MEASURED
