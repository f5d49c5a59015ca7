"""Reading the folder of a finished calibration; errors say which file is at fault and what to do."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mpm.output.section import Section
from reports import ReportError

Data = dict[str, Any]

COLUMNS = ("stroke_m", "real_N", "sim_N", "residual_N", "edge_N", "face_N", "start_N", "ramp_N",
           "half_sine_N", "three_term_N")  # fmt: skip
#: These must be finite; a part of the simulation or a null model may be missing (NaN).
COMPLETE = COLUMNS[:4]
#: These may be left out, by an interrupted run and by older versions.
BAND = ("band_low_N", "band_high_N")
STATUS = ("done", "interrupted")
LABELS = ("measured", "reconstructed")
RECORD = ("time_s", "raw_N", "tared_N")
REMEDY = "run the same calibrate command again with --resume"

#: What summary.json must hold: names -> kind. A kind is a tuple of types, {names: kind} ("*": any name) or
#: [kind]. The second group of numbers may be null: not known, or not defined for this curve.
_NULL = type(None)
_NUM, _OPT, _TEXT, _MAYBE, _ANY = (int, float), (int, float, _NULL), (str,), (str, _NULL), (object,)
SCHEMA: Data = {
    "food created status trace_sha256 baseline_kind stroke_source": _TEXT,
    "passed": (bool,),
    "baseline_N onset_s end_s stroke_m noise_sd_N filter_sd_m peak_real_N peak_sim_N dx_m": _NUM,
    "baseline_sd_N onset_sd_s peak_real_sd_N peak_error shape_error nrmse work_error": _OPT,
    "wall_s particles mach momentum_residual ke_over_ie ripple_N": _OPT,
    "simulations failed_simulations": (int,),
    "metrics": (dict,),
    "air": (dict, _NULL),
    "seed mirror_images": _ANY,
    "git device": _MAYBE,
    "command warnings limits": [_TEXT],
    "misfit_history": [[_OPT]],
    "versions": {"*": _ANY},
    "correlations": {"*": _OPT},
    "verdicts": [{"name": _TEXT, "value limit": _ANY, "unit note": _MAYBE, "passed": (bool, _NULL)}],
    "trace": {"source label sha256": _TEXT, "samples": (int,), "duration_s": _NUM, "columns": (dict,)},
    "sprague_geers": {"M P C": _OPT},
    "iso18571": {"Z EP EM ES R shift": _OPT, "at_bound": _ANY},
    "null_models": {"*": {"nrmse shape_error peak_error work_error R": _OPT}},
    "parameters": {"*": {"value": _NUM, "low95 high95 prior_low prior_high": _OPT,
                         "unit verdict status": _TEXT, "source": _MAYBE}},
    "fixed_parameters": {"*": {"value": _OPT, "unit status": _TEXT, "source": _MAYBE}},
    "failures": [{"reason": _TEXT, "fraction": _OPT, "parameters": (dict,)}],
    "shape": {"kind": _TEXT, "length width height": _NUM},
    "knife": {"name": _TEXT, "spine angle height length": _NUM},
}  # fmt: skip

#: What it may hold besides, or leave out.
EXTRA: Data = {
    "baseline_window_s": [_NUM],
    "end_sd_s": _OPT,
    "counters": {"*": (int,)},
    "energy_J": {"*": _NUM},
    "coarse_simulations": (int,),
    "nuisances": {"*": {"value sd prior_sd": _NUM, "unit": _TEXT, "outside": (bool,)}},
    "profiles": {"*": {"value rise trace_alone": [_NUM]}},
    "sensitivity": {"*": {"*": {"first total total_conf": _OPT}}},
    "reduced_chi2 correlation_length_m predictive_inside": _OPT,
}


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
        summary: ``summary.json``, checked against SCHEMA; numbers that are not finite are None.
        created: When the run was made.
        curves: Columns of ``curves.csv`` by name: stroke [m] and forces [N], shape (n,); BAND only where the file has it.
        time: Time of the whole record [s], shape (k,).
        raw: Force as recorded [N], shape (k,).
        tared: Force less its baseline [N], shape (k,).
        runs: The simulations, none where the store has no table of them.
        section: The food across the blade's middle; None where the record has none.
    """

    summary: Data
    created: datetime
    curves: dict[str, np.ndarray]
    time: np.ndarray
    raw: np.ndarray
    tared: np.ndarray
    runs: Runs
    section: Section | None = None


def read_finished(run: Path) -> Finished:
    """Read a calibration's folder.

    Args:
        run: Folder with ``summary.json``, ``curves.csv`` and ``evaluations.h5``.

    Raises:
        ReportError: A file is missing, damaged or incomplete.
    """
    if not run.is_dir():
        raise ReportError(f"{run}: no such folder; give the output folder of a calibration")
    summary, created = _read_summary(run / "summary.json")
    curves = _read_curves(run / "curves.csv")
    store = run / "evaluations.h5"
    section = read_section(run / "record.h5")
    return Finished(summary, created, curves, *_read_record(store), _read_runs(store), section)


def _read_summary(path: Path) -> tuple[Data, datetime]:
    data = read_json(path)
    check_kind(path, "", data, SCHEMA)
    for names, kind in EXTRA.items():
        for name in names.split():
            if data.get(name) is not None:
                check_kind(path, name, data[name], kind)
    for name, p in (data.get("profiles") or {}).items():
        if len({len(p[key]) for key in ("value", "rise", "trace_alone")}) != 1:
            raise ReportError(f"{path}: profiles.{name} has lists of unequal length; {REMEDY}")
    if len(data.get("baseline_window_s") or (0.0, 0.0)) != 2:
        raise ReportError(f"{path}: baseline_window_s is not a pair of times; {REMEDY}")
    if data["trace"]["label"] not in LABELS:
        raise ReportError(f"{path}: trace.label is not {' or '.join(LABELS)}; {REMEDY}")
    if data["status"] not in STATUS:
        raise ReportError(f"{path}: status is {data['status']!r}, not {' or '.join(STATUS)}; {REMEDY}")
    return data, read_date(path, data)


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
    columns = read_columns(path, COLUMNS, COMPLETE)
    return {name: x for name, x in columns.items() if name in COLUMNS or set(BAND) <= set(columns)}


def read_columns(path: Path, needed: Sequence[str], complete: Sequence[str]) -> dict[str, np.ndarray]:
    """Curves over a stroke that rises.

    Args:
        path: A table with a line of names; an empty cell is NaN.
        needed: Columns that must be there, ``stroke_m`` and ``real_N`` among them.
        complete: Those that must be finite.

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
    if np.any(np.diff(curves["stroke_m"]) <= 0.0) or not np.max(curves["real_N"]) > 0.0:
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
