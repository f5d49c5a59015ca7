"""Reading the folder of a finished calibration; errors say which file is at fault and what to do."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from mpm.output.section import Section
from reports import ReportError

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult

Data = dict[str, Any]

CURVE_COLUMNS = ("stroke_m", "real_N", "sim_N", "residual_N", "edge_N", "face_N", "start_N", "ramp_N",
                 "half_sine_N", "three_term_N")  # fmt: skip
#: These must be finite; a part of the simulation or a null model may be missing (NaN).
COMPLETE = CURVE_COLUMNS[:4]
#: These may be left out, by an interrupted run and by older versions.
BAND_COLUMNS = ("band_low_N", "band_high_N")
WITHDRAWAL_COLUMNS = ("way_m", "real_N", "sim_N", "residual_N")
RECORD = ("time_s", "raw_N", "tared_N")
REMEDY = "run the same calibrate command again with --resume"


@dataclass(frozen=True, eq=False)
class Runs:
    """The simulations of a fit that ended by themselves, m of them.

    Attributes:
        parameters: Values [SI] by name, each (m,), NaN where a run has none.
        failed: Whether a run broke down (m,).
    """

    parameters: dict[str, np.ndarray] = field(default_factory=dict)
    failed: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))


@dataclass(frozen=True)
class Finished:
    """What a report is made from.

    Attributes:
        result: What the calibration ended with.
        created: When the run was made.
        curves: Columns of ``curves.csv`` by name: stroke [m] and forces [N], shape (n,); those of the band only where
            the file has them.
        time: Time of the whole record [s], shape (k,).
        raw: Force as recorded [N], shape (k,).
        tared: Force less its baseline [N], shape (k,).
        runs: The simulations, none where the store has no table of them.
        section: The food across the blade's middle; None where the record has none.
        withdrawal: Columns of ``withdrawal.csv`` by name, shape (m,); empty where no way up was fitted.
    """

    result: CalibrationResult
    created: datetime
    curves: dict[str, np.ndarray]
    time: np.ndarray
    raw: np.ndarray
    tared: np.ndarray
    runs: Runs
    section: Section | None = None
    withdrawal: dict[str, np.ndarray] = field(default_factory=dict)


def read_finished(result: CalibrationResult) -> Finished:
    """Read what else there is in the folder of a calibration.

    Args:
        result: The calibration, whose folder has ``curves.csv`` and ``evaluations.h5``.

    Returns:
        All that a report is made from.

    Raises:
        ReportError: A file is missing, damaged or incomplete.
    """
    folder = result.folder
    created = read_date(folder / "summary.json", {"created": result.created})
    curves = _read_curves(folder / "curves.csv")
    store = folder / "evaluations.h5"
    section = read_section(folder / "record.h5")
    up = {} if result.withdrawal is None else _read_withdrawal(folder / "withdrawal.csv")
    return Finished(result, created, curves, *_read_record(store), _read_runs(store), section, up)


def read_json(path: Path) -> Any:
    """A JSON document in which numbers that are not finite are None.

    Raises:
        ReportError: It is missing or damaged.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda _: None)
    except OSError as e:
        raise unreadable(path, e) from None
    except ValueError as e:
        raise ReportError(f"{path}: damaged, not JSON ({e}); {REMEDY}") from None


def read_date(path: Path, data: Data) -> datetime:
    """When a run was made: ``created`` of its summary.

    Raises:
        ReportError: It is no date.
    """
    try:
        # Python 3.10 does not read the letter Z as a time zone.
        return datetime.fromisoformat(re.sub(r"[zZ]$", "+00:00", data["created"]))
    except ValueError:
        raise ReportError(f"{path}: created is {data['created']!r}, not an ISO date; {REMEDY}") from None


def check_kind(path: Path, place: str, value: Any, kind: Any) -> None:
    """Refuse a value of another kind than a schema says, and name its place.

    Args:
        path: The file, for the error.
        place: Where in it the value stands; empty at the top.
        value: The value.
        kind: Types it may have; or a mapping of names (several in one text, ``*`` for any) to kinds; or a list of one
            kind.

    Raises:
        ReportError: It is of another kind, or something is missing in it.
    """
    if isinstance(kind, tuple):
        flag_as_number = isinstance(value, bool) and bool not in kind and object not in kind
        if flag_as_number or not isinstance(value, kind):
            raise ReportError(f"{path}: {place} is {json.dumps(value)[:60]}, which it cannot be; {REMEDY}")
        return
    if not isinstance(value, type(kind)):
        wanted = "a list" if isinstance(kind, list) else "a mapping of names to values"
        raise ReportError(f"{path}: {place or 'the top level'} is not {wanted}; {REMEDY}")
    if isinstance(kind, list):
        for i, item in enumerate(value):
            check_kind(path, f"{place}[{i}]", item, kind[0])
        return
    for names, inner in kind.items():
        for name in value if names == "*" else names.split():
            where = f"{place}.{name}" if place else name
            if name not in value:
                raise ReportError(
                    f"{path}: {where} is missing; the file is incomplete or of another version of cutcal: {REMEDY}"
                )
            check_kind(path, where, value[name], inner)


def _read_curves(path: Path) -> dict[str, np.ndarray]:
    columns = read_columns(path, CURVE_COLUMNS, COMPLETE)
    return {name: x for name, x in columns.items() if name in CURVE_COLUMNS or set(BAND_COLUMNS) <= set(columns)}


def _read_withdrawal(path: Path) -> dict[str, np.ndarray]:
    return read_columns(path, WITHDRAWAL_COLUMNS, WITHDRAWAL_COLUMNS, over="way_m")


def read_columns(
    path: Path, needed: Sequence[str], complete: Sequence[str], over: str = "stroke_m"
) -> dict[str, np.ndarray]:
    """Curves over a stroke that rises.

    Args:
        path: A table with a line of names; an empty cell is NaN.
        needed: Columns that must be there, that of the stroke and ``real_N`` among them.
        complete: Those that must be finite.
        over: Column of the stroke.

    Returns:
        All its columns by name, each (n,).

    Raises:
        ReportError: It is missing or damaged.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        header = [name.strip() for name in lines[0].split(",")] if lines else []
        cells = [line.split(",") for line in lines[1:] if line.strip()]
        rows = np.array([[float(x or "nan") for x in row] for row in cells if len(row) == len(header)])
    except OSError as e:
        raise unreadable(path, e) from None
    except ValueError as e:
        raise ReportError(f"{path}: damaged, not a table of numbers ({e}); {REMEDY}") from None
    missing = [name for name in needed if name not in header]
    if missing:
        raise ReportError(f"{path}: column {', '.join(missing)} is missing; {REMEDY}")
    if len(rows) < 2 or len(rows) < len(cells):
        bad_row = next((i for i, row in enumerate(cells) if len(row) != len(header)), len(cells)) + 2
        raise ReportError(f"{path}: row {bad_row} is cut off or missing; {REMEDY}")
    curves = {name: rows[:, k] for k, name in enumerate(header)}
    gaps = [name for name in complete if not np.all(np.isfinite(curves[name]))]
    if gaps:
        raise ReportError(f"{path}: column {gaps[0]} has a value that is not finite; {REMEDY}")
    if np.any(np.diff(curves[over]) <= 0.0) or not np.max(curves["real_N"]) > 0.0:
        raise ReportError(f"{path}: damaged, the stroke does not rise or no real force is positive; {REMEDY}")
    return curves


def _read_record(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, raw and tared force of the trace in evaluations.h5."""
    if not path.is_file():
        raise unreadable(path, FileNotFoundError())
    try:
        with h5py.File(path, "r") as store:
            group = store["conditioning"]
            time, raw, tared = (np.asarray(group[name][()], dtype=float) for name in RECORD)
    except KeyError as e:
        raise ReportError(f"{path}: the record of the trace is not in it ({e.args[0]}); {REMEDY}") from None
    except OSError as e:
        raise ReportError(
            f"{path}: damaged, or open in another process ({e}); wait for that one, or {REMEDY}"
        ) from None
    finite = all(np.all(np.isfinite(x)) for x in (time, raw, tared))
    if time.ndim != 1 or len(time) < 2 or not time.shape == raw.shape == tared.shape or not finite:
        raise ReportError(f"{path}: conditioning holds records of unequal length or with gaps; {REMEDY}")
    return time, raw, tared


def read_section(path: Path) -> Section | None:
    """The section in the record of a cut; older runs have none, and a report does without it."""
    try:
        with h5py.File(path, "r") as file:
            return Section(**{f.name: file[f"section/{f.name}"][()] for f in fields(Section)})
    except (OSError, KeyError):
        return None


def _read_runs(path: Path) -> Runs:
    """The simulations in evaluations.h5 that finished or failed and have parameters."""
    try:
        with h5py.File(path, "r") as store:
            if "status" not in store or "parameters" not in store:
                return Runs()
            status = np.asarray(store["status"].asstr()[()], dtype=str)
            columns = {name: np.asarray(values[()], dtype=float) for name, values in store["parameters"].items()}
    except (OSError, TypeError, AttributeError) as e:
        raise ReportError(f"{path}: its table of simulations is damaged ({e}); {REMEDY}") from None
    if any(x.shape != status.shape for x in columns.values()):
        raise ReportError(f"{path}: its table of simulations has columns of unequal length; {REMEDY}")
    ended = np.isin(status, ("ok", "failed"))
    if columns:
        ended &= np.any(np.isfinite(np.array(list(columns.values()))), axis=0)
    return Runs({name: x[ended] for name, x in columns.items()}, status[ended] == "failed")


def unreadable(path: Path, e: OSError) -> ReportError:
    """The error of a file that is not there or cannot be read."""
    what = "no such file" if isinstance(e, FileNotFoundError) else f"cannot be read ({e.strerror})"
    return ReportError(f"{path}: {what}; a report needs it: {REMEDY}")
