"""Fields of logs as tables: vectors become columns, and those of libfranka have their documented meaning and unit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np

from calib.table.numerals import is_number
from calib.table.table import MEASURED, Cells, Table, check_names

FORCE_AXES = ("Fx_N", "Fy_N", "Fz_N", "Tx_Nm", "Ty_Nm", "Tz_Nm")
FIELD_PARTS: Mapping[str, Mapping[int, str]] = {
    "O_F_ext_hat_K": dict(enumerate(f"base_{axis}" for axis in FORCE_AXES)),
    "K_F_ext_hat_K": dict(enumerate(f"knife_{axis}" for axis in FORCE_AXES)),
    "O_T_EE": {12: "ee_x_m", 13: "ee_y_m", 14: "ee_z_m"},  # a pose, column after column
    "tau_ext_hat_filtered": {j - 1: f"tau_ext_j{j}_Nm" for j in range(1, 8)},
}
"""Fields of libfranka's RobotState: which of their numbers are columns, by index, and the names of those columns."""
FIELD_LENGTHS = {"O_F_ext_hat_K": 6, "K_F_ext_hat_K": 6, "O_T_EE": 16, "tau_ext_hat_filtered": 7}
"""Numbers that a sample of such a field has."""
FIELD_UNITS = {"time": "s"}
"""Units of fields of RobotState whose names have none."""
_VECTOR = re.compile(r"\s*[\[(]\s*([^\[\](){}]+?)\s*[\])]\s*")
LONGEST_VECTOR = 16
"""Numbers of a sample from which on it is no vector: a pose has as many."""


def table_of_fields(
    source: str,
    fields: Mapping[str, Cells],
    sha256: str,
    *,
    label: str = MEASURED,
    stated: Mapping[str, str] | None = None,
) -> Table:
    """The table of named lists of values or vectors.

    Lists that are not as long as most others, and those of long vectors, are left out and named in ``left_out``.

    Args:
        source: What errors call it.
        fields: Cells by name; vectors of k numbers as lists or as an array of shape (n, k).
        sha256: SHA-256 of where they come from.
        label: ``measured`` or ``reconstructed``.
        stated: Units of fields that are stated beside their names, by name.

    Returns:
        The table, with a column for each part of a vector (see :func:`parts`).

    Raises:
        TraceError: Two columns have one name.
    """
    rows = row_count(fields)
    columns: list[tuple[str, Cells]] = []
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
            if name in said and name not in FIELD_LENGTHS:
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


def written_vectors(columns: Mapping[str, tuple[str, ...]]) -> dict[str, dict[str, tuple[str, ...]]]:
    """The columns of text whose cells hold a vector, such as ``[0.1, 0.2, -5.0]``, as columns of their numbers.

    Args:
        columns: Cells by name.

    Returns:
        For each such column, by its name, the columns that it becomes (:func:`parts`); an empty cell is empty in each.
    """
    out = {}
    for name, cells in columns.items():
        samples = [numbers_of(cell) for cell in cells]
        widths = {len(sample) for sample, cell in zip(samples, cells, strict=True) if cell.strip()}
        if len(widths) != 1 or not 1 < max(widths) <= LONGEST_VECTOR:
            continue
        empty = ("",) * max(widths)
        whole = [tuple(sample) or empty for sample in samples]
        split = parts(name, max(widths))
        out[name] = {part: tuple(sample[i] for sample in whole) for i, part in split.items()}
    return out


def numbers_of(cell: str) -> list[str]:
    """The numbers of a vector that is written in a cell, as text; none where it holds anything else."""
    found = _VECTOR.fullmatch(cell)
    numbers = re.split(r"\s*[,;]\s*|\s+", found[1]) if found else []
    return numbers if all(is_number(number) for number in numbers) else []


def row_count(fields: Mapping[str, Cells]) -> int:
    """Length of the longest lists that are not alone in it: lists of another are settings, or were cut off."""
    lengths = Counter(len(values) for values in fields.values())
    return max([n for n, count in lengths.items() if count > 1] or lengths)


def without_common_group(fields: Mapping[str, Cells]) -> dict[str, Cells]:
    """Fields, as long as most are, without a first group that all of them are in.

    Args:
        fields: Cells by name, with a point between the name of a group and those in it.

    Returns:
        The same cells by shorter names, or as they are where two would have one name.
    """
    rows = row_count(fields) if fields else 0
    out = dict(fields)
    while True:
        groups = {name.rpartition(".")[0].partition(".")[0] for name, values in out.items() if len(values) == rows}
        group = groups.pop() if groups else ""
        if groups or not group:
            return out
        renamed = {name.removeprefix(f"{group}."): values for name, values in out.items()}
        if len(renamed) < len(out):
            return out
        out = renamed


def width_of(values: Cells) -> int | None:
    """Numbers of each sample of a field, 0 for one alone, None where they differ; a missing sample has any."""
    if isinstance(values, np.ndarray):
        return {1: 0, 2: values.shape[-1]}.get(values.ndim)
    widths = {len(item) if isinstance(item, list) else 0 for item in values if item is not None}
    return widths.pop() if len(widths) == 1 else None if widths else 0


def _part(values: Cells, i: int) -> Cells:
    """One number of each sample of a field of vectors."""
    return values[:, i] if isinstance(values, np.ndarray) else [sample and sample[i] for sample in values]


def parts(name: str, length: int) -> dict[int, str]:
    """The columns that a field with several numbers a sample becomes.

    Three numbers are x, y, z. Six are those and the three about the axes, which do not have the unit of the first
    three. Others are counted from 1. A unit at the end of the name stays there.

    Args:
        name: Name of the field, in a group or not.
        length: Numbers of each sample.

    Returns:
        Names of the columns, by index in the vector.
    """
    field = _field(name)
    if FIELD_LENGTHS.get(field) == length:
        return dict(FIELD_PARTS[field])
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
    """Units of the columns of a libfranka log whose names have none; none for any other log.

    Args:
        fields: Names of the fields of the file.
        columns: Names of the columns of the table.

    Returns:
        Units by name of the column.
    """
    if not any(_field(name) in FIELD_LENGTHS for name in fields):
        return {}
    return {name: FIELD_UNITS[_field(name)] for name in columns if _field(name) in FIELD_UNITS}


def _field(name: str) -> str:
    """A field's own name, without the groups that it is in: ``q`` of ``state.q``."""
    return name[max(name.rfind("."), name.rfind("/")) + 1 :]
