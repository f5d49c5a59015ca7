"""Repeats of a measured compression test: files to engineering stress over engineering strain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from calib.compression.faults import without_faults
from calib.errors import CurveError, TraceError
from calib.formats.reader import read_table
from calib.io.type_schema import Shared
from calib.io.wording import brief
from calib.table.table import Table
from calib.trace.columns import choose, numbers, without_empty
from calib.trace.mending import noise_of
from calib.trace.names import candidates, stem_of
from calib.trace.recorded import MIN_SAMPLES, parse_sign
from mpm.arrays import FloatArray
from mpm.scene.shapes import Shape, volume

STRAIN_STEP = 0.001
"""Step of the common strain grid, about [-]."""
SMALL_STRAIN = 0.05
"""Strain up to which the slope of the stress is the small-strain modulus [-]: the window of published moduli."""
REPEAT_COLUMNS = ("replicate", "repeat", "specimen", "sample", "run", "trial", "test")
"""Columns that split a file into repeats; one that counts rows does not."""
CONTACT_SD, CONTACT_PART, LONGEST_APPROACH = 5.0, 2e-3, 0.01
"""Noise standard deviations, and part of the largest stress, from which on a plate touches; strain before it that is
told [-]."""
_PHASES = frozenset("cycle cycle_number cycle_no cycle_count bite phase segment step stage state".split())
"""Stems of columns that tell parts of the test of one specimen, which is another one after each of them."""
BEGIN = 0.1
"""Part of the way within which that of each specimen begins [-]."""
LOADED, UNLOADED = 0.5, 0.2
"""Parts of the largest way of the plate above which it is pressed, and below which it has come back [-]."""


@dataclass(frozen=True)
class CompressionFile:
    """One file of a compression test.

    Attributes:
        name: Name of the file.
        sha256: SHA-256 of a file's content.
        compression: Column of the compression.
        force: Column of the load.
    """

    name: str
    sha256: Annotated[str, Shared("sha256")]
    compression: str
    force: str


@dataclass(frozen=True)
class MeasuredCompression:
    """Repeats of one compression test on a common strain grid.

    Attributes:
        strain: Engineering strain, compression positive [-], shape (n,).
        stress: Engineering stress of each repeat [Pa], shape (repeats, n).
        slope: Slope of the stress over 0 to 5 % strain of each repeat [Pa], shape (repeats,).
        names: Name of each repeat.
        files: The files.
        notes: What was done to read them, and what of them was left out, one sentence each.
    """

    strain: FloatArray
    stress: FloatArray
    slope: FloatArray
    names: list[str]
    files: tuple[CompressionFile, ...]
    notes: tuple[str, ...] = ()

    @property
    def mean(self) -> FloatArray:
        """Mean stress of the repeats [Pa], shape (n,)."""
        return self.stress.mean(axis=0)


def area(shape: Shape) -> float:
    """Area under the plate [m^2]."""
    return volume(shape) / shape.height


def strain_grid(strain: float) -> FloatArray:
    """Strains from 0 to ``strain`` [-].

    Raises:
        CurveError: It ends before the window of the small-strain modulus.
    """
    if strain < SMALL_STRAIN:
        raise CurveError(
            f"--strain {strain:g}: the modulus over 0 to {SMALL_STRAIN:g} is part of the result; give {SMALL_STRAIN:g} "
            "or more"
        )
    return np.linspace(0.0, strain, round(strain / STRAIN_STEP) + 1)


def slope(strain: FloatArray, stress: FloatArray) -> float:
    """Slope of the least-squares line through stress over 0 to 5 % strain; its offset is free [Pa]."""
    on = strain <= SMALL_STRAIN * (1 + 1e-9)
    return float(np.polyfit(strain[on], stress[on], 1)[0])


def read_repeats(
    paths: Sequence[str | Path],
    shape: Shape,
    strain: float,
    *,
    compression_col: str | None = None,
    force_col: str | None = None,
    sign: str | None = None,
) -> MeasuredCompression:
    """Read the repeats of a compression test.

    The first sample of a repeat is its zero of compression and of load; no toe is corrected. Of each repeat the first
    loading is used, up to ``strain``. A gap that closes is turned round.

    Args:
        paths: Files, each one repeat or several: with a column ``replicate``, ``specimen`` or the like, or a header
            for each; all of one material.
        shape: The specimen.
        strain: Largest engineering strain [-].
        compression_col: Column of the way of the plate; metres if its name has no unit.
        force_col: Column of the load; newtons if its name has no unit.
        sign: ``+`` or ``-``: the sign of the load that presses. The way is then counted in the direction in which it
            goes.

    Returns:
        The repeats on a common strain grid.

    Raises:
        TraceError: A file, a column or a repeat cannot be used; the message says which and why.
        CurveError: ``strain`` is too small.
    """
    grid = strain_grid(strain)
    names: list[str] = []
    rows, slopes, files, notes = [], [], [], []
    for path in map(Path, paths):
        table = read_table(path)
        if compression_col in candidates(table, "force") or force_col in candidates(table, "compression"):
            raise TraceError(
                f"{table.source}: columns {compression_col or 'unnamed'} (compression) and {force_col or 'unnamed'} "
                "(load) look swapped; exchange --compression-col and --force-col"
            )
        compression = choose(table, "compression", compression_col)
        force = choose(table, "force", force_col)
        table = without_empty(table, (compression, force), [int(on[0]) for _, on in _repeats(table)])
        notes += [*table.notes, *compression.notes, *force.notes]
        way, load = numbers(table, compression), numbers(table, force)
        if sign is not None:
            load = parse_sign(sign) * load
            way, said = _its_own_way(table.source, compression.name, way)
            notes += said
        repeats, said = _by_label(table, _repeats(table), way)
        notes += said
        for name, on in repeats:
            label = name if len(paths) == 1 else f"{path.stem} {name}".strip()
            label = label or path.stem
            if label in names:
                raise TraceError(
                    f"{table.source}: a second repeat is called {label!r}; give each file once, by its own name"
                )
            names.append(label)
            where = f"{table.source}{f', repeat {name}' if name else ''}"
            mended, faults = without_faults(
                way[on], load[on], strain * shape.height, _places(where, table, force.name, on)
            )
            notes += faults
            e, s = _loading(where, way[on], mended, shape, strain)
            notes += _before_contact(where, table, on, (e, s))
            notes += _later_loadings(where, table, on, way[on])
            rows.append(np.interp(grid, e, s))
            slopes.append(slope(e, s))
        files.append(CompressionFile(table.source, table.sha256, compression.name, force.name))
    return MeasuredCompression(grid, np.array(rows), np.array(slopes), names, tuple(files), tuple(notes))


def _repeats(table: Table) -> list[tuple[str, np.ndarray]]:
    """Name and rows of each repeat of a file; one without a name where nothing splits it.

    A column splits it whose name says so and each of whose values stands in many rows on end.
    """
    for wanted in REPEAT_COLUMNS:
        for name, cells in table.columns.items():
            if stem_of(name) not in (wanted, f"{wanted}_id", f"{wanted}_no", f"{wanted}_number", f"{wanted}_name"):
                continue
            of = np.array([str(cell).strip() for cell in cells])
            blocks = np.flatnonzero(np.r_[True, of[1:] != of[:-1]])
            if wanted == REPEAT_COLUMNS[0] or np.diff(np.r_[blocks, len(of)]).min() >= MIN_SAMPLES:
                return [(value, np.flatnonzero(of == value)) for value in dict.fromkeys(of.tolist())]
    ends = (*table.parts[1:], len(table.rows))
    if len(ends) == 1:
        return [("", np.arange(len(table.rows)))]
    return [(str(k), np.arange(*span)) for k, span in enumerate(zip(table.parts, ends, strict=True), start=1)]


def _by_label(
    table: Table, found: list[tuple[str, np.ndarray]], way: FloatArray
) -> tuple[list[tuple[str, np.ndarray]], list[str]]:
    """The repeats of a file that nothing known splits, by a column of labels: the way begins anew where they change."""
    if len(found) > 1 or len(way) < 2 * MIN_SAMPLES:
        return found, []
    for name, cells in table.columns.items():
        if stem_of(name) in _PHASES:
            continue
        of = np.array([str(cell).strip() for cell in cells])
        starts = np.flatnonzero(of[1:] != of[:-1]) + 1
        labels = list(dict.fromkeys(of.tolist()))
        blocks = np.diff(np.r_[0, starts, len(of)])
        if not len(starts) or len(labels) != len(blocks) or blocks.min() < MIN_SAMPLES:
            continue
        if np.all(np.abs(way[starts] - way[0]) <= BEGIN * np.ptp(way)):
            note = f"{table.source}: each value of column {brief(name)} is taken for a specimen of its own"
            return [(label, np.flatnonzero(of == label)) for label in labels], [note]
    return found, []


def _places(where: str, table: Table, column: str, on: np.ndarray) -> Callable[[int], str]:
    """What errors call a sample of a repeat, by its index in it."""
    return lambda i: f"{where}, {table.row} {brief(table.rows[on[i]])}, column {brief(column)}"


def _its_own_way(source: str, name: str, way: FloatArray) -> tuple[FloatArray, list[str]]:
    """The way of the plate, positive in the direction in which it goes, and what was done."""
    gone = way - way[0]
    if gone.max() >= -gone.min():
        return way, []
    return -way, [f"{source}: {brief(name)} falls as the plates approach, so it is taken as negative in compression"]


def _before_contact(where: str, table: Table, on: np.ndarray, curve: tuple[FloatArray, FloatArray]) -> list[str]:
    """Whether the load stays at nothing while the plate comes down, one sentence or none."""
    strain, stress = curve
    noise = noise_of(stress)
    touched = np.flatnonzero(np.abs(stress) > max(CONTACT_SD * noise, CONTACT_PART * float(np.ptp(stress))))
    free = float(strain[touched[0]]) if len(touched) else 0.0
    if free <= LONGEST_APPROACH:
        return []
    row = f"{table.row} {brief(table.rows[on[min(int(touched[0]), len(on) - 1)]])}"
    return [
        f"{where}: the load stays at nothing over the first {free:.1%} of strain, up to about {row}: if the plate had "
        "not touched the specimen there, remove the rows before it, or the modulus is too small"
    ]


def _later_loadings(where: str, table: Table, on: np.ndarray, way: FloatArray) -> list[str]:
    """What of a repeat is left out because the plate has come back and presses again, one sentence or none."""
    part = (way - way[0]) / max(float(np.max(way - way[0])), 1e-12)
    count, pressed = 0, False
    again = None
    for k, x in enumerate(part):
        if not pressed and x > LOADED:
            count, pressed = count + 1, True
            again = k if count == 2 else again
        elif pressed and x < UNLOADED:
            pressed = False
    if again is None:
        return []
    row = f"{table.row} {brief(table.rows[on[again]])}"
    return [f"{where}: the plate presses {count} times; the first loading is used, what is from {row} on is left out"]


def _loading(
    where: str, way: FloatArray, load: FloatArray, shape: Shape, strain: float
) -> tuple[FloatArray, FloatArray]:
    """Strain and stress of the first loading of a repeat, strain increasing and reaching ``strain``.

    Args:
        where: Name of the file and of the repeat.
        way: Way of the plate [m], shape (n,).
        load: Force on it [N], shape (n,).
        shape: The specimen.
        strain: Largest engineering strain [-].

    Raises:
        TraceError: The repeat cannot be used.
    """
    way, load = way - way[0], load - load[0]
    last = int(np.argmax(way))
    if way[last] <= 0 or -way.min() > way[last]:
        raise TraceError(
            f"{where}: the compression is negative; say with --sign - (or --sign + where the load is positive) which "
            "sign the load has that presses, and the way is counted in its own direction"
        )
    if way[last] >= shape.height:
        raise TraceError(
            f"{where}: a compression of {way[last]:g} m is more than the height of {shape.height:g} m; if it is in "
            "millimetres call the column compression_mm, and check that --compression-col and --force-col are not "
            "swapped"
        )
    if way[last] < strain * shape.height * (1 - 1e-9):
        raise TraceError(
            f"{where}: the compression reaches a strain of {way[last] / shape.height:.3g}, not {strain:g}; "
            "give a smaller --strain, or check --height"
        )
    e = way / shape.height
    ahead = np.r_[True, e[1:] > np.maximum.accumulate(e)[:-1]]
    ahead[int(np.argmax(e >= strain * (1 - 1e-9))) + 1 :] = False
    if np.count_nonzero(ahead) < MIN_SAMPLES:
        raise TraceError(
            f"{where}: {np.count_nonzero(ahead)} samples of loading up to a strain of {strain:g}, at least "
            f"{MIN_SAMPLES} are needed; record at a higher rate"
        )
    e, s = e[ahead], load[ahead] / area(shape)
    part = len(s) // 10 + 1
    rise = s[-part:].mean() - s[:part].mean()
    if abs(rise) <= 3 * np.std(np.diff(s)):
        raise TraceError(f"{where}: there is no load on the plate beyond noise; check --force-col")
    if rise < 0:
        raise TraceError(
            f"{where}: the load falls with compression; say --sign -, or exchange "
            "--compression-col and --force-col if they are swapped"
        )
    if np.count_nonzero(e <= SMALL_STRAIN) < 3:
        raise TraceError(
            f"{where}: fewer than 3 samples up to a strain of {SMALL_STRAIN:g}, where the small-strain modulus is "
            "taken; record at a higher rate"
        )
    return e, s
