"""The choice of the columns that are read, and their numbers in SI."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.errors import TraceError
from calib.io.wording import LONG, brief, listed, quoted
from calib.table.numerals import as_plain
from calib.table.table import Table, as_float
from calib.table.units import EXAMPLES, SI_OF_ROLE, Unit, unit_of
from calib.trace.names import LONGEST_NAME, candidates, is_depth, meaning, named_like, not_measured, sign_of

_LIMITS = {"time": (1e11, "s"), "force": (1e6, "N"), "position": (1e3, "m"), "compression": (1e3, "m")}
"""Largest number of each role: beyond it there is no clock since 1970, no knife and no kitchen."""
_EXPECTED = {
    "time": ("time_s", "time_ms", "t_s"),
    "force": ("force_N", "fz_N", "base_Fz_N", "force_kN", "force_mN"),
    "position": ("ee_z_m", "position_m", "position_mm", "stroke_m", "displacement_mm"),
    "compression": ("compression_mm", "displacement_mm", "stroke_m"),
}
_EMPTY = frozenset(
    "nan -nan +nan nan(ind) -nan(ind) na n/a #n/a #nv #num! #value! #div/0! null none 1.#qnan -1.#ind 1.#ind "
    "missing".split()
)
"""What programs write into a cell that holds nothing."""
EPOCH_S = (9.5e8, 4.1e9)
"""Seconds since 1970 between which a clock of our time is: the years 2000 to 2099."""
_FINER = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Units in which clocks count, and one of each in seconds."""
SLOWEST_STEP_S = 0.5
"""Step of a clock from which on it counts in a finer unit [s]."""
SPARSE = 0.1
"""Part of a column's cells that are empty from which on they are other topics' rows, not samples that are missing."""
MOST_EMPTY = 0.1
"""Part of the rows that may lack a number; a record with more of them has another fault."""

FEWEST_FILLED = 20
"""Rows with numbers from which on any number of empty ones behind them are an array that was longer than the record."""


@dataclass(frozen=True)
class Column:
    """One chosen column.

    Attributes:
        name: Its name in the table.
        role: ``time``, ``force``, ``position`` or ``compression``.
        factor: What turns its numbers into SI with our sign.
        depth: Whether its name is that of a way down.
        notes: What was assumed of its unit, one sentence each.
    """

    name: str
    role: str
    factor: float
    depth: bool = False
    notes: tuple[str, ...] = ()


def choose(table: Table, role: str, wanted: str | None, option: str | None = None) -> Column:
    """The column of a role, by name if the user gave one.

    Args:
        table: The table.
        role: ``time``, ``force``, ``position`` or ``compression``.
        wanted: Name of a column, with ``=unit`` behind it where that is to be said; None to choose one by its name and
            unit.
        option: Option that names the column, for errors; ``--role-col`` if not given.

    Returns:
        The column, with the factor that its unit and its name stand for.

    Raises:
        TraceError: There is no such column, no single one whose name fits, or a unit that is none of the role.
    """
    option = option or f"--{role}-col"
    if wanted is not None:
        name, given = _with_unit(table, wanted)
        if name not in table.columns:
            why = table.left_out.get(name)
            hint = f": it was left out, {why}" if why else _did_you_mean([name], table)
            raise TraceError(f"{table.source}: no column {quoted(wanted)} ({option}){hint}")
        return _column(table, role, name, option, given)
    fitting = candidates(table, role)
    if role == "time" and len(fitting) > 1 and _one_clock(table, fitting):
        note = f"{table.source}: {listed(fitting, LONG)} are one clock; {brief(fitting[0], LONG)} is used"
        one = _column(table, role, fitting[0], option)
        return replace(one, notes=(*one.notes, note))
    if len(fitting) == 1:
        return _column(table, role, fitting[0], option)
    if fitting:
        raise TraceError(
            f"{table.source}: several columns could be the {role}: {listed(fitting, LONG)}; choose one with {option}"
        )
    bare = _bare_force(table) if role == "force" else _clock_since_1970(table) if role == "time" else None
    if bare is not None:
        return bare
    raise TraceError(f"{table.source}: {table.hint}" if table.hint else _nothing_fits(table, role, option))


def _bare_force(table: Table) -> Column | None:
    """The only measured force, which has no unit, where others that were commanded or derived are in newtons."""
    asked = [name for name in table.columns if _would_fit(table, name, "force")]
    measured = [name for name in asked if not not_measured(name)]
    beside = [
        name
        for name in asked
        if not_measured(name) and (unit := meaning(table, name).measure) and unit.fits("force") and unit.factor == 1.0
    ]
    if len(measured) != 1 or not beside or table.hint:
        return None
    note = (
        f"{table.source}: no unit is stated for {brief(measured[0], LONG)}, which is taken in N as "
        f"{brief(beside[0], LONG)} is; that was commanded or derived and is not used"
    )
    return replace(_column(table, "force", measured[0], "--force-col"), notes=(note,))


def _one_clock(table: Table, names: Sequence[str]) -> bool:
    """Whether clocks go together, to half a step of the first."""
    clocks = []
    for name in names:
        try:
            clocks.append(numbers(table, _column(table, "time", name, "--time-col")))
        except TraceError:
            return False
    first = clocks[0] - clocks[0][0]
    step = float(np.median(np.abs(np.diff(first)))) if len(first) > 1 else 0.0
    return step > 0.0 and all(np.max(np.abs(other - other[0] - first)) <= 0.5 * step for other in clocks[1:])


def _plain_numbers(table: Table, name: str) -> np.ndarray | None:
    """The numbers of a column as they stand, None where it holds anything else."""
    values = [as_float(cell) for cell in table.columns[name]]
    return None if not values or any(value is None for value in values) else np.array(values, dtype=float)


def _clock_since_1970(table: Table) -> Column | None:
    """The only column that is called a time, has no unit, and counts since 1970: its size tells in what it counts."""
    asked = [name for name in table.columns if _would_fit(table, name, "time") and not not_measured(name)]
    values = _plain_numbers(table, asked[0]) if len(asked) == 1 and not table.hint else None
    if values is None:
        return None
    first, last = EPOCH_S
    clocks = {unit: values * factor for unit, factor in _FINER.items()}
    unit = next((unit for unit, clock in clocks.items() if np.all((clock > first) & (clock < last))), "")
    if not unit:
        return None
    note = f"{table.source}: {brief(asked[0], LONG)} counts since 1970, so it is taken in {unit}"
    return Column(asked[0], "time", _FINER[unit], notes=(note,))


def _likely_unit(table: Table, name: str) -> str:
    """The unit in which a clock without one would tick as those of sensors do; seconds where nothing tells."""
    values = _plain_numbers(table, name)
    step = float(np.median(np.abs(np.diff(values)))) if values is not None and len(values) > 1 else 0.0
    return next((unit for unit, factor in _FINER.items() if step * factor < SLOWEST_STEP_S), "s")


def _nothing_fits(table: Table, role: str, option: str) -> str:
    """Why no column could be chosen, and what can be named instead."""
    header = f"{table.source}: no {role} column with its unit in the name, such as {', '.join(_EXPECTED[role][:3])}"
    asked = [name for name in table.columns if _would_fit(table, name, role)]
    bare = [name for name in asked if not not_measured(name)]
    if bare:
        units = _likely_unit(table, bare[0]) if role == "time" else SI_OF_ROLE[role]
        what = (
            f"; did you mean {quoted(bare[0])}, which has no unit? name it with its unit: {option} "
            f"{quoted(bare[0] + chr(61) + units)}"
        )
    else:
        near = _did_you_mean(_EXPECTED[role], table)
        what = f"{near}; name one with {option} and its unit, as in 'NAME={SI_OF_ROLE[role]}'"
    others = [name for name in table.columns if (unit := meaning(table, name).measure) and unit.fits(role)]
    others = [name for name in others if not not_measured(name)]
    unfit = [name for name in table.columns if _unit_is_none_of_it(table, name, role)]
    if not bare and len(others) == 1 and "did you mean" not in what:
        what = f"; the only one in a unit of {role} is {quoted(others[0])}: name it with {option} if it is that"
    elif not bare and unfit:
        stated = quoted(meaning(table, unfit[0]).unit)
        what = f"; {quoted(unfit[0])} has the unit {stated}, which is none of a {role} ({EXAMPLES[role]})"
        what += f"; if that is wrong, say {option} {quoted(f'{unfit[0]}={SI_OF_ROLE[role]}')}"
    if role == "time":
        what += ", or give --rate where rows were written at a known rate"
    derived = [name for name in asked if not_measured(name)]
    more = f" ({listed(derived[:2], LONG)} was commanded or derived and is not chosen unasked)" if derived else ""
    left = "; ".join(f"{brief(name)} was left out, {why}" for name, why in list(table.left_out.items())[:3])
    return f"{header}{what}{more}{f' ({left})' if left else ''}"


def _unit_is_none_of_it(table: Table, name: str, role: str) -> bool:
    """Whether a column is called like one of a role but has a unit of something else, or one that nobody knows."""
    said = meaning(table, name)
    unfit = bool(said.unit) and (said.measure is None or not said.measure.fits(role))
    return unfit and named_like(said.stem, role)


def _would_fit(table: Table, name: str, role: str) -> bool:
    """Whether a column would have a role if its unit were stated, or if it were measured."""
    said = meaning(table, name)
    measure = said.measure
    unit_fits = measure.fits(role) if measure else not said.unit
    return unit_fits and (named_like(said.stem, role) or (not_measured(name) and role in said.stem))


def _with_unit(table: Table, wanted: str) -> tuple[str, Unit | None]:
    """Name and given unit in the text of an option such as ``Fz=N``."""
    name, equals, text = wanted.rpartition("=")
    if wanted in table.columns or not equals:
        return wanted, None
    unit = unit_of(text)
    return (name, unit) if unit is not None else (wanted, None)


def numbers(table: Table, column: Column, *, sparse: bool = False) -> np.ndarray:
    """The numbers of a column.

    Args:
        table: The table.
        column: One of its columns.
        sparse: Whether empty cells are other topics' rows, and become NaN.

    Returns:
        The numbers in SI with our sign, shape (n,) for n rows [s], [N] or [m] by the column's role.

    Raises:
        TraceError: A cell holds no finite number, or one that is too large; the message names the first one.
    """
    cells = table.columns[column.name]
    empty = empty_cells(cells) if sparse else np.zeros(len(cells), dtype=bool)
    if isinstance(cells, np.ndarray) and cells.dtype.kind in "iuf":
        values = cells.astype(float)
    else:
        values = np.array(
            [np.nan if empty[i] else _number(table, column, i, cell) for i, cell in enumerate(cells)], dtype=float
        )
    limit, unit = _LIMITS[column.role]
    finite = np.isfinite(values)
    usable = empty | (finite & (np.abs(np.where(finite, values, 0.0)) <= limit / abs(column.factor)))
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


def empty_cells(cells: Sequence[Any] | np.ndarray) -> np.ndarray:
    """Which cells hold nothing, or say that they are not a number, shape (n,)."""
    if isinstance(cells, np.ndarray) and cells.dtype.kind in "iuf":
        return np.isnan(cells.astype(float))
    return np.array([_is_empty(cell) for cell in cells], dtype=bool)


def without_empty(table: Table, columns: Sequence[Column], starts: Sequence[int] = ()) -> Table:
    """A table without the rows in which a column has no number, which are samples that are missing.

    Args:
        table: The table.
        columns: Columns that are read; a sparse one may have empty cells.
        starts: Indices of rows that are needed, shape (k,) [-].

    Returns:
        The same where no cell is empty, or where too many are; else its other rows, with a note.
    """
    lacking, unfilled = np.zeros(len(table.rows), dtype=bool), np.ones(len(table.rows), dtype=bool)
    names = []
    for column in columns:
        if column.name not in table.columns or is_sparse(table, column.name):
            continue
        empty = empty_cells(table.columns[column.name])
        unfilled &= empty
        if empty.any():
            names.append(brief(column.name, LONG))
            lacking |= empty
    count = int(np.count_nonzero(lacking))
    behind = int(np.argmin(unfilled[::-1])) if count <= len(lacking) - FEWEST_FILLED else 0
    if not names or count - behind > MOST_EMPTY * (len(lacking) - behind) or lacking[list(starts)].any():
        return table
    row = f"{table.row} {brief(table.rows[int(np.argmax(lacking))])}"
    rows = f"{count} rows, the first is {row}, were" if count > 1 else f"{row} was"
    note = f"{table.source}: {rows} left out, without a number in column {listed(names, LONG)}"
    part = table.part(np.flatnonzero(~lacking))
    return replace(part, notes=(*part.notes, note))


def is_sparse(table: Table, name: str) -> bool:
    """Whether a column has numbers in some rows of a table of several topics, and nothing in the others.

    The empty cells come again and again: there are ``SPARSE`` of all at least, and at least one in ten numbers is
    beside one.
    """
    empty = empty_cells(table.columns[name])
    held = int(np.count_nonzero(~empty))
    turns = int(np.count_nonzero(empty[1:] != empty[:-1]))
    return bool(empty.mean() >= SPARSE and held >= 2 and turns >= 2 * SPARSE * held)


def _is_empty(cell: Any) -> bool:
    if cell is None or (isinstance(cell, float) and cell != cell):
        return True
    return isinstance(cell, str) and (cell.strip().lower() in _EMPTY or not cell.strip().strip("-."))


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
    comma = isinstance(cell, str) and as_plain(cell, ",") is not None
    hint = "; write decimals with a point, or say --decimal , (or . where commas set off thousands)" if comma else ""
    hint = hint or "; remove or repair the row"
    raise TraceError(f"{_where(table, column, i)}: {_shown(cell)} is not a number{hint}")


def _where(table: Table, column: Column, i: int) -> str:
    """A cell's place, as the table's file counts rows."""
    return f"{table.source}, {table.row} {brief(table.rows[i])}, column {brief(column.name, LONG)}"


def _shown(cell: Any) -> str:
    """A cell in an error."""
    if isinstance(cell, str):
        return quoted(cell.strip())
    return brief(cell) if isinstance(cell, (int, float, np.number)) else f"{type(cell).__name__} {brief(cell)}"


def _column(table: Table, role: str, name: str, option: str, given: Unit | None = None) -> Column:
    """Factor of a named column: unit, known sign of a force, depth turned into height.

    Raises:
        TraceError: The unit in the name, or stated beside it, is none of the role or not known, or the two differ.
    """
    said = meaning(table, name)
    where = f"{table.source}, column {brief(name, LONG)}"
    remedy = f"say which it is with {option} {quoted(f'{brief(name)}={SI_OF_ROLE[role]}')}"
    measure = given or said.measure
    if given is None and said.unit and (measure is None or not measure.fits(role)):
        kind = "is not known" if measure is None else f"is none of a {role}"
        raise TraceError(
            f"{where}: its unit is {quoted(said.unit)}, which {kind}; use one of {EXAMPLES[role]}, or {remedy} if it "
            "is another column's or wrong"
        )
    if given is not None and not given.fits(role):
        raise TraceError(f"{where}: {quoted(given.symbol)} is no unit of a {role} ({option}); use {EXAMPLES[role]}")
    own = unit_of(said.named) if said.named else None
    if given is None and said.stated and own is not None and measure is not None and own.factor != measure.factor:
        raise TraceError(f"{where}: its unit is stated as {quoted(said.unit)}; correct one of them, or {remedy}")
    notes = _unit_notes(table, name, role, measure, given is not None)
    factor = (measure.factor if measure else 1.0) * sign_of(said.stem, role)
    return Column(name, role, factor, is_depth(said.stem), notes)


def _unit_notes(table: Table, name: str, role: str, measure: Unit | None, given: bool) -> tuple[str, ...]:
    """What was assumed of a unit that is not stated, and what one of another system is in SI."""
    si = SI_OF_ROLE[role]
    if measure is None:
        return (f"{table.source}: no unit is stated for {brief(name, LONG)}, which is taken in {si}",)
    if not measure.common:
        return (
            f"{table.source}: {brief(name, LONG)} is in {measure.symbol}, of which one is {measure.factor:.6g} {si}",
        )
    own = meaning(table, name).measure
    if given and own is not None and own.factor != measure.factor:
        return (f"{table.source}: {brief(name, LONG)} is taken in {measure.symbol} as asked, not in {own.symbol}",)
    return ()


def _did_you_mean(wanted: Sequence[str], table: Table) -> str:
    """A hint with the nearest existing names, or with all of them."""
    lower = {name.lower(): name for name in table.columns if len(name) <= LONGEST_NAME}
    near = [lower[n] for w in wanted for n in difflib.get_close_matches(w.lower(), lower, n=1, cutoff=0.7)]
    near = [name for name in near if not not_measured(name)]
    if not near:
        labels = [f"{name} [{table.units[name]}]" if name in table.units else name for name in table.columns]
        return f"; the columns are {listed(labels, LONG)}"
    stated = table.units.get(near[0])
    return f"; did you mean {quoted(near[0])}{f', whose unit is stated as {quoted(stated)}' if stated else ''}?"
