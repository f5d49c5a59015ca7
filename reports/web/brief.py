"""The page of a report that is a verdict, some figures and tables: ``report.html``, one file beside ``report.pdf``.

Its numbers are the texts of the PDF: what this module gets is what the typesetter gets. Where a report has curves, they
can be read off.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mpm.arrays import FloatArray
from reports.base.brief import Brief, Origin, ReportPart, ReportTable, brief_content, typeset_brief
from reports.base.run_folder import Data
from reports.web.calibration import write_page
from reports.web.curves import numbers, places, switches
from reports.web.markup import Markup, data, document, element, joined, picture, table
from reports.web.parts import assets, chart, limits_section, mark, pairs, stamped

DIGITS = 6
"""Significant digits of a curve."""


@dataclass(frozen=True, eq=False)
class Panel:
    """Curves that are drawn together: of one specimen, or of one group.

    Attributes:
        name: Whose they are.
        across: Values of the axis below (n,), rising.
        curves: Name and values (n,) of each curve, by its key, which says how it is drawn.
        band: Low and high end (n,) of a range; None for none.
        residual: What is left between two curves (n,); None where nothing is compared.
    """

    name: str
    across: FloatArray
    curves: Mapping[str, tuple[str, FloatArray]]
    band: tuple[FloatArray, FloatArray] | None = None
    residual: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Chart:
    """What a reader may point at in place of a figure.

    Attributes:
        part: Title of the part whose figure it stands for.
        across: What the axis below is, and its unit.
        up: What the other axis is, and its unit.
        panels: What is drawn, one at a time.
        choice: What a panel is of, such as ``Specimen``.
        band: What the band of a panel is.
        residual: What the residual is.
        logarithmic: Whether the axis below is one of logarithms.
    """

    part: str
    across: tuple[str, str]
    up: tuple[str, str]
    panels: Sequence[Panel]
    choice: str = "Cut"
    band: str = ""
    residual: str = ""
    logarithmic: bool = field(default=False)


def publish_brief(result: Path, brief: Brief, origin: Origin, curves: Chart | None = None) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside a document.

    Args:
        result: The JSON file of the run; the report has its date.
        brief: What the report holds.
        origin: Where the run comes from.
        curves: What a reader of the page may point at; None for the figures of the PDF alone.

    Returns:
        Path of ``report.pdf``.

    Raises:
        ReportError: One of them cannot be written.
    """
    target = typeset_brief(result, brief, origin)
    write_page(target.with_suffix(".html"), brief_page(brief, brief_content(result, brief, origin), curves))
    return target


def brief_page(brief: Brief, content: Data, curves: Chart | None = None) -> str:
    """The page of a report.

    Args:
        brief: What the report holds.
        content: What the PDF prints, as text.
        curves: What a reader may point at, or None.

    Returns:
        The HTML document.
    """
    places_of = {f"part{k}": part.title for k, part in enumerate(brief.parts)} | {"limits": "What this does not show"}
    sections = [_part(f"part{k}", part, curves) for k, part in enumerate(brief.parts)]
    verdict = element("section", element("p", brief.sentence), pairs(brief.facts), id="verdict")
    foot = joined([
        f"cutcal {content['cutcal']}, run of {content['created']}. ",
        element("a", "report.pdf", href="report.pdf"), " lies in the same folder.",
    ])  # fmt: skip
    body = joined([
        stamped(brief.kind, brief.name, "", brief.passed, places_of),
        element("main", verdict, *sections, limits_section(content), _provenance(content["provenance"])),
        element("footer", element("p", foot)),
        None if curves is None else data("curves", {"cuts": [_drawable(curves, panel) for panel in curves.panels]}),
    ])  # fmt: skip
    style, script = assets()
    return document(f"{brief.kind}: {brief.name}", body, style, "" if curves is None else script)


def _part(name: str, part: ReportPart, curves: Chart | None) -> Markup:
    """A part of the report; a chart takes the place of its figure, which is for readers without scripts."""
    parts: list[Markup | None] = [element("h2", part.title), element("p", part.text) if part.text else None]
    if part.picture:
        drawn = picture(part.picture, part.alt)
        parts += [drawn] if curves is None or curves.part != part.title else _chart(curves, part.alt, drawn)
    if part.table is not None:
        parts.append(_table(part.table, part.title))
    return element("section", *parts, id=name)


def _chart(curves: Chart, alt: str, drawn: Markup) -> list[Markup | None]:
    """The choice of a panel, the chart, its cursor and the switches of its curves."""
    options = [element("option", panel.name) for panel in curves.panels]
    label = element("label", f"{curves.choice} ", element("select", *options, id="cut"))
    names = {key: name for panel in reversed(curves.panels) for key, (name, _) in panel.curves.items()}
    rows = [(key, name, True) for key, name in names.items()]
    if any(panel.band is not None for panel in curves.panels):
        rows.append(("band", curves.band, True))
    return [
        element("p", label, class_="choice", hidden=True, id="choice") if len(options) > 1 else None,
        chart(alt, curves.across[0]),
        element("div", switches(rows), hidden=True, id="legend"),
        element("noscript", element("p", "Without scripts this is the figure of report.pdf."), drawn),
    ]


def _drawable(curves: Chart, panel: Panel) -> dict[str, Any]:
    """What the script draws of a panel; a value that is not known is None."""
    known = {key: (name, values) for key, (name, values) in panel.curves.items() if np.any(np.isfinite(values))}
    ends = () if panel.band is None else panel.band
    largest = max(float(np.nanmax(np.abs(values))) for values in (*(values for _, values in known.values()), *ends))
    residual = np.full(panel.across.shape, np.nan) if panel.residual is None else panel.residual
    finest = 0.0 if panel.residual is None else float(np.nanmax(np.abs(residual)))
    return {
        "x": numbers(panel.across, 9),
        "names": {key: name for key, (name, _) in known.items()},
        "y": {key: numbers(values, DIGITS) for key, (_, values) in known.items()},
        "band": dict(zip(("low", "high"), (numbers(end, DIGITS) for end in ends), strict=True)) if ends else None,
        "band_name": curves.band,
        "main": list(known),
        "axes": {"across": curves.across, "up": curves.up},
        "log": curves.logarithmic,
        "residual": numbers(residual, DIGITS),
        "residual_name": curves.residual,
        "noise": 0.0,
        "places": {
            "stroke": places(float(np.max(np.abs(panel.across[[0 if curves.logarithmic else -1]])))),
            "force": places(largest),
            "residual": max(places(largest), places(finest)),
        },
        "members": [],
    }


def _table(content: ReportTable, title: str) -> Markup:
    marked = content.marked
    rows = [[mark(cell) if k == marked and cell else cell for k, cell in enumerate(row)] for row in content.rows]
    right = [k for k in range(len(content.head)) if k >= content.left and k != marked]
    return table(content.head, rows, right, label=title)


def _provenance(origin: Data) -> Markup:
    """Where the numbers come from."""
    rows = [
        ("Commit", origin["commit"] or "not run from a checkout"),
        ("Device", origin["device"]),
        ("Versions", origin["versions"]),
        *([("Command", " ".join(origin["command"]))] if origin["command"] else []),
    ]
    return element("section", element("h2", "Provenance"), pairs(rows, "code"), id="provenance")
