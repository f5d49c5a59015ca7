"""The figure of a verification: the error of each row over the error that it may have."""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, NullFormatter

from reports.figures import BLACK, BLUE, GREY, svg

ROW_HEIGHT = 4.2  # [mm]
FLOOR = 1e-3  # smaller parts of the tolerance are drawn here
SHOWN = 1e2  # larger ones here


def write_figure(out: Path) -> None:
    """Draw verify.svg from verify.json in ``out``."""
    rows = json.loads((out / "verify.json").read_text(encoding="utf-8"))["rows"]

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, row in enumerate(rows):
            allowed = row["tolerance"] or abs(row["expected"]) or 1.0
            error = SHOWN * allowed if row["error"] is None else row["error"]
            part = abs(error) / allowed if not row["least"] else max(-error, 0.0) / allowed
            x = min(max(part, FLOOR), SHOWN)
            axes.plot(
                x,
                k,
                "o" if row["passed"] else "X",
                ms=4 if row["passed"] else 7,
                color=BLUE if row["passed"] else BLACK,
            )
        axes.axvline(1.0, color=GREY, lw=1)
        axes.set(xscale="log", xlim=(FLOOR / 1.5, SHOWN * 1.5), ylim=(len(rows) - 0.5, -0.5))
        axes.set_yticks(range(len(rows)), [f"{row['case']}: {row['quantity']}" for row in rows], fontsize=6)
        axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("error over the error allowed (crosses fail)")
        axes.grid(axis="x", color=GREY, lw=0.3)

    (out / "verify.svg").write_bytes(svg(draw, 25 + ROW_HEIGHT * len(rows)))
