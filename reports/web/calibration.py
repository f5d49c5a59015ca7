"""The page of a calibration: ``report.html``, one file that shows verdict, curves, parameters and members.

Its numbers are the texts of ``report.pdf``: what this module gets is what the typesetter gets.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from mpm.files import write_atomic
from reports import ReportError
from reports.base.run_folder import Data, Finished
from reports.web.curves import drawable, legend
from reports.web.markup import Markup, data, document, element, joined, picture, table
from reports.web.members import members_section, picker
from reports.web.parts import assets, chart, items, limits_section, mark, pairs, stamped

if TYPE_CHECKING:
    from calib.calibration.members import Members

FORCES = "Measured and simulated force over stroke with the 95 % band, and the residual below"
WITHDRAWAL = "Measured and simulated pull on the knife over its way up"
PAPER = "Measured and simulated force over stroke, with the edge and face parts of the simulation"


def calibration_page(done: Finished, content: Data, members: Members | None, pictures: Mapping[str, bytes]) -> str:
    """The page of a calibration.

    Args:
        done: The run and its curves.
        content: What the PDF prints, as text.
        members: Simulations to choose from; None where they were not read.
        pictures: Figures of the PDF by name, SVG documents: the main one is for readers without scripts.

    Returns:
        The HTML document.
    """
    shown = () if members is None else members.shown
    sections = [
        _verdict(content),
        _forces(done, content, members, pictures.get("forces", b"")),
        _withdrawal(content["withdrawal"], pictures.get("withdrawal", b"")),
        members_section(done.result.fitted, members),
        _parameters(content),
        limits_section(content),
        _provenance(content),
    ]
    body = joined([_head(content), element("main", *sections), _foot(content), data("curves", drawable(done, shown))])
    return document(f"Calibration of {content['food'].lower()}", body, *assets())


def write_page(target: Path, page: str) -> None:
    """Write a page, whole or not at all.

    Args:
        target: The file.
        page: The HTML document.

    Raises:
        ReportError: It cannot be written.
    """
    try:
        write_atomic(target, page.encode("utf-8", "backslashreplace"))
    except OSError as e:
        raise ReportError(
            f"{target}: cannot be written ({e.strerror}); free the disk or the permission, then make the "
            "report again with cutcal report"
        ) from None


def _head(c: Data) -> Markup:
    """Food, trace and outcome, and where the parts of the page are."""
    parts = {"forces": "Forces", "members": "Members", "parameters": "Parameters", "limits": "What this does not show"}
    return stamped("Calibration of a cutting simulation", c["food"], c["trace"]["source"], c["passed"], parts)


def _verdict(c: Data) -> Markup:
    """What was identified, the sentence, the facts and the verdict table."""
    notices = [element("p", element("strong", head), " ", text, class_="notice") for head, text in c["banners"]]
    rows = [[v["name"], v["value"], v["limit"], mark(v["mark"]), v["note"]] for v in c["verdicts"]]
    return element(
        "section",
        element("h2", c["identified"]),
        *notices,
        element("p", c["sentence"]),
        pairs(c["facts"]),
        table(("Line", "Value", "Limit", "Verdict", "Note"), rows, (1, 2), id="verdicts", label="Verdict table"),
        id="verdict",
    )


def _forces(done: Finished, c: Data, members: Members | None, forces: bytes) -> Markup:
    """The chart, the way of its cursor, the choice of a member, and the switches of the curves."""
    paper = [picture(forces, PAPER)] if forces else []
    return element(
        "section",
        element("h2", "Force over stroke"),
        chart(FORCES),
        picker(done.result.fitted, members),
        element("div", legend(done, c["curves"]), hidden=True, id="legend"),
        element("noscript", element("p", "Without scripts this is the figure of report.pdf."), *paper),
        element("p", " ".join(c["errors"]), class_="note") if c["errors"] else None,
        id="forces",
    )  # fmt: skip


def _withdrawal(found: Data | None, drawn: bytes) -> Markup | None:
    """The way up, where it was fitted."""
    if found is None:
        return None
    return element(
        "section",
        element("h2", "The withdrawal of the blade"),
        element("p", found["told"]),
        picture(drawn, WITHDRAWAL) if drawn else None,
        pairs(found["rows"]),
        id="withdrawal",
    )


def _parameters(c: Data) -> Markup:
    """The fitted values, what the words mean, the posterior, and what cannot be told apart."""
    head = ("Parameter", "Value", "95 % interval", "Literature, 95 %", "Identifiability", "Kind of source")
    rows = []
    for p in c["parameters"]:
        name = joined([element("code", p["name"]), element("small", p["meaning"])])
        outside = joined([", ", element("em", "outside the literature’s range")]) if p["outside"] else None
        word = joined([p["verdict"], outside])
        rows.append([name, element("strong", p["value"]), p["interval"], p["literature"], word, p["status"]])
    words = [joined([element("em", word), f": {text}"]) for word, text in c["legend"]]
    alike = c["correlations"]
    none = "Not determined." if alike is None else "No two fitted parameters are correlated above 0.9 in magnitude."
    return element(
        "section",
        element("h2", "The fitted parameters"),
        table(head, rows, (1, 2, 3), id="values", label="Fitted parameters") if rows else "No parameter was fitted.",
        items(words, class_="note") if words else None,
        _posterior(c["posterior"]),
        element("h3", "Parameters that the trace cannot tell apart"),
        items(alike) if alike else element("p", none),
        id="parameters",
    )


def _posterior(p: Data | None) -> Markup | None:
    """The combinations and modes of a sampled posterior."""
    if p is None:
        return None
    modes = ("Mode", "Weight", "Log evidence", "Chi-square of its best simulated food")
    values = ("Parameter", *(f"Mode {m[0]}, median and 95 %" for m in p["modes"]))
    differ = f"Modes differ in {p['differ']}." if len(p["modes"]) > 1 and p["differ"] else None
    return joined([
        element("h3", "All foods that are plausible"),
        element("p", "The posterior was sampled over the whole of the literature’s ranges. h is the height."),
        table(("Combination", "Median", "95 % interval"), p["combinations"], (1,), label="Combinations"),
        table(modes, p["modes"], (1, 2, 3), label="Modes"),
        table(values, p["values"], label="Values in each mode"),
        element("p", differ) if differ else None,
        element("p", f"Posterior predictive p-value: {p['explained']}."),
    ])  # fmt: skip


def _provenance(c: Data) -> Markup:
    """Where the numbers come from."""
    o = c["provenance"]
    rows = [
        ("Trace, SHA-256", o["trace"]),
        ("Air run, SHA-256", o["air"] or "no air run"),
        ("Commit", o["commit"] or "not run from a checkout"),
        ("Seed, device", f"{o['seed']}, {o['device']}"),
        ("Versions", o["versions"]),
        ("Command", " ".join(o["command"])),
    ]
    return element("section", element("h2", "Provenance"), pairs(rows, "code"), id="provenance")


def _foot(c: Data) -> Markup:
    made = f"cutcal {c['cutcal']}, run of {c['created']}. Model, record, numerics and references are in "
    return element("footer", element("p", made, element("a", "report.pdf", href="report.pdf"), " of the same folder."))
