"""Figure and report of a verification: the error of each row over the error that it may have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, NullFormatter

from reports.base.brief import Brief, ReportPart, ReportTable
from reports.base.figures import BLACK, BLUE, GREY, svg
from reports.base.format import breakable, duration, plain
from reports.base.labels import capital
from reports.web.brief import publish_brief

if TYPE_CHECKING:
    from studies.verification.result import Comparison, Verification

ROW_HEIGHT = 4.2  # [mm]
LEAST_SHARE, LARGEST_SHARE = 1e-3, 1e2  # parts of the tolerance beyond these are drawn at them
NOT_SHOWN = (
    "That the equations are solved says nothing of whether they are a food's: that is what a calibration against "
    "measured cuts is for.",
    "The finite elements have the same laws as the particles, so an error of a law that both share is not seen; the "
    "laws have closed forms of their own.",
    "A tolerance is what the discretisation may cost on the cells of the case; other cells are the business of cutcal "
    "converge.",
)


def write_figure(result: Verification, out: Path) -> None:
    """Draw ``verify.svg`` into a folder."""
    names = [f"{row.case}: {row.quantity}" for row in result.rows]
    (out / "verify.svg").write_bytes(_picture(result.rows, names))


def write_report(result: Verification, out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``verify.json``.

    Args:
        result: The verification.
        out: Its folder.

    Returns:
        Path of the report.

    Raises:
        ReportError: The report cannot be written.
    """
    return publish_brief(out / "verify.json", _brief(result), result)


def _brief(result: Verification) -> Brief:
    """What the report holds."""
    rows, broken = result.rows, result.broken
    failed = sum(not row.passed for row in rows)
    said = (
        "All rows pass"
        if result.passed
        else _many(failed, "row") + (" fails" if failed == 1 else " fail")
        if failed
        else "No row fails, but not all cases ended"
    )
    groups = dict.fromkeys(row.group for row in rows)
    worst = [max((row for row in rows if row.group == group), key=lambda row: row.share) for group in groups]
    facts = [
        ("Cases", f"{len(result.seconds)}, {len(rows)} rows, {duration(sum(result.seconds.values()))} of work"),
        ("Versions of them", "coarse (--quick)" if result.quick else "whole"),
        ("Seed of the particles", str(result.seed)),
    ]
    parts = [
        ReportPart(
            "The worst row of each case",
            picture=_picture(worst, [f"{row.group}: {row.quantity}" for row in worst]),
            alt="Error of the worst row of each case over the error that it may have",
        )
    ]
    if broken:
        reasons = ReportTable(("Case", "Why"), ("50mm", "1fr"), [[name, why] for name, why in broken.items()], left=2)
        parts.append(ReportPart("Cases that broke down", table=reasons))
    for group in groups:
        own = [row for row in rows if row.group == group]
        sources = "; ".join(dict.fromkeys(capital(row.source) for row in own))
        parts.append(ReportPart(capital(group), f"Known from: {sources}.", table=_table(own), apart=len(parts) == 1))
    return Brief(
        kind="Verification of the solver",
        name="The solver and known answers",
        passed=result.passed,
        sentence=f"{said}, of {len(rows)}, against closed forms, conservation laws and finite elements of the same "
        "laws." + (f" {_many(len(broken), 'case')} broke down." if broken else ""),
        facts=facts,
        parts=parts,
        limits=NOT_SHOWN if not result.quick else (*NOT_SHOWN, "Coarse versions were run, and the fast cases alone."),
    )


def _many(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _table(rows: Sequence[Comparison]) -> ReportTable:
    head = ("Case", "Quantity", "Expected", "Got", "Error", "Allowed", "")
    lines = [
        [
            breakable(row.case), _raised(row.quantity), ("≥ " if row.least else "") + plain(row.expected, 4),
            _shown(row.got, 4), _shown(row.error, 2), plain(row.tolerance, 2), "yes" if row.passed else "no",
        ]
        for row in rows
    ]  # fmt: skip
    return ReportTable(head, ("1fr", "1fr", "auto", "auto", "auto", "auto", "20mm"), lines, marked=6, left=2)


def _shown(x: float, digits: int) -> str:
    return plain(x, digits) if math.isfinite(x) else "–"


def _raised(text: str) -> str:
    """A quantity with its unit's powers as people write them."""
    return breakable(text.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"))


def _picture(rows: Sequence[Comparison], names: Sequence[str]) -> bytes:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, row in enumerate(rows):
            x = min(max(row.share, LEAST_SHARE), LARGEST_SHARE)
            marker, size, color = ("o", 4, BLUE) if row.passed else ("X", 7, BLACK)
            axes.plot(x, k, marker, ms=size, color=color)
        axes.axvline(1.0, color=GREY, lw=1)
        axes.set(xscale="log", xlim=(LEAST_SHARE / 1.5, LARGEST_SHARE * 1.5), ylim=(len(rows) - 0.5, -0.5))
        axes.set_yticks(range(len(rows)), names, fontsize=6)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("error over the error allowed (crosses fail)")
        axes.grid(axis="x", color=GREY, lw=0.3)

    return svg(draw, 25 + ROW_HEIGHT * len(rows))
