"""Fields of logs as tables: vectors become columns, and those of libfranka have their documented meaning and unit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from calib.trace.table import LABELS, Table, check_names

Values = Sequence[Any] | np.ndarray

AXES = ("Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm")
PARTS: Mapping[str, Mapping[int, str]] = {
    "O_F_ext_hat_K": dict(enumerate(f"base_{axis}" for axis in AXES)),
    "K_F_ext_hat_K": dict(enumerate(f"knife_{axis}" for axis in AXES)),
    "O_T_EE": {12: "ee_x_m", 13: "ee_y_m", 14: "ee_z_m"},  # a pose, column after column
    "tau_ext_hat_filtered": {j - 1: f"tau_ext_j{j}_Nm" for j in range(1, 8)},
}
"""Fields of libfranka's RobotState: which parts are columns, and their names."""
LENGTHS = {"O_F_ext_hat_K": 6, "K_F_ext_hat_K": 6, "O_T_EE": 16, "tau_ext_hat_filtered": 7}
SI = {"time": "s"}
"""Units of its numbers whose names have none."""
LONGEST_VECTOR = 16
"""Numbers of a sample from which on it is no vector: a pose has as many."""


def table_of_fields(
    source: str,
    fields: Mapping[str, Values],
    sha256: str,
    *,
    label: str = LABELS[0],
    stated: Mapping[str, str] | None = None,
) -> Table:
    """The table of named lists of values or vectors; those that do not fit are left out.

    Args:
        source: What errors call it.
        fields: Values by name.
        sha256: SHA-256 of where they come from.
        label: ``measured`` or ``reconstructed``.
        stated: Units of fields that are stated beside their names.

    Raises:
        TraceError: Two columns have one name.
    """
    rows = row_count(fields)
    columns: list[tuple[str, Values]] = []
    left_out: dict[str, str] = {}
    said = dict(stated or {})
    for name, values in fields.items():
        width = width_of(values)
        if len(values) != rows:
            left_out[name] = f"it has {len(values)} values where others have {rows}"
        elif width is None or width > LONGEST_VECTOR:
            left_out[name] = f"its values are lists {'of unequal length' if width is None else f'of {width}'}"
        elif width == 0:
            columns.append((name, values))
        else:
            split = parts(name, width)
            columns += [(part, _part(values, i)) for i, part in split.items()]
            if name in said and name not in LENGTHS:
                said |= {part: said[name] for i, part in split.items() if i < 3 or width != 6}
    check_names(source, [name for name, _ in columns])
    return Table(
        source=source,
        columns=dict(columns),
        rows=range(rows),
        row="index",
        sha256=sha256,
        label=label,
        units=units(fields, dict(columns)) | said,
        left_out=left_out,
    )


def row_count(fields: Mapping[str, Values]) -> int:
    """Length of the longest lists that are not alone in it: lists of another are settings, or were cut off."""
    lengths = Counter(len(values) for values in fields.values())
    return max([n for n, count in lengths.items() if count > 1] or lengths)


def width_of(values: Values) -> int | None:
    """Numbers of each sample of a field, 0 for one alone, None where they differ; a missing sample has any."""
    if isinstance(values, np.ndarray):
        return {1: 0, 2: values.shape[-1]}.get(values.ndim)
    widths = {len(item) if isinstance(item, list) else 0 for item in values if item is not None}
    return widths.pop() if len(widths) == 1 else None if widths else 0


def _part(values: Values, i: int) -> Values:
    """One number of each sample of a field of vectors."""
    return values[:, i] if isinstance(values, np.ndarray) else [sample and sample[i] for sample in values]


def parts(name: str, length: int) -> dict[int, str]:
    """Columns that a field with several numbers a sample becomes: index in the vector and name.

    Three numbers are x, y, z; six are those and the three about the axes, which do not have the unit of the first; others
    are counted from 1. A unit at the end of the name stays there.

    Args:
        name: Name of the field, in a group or not.
        length: Numbers of each sample.
    """
    field = _field(name)
    if LENGTHS.get(field) == length:
        return dict(PARTS[field])
    found = re.fullmatch(r"(.+)(_(?:[kmM]?N|[cmu]?m|Nm|rad))", name)
    stem, unit = found.groups() if found else (name, "")
    if length == 1:
        return {0: name}
    if length == 3:
        return {i: f"{stem}_{axis}{unit}" for i, axis in enumerate("xyz")}
    if length == 6:
        return parts(name, 3) | {i + 3: f"{stem}_r{axis}" for i, axis in enumerate("xyz")}
    return {i: f"{stem}_{i + 1}{unit}" for i in range(length)}


def units(fields: Iterable[str], columns: Iterable[str]) -> dict[str, str]:
    """Units of the columns of a libfranka log whose names have none; no log of libfranka, no units.

    Args:
        fields: Names of the fields of the file.
        columns: Names of the columns of the table.
    """
    if not any(_field(name) in LENGTHS for name in fields):
        return {}
    return {name: SI[_field(name)] for name in columns if _field(name) in SI}


def _field(name: str) -> str:
    """A field's own name, without the groups that it is in: ``q`` of ``state.q``."""
    return name[max(name.rfind("."), name.rfind("/")) + 1 :]
