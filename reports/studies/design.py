"""The figure of a design: what is left of each interval after each test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from reports.base.figures import BLACK, GREY, RED, svg

if TYPE_CHECKING:
    from calib.design.result import DesignResult

ROW = 11.0  # height of a test [mm]
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "*")


def write_figure(result: DesignResult, out: Path) -> None:
    """Draw ``design.svg`` into a folder.

    Args:
        result: The design.
        out: The folder.
    """
    (out / "design.svg").write_bytes(svg(lambda figure: draw(figure, result), 24.0 + ROW * (len(result.tests) + 1)))


def draw(figure: Figure, result: DesignResult) -> None:
    """Fill a figure: a row for each test, a mark for each parameter, and a cross for what was asked for.

    Args:
        figure: The figure.
        result: The design.
    """
    axes = figure.subplots()
    names = list(result.known)
    rows = np.arange(len(result.tests))
    for k, name in enumerate(names):
        parts = [test.parameters[name].part for test in result.tests]
        marked: dict[str, Any] = {
            "color": RED if name == result.asked else GREY,
            "marker": MARKS[k % len(MARKS)],
            "ls": "none",
        }
        axes.plot(parts, rows, ms=4.5, label=name, **marked)
    if result.quantity is not None:
        parts = [1.0 if test.asked is None else test.asked.part for test in result.tests]
        axes.plot(parts, rows, color=RED, marker="x", ms=6.0, ls="none", label=result.asked)
    axes.axvline(1.0, color=BLACK, lw=0.6)
    axes.set_yticks(rows, [f"{test.name}, {test.minutes:g} min" for test in result.tests])
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.05)
    axes.set_xlabel("expected width of the 95 % interval over the present one")
    figure.legend(loc="outside upper left", ncols=5)
