"""The report of a calibration: its result, ``curves.csv`` and ``evaluations.h5`` become ``report.pdf`` and
``report.html``.

Numbers and the sentences that depend on them are made here, once for both; the other words are in
``templates/calibration.typ`` and :mod:`reports.web.calibration`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.scene import Knife
from mpm.scene.shapes import Shape
from reports.base import figures
from reports.base.format import breakable, compared, count, listed, plain, publish, quantity, uncertain
from reports.base.labels import LEAST_PART, capital, in_type, in_words, related, shown
from reports.base.references import Citations
from reports.base.run_folder import Data, Finished, read_finished
from reports.calibration import (
    credibility_page,
    cut_figure,
    failures,
    measurement,
    model_page,
    numerics_page,
    parameter_figures,
    parameter_page,
    posterior_page,
    withdrawal_page,
)
from reports.web.calibration import calibration_page, write_page

if TYPE_CHECKING:
    from calib.calibration.members import Members
    from calib.calibration.result import CalibrationResult
    from calib.calibration.result_parts import Agreement, FixedParameter, NullRating
    from calib.validation.acceptance import Verdict

#: First page [mm]: what title, a line, a sentence of two lines and facts leave; a line of the table, one more line in
#: it, a line of the sentence, a banner.
PAGE_ROOM, LINE_HEIGHT, NEXT_LINE, SENTENCE_LINE, BANNER_HEIGHT = 193.0, 4.9, 3.7, 5.2, 20.0
#: Letters in a line of a name, a note and the sentence.
NAME_LETTERS, NOTE_LETTERS, SENTENCE_LETTERS = 42, 47, 92
#: Least and largest height of the main figure [mm].
FIGURE_HEIGHT = (60.0, 125.0)
#: What the null models are compared in: key, label, unit, and whether more is better.
MEASURES = (
    ("nrmse", "NRMSE", "fraction", False),
    ("shape_error", "shape error", "fraction", False),
    ("R", "ISO rating", "-", True),
)
#: Noise below this part of the peak is that of digitised, smoothed or clipped data [-].
NO_NOISE = 1e-3
#: Head and text of the notices.
RECONSTRUCTED = (
    "Reconstructed trace, not a measurement",
    "No force sensor recorded this curve. Nothing that is fitted to it is validated by it.",
)
INTERRUPTED = (
    "Interrupted",
    "The fit was stopped before it had ended. Values are those of the best simulation until then; intervals may be "
    "missing or too narrow. Continue with --resume.",
)
USE = "for simulating cuts of this food with this knife; the values are constants of the simulation, fitted to one cut"
#: Parts that cite, in the order in which they are read.
CITING = ("model", "withdrawal", "influence_caption", "credibility")
RELATIONS = {"<=": "≤ ", ">=": "≥ "}


def write_report(result: CalibrationResult, members: Members | None = None) -> Path:
    """Write ``report.pdf`` and ``report.html`` of a finished or interrupted calibration into its folder.

    The same result and files give the same bytes. If the report cannot be made, an older one stays as it is.

    Args:
        result: The calibration; its folder has ``curves.csv`` and ``evaluations.h5``.
        members: Simulations that the page in HTML has to choose from.

    Returns:
        Path of ``report.pdf``; ``report.html`` lies beside it.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    done = read_finished(result)
    pictures = _pictures(done)
    content = {**_content(done), "figures": sorted(pictures)}
    target = result.folder / "report.pdf"
    page = calibration_page(done, content, members, {name.removesuffix(".svg"): p for name, p in pictures.items()})
    publish(target, "calibration.typ", content, pictures, date=done.created)
    write_page(target.with_suffix(".html"), page)
    return target


def _pictures(done: Finished) -> dict[str, bytes]:
    """The figures by file name."""
    result, curves = done.result, done.curves
    fitted, trace = result.fitted, result.trace.label
    legend = _legend(result)
    look = None
    if done.section is not None:
        cut = result.cut
        of_cut = (done.section, cut.knife, cut.shape.height, curves["stroke_m"], curves["sim_N"])
        look = cut_figure.glance(*of_cut)
    found = {
        "forces.svg": figures.forces(curves, legend["real_N"], legend["sim_N"], _room(result), _inside(result), look),
        "conditioning.svg": figures.conditioning(_record(done), curves),
        "fit.svg": figures.fit(curves, result.conditioning.noise_sd_N, trace),
        "sketch.svg": model_page.sketch(result),
        "nulls.svg": figures.null_models(curves, trace, _null_peaks(result)),
    }
    if done.section is not None:
        found |= {f"cut{k}.svg": look for k, look in enumerate(cut_figure.cut(*of_cut))}
    names, matrix = parameter_page.correlation_matrix(result.posterior.correlations, list(fitted))
    if len(names) > 2:  # of two the text says it
        found["correlations.svg"] = parameter_figures.correlations(names, matrix)
    ranges = [parameter_page.parameter_range(name, p) for name, p in fitted.items()]
    if ranges:
        found["parameters.svg"] = parameter_figures.ranges(ranges)
    panels = parameter_page.panels(result.posterior.profiles, fitted)
    if panels:
        found["profiles.svg"] = parameter_figures.profile_panels(panels)
    if result.sensitivity:
        found["influence.svg"] = parameter_figures.influence(result.sensitivity, parameter_page.QUANTITIES)
    apart = failures.splits(done.runs, fitted)
    if apart:
        found["breakdowns.svg"] = failures.picture(done.runs, apart)
    if done.withdrawal:
        found["withdrawal.svg"] = withdrawal_page.figure(done.withdrawal, trace)
    if result.history.misfit_history:
        found["misfit.svg"] = figures.misfit(result.history.misfit_history)
    return found


def _null_peaks(result: CalibrationResult) -> dict[str, str]:
    """Peaks of the null models as the table has them, by column of ``curves.csv``."""
    agreement = result.agreement
    models = {**agreement.null_models, **({"start": result.at_literature} if result.at_literature else {})}
    peaks = {name: agreement.peak_real_N * (1.0 + (m.peak_error or 0.0)) for name, m in models.items()}
    return {f"{name}_N": compared(peak, "N") for name, peak in peaks.items()}


def _legend(result: CalibrationResult) -> dict[str, str]:
    """What the two curves of the main figure are called, with their peaks, by column of ``curves.csv``."""
    agreement = result.agreement
    return {
        "real_N": f"{result.trace.label}, peak {uncertain(agreement.peak_real_N, result.peak_sd_N, 'N')}",
        "sim_N": f"simulated, peak {compared(agreement.peak_sim_N, 'N')}",
    }


def _inside(result: CalibrationResult) -> str:
    """What the legend says of the trace within the predictive band."""
    part = result.posterior.predictive_inside
    return "" if part is None else f" ({quantity(part, 'fraction', digits=2)} of the trace inside)"


def _room(result: CalibrationResult) -> float:
    """Height for the main figure that fills the first page [mm]: what the lines above it leave."""
    banners = (result.trace.label == "reconstructed") + (result.status == "interrupted")
    table = [(len(v.name) // NAME_LETTERS, len(v.note or "") // NOTE_LETTERS) for v in result.verdicts]
    said = max(len(_sentence(result)) // SENTENCE_LETTERS - 1, 0)
    left = PAGE_ROOM - LINE_HEIGHT * len(table) - NEXT_LINE * sum(map(max, table))
    left -= SENTENCE_LINE * said + BANNER_HEIGHT * banners
    return min(max(left, FIGURE_HEIGHT[0]), FIGURE_HEIGHT[1])


def _record(done: Finished) -> figures.ConditioningRecord:
    c, agreement = done.result.conditioning, done.result.agreement
    return figures.ConditioningRecord(
        time=done.time,
        raw=done.raw,
        tared=done.tared,
        onset=c.onset_s,
        onset_sd=c.onset_sd_s,
        end=c.end_s,
        end_sd=c.end_sd_s,
        window=c.baseline_window_s,
        baseline_kind=c.baseline_kind,
        peak=agreement.peak_real_N,
        peak_sd=done.result.peak_sd_N,
    )


def _used(result: CalibrationResult) -> Mapping[str, FixedParameter]:
    """Values that were not fitted, but for what starts a cut in bare flesh where a skin starts it."""
    fixed = result.fixed_parameters
    skin = result.fitted.get("skin_thickness") or fixed.get("skin_thickness")
    return {n: p for n, p in fixed.items() if n != "R_initiation" or skin is None or not skin.value}


def _content(done: Finished) -> Data:
    """Everything the template prints, as text."""
    result, broken = done.result, failures.splits(done.runs, done.result.fitted)
    fitted, fixed, correlations = result.fitted, _used(result), result.posterior.correlations
    content = {
        "food": result.food.replace("_", " ").capitalize(),
        "cutcal": result.software.versions.get("cutcal", ""),
        "created": done.created.strftime("%Y-%m-%d %H:%M"),
        "interrupted": result.status == "interrupted",
        "reconstructed": result.trace.label == "reconstructed",
        "banners": _banners(result),
        "passed": result.passed,
        "sentence": _sentence(result),
        "identified": posterior_page.identified(fitted),
        "verdicts": [_verdict_line(v) for v in result.verdicts],
        "trace": _trace(result),
        "facts": [
            ["Food", _specimen(result.cut.shape)],
            ["Knife", _knife(result.cut.knife)],
            ["Use", USE],
        ],
        "curves": {**_legend(result), "inside": _inside(result)},
        "conditioning": _conditioning(done),
        "left_open": [measurement.left_open(name, n) for name, n in result.nuisances.items()],
        "errors": measurement.errors(result, len(done.curves["stroke_m"])),
        "null_rows": _null_rows(result),
        "null_sentences": _null_sentences(result.agreement),
        "metrics": _metrics(result.agreement),
        "parameters": [parameter_page.parameter(name, p, result.meaning(name)) for name, p in fitted.items()],
        "legend": parameter_page.legend(fitted),
        "posterior": posterior_page.posterior(result.sampled, fitted),
        "influences": parameter_page.influences(result.sensitivity),
        "influence_caption": parameter_page.influence_caption() if result.sensitivity else "",
        "correlations": parameter_page.correlations(correlations) if correlations else None,
        "pair": parameter_page.pair(*parameter_page.correlation_matrix(correlations, list(fitted))),
        "fixed": [parameter_page.fixed(name, p, result.meaning(name)) for name, p in fixed.items()],
        "numerics": numerics_page.numerics(result),
        "broke_down": failures.sentence(done.runs, broken),
        "misfit_data": count(measurement.assumed_data(result, len(done.curves["stroke_m"]))),
        "failures": numerics_page.failures(result.history.failures),
        "credibility": credibility_page.credibility(result.folder),
        "withdrawal": None if result.withdrawal is None else withdrawal_page.withdrawal(result.withdrawal),
        "provenance": numerics_page.provenance(result),
        "model": model_page.model(result),
        "limits": [capital(in_type(text)) for text in result.limits],
        "warnings": [capital(in_type(text)) for text in result.warnings],
    }
    citations = Citations()
    content |= {name: citations.numbered(content[name]) for name in CITING}
    return {**content, "references": citations.listed}


def _specimen(shape: Shape) -> str:
    sizes = " × ".join(plain(1e3 * size) for size in (shape.length, shape.width, shape.height))
    name = in_words(shape.kind) if shape.outline is None else breakable(shape.words)
    return f"{name}, {sizes} mm (across the blade, along it, height)"


def _knife(knife: Knife) -> str:
    spine, height, edge = (quantity(getattr(knife, k), "m") for k in ("spine", "height", "length"))
    angle = quantity(knife.angle, "rad")
    return f"{breakable(knife.name)}: spine {spine}, wedge {angle}, height {height}, edge {edge}"


def _banners(result: CalibrationResult) -> list[list[str]]:
    """Loud notices above the verdict: head and text of each."""
    said = {RECONSTRUCTED: result.trace.label == "reconstructed", INTERRUPTED: result.status == "interrupted"}
    return [list(notice) for notice, shown_ in said.items() if shown_]


def _trace(result: CalibrationResult) -> Data:
    trace, air = result.trace, result.air
    seconds = trace.duration_s
    return {
        "source": breakable(trace.source),
        "label": trace.label,
        "samples": count(trace.samples),
        "duration": quantity(seconds, "s"),
        "rate": quantity((trace.samples - 1) / seconds if seconds > 0.0 else None, "Hz"),
        "columns": [[role, breakable(name)] for role, name in trace.columns.items()],
        "air": breakable(air.source or "without a name") if air else None,
    }


def _conditioning(done: Finished) -> Data:
    c, agreement = done.result.conditioning, done.result.agreement
    sd, seconds = c.onset_sd_s, c.end_s - c.onset_s
    speed = c.stroke_m / seconds if seconds > 0.0 else None
    noisy = c.noise_sd_N > NO_NOISE * agreement.peak_real_N
    return {
        "baseline": uncertain(c.baseline_N, c.baseline_sd_N, "N"),
        "noise": quantity(c.noise_sd_N, "N", digits=2) if noisy else "none",
        "noisy": noisy,
        "filter": quantity(c.filter_sd_m, "m", digits=None),
        "bandwidth": None if c.bandwidth_Hz is None else quantity(c.bandwidth_Hz, "Hz"),
        "onset": uncertain(c.onset_s, sd, "s"),
        "onset_stroke": quantity(sd * speed, "m", digits=2) if sd and speed else None,
        "end": uncertain(c.end_s, c.end_sd_s, "s"),
        "speed": quantity(speed, "m/s"),
        "stroke": quantity(c.stroke_m, "m"),
        "stroke_source": c.stroke_source,
        "steps": count(len(done.curves["stroke_m"])),
        "peak": uncertain(agreement.peak_real_N, done.result.peak_sd_N, "N"),
        "peak_parts": _peak_parts(done.result),
    }


def _peak_parts(result: CalibrationResult) -> str:
    """What the standard uncertainty of the measured peak is made of."""
    names = ("noise and baseline", "gain of the sensor", "drift")
    parts = [f"{name} {quantity(sd, 'N', digits=2)}" for name, sd in zip(names, result.peak_parts_N, strict=True) if sd]
    return f"± of {listed(parts)}" if parts else "no uncertainty is known"


def _sentence(result: CalibrationResult) -> str:
    """The verdict in plain words."""
    failed = [v.name for v in result.verdicts if v.value is not None and v.passed is False]
    ran = sum(v.value is not None for v in result.verdicts)
    absent = [v.name for v in result.verdicts if v.value is None]
    if result.passed:
        text = "Passed: the simulated force stays within every limit of the table that was tested"
        text += f", except in {listed(failed)}, which does not decide." if failed else "."
    elif failed:
        text = f"Not passed: {len(failed)} of {ran} lines of the table failed ({listed(failed)})."
    elif result.status == "interrupted":
        text = "Not passed: the fit was interrupted. No line of the table has failed so far."
    else:
        text = "Not passed: no line of the table failed, but not all that decides was tested."
    if result.trace.label == "reconstructed":
        text += " The trace is a reconstruction, so this says nothing about a real cut."
    text += f" Not run: {listed(absent)}." if absent else ""
    return breakable(text + numerics_page.broke_down(result.history))


def _verdict_line(v: Verdict) -> Data:
    """One line of the verdict table; without a ``relation`` it follows from value, limit and outcome."""
    value, limit, unit, passed = v.value, v.limit, v.unit or "-", v.passed
    relation = RELATIONS.get(v.relation or "", "") or related(value, limit, passed)
    mark = "none" if value is None or passed is None else "yes" if passed else "no"
    return {
        "name": breakable(v.name), "value": "not run" if value is None else shown(value, unit, 3),
        "limit": relation + shown(limit, unit, None), "mark": mark,
        "note": "" if v.note in (None, "not run") else v.note,
    }  # fmt: skip


def _null_rows(result: CalibrationResult) -> list[list[str]]:
    """Simulation, null models and the simulation before the fit: name, NRMSE, shape, R, peak, work."""
    rows: list[tuple[str, NullRating | Agreement]] = [("simulation, fitted", result.agreement)]
    rows += [(in_words(name), model) for name, model in result.agreement.null_models.items()]
    if result.at_literature is not None:
        rows.append(("simulation at literature values", result.at_literature))
    return [[name, *_rating(model)] for name, model in rows]


def _rating(m: NullRating | Agreement) -> list[str]:
    errors = (0.0 if x is not None and abs(x) < LEAST_PART else x for x in (m.peak_error, m.work_error))
    signed = [quantity(x, "fraction", signed=True) for x in errors]
    return [quantity(getattr(m, key), unit) for key, _, unit, _ in MEASURES] + signed


def _null_sentences(agreement: Agreement) -> list[str]:
    """Which null model is closer to the trace than the simulation, and in what."""
    said = []
    for name, model in agreement.null_models.items():
        better = []
        for key, label, unit, more in MEASURES:
            a, b = getattr(model, key), getattr(agreement, key)
            if a is not None and b is not None and (a > b if more else a < b):
                better.append(f"{label} ({quantity(a, unit)} against {quantity(b, unit)})")
        if better:
            said.append(f"The {in_words(name)} is closer to the trace than the simulation in {listed(better)}.")
    names = listed([label for _, label, _, _ in MEASURES])
    return said or [f"No null model is closer to the trace than the simulation in {names}."]


def _metrics(agreement: Agreement) -> Data:
    """The figures of the comparison by name; the template labels them."""
    m, g, iso = agreement.metrics, agreement.sprague_geers, agreement.iso18571
    units = {"shape_ramp": "fraction", "shape_peak": "fraction", "shape_release": "fraction", "best_scale": "-",
             "relative_l2": "fraction", "best_scale_residual": "fraction"}  # fmt: skip
    sizes = {"peak_sim_N": "N", "work_sim_J": "J", "work_real_J": "J"}
    signed = ("peak_error", "peak_position_error", "work_error", "stiffness_error")
    return {
        **{name: quantity(getattr(m, name), unit) for name, unit in units.items()},
        **{name: compared(getattr(m, name), unit) for name, unit in sizes.items()},
        **{name: quantity(getattr(m, name), "fraction", signed=True) for name in signed},
        "sprague_geers": [quantity(getattr(g, k), "fraction", signed=k == "M") for k in "MPC"],
        "iso": {k: quantity(getattr(iso, k), "-") for k in ("Z", "EP", "EM", "ES", "R")},
        "shift": count(iso.shift),
        "at_bound": iso.at_bound,
        "without_phase": quantity(iso.without_phase, "-"),
    }
