"""The report of a study of several specimens: ``summary.json`` and the ``curves-NAME.csv`` become ``report.pdf``."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping
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
from reports.base.format import breakable, count, duration, listed, publish, quantity
from reports.base.labels import as_sentence, in_type, in_words
from reports.base.run_folder import Data, check_kind, read_columns, read_date, read_json, read_section
from reports.calibration import cut_figure, measurement, parameter_figures, parameter_page
from reports.multi_specimen import parameters, verdicts
from reports.multi_specimen.model import model, sketch
from reports.multi_specimen.shown_cut import Cited, Known, read_known
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


def nothing_cited(sources: Iterable[str | None]) -> Mapping[str, str]:
    """No reference for any source."""
    return {}


@dataclass(frozen=True)
class FinishedStudy:
    """A finished study.

    Attributes:
        summary: ``summary.json``, checked against SCHEMA.
        created: When it was made.
        curves: Columns of ``curves-NAME.csv`` by trace: stroke [m] and forces [N].
        sections: The food across the blade's middle, by trace; those that were fitted have one, but for older runs.
        meanings: What each property of the material is, in words.
        known: What the folder says of food and records.
        cited: What gives the references that sources name.
    """

    summary: Data
    created: datetime
    curves: dict[str, dict[str, np.ndarray]]
    sections: dict[str, Section]
    meanings: Mapping[str, str] = field(default_factory=dict)
    known: Known = field(default_factory=Known)
    cited: Cited = nothing_cited


def write_report(folder: Path, meanings: Mapping[str, str] | None = None, cited: Cited = nothing_cited) -> Path:
    """Write ``report.pdf`` and ``report.html`` of a finished study into its folder.

    Args:
        folder: Folder with ``summary.json`` and ``curves-NAME.csv`` of each trace.
        meanings: What each property of the material is, in words.
        cited: What gives the references that sources name.

    Returns:
        Path of the PDF; the page lies beside it.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    done = read_study(Path(folder), meanings, cited)
    figures = {name: picture(done, name) for name in done.curves}
    printed = content(done)
    target = Path(folder) / "report.pdf"
    pictures = {f"trace{k}.svg": drawn for k, drawn in enumerate(figures.values())} | _model_pictures(done)
    publish(target, "study.typ", {**printed, "figures": list(pictures)}, pictures, date=done.created)
    page = study_page(printed, done.curves, list(done.summary["hold_out"]), figures)
    write_page(target.with_suffix(".html"), page)
    return target


def _model_pictures(done: FinishedStudy) -> dict[str, bytes]:
    """The sketch of the cut, and the correlations of more than two parameters, by file name."""
    drawn = sketch(done.summary, done.curves, done.known)
    names, matrix = parameters.correlations(done.summary)
    found = {} if drawn is None else {"sketch.svg": drawn}
    return found | ({"correlations.svg": parameter_figures.correlations(names, matrix)} if len(names) > 2 else {})


def is_study(summary: Path) -> bool:
    """Whether a summary.json is that of a study of several cuts.

    Raises:
        ReportError: It is missing or damaged.
    """
    found = read_json(summary)
    return isinstance(found, dict) and "study" in found


def read_study(folder: Path, meanings: Mapping[str, str] | None = None, cited: Cited = nothing_cited) -> FinishedStudy:
    """Read a study's folder.

    Args:
        folder: The folder.
        meanings: What each property of the material is, in words.
        cited: What gives the references that sources name.

    Returns:
        All that a report is made from.

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
    return FinishedStudy(summary, created, curves, looks, meanings or {}, read_known(folder, summary["traces"]), cited)


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
    widths = {name: verdicts.band_width(curves, name in s["hold_out"]) for name, curves in done.curves.items()}
    held, fitted = s["hold_out"], s["traces"]
    lines = {name: verdicts.held_lines(p, widths[name]) for name, p in held.items()}
    each = [(_title(n, s, "held out"), p) for n, p in held.items()]
    each += [(_title(n, s, "in-sample"), t) for n, t in fitted.items()]
    reduced = s.get("reduced_chi2")
    rows = [(parameters.parameter(n, p, done.meanings), p) for n, p in s["parameters"].items()]
    return {
        "food": s["food"].replace("_", " ").capitalize(),
        "study": breakable(Path(s["study"]).name),
        "created": done.created.strftime("%Y-%m-%d %H:%M"),
        "cutcal": str(s.get("versions", {}).get("cutcal", "")),
        "passed": s["passed"],
        "sentence": verdicts.sentence(s, {name: widths[name] for name in held}),
        "conflicts": parameters.conflicts(s),
        "held": [verdicts.summary_line(name, p, widths[name]) for name, p in held.items()],
        "fitted": [verdicts.summary_line(n, t, verdicts.band_width(done.curves[n], False)) for n, t in fitted.items()],
        "held_limits": verdicts.held_limits(s),
        "fitted_limits": verdicts.fitted_limits(s),
        "held_notes": [text for n, p in held.items() if (text := verdicts.reason(n, p, lines[n]))],
        "fitted_notes": [text for n, t in fitted.items()
                         if (text := verdicts.reason(n, t, verdicts.fitted_lines(t)))],
        "lines": [[breakable(title), rows] for (title, _), rows in zip(
            each, [*lines.values(), *map(verdicts.fitted_lines, fitted.values())], strict=True) if rows],
        "chi_square": "" if reduced is None else measurement.size_of_errors(reduced),
        "ranking": [[breakable(name), _ranking(s, name)] for name in done.curves],
        "names": [breakable(name) for name in done.curves],
        "shown": list(done.curves).index(first(done)),
        "captions": [_caption(s, name) for name in done.curves],
        "left_open": [row for title, cut in each for row in _left_open(title, cut)],
        "shared": [row for row, p in rows if p.get("shared", True)],
        "own": [row for row, p in rows if not p.get("shared", True)],
        "legend": parameters.legend(s),
        "pair": parameter_page.pair(*parameters.correlations(s)),
        "correlations": None if s.get("correlations") is None else parameter_page.correlations(s["correlations"]),
        "fixed": parameters.fixed(s, done.known, done.meanings),
        "checks": [[breakable(name), in_words(c["name"]), *verdicts.change(c)] for name, t in fitted.items()
                   for c in t.get("numerical_checks") or []],
        "checks_note": verdicts.carried_on(s),
        "model": model(s, done.curves, done.known, done.cited),
        "traces": [[breakable(name), *_origin(_source(s, name))] for name in done.curves],
        "runs": _runs(s),
        "commit": s.get("git") or "",
        "command": [breakable(shlex.quote(word)) for word in s["command"]],
        "versions": ", ".join(f"{name}\u00a0{v}" for name, v in sorted(s.get("versions", {}).items())),
        "limits": [as_sentence(in_type(text)) for text in s["limits"]],
        "warnings": [as_sentence(in_type(text)) for text in s["warnings"]],
    }  # fmt: skip


def _origin(trace: Data) -> list[str]:
    """File, kind and the two halves of the hash of a trace."""
    digest = str(trace.get("sha256", ""))
    return [breakable(str(trace.get("source", "not recorded"))), str(trace.get("label", "")), digest[:32], digest[32:]]


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
        return f"Fitted with the others: in-sample. {verdicts.peaks(s['traces'][name], 'simulated')}"
    own = listed(list(held.get("fitted", {}))) or "nothing"
    return breakable(
        f"Predicted with the flesh of {listed(held['trained_on'])}. "
        f"Fitted to this cut: {own}, and one factor on its force. {verdicts.peaks(held, 'predicted')}"
    )


def _title(name: str, s: Data, how: str) -> str:
    """What a cut is called, which may be held out in one fit and fitted in another.

    Args:
        name: The cut.
        s: ``summary.json``.
        how: Which of the two is meant, in words.

    Returns:
        Its name, with these words where it is both.
    """
    return f"{name}, {how}" if name in s["hold_out"] and name in s["traces"] else name


def _left_open(name: str, cut: Data) -> list[list[str]]:
    """What a cut's measurement leaves open, its factor last."""
    known = cut.get("nuisances") or {}
    rows = [
        [breakable(name), *measurement.left_open(n, SimpleNamespace(**row))] for n, row in known.items() if n != "scale"
    ]
    return [*rows, verdicts.factor_row(name, cut, measurement.LEFT_OPEN["scale"])]


def _runs(s: Data) -> str:
    failed = s.get("failed_simulations")
    text = f"{count(s.get('simulations'))} simulations in {duration(s.get('wall_s'))}"
    return text + (f", {count(failed)} of the last fit failed" if failed else "")
