"""What the name of a measured column says: quantity, unit and sign; and the choice of the columns that are read."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.io.wording import brief, listed, quoted
from calib.trace.table import Table, as_float
from calib.trace.units import UNITS_OF_ROLE

_LIMITS = {"time": (1e11, "s"), "force": (1e6, "N"), "position": (1e3, "m"), "compression": (1e3, "m")}
"""Largest number of each role: beyond it there is no clock since 1970, no knife and no kitchen."""
_STEMS = {
    "time": (re.compile(r"time|t|timestamp|elapsed(_time)?"),),
    "force": (re.compile(r"(.*_)?(force|load|resistance|f|fz)(_z)?|(.*_)?wrench_z"),),
    "position": (
        re.compile(r"((ee|knife|tool|tcp|blade)_)?(z|height|position|pos)(_z)?"),
        re.compile(r"(.*_)?(stroke|displacement|travel|depth|extension|penetration)"),
    ),
    "compression": (re.compile(r"(.*_)?(compression|stroke|displacement|travel|extension)"),),
}
_DEPTH = _STEMS["position"][1]
_KNOWN_FORCE = {"base_fz": -1.0, "knife_fz": 1.0}
"""Columns whose sign is known: robot logs hold the force on the world in the base frame, downwards negative."""
_KNOWN = {"force": tuple(_KNOWN_FORCE), "position": ("ee_z",), "time": ("stamp",)}
"""Stems that are preferred to others of the same role. A ROS message's own stamp is the time of its measurement, the
other clock in its file that of its recording."""
_ROS = (
    (re.compile(r"field\.(.*\.)?stamp"), "stamp", "ns"),
    (re.compile(r"%time"), "time", "ns"),
    (re.compile(r"/(.*/)?stamp"), "stamp", "s"),
    (re.compile(r"__time"), "time", "s"),
    (re.compile(r"(.*[./])?O_F_ext_hat_K[.\[]?2\]?"), "base_fz", "N"),
    (re.compile(r"(.*[./])?K_F_ext_hat_K[.\[]?2\]?"), "knife_fz", "N"),
    (re.compile(r"(.*[./])?O_T_EE[.\[]?14\]?"), "ee_z", "m"),
    (re.compile(r"(.*[./])?force[./]z"), "force_z", "N"),
    (re.compile(r"(.*[./])?position[./]z"), "position_z", "m"),
)
"""Names in text exports of ROS messages, whose units are SI (REP 103) and whose clocks are known by the program that
writes such names: ``rostopic echo -p`` nanoseconds, PlotJuggler seconds."""
_EXPECTED = {
    "time": ("time_s", "time_ms", "t_s"),
    "force": ("force_N", "fz_N", "base_Fz_N", "force_kN", "force_mN"),
    "position": ("ee_z_m", "position_m", "position_mm", "stroke_m", "displacement_mm"),
    "compression": ("compression_mm", "displacement_mm", "stroke_m"),
}
LONGEST_NAME = 200
"""Letters from which on the name of a column means nothing."""


@dataclass(frozen=True)
class Column:
    """One chosen column.

    Attributes:
        name: Its name in the table.
        role: ``time``, ``force``, ``position`` or ``compression``.
        factor: What turns its numbers into SI with our sign.
    """

    name: str
    role: str
    factor: float


def candidates(table: Table, role: str) -> list[str]:
    """Columns whose name and unit fit a role; known ones alone if there are any."""
    fitting = [name for name in table.columns if _fits(table, name, role)]
    for stem in _KNOWN.get(role, ()):
        preferred = [name for name in fitting if _meaning(table, name)[0] == stem]
        if preferred:
            return preferred
    return fitting


def choose(table: Table, role: str, wanted: str | None) -> Column:
    """The column of a role, by name if the user gave one.

    Args:
        table: The table.
        role: ``time``, ``force``, ``position`` or ``compression``.
        wanted: Name of a column, or None to choose one by its name and unit.

    Returns:
        The column, with the factor that its unit and its name stand for.

    Raises:
        TraceError: There is no such column, no single one whose name fits, or a unit that is none of the role.
    """
    option = f"--{role}-col"
    if wanted is not None:
        if wanted not in table.columns:
            why = table.left_out.get(wanted)
            hint = f": it was left out, {why}" if why else _did_you_mean([wanted], table)
            raise TraceError(f"{table.source}: no column {quoted(wanted)} ({option}){hint}")
        return _column(table, role, wanted)
    fitting = candidates(table, role)
    if len(fitting) == 1:
        return _column(table, role, fitting[0])
    if fitting:
        raise TraceError(
            f"{table.source}: several columns could be the {role}: {listed(fitting)}; choose one with {option}"
        )
    left = "; ".join(f"{brief(name)} was left out, {why}" for name, why in list(table.left_out.items())[:3])
    raise TraceError(
        f"{table.source}: no {role} column with its unit in the name, such as "
        f"{', '.join(_EXPECTED[role][:3])}{_did_you_mean(_EXPECTED[role], table)}; name one with "
        f"{option}{f' ({left})' if left else ''}"
    )


def numbers(table: Table, column: Column) -> np.ndarray:
    """The numbers of a column.

    Args:
        table: The table.
        column: One of its columns.

    Returns:
        The numbers in SI with our sign, shape (n,) for n rows [s], [N] or [m] by the column's role.

    Raises:
        TraceError: A cell holds no finite number, or one that is too large; the message names the first one.
    """
    cells = table.columns[column.name]
    if isinstance(cells, np.ndarray) and cells.dtype.kind in "iuf":
        values = cells.astype(float)
    else:
        values = np.array([_number(table, column, i, cell) for i, cell in enumerate(cells)])
    limit, unit = _LIMITS[column.role]
    finite = np.isfinite(values)
    usable = finite & (np.abs(np.where(finite, values, 0.0)) <= limit / abs(column.factor))
    if not usable.all():
        i = int(np.argmin(usable))
        where = _where(table, column, i)
        if not finite[i]:
            raise TraceError(f"{where}: {_shown(cells[i])} is not finite; remove or repair the row")
        raise TraceError(
            f"{where}: {_shown(cells[i])} is beyond {limit:g} {unit}, too much for a {column.role}; check the unit of "
            "the column"
        )
    return values * column.factor


def _number(table: Table, column: Column, i: int, cell: Any) -> float:
    """The number in a cell, which may not be finite.

    Raises:
        TraceError: There is none.
    """
    number = as_float(cell)
    if number is not None:
        return number
    if cell is None or (isinstance(cell, str) and not cell.strip()):
        raise TraceError(f"{_where(table, column, i)}: an empty cell is not a number; fill it or remove the row")
    decimal = isinstance(cell, str) and as_float(cell.replace(",", ".")) is not None
    hint = "; write decimals with a point" if decimal else ""
    raise TraceError(f"{_where(table, column, i)}: {_shown(cell)} is not a number{hint}")


def _where(table: Table, column: Column, i: int) -> str:
    """A cell's place, as the table's file counts rows."""
    return f"{table.source}, {table.row} {brief(table.rows[i])}, column {brief(column.name)}"


def _shown(cell: Any) -> str:
    """A cell in an error."""
    if isinstance(cell, str):
        return quoted(cell.strip())
    return brief(cell) if isinstance(cell, (int, float, np.number)) else f"{type(cell).__name__} {brief(cell)}"


def _split_unit(name: str) -> tuple[str, str]:
    """Stem (lower case, words joined by _) and unit of a column name such as ``force_N`` or ``Force [N]``."""
    found = re.fullmatch(r"(.+?)(?:[\s_]+|\s*[\[(])\[?\(?([A-Za-z]+)[\])]?", name)
    stem, unit = (found.group(1), found.group(2)) if found else (name, "")
    return _stem(stem), unit


def _stem(name: str) -> str:
    """Lower case, words joined by _."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _meaning(table: Table, name: str) -> tuple[str, str]:
    """Stem and unit of a column: from the unit stated beside its name, the conventions of ROS, or its name alone."""
    if len(name) > LONGEST_NAME:
        return "", ""
    stem, unit = next(((s, u) for pattern, s, u in _ROS if pattern.fullmatch(name)), _split_unit(name))
    stated = table.units.get(name, unit)
    ends_in_unit = any(unit in units for units in UNITS_OF_ROLE.values())
    return (stem, unit) if stated == unit else (stem if ends_in_unit else _stem(name), stated)


def _fits(table: Table, name: str, role: str) -> bool:
    """Whether a column can have a role; a ROS stamp that nobody has set, and so stands, is no clock."""
    stem, unit = _meaning(table, name)
    if unit not in UNITS_OF_ROLE[role]:
        return False
    if role == "time" and stem == "stamp":
        cells = table.columns[name]
        return any(cell != cells[0] for cell in cells)
    return any(pattern.fullmatch(stem) for pattern in _STEMS[role])


def _column(table: Table, role: str, name: str) -> Column:
    """Factor of a named column: unit, known sign of a force, depth turned into height.

    Raises:
        TraceError: The unit stated beside the name is none of the role, or not that of the name.
    """
    stem, unit = _meaning(table, name)
    named = _split_unit(name[:LONGEST_NAME])[1]
    if name in table.units and unit not in UNITS_OF_ROLE[role]:
        raise TraceError(
            f"{table.source}, column {brief(name)}: its unit is {quoted(unit)}, which is none of a {role}; use one of "
            f"{', '.join(list(UNITS_OF_ROLE[role])[:6])}"
        )
    if name in table.units and UNITS_OF_ROLE[role].get(named, UNITS_OF_ROLE[role][unit]) != UNITS_OF_ROLE[role][unit]:
        raise TraceError(
            f"{table.source}, column {brief(name)}: its unit is stated as {quoted(unit)}; correct one of them"
        )
    factor = UNITS_OF_ROLE[role].get(unit, 1.0)
    if role == "force":
        factor *= _KNOWN_FORCE.get(stem, 1.0)
    if role == "position" and _DEPTH.fullmatch(stem):
        factor = -factor
    return Column(name, role, factor)


def _did_you_mean(wanted: Sequence[str], table: Table) -> str:
    """A hint with the nearest existing names, or with all of them."""
    lower = {name.lower(): name for name in table.columns if len(name) <= LONGEST_NAME}
    near = [lower[n] for w in wanted for n in difflib.get_close_matches(w.lower(), lower, n=1, cutoff=0.7)]
    if not near:
        labels = [f"{name} [{table.units[name]}]" if name in table.units else name for name in table.columns]
        return f"; the columns are {listed(labels)}"
    stated = table.units.get(near[0])
    return f"; did you mean {quoted(near[0])}{f', whose unit is stated as {quoted(stated)}' if stated else ''}?"
