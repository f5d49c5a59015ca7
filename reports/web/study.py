"""The page of a study: ``report.html``, one file with the verdict, the curves of each cut to read off, and what was
fitted.

Its numbers are the texts of ``report.pdf``: what this module gets is what the typesetter gets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mpm.arrays import FloatArray
from reports.base.run_folder import Data
from reports.web.curves import AXES, BAND, BAND_SHORT, known, numbers, places, switches
from reports.web.markup import Markup, data, document, element, joined, picture, table
from reports.web.parts import assets, chart, limits_section, mark, pairs, stamped

FORCES = "Measured, simulated and predicted force over stroke with the 95 % band, and the residual below"
HEAD = ("Cut", "NRMSE", "Shape", "ISO rating", "Peak", "Work", "In band", "Band width", "Factor", "Verdict")
ONE_SD = "±: one standard uncertainty, before and after; of a factor that of its logarithm, times the factor."
PREDICTED, FITTED = "predicted from the other cuts", "simulated, fitted to it too"
WORDS = (
    "Shape: difference of the curves over their own peaks. ISO rating: overall rating in the manner of ISO/TS 18571, "
    "1 is perfect. In band: part of the measured curve within the 95 % band. Band width: mean width of that band over "
    "the measured peak. Factor: on the simulated force, for the width of the specimen and the gain of its sensor."
)


def study_page(
    content: Data, curves: Mapping[str, Mapping[str, FloatArray]], held: Sequence[str], figures: Mapping[str, bytes]
) -> str:
    """The page of a study.

    Args:
        content: What the PDF prints, as text.
        curves: Columns of ``curves-NAME.csv`` by cut, each (n,): stroke [m], forces [N].
        held: Cuts that were held out.
        figures: Figures of the PDF by cut, SVG documents for readers without scripts.

    Returns:
        The HTML document.
    """
    body = joined([
        stamped("Study of several cuts", content["food"], content["study"], content["passed"],
                {"forces": "Forces", "lines": "Lines of each cut", "model": "Model", "ranking": "Null models",
                 "parameters": "What was fitted", "limits": "What this does not show"}),
        element("main", _verdict(content), _forces(content, curves, held, figures), _lines(content), _model(content),
                _ranking(content), _parameters(content), limits_section(content), _provenance(content)),
        element("footer", element("p", f"cutcal {content['cutcal']}, run of {content['created']}. ",
                                  element("a", "report.pdf", href="report.pdf"), " lies in the same folder.")),
        data("curves", {"cuts": [drawable(columns, name in held) for name, columns in curves.items()]}),
    ])  # fmt: skip
    return document(f"Study of {content['food'].lower()}", body, *assets())


def drawable(curves: Mapping[str, FloatArray], held: bool) -> dict[str, Any]:
    """What the script draws of a cut.

    Args:
        curves: Columns of its file, each (n,): stroke [m], forces [N].
        held: Whether it was held out: the band and the residual are then those of the prediction.

    Returns:
        Plain data; a value that is not known is None.
    """
    foretold = held and known(curves, "predicted_N")
    ours = curves["predicted_N" if foretold else "sim_N"] if foretold or known(curves, "sim_N") else None
    ends = ("predicted_low_N", "predicted_high_N") if foretold else ("band_low_N", "band_high_N")
    forces = {"real_N": curves["real_N"]}
    names = {"real_N": "trace"}
    if ours is not None:
        forces["sim_N"], names["sim_N"] = ours, PREDICTED if foretold else FITTED
    if foretold and known(curves, "sim_N"):
        forces["fitted_N"], names["fitted_N"] = curves["sim_N"], FITTED
    residual = np.full(curves["real_N"].shape, np.nan) if ours is None else ours - curves["real_N"]
    force = places(max(float(np.nanmax(values)) for values in forces.values()))
    finest = force if ours is None else max(force, places(float(np.nanmax(np.abs(residual)))))
    decimals = {"stroke": places(1e3 * float(curves["stroke_m"][-1])), "force": force, "residual": finest}
    return {
        "x": numbers(1e3 * curves["stroke_m"], 9),
        "names": names,
        "y": {key: numbers(values) for key, values in forces.items()},
        "band": {end: numbers(curves[key]) for end, key in zip(("low", "high"), ends, strict=True)}
        if known(curves, ends[0])
        else None,
        "band_name": BAND_SHORT,
        "main": [key for key in ("real_N", "sim_N") if key in forces],
        "axes": AXES,
        "residual": numbers(residual),
        "residual_name": f"{'predicted' if foretold else 'simulated'} − trace",
        "noise": 0.0,
        "places": decimals,
        "members": [],
    }  # fmt: skip


def _verdict(c: Data) -> Markup:
    """The sentence, and the lines of each cut: predicted and in-sample apart."""
    kinds = (("Held out and predicted", "held", "No cut was held out."), ("Fitted: in-sample", "fitted", "None."))
    parts: list[Markup] = []
    for title, key, none in kinds:
        rows = [[r["name"], *r["cells"], mark(r["mark"])] for r in c[key]]
        parts.append(element("h2", title))
        parts.append(table(HEAD, rows, range(1, 9), id=key, label=title) if rows else element("p", none))
        limits = f"Limits: {c[f'{key}_limits']}." if c[f"{key}_limits"] else ""
        said = " ".join(text for text in (limits, *c[f"{key}_notes"]) if text)
        parts.append(element("p", said, class_="note") if rows and said else Markup(""))
    words = element("p", f"{WORDS} {c['chi_square']}", class_="note")
    conflicts = [element("p", element("strong", text)) for text in c["conflicts"]]
    return element("section", element("p", c["sentence"]), *conflicts, *parts, words, id="verdict")


def _forces(
    c: Data, curves: Mapping[str, Mapping[str, FloatArray]], held: Sequence[str], figures: Mapping[str, bytes]
) -> Markup:
    """The choice of a cut, its chart, its caption, and the switches of the curves."""
    options = [element("option", name) for name in c["names"]]
    choose = element("p", element("label", "Cut ", element("select", *options, id="cut")), class_="choice", hidden=True)
    captions = [element("p", text, class_="note", data_cut=str(k)) for k, text in enumerate(c["captions"])]
    rows = [("real_N", "trace", True), ("sim_N", "predicted, or simulated where it was only fitted", True)]
    rows += [("band", BAND, True)]
    if any(name in held and known(columns, "sim_N") for name, columns in curves.items()):
        rows.append(("fitted_N", FITTED, False))
    paper = [picture(figures[name], f"Measured, simulated and predicted force of {name}") for name in figures]
    return element(
        "section",
        element("h2", "Force over stroke"),
        choose,
        chart(FORCES),
        *captions,
        element("div", switches(rows), hidden=True, id="legend"),
        element("noscript", element("p", "Without scripts these are the figures of report.pdf."), *paper),
        id="forces",
    )


def _lines(c: Data) -> Markup | None:
    """The lines of each cut, with their limits."""
    if not c["lines"]:
        return None
    parts = []
    for name, rows in c["lines"]:
        cells = [[v["name"], v["value"], v["limit"], mark(v["mark"]), v["note"]] for v in rows]
        head = ("Line", "Value", "Limit", "Verdict", "Note")
        parts += [element("h3", name), table(head, cells, (1, 2), label=f"Lines of {name}")]
    said = element("p", "A cut passes where each of its lines does.")
    return element("section", element("h2", "The lines of each cut"), said, *parts, id="lines")


def _model(c: Data) -> Markup:
    """The cuts as they were simulated, the laws, and where limits and ranges come from."""
    w = c["model"]
    head = ("Cut", "Specimen: across the blade, along it, height", "Knife", "Cells", "Particles", "Stroke", "Peak",
            "Simulated")  # fmt: skip
    laws = [[part, law, element("code", names)] for part, law, names in w["laws"]]
    ranges = [[element("code", row[0]), *row[1:]] for row in w["ranges"]]
    kept = ("Cut", "Subtracted", "Contact", "Stroke by", "Noise", "Filter", "Low-pass")
    parts: list[Markup] = [
        element("h2", "The model"),
        element("p", w["method"]),
        table(head, w["cuts"], (4, 5, 6, 7), id="cuts", label="The cuts as they were simulated"),
        *([table(("Part", "Law", "Properties"), laws, label="Laws")] if laws else []),
    ]
    if w["conditioning"]:
        parts += [element("h3", "From record to curve"), table(kept, w["conditioning"], (2, 4, 5, 6), label="Records")]
    parts += [element("h3", "What is minimised"), element("p", w["objective"])]
    if w["limit_sources"]:
        parts += [element("h3", "Where the limits come from")]
        parts += [table(("Line", "Its limit"), w["limit_sources"], label="Where the limits come from")]
    if ranges:
        title, columns = "Where the priors come from", ("Property", "Prior, 95 %", "Kind of source", "Source")
        parts += [element("h3", title), table(columns, ranges, label=title)]
    listed = element("ol", *(element("li", text) for text in w["references"]), class_="note")
    of_values = [element("h3", "References of the values"), pairs(w["food_references"])] if w["food_references"] else []
    return element("section", *parts, element("h3", "References"), listed, *of_values, id="model")


def _ranking(c: Data) -> Markup:
    """Each cut among curves that explain nothing."""
    parts = []
    for name, rows in c["ranking"]:
        cells = [[element("strong", text) if row[3] else text for text in row[:3]] for row in rows]
        parts.append(table((name, "ISO rating", "NRMSE"), cells, (1, 2), label=f"Ratings of {name}"))
    said = "Best rating first; what stands above the cut's own line is closer to the trace than the physics."
    title = element("h2", "Against curves that explain nothing")
    return element("section", title, element("p", said), *parts, id="ranking")


def _parameters(c: Data) -> Markup:
    """Values, what the measurements leave open, and what numerical choices change."""
    head = ("Parameter", "Value", "95 % interval", "Prior, 95 %", "Identifiability")
    parts: list[Markup] = []
    for key, title, more in (("shared", "Of all cuts", ()), ("own", "Of one cut, or of one knife", ("Of",))):
        rows = [
            [
                joined([element("code", p[0]), element("small", p[1])]),
                element("strong", p[2]),
                *p[3:5],
                _verdict_of(p),
                *p[6 : 6 + len(more)],
            ]
            for p in c[key]  # fmt: skip
        ]
        if rows:
            parts += [
                element("h3", title),
                table((*head, *more), rows, (1, 2, 3), id=key, label=f"Parameters: {title}"),
            ]
    if not parts:
        parts = [element("p", "No parameter was fitted.")]
    if c["legend"]:
        parts += [element("p", "; ".join(f"{word}: {text}" for word, text in c["legend"]) + ".", class_="note")]
    if c["fixed"]:
        title, columns = "Values that were not fitted", ("Property", "Value", "Kind of source", "Source")
        rows = [[joined([element("code", row[0]), element("small", row[1])]), *row[2:]] for row in c["fixed"]]
        parts += [element("h3", title), table(columns, rows, (1,), label=title)]
    if c["left_open"]:
        known_before = ("Cut", "Quantity", "What it is", "Known before", "What the fit says", "Within 3 sd")
        open_ = [[*row[:5], mark_of(row[5])] for row in c["left_open"]]
        parts += [element("h3", "What the measurements leave open")]
        parts += [table(known_before, open_, (3, 4), label="What the measurements leave open")]
        parts += [element("p", ONE_SD, class_="note")]
    if c["checks"]:
        parts += [element("h3", "What numerical choices change")]
        parts += [table(("Cut", "Choice", "Peak", "Work"), c["checks"], (2, 3), label="Numerical checks")]
        parts += [element("p", c["checks_note"], class_="note")] if c["checks_note"] else []
    return element("section", element("h2", "What was fitted"), *parts, id="parameters")


def _verdict_of(p: Sequence[str]) -> Markup:
    """What is known of a parameter, and whether it is outside of its prior."""
    return joined([p[5], ", ", element("strong", p[7])] if p[7] else [p[5]])


def mark_of(word: str) -> Markup:
    """Whether a value lies within what was known before."""
    kinds = {"yes": ("yes", "yes"), "no": ("no: outside", "no")}
    text, kind = kinds.get(word, (word, "none"))
    return element("span", text, class_=kind)


def _provenance(c: Data) -> Markup:
    """Where the numbers come from."""
    rows = [[r[0], r[1], r[2], element("code", r[3] + r[4])] for r in c["traces"]]
    said = [
        ("Runs", c["runs"]),
        ("Commit", c["commit"] or "not run from a checkout"),
        ("Versions", c["versions"]),
        ("Command", " ".join(c["command"])),
    ]
    traces = [table(("Cut", "File", "Kind", "SHA-256"), rows, label="Traces")] if rows else []
    return element("section", element("h2", "Provenance"), *traces, pairs(said, "code"), id="provenance")
