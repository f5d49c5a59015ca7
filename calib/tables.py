"""Tables of measured columns: what their names say of quantity, unit and sign, and their numbers."""

from __future__ import annotations

import csv
import difflib
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import TraceError

LABELS = ("measured", "reconstructed")

_UNITS = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6},
    "force": {"N": 1.0, "n": 1.0, "kN": 1e3, "KN": 1e3, "kn": 1e3, "mN": 1e-3, "mn": 1e-3},
    "position": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6},
    "compression": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "um": 1e-6},
}
_TIME_STEM = re.compile(r"time|t|timestamp|elapsed(_time)?")
_FORCE_STEM = re.compile(r"(.*_)?(force|load|resistance|f|fz)(_z)?")
_HEIGHT_STEM = re.compile(r"((ee|knife|tool|tcp|blade)_)?(z|height|position|pos)(_z)?")
_DEPTH_STEM = re.compile(r"(.*_)?(stroke|displacement|travel|depth|extension|penetration)")
_COMPRESSION_STEM = re.compile(r"(.*_)?(compression|stroke|displacement|travel|extension)")
_KNOWN_FORCE = {"base_fz": -1.0, "knife_fz": 1.0}
"""Columns whose sign is known: robot logs hold the force on the world in the base frame, downwards
negative."""
_KNOWN_POSITION = ("ee_z",)
_EXPECTED = {
    "time": ("time_s", "time_ms", "t_s"),
    "force": ("force_N", "fz_N", "base_Fz_N", "force_kN", "force_mN"),
    "position": ("ee_z_m", "position_m", "position_mm", "stroke_m", "displacement_mm"),
    "compression": ("compression_mm", "displacement_mm", "stroke_m"),
}


@dataclass(frozen=True)
class Table:
    """Text of a CSV file: column names, rows and their line numbers in the file."""

    source: str
    names: list[str]
    rows: list[list[str]]
    lines: list[int]
    label: str
    sha256: str


@dataclass(frozen=True)
class Column:
    """One chosen column and the factor that turns its numbers into SI with our sign."""

    name: str
    index: int
    factor: float


def read_table(path: Path) -> Table:
    """Split a CSV file into header and rows; comments and blank lines are dropped, line numbers kept.

    Raises:
        TraceError: There is no such file, or it is no CSV file with a header.
    """
    if path.is_dir():
        raise TraceError(f"{path} is a directory; name a CSV file")
    if not path.is_file():
        near = difflib.get_close_matches(path.name, _names_beside(path), n=3)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise TraceError(f"{path}: no such file{hint}")
    raw = path.read_bytes()
    if not raw.strip():
        raise TraceError(f"{path.name} is empty")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TraceError(f"{path.name}: not a text CSV file (byte {error.start} is not UTF-8)") from error
    if "\0" in text:
        raise TraceError(f"{path.name}: not a text CSV file (it holds zero bytes)")
    numbered = [(i, line) for i, line in enumerate(text.splitlines(), start=1) if line.strip()]
    comments = [line for _, line in numbered if line.lstrip().startswith("#")]
    body = [(i, line) for i, line in numbered if not line.lstrip().startswith("#")]
    if len(body) < 2:
        raise TraceError(f"{path.name}: {'a header but no data' if body else 'nothing but comments'}")
    delimiter = max(",;\t", key=body[0][1].count)
    cells = list(csv.reader([line for _, line in body], delimiter=delimiter))
    names = [name.strip() for name in cells[0]]
    _check_header(path.name, names)
    return Table(
        source=path.name,
        names=names,
        rows=cells[1:],
        lines=[i for i, _ in body[1:]],
        label=_label(comments),
        sha256=hashlib.sha256(raw).hexdigest(),
    )


def _names_beside(path: Path) -> list[str]:
    """File names in the folder where a missing file was looked for."""
    return [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []


def _check_header(source: str, names: list[str]) -> None:
    """Refuse a header with one column, without names, or with a name twice."""
    if len(names) < 2:
        raise TraceError(f"{source}: not a CSV file with a force column and one beside it (header: {names[0][:60]!r})")
    if all(_as_float(name) is not None for name in names):
        raise TraceError(f"{source}: the first row holds numbers; add a header such as time_s,force_N")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise TraceError(f"{source}: column name {twice[0]!r} occurs {names.count(twice[0])} times; rename one")


def _label(comments: list[str]) -> str:
    """The label that a ``# label: ...`` comment gives, ``measured`` without one."""
    for comment in comments:
        found = re.match(r"\s*#\s*label\s*:\s*(\S+)", comment)
        if found:
            return found.group(1).lower()
    return LABELS[0]


def _as_float(cell: str) -> float | None:
    """The number in a cell, or None."""
    try:
        return float(cell)
    except ValueError:
        return None


def _split_unit(name: str) -> tuple[str, str]:
    """Stem (lower case, words joined by _) and unit of a column name such as ``force_N`` or ``Force [N]``."""
    found = re.fullmatch(r"(.+?)(?:[\s_]+|\s*[\[(])\[?\(?([A-Za-z]+)[\])]?", name)
    stem, unit = (found.group(1), found.group(2)) if found else (name, "")
    return re.sub(r"[^a-z0-9]+", "_", stem.lower()).strip("_"), unit


def _stem_matches(role: str, stem: str) -> bool:
    """Whether a stem names the role."""
    patterns = {
        "time": (_TIME_STEM,),
        "force": (_FORCE_STEM,),
        "position": (_HEIGHT_STEM, _DEPTH_STEM),
        "compression": (_COMPRESSION_STEM,),
    }
    return any(pattern.fullmatch(stem) for pattern in patterns[role])


def candidates(table: Table, role: str) -> list[str]:
    """Columns whose name and unit fit a role; known ones alone if there are any."""
    fitting = []
    for name in table.names:
        stem, unit = _split_unit(name)
        if unit in _UNITS[role] and _stem_matches(role, stem):
            fitting.append(name)
    known: Sequence[str] = {"force": tuple(_KNOWN_FORCE), "position": _KNOWN_POSITION}.get(role, ())
    for stem in known:
        preferred = [name for name in fitting if _split_unit(name)[0] == stem]
        if preferred:
            return preferred
    return fitting


def choose(table: Table, role: str, wanted: str | None) -> Column:
    """The column of a role (``time``, ``force``, ``position`` or ``compression``), by name if the user gave one.

    Raises:
        TraceError: There is no such column, or no single one whose name fits.
    """
    option = f"--{role}-col"
    if wanted is not None:
        if wanted not in table.names:
            raise TraceError(f"{table.source}: no column {wanted!r} ({option}){_did_you_mean([wanted], table.names)}")
        return _column(table, role, wanted)
    fitting = candidates(table, role)
    if len(fitting) == 1:
        return _column(table, role, fitting[0])
    if fitting:
        raise TraceError(
            f"{table.source}: several columns could be the {role}: {', '.join(fitting)}; choose one with {option}"
        )
    raise TraceError(
        f"{table.source}: no {role} column with its unit in the name, such as "
        f"{', '.join(_EXPECTED[role][:3])}{_did_you_mean(_EXPECTED[role], table.names)}; name one with "
        f"{option}"
    )


def _did_you_mean(wanted: Sequence[str], names: list[str]) -> str:
    """A hint with the nearest existing names, or with all of them."""
    lower = {name.lower(): name for name in names}
    near = [n for w in wanted for n in difflib.get_close_matches(w.lower(), lower, n=1, cutoff=0.7)]
    if near:
        return f"; did you mean {lower[near[0]]!r}?"
    return f"; the columns are {', '.join(names)}"


def _column(table: Table, role: str, name: str) -> Column:
    """Index and factor of a named column: unit, known sign of a force, depth turned into height."""
    stem, unit = _split_unit(name)
    factor = _UNITS[role].get(unit, 1.0)
    if role == "force":
        factor *= _KNOWN_FORCE.get(stem, 1.0)
    if role == "position" and _DEPTH_STEM.fullmatch(stem):
        factor = -factor
    return Column(name, table.names.index(name), factor)


def numbers(table: Table, column: Column) -> np.ndarray:
    """The numbers of a column in SI, shape (rows,).

    Raises:
        TraceError: A cell holds no finite number; the message names the first one.
    """
    values = np.empty(len(table.rows))
    for i, (row, line) in enumerate(zip(table.rows, table.lines, strict=True)):
        where = f"{table.source}, row {line}"
        if len(row) != len(table.names):
            raise TraceError(f"{where}: {len(row)} cells, the header has {len(table.names)}")
        cell = row[column.index].strip()
        number = _as_float(cell)
        if number is None:
            hint = "; write decimals with a point" if _as_float(cell.replace(",", ".")) is not None else ""
            shown = repr(cell) if cell else "an empty cell"
            raise TraceError(f"{where}, column {column.name}: {shown} is not a number{hint}")
        if not np.isfinite(number):
            raise TraceError(f"{where}, column {column.name}: {cell!r} is not finite; remove or repair the row")
        values[i] = number
    return values * column.factor
