"""The report of a calibration: ``summary.json``, ``curves.csv`` and ``evaluations.h5`` become ``report.pdf``.

Here are the numbers and the sentences that depend on them; ``templates/calibration.typ`` has the rest of the words.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.errors import CurveError
from calib.metrics import compare
from calib.properties import PROPERTIES
from reports import ReportError, figures
from reports.document import (
    DASH,
    breakable,
    count,
    duration,
    interval,
    listed,
    moment,
    plain,
    quantity,
    typeset,
    uncertain,
    write_whole,
)

Data = dict[str, Any]

#: Correlations of fitted parameters from here on are worth a sentence: at 0.9 an interval is 2.3 times as wide as it
#: would be if the other parameter were known, 1 / sqrt(1 - r^2).
STRONG = 0.9
COLUMNS = ("stroke_m", "real_N", "sim_N", "residual_N", "edge_N", "face_N", "start_N", "ramp_N", "half_sine_N",
           "three_term_N")  # fmt: skip
#: These must be finite; a part of the simulation or a null model may be missing (NaN).
COMPLETE = COLUMNS[:4]
MEASURES = (("nrmse", "NRMSE", "fraction"), ("shape_error", "shape error", "-"), ("R", "rating R", "-"))
NULLS = {
    "ramp": "straight ramp, 1 number",
    "half_sine": "half sine, 1 number",
    "three_term": "three-term curve, 7 numbers",
}
IDENTIFIABILITY = {"weak": "weakly identified", "not_seen": "not seen by this trace", "at_bound": "at its bound"}
REMEDY = "run the same calibrate command again with --resume"

#: What summary.json must hold: names -> kind. A kind is a tuple of types, {name: kind} ("*": any name) or [kind].
_NULL = type(None)
_NUM, _OPT, _TEXT, _MAYBE, _ANY = (int, float), (int, float, _NULL), (str,), (str, _NULL), (object,)
SCHEMA: Data = {
    "food created status trace_sha256 baseline_kind stroke_source": _TEXT,
    "passed": (bool,),
    "baseline_N onset_s end_s stroke_m noise_sd_N filter_sd_m peak_real_N peak_sim_N dx_m": _NUM,
    "baseline_sd_N onset_sd_s peak_real_sd_N peak_error shape_error nrmse work_error wall_s particles mach": _OPT,
    "momentum_residual ke_over_ie ripple_N": _OPT,
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
    "parameters": {"*": {"value": _NUM, "low95 high95 prior_low prior_high": _OPT, "unit verdict status": _TEXT,
                         "source": _MAYBE}},
    "fixed_parameters": {"*": {"value": _OPT, "unit status": _TEXT, "source": _MAYBE}},
    "failures": [{"reason": _TEXT, "fraction": _OPT, "parameters": (dict,)}],
    "shape": {"kind": _TEXT, "length width height": _NUM},
    "knife": {"name": _TEXT, "spine angle height length": _NUM},
}  # fmt: skip


def write_report(run: Path) -> Path:
    """Write ``report.pdf`` of a finished or interrupted calibration into its folder.

    The same files give the same bytes. A report that cannot be made leaves an older one as it is.

    Args:
        run: Folder with ``summary.json``, ``curves.csv`` and ``evaluations.h5``. The summary may also hold
            ``baseline_window_s`` (two times) and ``end_sd_s``; both are then drawn.

    Returns:
        Path of the report.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    run = Path(run)
    if not run.is_dir():
        raise ReportError(f"{run}: no such folder; give the output folder of a calibration")
    summary, created = _read_summary(run / "summary.json")
    curves = _read_curves(run / "curves.csv")
    record = _read_record(run / "evaluations.h5", summary)
    pictures = _pictures(summary, curves, record)
    content = {**_content(summary, curves, created), "figures": sorted(pictures)}
    target = run / "report.pdf"
    write_whole(target, typeset("calibration.typ", content, pictures, date=created))
    return target


def _read_summary(path: Path) -> tuple[Data, datetime]:
    """The summary, checked; numbers that are not finite become None."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda _: None)
    except OSError as e:
        raise _unreadable(path, e) from None
    except ValueError as e:
        raise ReportError(f"{path}: damaged, not JSON ({e}); {REMEDY}") from None
    _check(path, "", data, SCHEMA)
    if data["status"] not in ("done", "interrupted"):
        raise ReportError(f"{path}: status is {data['status']!r}, not 'done' or 'interrupted'; {REMEDY}")
    try:
        return data, moment(data["created"])
    except ValueError:
        raise ReportError(f"{path}: created is {data['created']!r}, not an ISO date and time; {REMEDY}") from None


def _check(path: Path, place: str, value: Any, kind: Any) -> None:
    """Refuse a value of another kind than SCHEMA says, and name its place."""
    if isinstance(kind, tuple):
        numeric_flag = isinstance(value, bool) and bool not in kind and object not in kind
        if numeric_flag or not isinstance(value, kind):
            raise ReportError(f"{path}: {place} is {json.dumps(value)[:60]}, which it cannot be; {REMEDY}")
        return
    if not isinstance(value, type(kind)):
        want = "a list" if isinstance(kind, list) else "a mapping of names to values"
        raise ReportError(f"{path}: {place or 'the top level'} is not {want}; {REMEDY}")
    if isinstance(kind, list):
        for i, item in enumerate(value):
            _check(path, f"{place}[{i}]", item, kind[0])
        return
    for names, inner in kind.items():
        for name in value if names == "*" else names.split():
            where = f"{place}.{name}" if place else name
            if name not in value:
                raise ReportError(f"{path}: {where} is missing; the summary is incomplete or of another version of "
                                  f"cutcal: {REMEDY}")  # fmt: skip
            _check(path, where, value[name], inner)


def _read_curves(path: Path) -> dict[str, np.ndarray]:
    """Columns of curves.csv by name, shape (n,)."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        header = [name.strip() for name in lines[0].split(",")] if lines else []
        rows = np.array([[float(x or "nan") for x in line.split(",")] for line in lines[1:] if line.strip()])
    except OSError as e:
        raise _unreadable(path, e) from None
    except ValueError as e:
        raise ReportError(f"{path}: damaged, not a table of numbers ({e}); {REMEDY}") from None
    missing = [name for name in COLUMNS if name not in header]
    if missing:
        raise ReportError(f"{path}: column {', '.join(missing)} is missing; {REMEDY}")
    if rows.ndim != 2 or rows.shape[0] < 2 or rows.shape[1] != len(header):
        raise ReportError(f"{path}: shape {rows.shape} for {len(header)} columns; the file is cut off: {REMEDY}")
    curves = {name: rows[:, header.index(name)] for name in COLUMNS}
    bad = [name for name in COMPLETE if not np.all(np.isfinite(curves[name]))]
    if bad or np.any(np.diff(curves["stroke_m"]) <= 0.0) or not np.max(curves["real_N"]) > 0.0:
        what = f"column {bad[0]} has gaps" if bad else "the stroke does not rise or no force is positive"
        raise ReportError(f"{path}: damaged, {what}; {REMEDY}")
    return curves


def _read_record(path: Path, s: Data) -> figures.Record:
    """The conditioned record in evaluations.h5, with the marks of the summary."""
    try:
        if not path.is_file():
            raise FileNotFoundError(2, "No such file")
        with h5py.File(path, "r") as store:
            group = store["conditioning"]
            time, raw, tared = (np.asarray(group[name][()], float) for name in ("time_s", "raw_N", "tared_N"))
    except KeyError as e:
        raise ReportError(f"{path}: the record of the trace is not in it ({e.args[0]}); {REMEDY}") from None
    except FileNotFoundError as e:
        raise _unreadable(path, e) from None
    except OSError as e:
        raise ReportError(f"{path}: damaged or in use by another process ({e}); wait for it, or {REMEDY}") from None
    whole = all(np.all(np.isfinite(x)) for x in (time, raw, tared))
    if time.ndim != 1 or len(time) < 2 or not time.shape == raw.shape == tared.shape or not whole:
        raise ReportError(f"{path}: conditioning holds records of different lengths or with gaps; {REMEDY}")
    window = s.get("baseline_window_s")
    return figures.Record(
        time=time, raw=raw, tared=tared, onset=s["onset_s"], onset_sd=s["onset_sd_s"], end=s["end_s"],
        end_sd=s.get("end_sd_s"), window=None if window is None else (float(window[0]), float(window[1])),
        baseline_kind=s["baseline_kind"], peak=s["peak_real_N"], peak_sd=s["peak_real_sd_N"],
    )  # fmt: skip


def _unreadable(path: Path, e: OSError) -> ReportError:
    what = "no such file" if isinstance(e, FileNotFoundError) else f"cannot be read ({e.strerror})"
    return ReportError(f"{path}: {what}; a report needs it: {REMEDY}")


def _pictures(s: Data, curves: dict[str, np.ndarray], record: figures.Record) -> dict[str, bytes]:
    """The figures by file name."""
    real = f"measured, peak {uncertain(s['peak_real_N'], s['peak_real_sd_N'], 'N')}"
    if s["trace"]["label"] == "reconstructed":
        real = real.replace("measured", "reconstructed")
    found = {
        "forces.svg": figures.forces(curves, real, f"simulated, peak {quantity(s['peak_sim_N'], 'N')}"),
        "conditioning.svg": figures.conditioning(record, curves),
        "fit.svg": figures.fit(curves, s["noise_sd_N"]),
        "nulls.svg": figures.nulls(curves),
    }
    rows = [_row(name, p) for name, p in s["parameters"].items()]
    if rows:
        found["parameters.svg"] = figures.parameters(rows)
    history = [(e[0], e[1]) for e in s["misfit_history"] if len(e) == 2 and None not in e]
    if history:
        found["misfit.svg"] = figures.misfit(history)
    return found


def _row(name: str, p: Data) -> figures.Row:
    """A parameter over the middle of its literature range: geometric, or arithmetic where the range starts at 0."""
    low, high = p["prior_low"], p["prior_high"]
    known = low is not None and high is not None and low + high > 0.0
    middle = 1.0 if not known else math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)
    middle = middle if known else abs(p["value"]) or 1.0
    over = [None if x is None else x / middle for x in (p["low95"], p["high95"], low, high)]
    note = f"{quantity(p['value'], p['unit'])}, {_verdict(p)}"
    return figures.Row(name, note, p["value"] / middle, *over)


def _content(s: Data, curves: dict[str, np.ndarray], created: datetime) -> Data:
    """Everything the template prints, as text."""
    trace, shape, knife = s["trace"], s["shape"], s["knife"]
    mean_speed = s["stroke_m"] / (s["end_s"] - s["onset_s"]) if s["end_s"] > s["onset_s"] else None
    sd = s["onset_sd_s"]
    sizes = " × ".join(plain(1e3 * shape[k]) for k in ("length", "width", "height"))
    return {
        "food": s["food"].replace("_", " ").capitalize(),
        "cutcal": str(s["versions"].get("cutcal", "")),
        "created": created.strftime("%Y-%m-%d %H:%M"),
        "interrupted": s["status"] == "interrupted",
        "reconstructed": trace["label"] == "reconstructed",
        "passed": s["passed"],
        "sentence": _sentence(s),
        "verdicts": [_verdict_line(v) for v in s["verdicts"]],
        "trace": {
            "source": breakable(trace["source"]), "samples": count(trace["samples"]), "label": trace["label"],
            "duration": quantity(trace["duration_s"], "s"),
            "rate": quantity(trace["samples"] / trace["duration_s"], "Hz") if trace["duration_s"] > 0.0 else DASH,
            "columns": [[str(k), breakable(str(v))] for k, v in trace["columns"].items()],
            "air": breakable(str(s["air"].get("source", "?"))) if s["air"] else None,
        },
        "specimen": f"{shape['kind'].replace('_', ' ')}, {sizes} mm (across, along the blade, height)",
        "knife": {"name": breakable(knife["name"]), "angle": quantity(knife["angle"], "rad"),
                  **{k: quantity(knife[k], "m") for k in ("spine", "height", "length")}},
        "baseline": uncertain(s["baseline_N"], s["baseline_sd_N"], "N"), "baseline_kind": s["baseline_kind"],
        "noise": quantity(s["noise_sd_N"], "N"), "filter": quantity(s["filter_sd_m"], "m", digits=None),
        "onset": uncertain(s["onset_s"], sd, "s"), "end": uncertain(s["end_s"], s.get("end_sd_s"), "s"),
        "onset_stroke": None if not (sd and mean_speed) else quantity(sd * mean_speed, "m", digits=2),
        "speed": quantity(mean_speed, "m/s"), "stroke": quantity(s["stroke_m"], "m"),
        "stroke_source": s["stroke_source"], "samples_stroke": count(len(curves["stroke_m"])),
        "peak_real": uncertain(s["peak_real_N"], s["peak_real_sd_N"], "N"),
        "null_rows": _null_rows(s, curves), "null_sentences": _null_sentences(s), "metrics": _metrics(s),
        "parameters": [_parameter(name, p) for name, p in s["parameters"].items()],
        "correlations": _correlations(s["correlations"]),
        "fixed": [[name, _meaning(name), quantity(p["value"], p["unit"]), _words(p["status"]), p["source"] or ""]
                  for name, p in s["fixed_parameters"].items()],
        "numerics": _numerics(s),
        "failures": _failures(s["failures"]),
        "failed": f"{s['failed_simulations']} of {s['simulations']}",
        "provenance": _provenance(s),
        "command": breakable(shlex.join(s["command"])),
        "limits": s["limits"],
        "warnings": s["warnings"],
    }  # fmt: skip


def _sentence(s: Data) -> str:
    """The verdict in plain words."""
    failed = [v["name"] for v in s["verdicts"] if v["value"] is not None and v["passed"] is False]
    ran = sum(v["value"] is not None for v in s["verdicts"])
    absent = [v["name"] for v in s["verdicts"] if v["value"] is None]
    lines = "the line" if len(failed) == 1 else f"{len(failed)} of {ran} lines"
    if s["passed"]:
        text = "Passed: the simulated force stays within every limit of the table that was tested"
        text += f", except in {listed(failed)}, which does not decide." if failed else "."
    elif failed:
        text = f"Not passed: {lines} of the table failed ({listed(failed)})."
    else:
        text = "Not passed: no line of the table failed, but not all that decides was tested."
    return text + (f" Not run: {listed(absent)}." if absent else "")


def _verdict_line(v: Data) -> Data:
    """One line of the verdict table; the direction of the limit follows from value, limit and outcome."""
    value, limit, unit, passed = v["value"], v["limit"], v["unit"] or "-", v["passed"]
    relation = ""
    numbers = [isinstance(x, (int, float)) and not isinstance(x, bool) for x in (value, limit)]
    if all(numbers) and passed is not None:
        relation = "≤ " if (abs(value) <= limit) == passed else "≥ "
    mark = "none" if value is None or passed is None else "yes" if passed else "no"
    signed = unit == "fraction" and numbers[0] and value < 0.0
    return {
        "name": breakable(v["name"]), "value": "not run" if value is None else _shown(value, unit, 3, signed),
        "limit": relation + _shown(limit, unit, None, False), "mark": mark, "note": v["note"] or "",
    }  # fmt: skip


def _shown(x: Any, unit: str, digits: int | None, signed: bool) -> str:
    """A value or limit of any type as text."""
    if x is None:
        return DASH
    if isinstance(x, bool):
        return "yes" if x else "no"
    if isinstance(x, int) and unit == "-":
        return count(x)
    if isinstance(x, (int, float)):
        return quantity(float(x), unit, digits=digits, signed=signed)
    return breakable(listed([str(i) for i in x]) if isinstance(x, list) else str(x))


def _null_rows(s: Data, curves: dict[str, np.ndarray]) -> list[list[str]]:
    """Simulation, null models and the simulation before the fit: name, NRMSE, shape, R, peak, work."""
    ours = {**{k: s[k] for k in ("nrmse", "shape_error", "peak_error", "work_error")}, "R": s["iso18571"]["R"]}
    rows = [("simulation, fitted", ours), *((NULLS.get(k, _words(k)), m) for k, m in s["null_models"].items())]
    if np.all(np.isfinite(curves["start_N"])):
        try:
            m = compare(curves["stroke_m"], curves["real_N"], curves["start_N"])
            start = {k: getattr(m, k) for k in ("nrmse", "shape_error", "peak_error", "work_error")}
            rows.append(("simulation at literature values", {**start, "R": m.iso18571.R}))
        except CurveError:
            rows.append(("simulation at literature values (no positive force)", dict.fromkeys(ours)))
    return [
        [name, quantity(m["nrmse"], "fraction"), quantity(m["shape_error"], "-"), quantity(m["R"], "-"),
         quantity(m["peak_error"], "fraction", signed=True), quantity(m["work_error"], "fraction", signed=True)]
        for name, m in rows
    ]  # fmt: skip


def _null_sentences(s: Data) -> list[str]:
    """Which null model is closer to the trace than the simulation, and in what."""
    ours = {"nrmse": s["nrmse"], "shape_error": s["shape_error"], "R": s["iso18571"]["R"]}
    said = []
    for name, model in s["null_models"].items():
        better = []
        for key, label, unit in MEASURES:
            if ours[key] is None or model[key] is None:
                continue
            if (model[key] > ours[key]) if key == "R" else (model[key] < ours[key]):
                better.append(f"{label} ({quantity(model[key], unit)} against {quantity(ours[key], unit)})")
        if better:
            said.append(f"The {NULLS.get(name, _words(name))}, is closer to the trace than the simulation in "
                        f"{listed(better)}.")  # fmt: skip
    names = listed([label for _, label, _ in MEASURES])
    return said or [f"No null model is closer to the trace than the simulation in {names}."]


def _metrics(s: Data) -> list[list[str]]:
    """All figures of the comparison as label and value."""
    m, g, iso = s["metrics"], s["sprague_geers"], s["iso18571"]

    def get(key: str, unit: str = "fraction", signed: bool = True) -> str:
        return quantity(m.get(key), unit, signed=signed)

    windows = " / ".join(get(f"shape_{k}", "-", False) for k in ("ramp", "peak", "release"))
    bound = " (at the end of its range: EP says nothing)" if iso["at_bound"] else ""
    shift = "" if iso["shift"] is None else f", lag {plain(iso['shift'], None)} of 240 samples{bound}"
    return [
        ["Peak, simulated against measured", f"{get('peak_sim_N', 'N', False)}, {get('peak_error')}"],
        ["Position of the peak, of the stroke", get("peak_position_error")],
        ["Work, simulated / measured", f"{get('work_sim_J', 'J', False)} / {get('work_real_J', 'J', False)}, "
         + get("work_error")],
        ["Initial stiffness", get("stiffness_error")],
        ["Relative L2 norm of the residual", get("relative_l2", signed=False)],
        ["Shape error: ramp / peak / release", windows],
        ["Best scale on the simulation, what then remains",
         f"{get('best_scale', '-', False)}, {get('best_scale_residual', signed=False)}"],
        ["Sprague–Geers M, P, C", ", ".join(quantity(g[k], "fraction", signed=k == "M") for k in "MPC")],
        ["ISO/TS 18571-style Z, EP, EM, ES → R",
         ", ".join(quantity(iso[k], "-") for k in ("Z", "EP", "EM", "ES")) + " → " + quantity(iso["R"], "-") + shift],
    ]  # fmt: skip


def _parameter(name: str, p: Data) -> Data:
    low, high, value = p["prior_low"], p["prior_high"], p["value"]
    outside = (low is not None and value < low) or (high is not None and value > high)
    return {
        "name": name, "meaning": _meaning(name), "value": quantity(value, p["unit"]),
        "interval": interval(p["low95"], p["high95"], p["unit"]), "literature": interval(low, high, p["unit"]),
        "verdict": _verdict(p), "outside": outside, "status": _words(p["status"]), "source": p["source"] or "",
    }  # fmt: skip


def _correlations(correlations: Data) -> list[str]:
    strong = sorted(((n, r) for n, r in correlations.items() if r is not None and abs(r) >= STRONG),
                    key=lambda item: (-abs(item[1]), item[0]))  # fmt: skip
    means = {True: "their ratio is known better than either", False: "their product is known better than either"}
    return [f"{listed(n.split(','))}: r = {plain(r, 2)}; {means[r > 0.0]}." for n, r in strong]


def _numerics(s: Data) -> list[list[str]]:
    """Numerical settings and audits as label, value and what a good value is."""
    images = s["mirror_images"]
    mirrored = "none" if images in (None, False, 1) else "yes" if images is True else str(images)
    ripple = quantity(s["ripple_N"], "N")
    if s["ripple_N"] is not None and s["peak_sim_N"] > 0.0:
        ripple += f" ({quantity(s['ripple_N'] / s['peak_sim_N'], 'fraction', digits=2)} of the simulated peak)"
    return [
        ["Cell size dx", quantity(s["dx_m"], "m"), f"{plain(s['shape']['height'] / s['dx_m'], 2)} cells over the "
         "height of the food"],
        ["Particles", DASH if s["particles"] is None else count(s["particles"]), f"mirror images: {mirrored}"],
        ["Mach number of the knife", quantity(s["mach"], "-"), "simulated speed over the pressure wave's; under 0.01 "
         "the force hardly depends on it"],
        ["Momentum residual", quantity(s["momentum_residual"], "fraction"), "impulse that the balance misses; should "
         "be under 1 %"],
        ["Kinetic over internal energy", quantity(s["ke_over_ie"], "fraction"), "a quasi-static cut has a few per "
         "cent at most"],
        ["Ripple on the force", ripple, "standard deviation of what the filter removes from the simulation"],
        ["Run time", duration(s["wall_s"]), f"{s['simulations']} simulations, {s['failed_simulations']} of them "
         "failed"],
    ]  # fmt: skip


def _failures(failures: list[Data]) -> list[list[str]]:
    """Failed simulations by reason: number, completed parts of the stroke, parameter values of the first."""
    rows = []
    for reason in sorted({f["reason"] for f in failures}):
        same = [f for f in failures if f["reason"] == reason]
        parts = [100.0 * f["fraction"] for f in same if f["fraction"] is not None]
        span = f"{min(parts):.0f} to {max(parts):.0f}\u00a0%" if parts else DASH
        first = [f"{k} = {_shown(v, PROPERTIES[k].unit if k in PROPERTIES else '-', 3, False)}"
                 for k, v in same[0]["parameters"].items()]  # fmt: skip
        rows.append([breakable(_words(reason)), str(len(same)), span, "; ".join(first)])
    return rows


def _provenance(s: Data) -> list[list[str]]:
    air = s["air"]
    versions: Callable[[str], str] = lambda name: f"{name}\u00a0{s['versions'][name]}"
    rows = [
        ["Trace, SHA-256", breakable(s["trace_sha256"])],
        ["Air run, SHA-256", breakable(str(air.get("sha256", DASH))) if air else "no air run"],
        ["Commit", breakable(s["git"]) if s["git"] else "not run from a checkout"],
        ["Seed, device", f"{s['seed']}, {s['device'] or 'not recorded'}"],
        ["Versions", ", ".join(versions(name) for name in sorted(s["versions"]))],
    ]
    return rows


def _verdict(p: Data) -> str:
    return IDENTIFIABILITY.get(p["verdict"], _words(p["verdict"]))


def _meaning(name: str) -> str:
    return PROPERTIES[name].meaning if name in PROPERTIES else ""


def _words(name: str) -> str:
    return name.replace("_", " ")
