"""Figure and report of a verification: the error of each row over the error that it may have."""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, NullFormatter

from reports.base.brief import Brief, Part, Table, write_brief
from reports.base.figures import BLACK, BLUE, GREY, svg
from reports.base.format import breakable, duration, plain
from reports.base.labels import capital
from reports.base.run_folder import Data

ROW_HEIGHT = 4.2  # [mm]
FLOOR = 1e-3  # smaller parts of the tolerance are drawn here
SHOWN = 1e2  # larger ones here
LIMITS = (
    "That the equations are solved says nothing of whether they are a food's: that is what a calibration against measured cuts is for.",
    "The finite elements have the same laws as the particles, so an error of a law that both share is not seen; the laws have closed forms of "
    "their own.",
    "A tolerance is what the discretisation may cost on the cells of the case; other cells are the business of cutcal converge.",
)


def write_figure(out: Path) -> None:
    """Draw verify.svg from verify.json in ``out``."""
    rows = json.loads((out / "verify.json").read_text(encoding="utf-8"))["rows"]
    (out / "verify.svg").write_bytes(_picture(rows, [f"{row['case']}: {row['quantity']}" for row in rows]))


def write_report(out: Path) -> Path:
    """Write report.pdf from verify.json in ``out``.

    Raises:
        ReportError: The file is missing, damaged or incomplete, or the report cannot be written.
    """
    return write_brief(out / "verify.json", _brief)


def _brief(d: Data) -> Brief:
    """What the report holds."""
    rows, broken = d["rows"], d["broken"]
    failed = sum(not row["passed"] for row in rows)
    said = (
        "All rows pass"
        if d["passed"]
        else _many(failed, "row") + (" fails" if failed == 1 else " fail")
        if failed
        else "No row fails, but not all cases ended"
    )
    worst = [max((r for r in rows if r["group"] == g), key=part) for g in dict.fromkeys(r["group"] for r in rows)]
    facts = [
        ("Cases", f"{len(d['seconds'])}, {len(rows)} rows, {duration(sum(d['seconds'].values()))} of work"),
        ("Versions of them", "coarse (--quick)" if d["quick"] else "whole"),
        ("Seed of the particles", str(d["seed"])),
    ]
    parts = [
        Part(
            "The worst row of each case",
            picture=_picture(worst, [f"{row['group']}: {row['quantity']}" for row in worst]),
            alt="Error of the worst row of each case over the error that it may have",
        )
    ]
    if broken:
        rows_of = [[name, str(why)] for name, why in broken.items()]
        parts.append(Part("Cases that broke down", table=Table(("Case", "Why"), ("50mm", "1fr"), rows_of, left=2)))
    for group in dict.fromkeys(row["group"] for row in rows):
        own = [row for row in rows if row["group"] == group]
        sources = "; ".join(dict.fromkeys(capital(str(row["source"])) for row in own))
        parts.append(Part(capital(group), f"Known from: {sources}.", table=_table(own), apart=len(parts) == 1))
    return Brief(
        kind="Verification of the solver",
        name="The solver and known answers",
        passed=bool(d["passed"]),
        sentence=f"{said}, of {len(rows)}, against closed forms, conservation laws and finite elements of the same laws."
        + (f" {_many(len(broken), 'case')} broke down." if broken else ""),
        facts=facts,
        parts=parts,
        limits=LIMITS if not d["quick"] else (*LIMITS, "Coarse versions were run, and the fast cases alone."),
    )


def _many(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def part(row: Data) -> float:
    """Error of a row over the error that it may have [-]."""
    allowed = row["tolerance"] or abs(row["expected"]) or 1.0
    error = SHOWN * allowed if row["error"] is None else row["error"]
    return float(abs(error) / allowed if not row["least"] else max(-error, 0.0) / allowed)


def _table(rows: list[Data]) -> Table:
    head = ("Case", "Quantity", "Expected", "Got", "Error", "Allowed", "")
    lines = [
        [
            breakable(row["case"]), _raised(row["quantity"]), ("≥ " if row["least"] else "") + plain(row["expected"], 4),
            "–" if row["got"] is None else plain(row["got"], 4), "–" if row["error"] is None else plain(row["error"], 2),
            plain(row["tolerance"], 2), "yes" if row["passed"] else "no",
        ]
        for row in rows
    ]  # fmt: skip
    return Table(head, ("1fr", "1fr", "auto", "auto", "auto", "auto", "20mm"), lines, marked=6, left=2)


def _raised(text: str) -> str:
    """A quantity with its unit's powers as people write them."""
    return breakable(text.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"))


def _picture(rows: list[Data], names: list[str]) -> bytes:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, row in enumerate(rows):
            x = min(max(part(row), FLOOR), SHOWN)
            look = ("o", 4, BLUE) if row["passed"] else ("X", 7, BLACK)
            axes.plot(x, k, look[0], ms=look[1], color=look[2])
        axes.axvline(1.0, color=GREY, lw=1)
        axes.set(xscale="log", xlim=(FLOOR / 1.5, SHOWN * 1.5), ylim=(len(rows) - 0.5, -0.5))
        axes.set_yticks(range(len(rows)), names, fontsize=6)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("error over the error allowed (crosses fail)")
        axes.grid(axis="x", color=GREY, lw=0.3)

    return svg(draw, 25 + ROW_HEIGHT * len(rows))
