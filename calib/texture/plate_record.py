"""Records of tests between two plates: time, way of the plate and load, as the machine wrote them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from calib.errors import TraceError
from calib.formats.reader import read_table
from calib.io.type_schema import Shared
from calib.io.wording import brief
from calib.table.table import Table
from calib.trace.clock import running_clock
from calib.trace.columns import Column, choose, numbers, without_empty
from calib.trace.names import meaning
from calib.trace.recorded import MIN_SAMPLES, parse_sign
from mpm.arrays import FloatArray

GAP = "gap"
"""Stem of a column that holds the distance of the plates; its first value is the height of the specimen."""


@dataclass(frozen=True)
class PlateColumns:
    """How the columns of a record are found.

    Attributes:
        time: Column of the time, None to find it.
        compression: Column of the way or of the gap, None to find it.
        force: Column of the load, None to find it.
        sign: Sign of the load that presses, ``+`` or ``-``; None for positive.
    """

    time: str | None = None
    compression: str | None = None
    force: str | None = None
    sign: str | None = None


@dataclass(frozen=True)
class RecordedFile:
    """A file of a test: its name, its SHA-256 and the columns of time, compression and load.

    Attributes:
        name: Its name.
        sha256: SHA-256 of a file's content.
        time: Column of the time.
        compression: Column of the compression.
        force: Column of the load.
    """

    name: str
    sha256: Annotated[str, Shared("sha256")]
    time: str
    compression: str
    force: str


@dataclass(frozen=True)
class PlateRecord:
    """One specimen between two plates.

    Attributes:
        name: Its name.
        time: Time from the first sample [s], shape (n,).
        way: Way of the plate from its first place, compression positive [m], shape (n,).
        load: Load as recorded, compression positive [N], shape (n,).
        gap: First distance of the plates [m]; None where the machine recorded a way and no gap.
        file: Where it is from.
        notes: What was done to read it, one sentence each.
    """

    name: str
    time: FloatArray
    way: FloatArray
    load: FloatArray
    gap: float | None
    file: RecordedFile
    notes: tuple[str, ...] = ()

    def height(self, given: float | None) -> float:
        """Height of the specimen [m]: the one that is given, else the first gap.

        Raises:
            TraceError: Neither is known, or the plate goes further than the height.
        """
        height = given if given is not None else self.gap
        if height is None:
            raise TraceError(f"{self.file.name}: no gap is recorded, so give the height of the specimen with --height")
        if not self.way.max() < height:
            raise TraceError(
                f"{self.file.name}: the plate goes {self.way.max():.4g} m, which is not less than the height of "
                f"{height:.4g} m; check --height and the unit of column {self.file.compression}"
            )
        return height


def read_records(paths: Sequence[str | Path], columns: PlateColumns) -> list[PlateRecord]:
    """Read the records of several specimens, each in a file of its own.

    Args:
        paths: Files in any format that traces have.
        columns: How their columns are found.

    Returns:
        The records, in the order of the files.

    Raises:
        TraceError: A file, a column or a record cannot be used, or two have one name.
    """
    records = [read_record(path, columns) for path in paths]
    names = [record.name for record in records]
    for name in names:
        if names.count(name) > 1:
            raise TraceError(f"{name}: given {names.count(name)} times; give each file once, by its own name")
    return records


def read_record(path: str | Path, columns: PlateColumns) -> PlateRecord:
    """Read the record of one specimen.

    The clock is repaired where that is sound. A gap that closes is turned round. Nothing is subtracted from the load.

    Args:
        path: The file.
        columns: How its columns are found.

    Returns:
        The record.

    Raises:
        TraceError: It cannot be used; the message says why and what to do.
    """
    table = read_table(path)
    time = choose(table, "time", columns.time)
    way = choose(table, "compression", columns.compression)
    force = choose(table, "force", columns.force)
    table = without_empty(table, (time, way, force))
    if len(table.parts) > 1:
        raise TraceError(f"{table.source}: holds {len(table.parts)} tables; give each specimen in a file of its own")
    if len(table.rows) < MIN_SAMPLES:
        raise TraceError(f"{table.source}: {len(table.rows)} rows of data, at least {MIN_SAMPLES} are needed")
    t, x, load = (numbers(table, column) for column in (time, way, force))
    if columns.sign is not None:
        load = parse_sign(columns.sign) * load
    clock = running_clock(table, (time, force), t, load, None)
    if clock.breaks:
        raise TraceError(
            f"{table.source}: its clock starts again at {table.row} {table.rows[clock.kept[clock.breaks[0]]]}; give "
            "each specimen in a file of its own"
        )
    x, load = x[clock.kept], load[clock.kept]
    first = abs(float(x[0]))
    x, turned = _own_direction(table, way, x - x[0], columns.sign)
    _check_load(table, force, load)
    gap = first if meaning(table, way.name).stem == GAP else None
    file = RecordedFile(table.source, table.sha256, time.name, way.name, force.name)
    notes = (*table.notes, *time.notes, *way.notes, *force.notes, *clock.notes, *turned)
    return PlateRecord(Path(path).stem, clock.time - clock.time[0], x, load, gap, file, notes)


def _own_direction(table: Table, way: Column, gone: FloatArray, sign: str | None) -> tuple[FloatArray, tuple[str, ...]]:
    """The way of the plate, positive as it presses, and what was done.

    Args:
        table: The table.
        way: Column of the way.
        gone: Way from its first value [m], shape (n,).
        sign: Sign of the load, None where it was not given.

    Returns:
        The way [m], shape (n,), and a sentence where it was turned.

    Raises:
        TraceError: It does not grow, and no sign was given.
    """
    name = brief(way.name)
    if not np.any(gone):
        raise TraceError(f"{table.source}, column {name}: the plate does not move; check --compression-col")
    if gone.max() > -gone.min():
        return gone, ()
    if sign is None:
        raise TraceError(
            f"{table.source}, column {name}: falls as the plates approach; rename the column to gap_um (or _mm) if it "
            "is the distance of the plates, or say with --sign which sign the load has that presses"
        )
    return -gone, (f"{table.source}: {name} falls as the plates approach, so it is taken as negative in compression",)


def _check_load(table: Table, force: Column, load: FloatArray) -> None:
    """Refuse a load that falls as the plates approach, or none at all.

    Raises:
        TraceError: It is so.
    """
    if load.max() <= -load.min():
        raise TraceError(
            f"{table.source}, column {brief(force.name)}: the largest load is {load.max():.4g} N and the smallest "
            f"{load.min():.4g} N; if compression is counted negative, read it with --sign -"
        )
