"""The report of a calibration: ``summary.json``, ``curves.csv`` and ``evaluations.h5`` become ``report.pdf``.

Numbers and the sentences that depend on them are made here; the other words are in
``templates/calibration.typ``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calib.errors import CurveError
from calib.validation.metrics import compare
from reports.base import figures
from reports.base.format import breakable, count, listed, plain, publish, quantity, uncertain
from reports.base.labels import capital, shown, words
from reports.base.run_folder import Data, Finished, read_finished
from reports.calibration import (
    cut_figure,
    failures,
    measurement,
    numerics_page,
    parameter_figures,
    parameter_page,
)

#: First page [mm]: what title, a sentence of two lines and facts leave, a line of the table and one more in it, a line of the
#: sentence, a banner; letters in a line of a name, a note and the sentence; least and largest height of the main figure.
PAGE_ROOM, LINE_HEIGHT, NEXT_LINE, SENTENCE_LINE, BANNER_HEIGHT = 200.0, 4.9, 3.7, 5.2, 20.0
NAME_LETTERS, NOTE_LETTERS, SENTENCE_LETTERS, FIGURE_HEIGHT = 42, 47, 92, (60.0, 125.0)
#: What the null models are compared in: key, label, unit, and whether more is better.
MEASURES = (
    ("nrmse", "NRMSE", "fraction", False),
    ("shape_error", "shape error", "-", False),
    ("R", "rating R", "-", True),
)
RELATIONS = {"<=": "≤ ", ">=": "≥ "}


def write_report(run: Path) -> Path:
    """Write ``report.pdf`` of a finished or interrupted calibration into its folder.

    The same files give the same bytes. If the report cannot be made, an older one stays as it is.

    Args:
        run: Folder with ``summary.json``, ``curves.csv`` and ``evaluations.h5``. The summary may also hold
            ``baseline_window_s`` (two times) and ``end_sd_s``, and its verdicts a ``relation`` (<= or >=).

    Returns:
        Path of the report.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    run = Path(run)
    done = read_finished(run)
    pictures = _pictures(done)
    content = {**_content(done), "figures": sorted(pictures)}
    target = run / "report.pdf"
    publish(target, "calibration.typ", content, pictures, date=done.created)
    return target


def _pictures(done: Finished) -> dict[str, bytes]:
    """The figures by file name."""
    s, curves = done.summary, done.curves
    trace = s["trace"]["label"]
    real = f"{trace}, peak {uncertain(s['peak_real_N'], s['peak_real_sd_N'], 'N')}"
    simulated = f"simulated, peak {quantity(s['peak_sim_N'], 'N')}"
    look = None
    if done.section is not None:
        of_cut = (done.section, s["knife"], s["shape"]["height"], curves["stroke_m"], curves["sim_N"])
        look = cut_figure.glance(*of_cut)
    found = {
        "forces.svg": figures.forces(curves, real, simulated, _room(s), _inside(s), look),
        "conditioning.svg": figures.conditioning(_record(done), curves),
        "fit.svg": figures.fit(curves, s["noise_sd_N"], trace),
        "nulls.svg": figures.nulls(curves, trace),
    }
    if done.section is not None:
        found["cut.svg"] = cut_figure.cut(*of_cut)
    rows = [parameter_page.row(name, p) for name, p in s["parameters"].items()]
    if rows:
        found["parameters.svg"] = parameter_figures.ranges(rows)
    panels = parameter_page.panels(s.get("profiles") or {}, s["parameters"])
    if panels:
        found["profiles.svg"] = parameter_figures.profiles(panels)
    if s.get("sensitivity"):
        found["influence.svg"] = parameter_figures.influence(s["sensitivity"], parameter_page.QUANTITIES)
    apart = failures.splits(done.runs, s["parameters"])
    if apart:
        found["breakdowns.svg"] = failures.picture(done.runs, apart)
    history = [(e[0], e[1]) for e in s["misfit_history"] if len(e) == 2 and None not in e]
    if history:
        found["misfit.svg"] = figures.misfit(history)
    return found


def _inside(s: Data) -> str:
    """What the legend says of the trace within the predictive band."""
    part = s.get("predictive_inside")
    return "" if part is None else f" ({quantity(part, 'fraction', digits=2)} of the trace inside)"


def _room(s: Data) -> float:
    """Height for the main figure that fills the first page [mm]: what the lines above it leave."""
    banners = (s["trace"]["label"] == "reconstructed") + (s["status"] == "interrupted")
    table = [(len(v["name"]) // NAME_LETTERS, len(v["note"] or "") // NOTE_LETTERS) for v in s["verdicts"]]
    said = max(len(_sentence(s)) // SENTENCE_LETTERS - 1, 0)
    left = PAGE_ROOM - LINE_HEIGHT * len(table) - NEXT_LINE * sum(map(max, table))
    left -= SENTENCE_LINE * said + BANNER_HEIGHT * banners
    return min(max(left, FIGURE_HEIGHT[0]), FIGURE_HEIGHT[1])


def _record(done: Finished) -> figures.Record:
    s = done.summary
    window = s.get("baseline_window_s")
    return figures.Record(
        time=done.time,
        raw=done.raw,
        tared=done.tared,
        onset=s["onset_s"],
        onset_sd=s["onset_sd_s"],
        end=s["end_s"],
        end_sd=s.get("end_sd_s"),
        window=None if window is None else (float(window[0]), float(window[1])),
        baseline_kind=s["baseline_kind"],
        peak=s["peak_real_N"],
        peak_sd=s["peak_real_sd_N"],
    )


def _content(done: Finished) -> Data:
    """Everything the template prints, as text."""
    s = done.summary
    return {
        "food": s["food"].replace("_", " ").capitalize(),
        "cutcal": str(s["versions"].get("cutcal", "")),
        "created": done.created.strftime("%Y-%m-%d %H:%M"),
        "interrupted": s["status"] == "interrupted",
        "reconstructed": s["trace"]["label"] == "reconstructed",
        "passed": s["passed"],
        "sentence": _sentence(s),
        "verdicts": [_verdict_line(v) for v in s["verdicts"]],
        "trace": _trace(s),
        "specimen": _specimen(s["shape"]),
        "knife": _knife(s["knife"]),
        "conditioning": _conditioning(done),
        "left_open": [measurement.left_open(name, n) for name, n in (s.get("nuisances") or {}).items()],
        "errors": measurement.errors(s, len(done.curves["stroke_m"])),
        "null_rows": _null_rows(done),
        "null_sentences": _null_sentences(s),
        "metrics": _metrics(s),
        "parameters": [parameter_page.parameter(name, p) for name, p in s["parameters"].items()],
        "legend": parameter_page.legend(s["parameters"]),
        "influences": parameter_page.influences(s.get("sensitivity") or {}),
        "correlations": parameter_page.correlations(s["correlations"]) if s["correlations"] else None,
        "fixed": [parameter_page.fixed(name, p) for name, p in s["fixed_parameters"].items()],
        "numerics": numerics_page.numerics(s),
        "broke_down": failures.sentence(done.runs, failures.splits(done.runs, s["parameters"])),
        "failures": numerics_page.failures(s["failures"]),
        "provenance": numerics_page.provenance(s),
        "limits": [capital(text) for text in s["limits"]],
        "warnings": [capital(text) for text in s["warnings"]],
    }


def _specimen(shape: Data) -> str:
    sizes = " × ".join(plain(1e3 * shape[k]) for k in ("length", "width", "height"))
    return f"{words(shape['kind'])}, {sizes} mm (across the blade, along it, height)"


def _knife(knife: Data) -> Data:
    sizes = {k: quantity(knife[k], "m") for k in ("spine", "height", "length")}
    return {"name": breakable(knife["name"]), "angle": quantity(knife["angle"], "rad"), **sizes}


def _trace(s: Data) -> Data:
    trace, air = s["trace"], s["air"]
    seconds = trace["duration_s"]
    return {
        "source": breakable(trace["source"]),
        "label": trace["label"],
        "samples": count(trace["samples"]),
        "duration": quantity(seconds, "s"),
        "rate": quantity(trace["samples"] / seconds if seconds > 0.0 else None, "Hz"),
        "columns": [[str(k), breakable(str(v))] for k, v in trace["columns"].items()],
        "air": breakable(str(air.get("source", "without a name"))) if air else None,
    }


def _conditioning(done: Finished) -> Data:
    s, sd = done.summary, done.summary["onset_sd_s"]
    seconds = s["end_s"] - s["onset_s"]
    speed = s["stroke_m"] / seconds if seconds > 0.0 else None
    return {
        "baseline": uncertain(s["baseline_N"], s["baseline_sd_N"], "N"),
        "noise": quantity(s["noise_sd_N"], "N", digits=2),
        "filter": quantity(s["filter_sd_m"], "m", digits=None),
        "onset": uncertain(s["onset_s"], sd, "s"),
        "onset_stroke": quantity(sd * speed, "m", digits=2) if sd and speed else None,
        "end": uncertain(s["end_s"], s.get("end_sd_s"), "s"),
        "speed": quantity(speed, "m/s"),
        "stroke": quantity(s["stroke_m"], "m"),
        "stroke_source": s["stroke_source"],
        "steps": count(len(done.curves["stroke_m"])),
        "peak": uncertain(s["peak_real_N"], s["peak_real_sd_N"], "N"),
    }


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
    elif s["status"] == "interrupted":
        text = "Not passed: the fit was interrupted. No line of the table has failed so far."
    else:
        text = "Not passed: no line of the table failed, but not all that decides was tested."
    if s["trace"]["label"] == "reconstructed":
        text += " The trace is a reconstruction, so this says nothing about a real cut."
    return breakable(text + (f" Not run: {listed(absent)}." if absent else ""))


def _verdict_line(v: Data) -> Data:
    """One line of the verdict table; without a ``relation`` it follows from value, limit and outcome."""
    value, limit, unit, passed = v["value"], v["limit"], v["unit"] or "-", v["passed"]
    relation = RELATIONS.get(v.get("relation") or "", "")
    numbers = [isinstance(x, (int, float)) and not isinstance(x, bool) for x in (value, limit)]
    if not relation and all(numbers) and passed is not None and abs(value) != limit:
        relation = "≤ " if (abs(value) < limit) == passed else "≥ "
    mark = "none" if value is None or passed is None else "yes" if passed else "no"
    return {
        "name": breakable(v["name"]), "value": "not run" if value is None else shown(value, unit, 3),
        "limit": relation + shown(limit, unit, None), "mark": mark,
        "note": "" if v["note"] in (None, "not run") else v["note"],
    }  # fmt: skip


def _null_rows(done: Finished) -> list[list[str]]:
    """Simulation, null models and the simulation before the fit: name, NRMSE, shape, R, peak, work."""
    s = done.summary
    keys = ("nrmse", "shape_error", "peak_error", "work_error")
    rows: list[tuple[str, Data]] = [
        ("simulation, fitted", {**{k: s[k] for k in keys}, "R": s["iso18571"]["R"]}),
        *((words(name), model) for name, model in s["null_models"].items()),
    ]
    curves = done.curves
    if np.all(np.isfinite(curves["start_N"])):
        try:
            m = compare(curves["stroke_m"], curves["real_N"], curves["start_N"])
            start = {**{k: getattr(m, k) for k in keys}, "R": m.iso18571.R}
        except CurveError:  # a simulation without any positive force cannot be rated
            start = dict.fromkeys((*keys, "R"))
        rows.append(("simulation at literature values", start))
    return [[name, *_rating(model)] for name, model in rows]


def _rating(m: Data) -> list[str]:
    signed = [quantity(m[k], "fraction", signed=True) for k in ("peak_error", "work_error")]
    return [quantity(m[key], unit) for key, _, unit, _ in MEASURES] + signed


def _null_sentences(s: Data) -> list[str]:
    """Which null model is closer to the trace than the simulation, and in what."""
    ours = {"nrmse": s["nrmse"], "shape_error": s["shape_error"], "R": s["iso18571"]["R"]}
    said = []
    for name, model in s["null_models"].items():
        better = []
        for key, label, unit, more in MEASURES:
            a, b = model[key], ours[key]
            if a is not None and b is not None and (a > b if more else a < b):
                better.append(f"{label} ({quantity(a, unit)} against {quantity(b, unit)})")
        if better:
            said.append(f"The {words(name)} is closer to the trace than the simulation in {listed(better)}.")
    names = listed([label for _, label, _, _ in MEASURES])
    return said or [f"No null model is closer to the trace than the simulation in {names}."]


def _metrics(s: Data) -> Data:
    """The figures of the comparison by name; the template labels them."""
    m, g, iso = s["metrics"], s["sprague_geers"], s["iso18571"]
    units = {"peak_sim_N": "N", "work_sim_J": "J", "work_real_J": "J", "shape_ramp": "-", "shape_peak": "-",
             "shape_release": "-", "best_scale": "-", "relative_l2": "fraction",
             "best_scale_residual": "fraction"}  # fmt: skip
    signed = ("peak_error", "peak_position_error", "work_error", "stiffness_error")
    return {
        **{name: quantity(m.get(name), unit) for name, unit in units.items()},
        **{name: quantity(m.get(name), "fraction", signed=True) for name in signed},
        "sprague_geers": [quantity(g[k], "fraction", signed=k == "M") for k in "MPC"],
        "iso": {k: quantity(iso[k], "-") for k in ("Z", "EP", "EM", "ES", "R")},
        "shift": count(iso["shift"]),
        "at_bound": bool(iso["at_bound"]),
        "without_phase": quantity(iso.get("without_phase"), "-"),
    }  # fmt: skip
