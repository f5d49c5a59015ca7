"""JSON and YAML logs as tables: lists per channel, lists of records, both in groups, and vectors per sample."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from calib.errors import TraceError
from calib.io.wording import brief, quoted
from calib.table.encoding import decode
from calib.table.table import MEASURED, Table, check_names
from calib.table.vector_fields import LONGEST_VECTOR, table_of_fields, width_of, without_common_group

_UNITS = ("unit", "units")
_ALIAS = re.compile(r"(^|[:,\[{-])[ \t]+\*\w", re.MULTILINE)
"""Where YAML says that a part stands elsewhere."""
_NAMES = ("name", "channel", "label", "title", "id")
"""Names of the name of a channel, in a list of channels."""
_VALUES = ("values", "value", "data", "samples")
"""Names of a unit and of the numbers it belongs to, in a group that is one column."""
_HEADS, _ROWS = ("columns", "header", "headers", "names"), ("data", "rows", "values", "samples")
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
    return _table_of(source, raw, lambda text: (_parsed(source, text), []), "JSON")


def table_of_yaml(source: str, raw: bytes) -> Table:
    """The table in a YAML file: the messages that ``ros2 topic echo`` and ``rostopic echo`` print, or lists by name.

    Args:
        source: Name of the file.
        raw: Its bytes.

    Returns:
        The table, named as :func:`table_of_json` names it.

    Raises:
        TraceError: It is not YAML, or holds no lists and no messages.
    """
    return _table_of(source, raw, lambda text: _messages(source, text), "YAML")


def _table_of(source: str, raw: bytes, parse: Callable[[str], tuple[Any, list[str]]], kind: str) -> Table:
    """The table in a document, which a function makes of the text, with what it did.

    Raises:
        TraceError: There is none.
    """
    try:
        parsed, notes = parse(decode(source, raw, kind)[0])
        content, stated = _units_apart(parsed)
        found = list(_fields(source, "", content))
    except RecursionError:
        raise TraceError(f"{source}: lists or groups are nested too deeply for a record of a cut") from None
    if not found:
        raise TraceError(
            f"{source}: no lists of values with names; write lists of one length by name, or a list of records, with "
            "units in the names such as time_s and force_N"
        )
    check_names(source, [name for name, _ in found])
    fields = without_common_group(dict(found))
    units = {name: unit for name in fields for key, unit in stated.items() if f".{name}".endswith(f".{key}")}
    table = table_of_fields(source, fields, hashlib.sha256(raw).hexdigest(), label=_label(content), stated=units)
    return replace(table, notes=(*table.notes, *notes))


def _units_apart(content: Any) -> tuple[Any, dict[str, str]]:
    """A document whose columns are lists, and the units that it states beside them, by name."""
    units: dict[str, str] = {}

    def plain(name: str, value: Any) -> Any:
        value = _channels_by_name(value) if isinstance(value, list) else value
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


def _channels_by_name(channels: list[Any]) -> list[Any] | dict[str, Any]:
    """A list of channels, each with its name and its numbers, as a group; any other list as it is."""
    found = {}
    for channel in channels[: LONGEST_VECTOR**2]:
        name = next((channel[key] for key in _NAMES if key in channel), None) if isinstance(channel, dict) else None
        if not isinstance(name, str) or not any(isinstance(channel.get(key), list) for key in _VALUES):
            return channels
        found[name] = {key: value for key, value in channel.items() if key not in _NAMES}
    return found if len(found) == len(channels) > 0 else channels


def _messages(source: str, text: str) -> tuple[Any, list[str]]:
    """The document of a YAML file, or the list of its messages, and what was done.

    ROS writes a line of dashes behind each message; a last one without it was cut off, and is left out.

    Raises:
        TraceError: It is not YAML, or has aliases, with which a small file can be endless.
    """
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    if _ALIAS.search(text):
        raise TraceError(f"{source}: YAML with aliases (*name) is not read; write the numbers themselves")
    pieces = re.split(r"^---[ \t]*\r?$", text, flags=re.MULTILINE)
    cut = len(pieces) > 1 and bool(pieces[0].strip()) and bool(pieces.pop().strip())
    read: list[Any] = []
    pieces = [piece for piece in pieces if piece.strip()]
    for k, piece in enumerate(pieces, start=1):
        try:
            read.append(yaml.load(piece, Loader=loader))
        except (yaml.YAMLError, ValueError) as error:
            what = f"message {k} is " if len(pieces) > 1 else ""
            raise TraceError(f"{source}: {what}not YAML ({brief(str(error))}); remove or repair it") from None
    notes = [f"{source}: the last message is cut off and was left out"] if cut else []
    return (read[0] if len(pieces) == 1 else read), notes


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


def _label(content: Any) -> str:
    """The label that a document states, ``measured`` without one."""
    label = content.get("label") if isinstance(content, dict) else None
    return label.lower() if isinstance(label, str) else MEASURED
