"""The report of a study of several specimens: ``summary.json`` and the ``curves-NAME.csv`` become ``report.pdf``."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mpm.output.section import Section
from mpm.scene import Knife
from reports import ReportError
from reports.base.figures import BLACK, BLUE, MEASURED, SIMULATED, next_to, predictive, stroke_axis, svg
from reports.base.format import breakable, count, duration, interval, listed, publish, quantity
from reports.base.labels import capital, in_words
from reports.base.run_folder import Data, check_kind, read_columns, read_date, read_json, read_section
from reports.calibration import cut_figure, measurement
from reports.web.calibration import write_page
from reports.web.study import study_page

PREDICTED: dict[str, Any] = {"color": BLUE, "lw": 1.8, "dashes": (1.4, 1.2)}
FIGURE_HEIGHT = 60.0  # of the figure of a trace [mm]
BESIDE_HEIGHT = 78.0  # with the food under the blade beside it [mm]
MORE_HEIGHT = 22.0  # added on the first page [mm]

_NUM, _OPT, _TEXT, _MAYBE = (int, float), (int, float, type(None)), (str,), (str, type(None))
_METRICS: Data = {
    "nrmse shape_error peak_error work_error": _OPT,
    "peak_real_N peak_sim_N": _OPT,
    "iso18571": {"R": _OPT},
}
#: What summary.json must hold, as in :mod:`reports.base.run_folder`.
SCHEMA: Data = {
    "food study": _TEXT,
    "passed": (bool,),
    "limits warnings command": [_TEXT],
    "traces": {"*": {
        "passed": (bool,), "factor": _NUM, "metrics": _METRICS, "null_models": {"*": {"R nrmse": _OPT}},
        "trace": {"source sha256 label": _TEXT},
    }},
    "hold_out": {"*": {
        "passed": (bool,), "factor": _NUM, "predictive_inside": _OPT, "metrics": _METRICS, "trained_on": [_TEXT],
        "limits": {"*": _NUM}, "null_models": {"*": {"R nrmse shape_error": _OPT}},
    }},
    "parameters": {"*": {"value": _NUM, "low95 high95 prior_low prior_high": _OPT, "unit verdict": _TEXT}},
}  # fmt: skip


@dataclass(frozen=True)
class FinishedStudy:
    """A finished study.

    Attributes:
        summary: ``summary.json``, checked against SCHEMA.
        created: When it was made.
        curves: Columns of ``curves-NAME.csv`` by trace: stroke [m] and forces [N].
        sections: The food across the blade's middle, by trace; those that were fitted have one, but for older runs.
        meanings: What each property of the material is, in words.
    """

    summary: Data
    created: datetime
    curves: dict[str, dict[str, np.ndarray]]
    sections: dict[str, Section]
    meanings: Mapping[str, str] = field(default_factory=dict)


def write_report(folder: Path, meanings: Mapping[str, str] | None = None) -> Path:
    """Write ``report.pdf`` and ``report.html`` of a finished study into its folder.

    Args:
        folder: Folder with ``summary.json`` and ``curves-NAME.csv`` of each trace.
        meanings: What each property of the material is, in words.

    Returns:
        Path of the PDF; the page lies beside it.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    done = read_study(Path(folder), meanings)
    figures = {name: picture(done, name) for name in done.curves}
    printed = content(done)
    target = Path(folder) / "report.pdf"
    pictures = {f"trace{k}.svg": drawn for k, drawn in enumerate(figures.values())}
    publish(target, "study.typ", printed, pictures, date=done.created)
    page = study_page(printed, done.curves, list(done.summary["hold_out"]), figures)
    write_page(target.with_suffix(".html"), page)
    return target


def is_study(summary: Path) -> bool:
    """Whether a summary.json is that of a study of several cuts.

    Raises:
        ReportError: It is missing or damaged.
    """
    found = read_json(summary)
    return isinstance(found, dict) and "study" in found


def read_study(folder: Path, meanings: Mapping[str, str] | None = None) -> FinishedStudy:
    """Read a study's folder.

    Raises:
        ReportError: A file is missing, damaged or incomplete.
    """
    if not folder.is_dir():
        raise ReportError(f"{folder}: no such folder; give the output folder of a study")
    path = folder / "summary.json"
    summary = read_json(path)
    check_kind(path, "", summary, SCHEMA)
    created = read_date(path, summary) if "created" in summary else _changed(path)
    names = [*summary["hold_out"], *(n for n in summary["traces"] if n not in summary["hold_out"])]
    if not names:
        raise ReportError(f"{path}: traces and hold_out are empty; a report needs at least one cut")
    complete = ("stroke_m", "real_N")
    curves = {n: read_columns(folder / f"curves-{n}.csv", complete, complete) for n in names}
    drawn = [n for n, t in summary["traces"].items() if "shape" in t and "sim_N" in curves[n]]
    looks = {n: look for n in drawn if (look := read_section(folder / f"record-{n}.h5")) is not None}
    return FinishedStudy(summary, created, curves, looks, meanings or {})


def _changed(path: Path) -> datetime:
    return datetime.fromtimestamp(int(path.stat().st_mtime), tz=timezone.utc)


def first(done: FinishedStudy) -> str:
    """The cut of the first page: one that is also seen under the blade, if there is one."""
    return next((name for name in done.curves if name in done.sections), next(iter(done.curves)))


def picture(done: FinishedStudy, name: str) -> bytes:
    """Forces of a trace with their bands: measured, simulated, predicted; beside them the food about the blade.

    The food about the blade is shown where the trace was fitted.
    """
    curves, s = done.curves[name], done.summary
    held, fitted = s["hold_out"].get(name), s["traces"].get(name)

    look = None
    if fitted and name in done.sections:
        of_cut = (Knife(**fitted["knife"]), fitted["shape"]["height"], curves["stroke_m"], curves["sim_N"])
        look = cut_figure.glance(done.sections[name], *of_cut)

    def draw(figure: Figure) -> None:
        axes = next_to(figure, look)
        x = 1e3 * curves["stroke_m"]
        axes.axhline(0.0, color=BLACK, lw=0.5)
        band = ("predicted_low_N", "predicted_high_N") if held else ("band_low_N", "band_high_N")
        label = "95 % band of the prediction" if held else "95 % predictive band"
        predictive(axes, x, curves, *band, label)
        axes.plot(x, curves["real_N"], label=_label(s, name), **MEASURED)
        if fitted and "sim_N" in curves:
            axes.plot(x, curves["sim_N"], label="simulated, fitted to it too", **SIMULATED)
        if held and "predicted_N" in curves:
            axes.plot(x, curves["predicted_N"], label="predicted from the other cuts", **PREDICTED)
        stroke_axis(axes, x)
        axes.set_ylabel("force on the knife [N]")
        figure.legend(loc="outside upper left", ncols=3 if len(axes.get_legend_handles_labels()[1]) == 3 else 2)

    height = FIGURE_HEIGHT if look is None else BESIDE_HEIGHT
    return svg(draw, height + MORE_HEIGHT * (name == first(done)))


def _label(s: Data, name: str) -> str:
    return str(_source(s, name).get("label", "trace"))


def _source(s: Data, name: str) -> Data:
    """File, hash and label of a trace; empty where the summary does not say them of one that was only held out."""
    found: Data = (s["traces"].get(name) or s["hold_out"].get(name) or {}).get("trace") or {}
    return found


def content(done: FinishedStudy) -> Data:
    """Everything the template prints, as text."""
    s = done.summary
    return {
        "food": s["food"].replace("_", " ").capitalize(),
        "study": breakable(Path(s["study"]).name),
        "created": done.created.strftime("%Y-%m-%d %H:%M"),
        "cutcal": str(s.get("versions", {}).get("cutcal", "")),
        "passed": s["passed"],
        "sentence": sentence(s),
        "held": [_line(name, p) for name, p in s["hold_out"].items()],
        "fitted": [_line(name, t) for name, t in s["traces"].items()],
        "held_limits": _limits(s["hold_out"]),
        "ranking": [[breakable(name), _ranking(s, name)] for name in done.curves],
        "names": [breakable(name) for name in done.curves],
        "shown": list(done.curves).index(first(done)),
        "captions": [_caption(s, name) for name in done.curves],
        "left_open": [[breakable(name), *measurement.left_open(n, SimpleNamespace(**row))]
                      for name, t in s["traces"].items()
                      for n, row in (t.get("nuisances") or {}).items()],
        "parameters": [_parameter(name, p, done.meanings) for name, p in s["parameters"].items()],
        "checks": [[breakable(name), in_words(c["name"]), *_change(c)] for name, t in s["traces"].items()
                   for c in t.get("numerical_checks") or []],
        "traces": [[breakable(name), *_origin(_source(s, name))] for name in done.curves],
        "runs": _runs(s),
        "commit": s.get("git") or "",
        "command": [breakable(shlex.quote(word)) for word in s["command"]],
        "versions": ", ".join(f"{name}\u00a0{v}" for name, v in sorted(s.get("versions", {}).items())),
        "limits": [capital(text) for text in s["limits"]],
        "warnings": [capital(text) for text in s["warnings"]],
    }  # fmt: skip


def _origin(trace: Data) -> list[str]:
    """File, kind and the two halves of the hash of a trace."""
    digest = str(trace.get("sha256", ""))
    return [breakable(str(trace.get("source", "not recorded"))), str(trace.get("label", "")), digest[:32], digest[32:]]


def sentence(s: Data) -> str:
    """The verdict in plain words: what was predicted, and what was only fitted."""
    failed = [name for name, p in s["hold_out"].items() if not p["passed"]]
    held = len(s["hold_out"])
    if not held:
        text = "No cut was held out: every figure is in-sample, and nothing here is a prediction."
    elif failed:
        text = f"{held - len(failed)} of {held} held-out cuts were predicted within the limits; not {listed(failed)}."
    else:
        text = f"All {held} held-out cuts were predicted within the limits." if held > 1 else (
            f"The held-out cut {next(iter(s['hold_out']))} was predicted within the limits.")  # fmt: skip
    apart = [name for name, t in s["traces"].items() if not t["passed"]]
    text += f" In-sample lines that failed: {listed(apart)}." if apart else " All in-sample lines passed."
    unlike = [n for n, t in s["traces"].items() if t["trace"]["label"] != "measured"]
    return breakable(text + (f" Reconstructed, not measured: {listed(unlike)}." if unlike else ""))


def _line(name: str, t: Data) -> Data:
    """One line of the verdict table."""
    m = t["metrics"]
    return {
        "name": breakable(name),
        "cells": [
            quantity(m["nrmse"], "fraction"),
            quantity(m["shape_error"], "fraction"),
            quantity(m["iso18571"]["R"], "-"),
            quantity(m["peak_error"], "fraction", signed=True),
            quantity(m["work_error"], "fraction", signed=True),
            quantity(t.get("predictive_inside"), "fraction", digits=2),
            quantity(t["factor"], "-"),
        ],
        "mark": "yes" if t["passed"] else "no",
    }


def _limits(hold_out: Data) -> str:
    """The limits of the predictions, which are the same for all."""
    found: Data = next((p["limits"] for p in hold_out.values()), {})
    texts = {
        "nrmse": ("NRMSE ≤ ", "fraction"),
        "rating": ("ISO rating ≥ ", "-"),
        "inside": ("in band ≥ ", "fraction"),
    }
    return listed([start + quantity(found[k], unit, digits=None) for k, (start, unit) in texts.items() if k in found])


def _ranking(s: Data, name: str) -> list[list[str]]:
    """The prediction, or the fit where nothing was predicted, among curves that explain nothing: best rating first."""
    own = s["hold_out"].get(name)
    us = "predicted" if own else "simulated, in-sample"
    own = own or s["traces"][name]
    rows = {us: {"R": own["metrics"]["iso18571"]["R"], "nrmse": own["metrics"]["nrmse"]}, **own["null_models"]}
    order = sorted(rows, key=lambda n: -(rows[n]["R"] if rows[n]["R"] is not None else -1.0))
    return [
        [in_words(n), quantity(rows[n]["R"], "-"), quantity(rows[n]["nrmse"], "fraction"), "own" if n == us else ""]
        for n in order
    ]


def _caption(s: Data, name: str) -> str:
    held = s["hold_out"].get(name)
    if held is None:
        return "Fitted with the others: in-sample."
    own = listed(list(held.get("fitted", {}))) or "nothing"
    return breakable(
        f"Predicted with the flesh of {listed(held['trained_on'])}. "
        f"Fitted to this cut: {own}, and one factor on its force."
    )


def _property_of(name: str) -> str:
    """The property that a parameter is: one of a single specimen is called PROPERTY@SPECIMEN."""
    return name.split("@")[0]


def _parameter(name: str, p: Data, meanings: Mapping[str, str]) -> list[str]:
    unit = p["unit"]
    shared = "all cuts" if p.get("shared", True) else "one cut"
    return [
        breakable(name), meanings.get(_property_of(name), ""), quantity(p["value"], unit),
        interval(p["low95"], p["high95"], unit), interval(p["prior_low"], p["prior_high"], unit),
        in_words(p["verdict"]), shared,
    ]  # fmt: skip


def _change(c: Data) -> list[str]:
    if c.get("reason"):
        return [f"broke down: {in_words(c['reason'])}", ""]
    return [quantity(c.get(key), "fraction", digits=2, signed=True) for key in ("peak_change", "work_change")]


def _runs(s: Data) -> str:
    failed = s.get("failed_simulations")
    text = f"{count(s.get('simulations'))} simulations in {duration(s.get('wall_s'))}"
    return text + (f", {count(failed)} of the last fit failed" if failed else "")
