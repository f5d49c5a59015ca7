"""Figure and report of a stability map: four planes of pairs, and a list of all other cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reports import ReportError
from reports.base.brief import AGAIN, Brief, ReportPart, ReportTable
from reports.base.figures import BLACK, BLUE, GREEN, GREY, ORANGE, RED, svg
from reports.base.format import breakable, duration, quantity
from reports.base.labels import capital, in_words
from reports.web.brief import publish_brief

if TYPE_CHECKING:
    from studies.stability.result import CellResult, StabilityMap

PLANES = {
    "E and nu": ("E_Pa", "nu", "stiffness [Pa]", "Poisson's ratio"),
    "E and R": ("E_Pa", "R_over_E_m", "stiffness [Pa]", "resistance / stiffness [m]"),
    "dt and dx": ("dt_over_limit", "dx_m", "time step / its limit", "cell [m]"),
    "dt and nu": ("dt_over_limit", "nu", "time step / its limit", "Poisson's ratio"),
}
MARKERS: dict[str, dict[str, Any]] = {
    "stable": {"marker": "o", "color": GREEN},
    "inverted": {"marker": "v", "color": RED},
    "left_grid": {"marker": ">", "color": RED},
    "not_finite": {"marker": "X", "color": RED},
    "energy_growth": {"marker": "^", "color": ORANGE},
    "momentum": {"marker": "P", "color": ORANGE},
    "too_long": {"marker": "s", "color": BLUE},
    "worker_died": {"marker": "*", "color": BLUE},
    "refused": {"marker": "s", "mfc": "none", "mec": GREY, "color": GREY, "ms": 7.5},
    "unexplained": {"marker": "D", "color": BLACK},
}
FIGURE_ALT = (
    "Runs over stiffness and Poisson's ratio, stiffness and resistance, time step and cell, time step and Poisson's "
    "ratio, and all others"
)
MAP = (
    "A mark for each run; marks in a circle should be stable and are not. Framed cells are refused; where a mark is in "
    "the frame they were run in spite of that."
)
BALANCES = (
    "Momentum that does not balance, over the largest force; energy that came from nothing, over the work "
    "that was put in."
)
NOT_SHOWN = (
    "Cells are small cuts of simple blocks: a large food of odd shape may break down where none of these does.",
    "Stable is not accurate: that is the business of cutcal verify and cutcal converge.",
    "Between the values that were tried nothing is known.",
)
LIST_COLUMNS = 3
LINE = 3.4  # height of a line of the list [mm]


def write_figure(cells: Sequence[CellResult], out: Path) -> None:
    """Draw ``stress.svg`` of the cells into a folder."""
    (out / "stress.svg").write_bytes(_picture(cells))


def write_report(result: StabilityMap, out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``stress.json``.

    Args:
        result: The finished map.
        out: Its folder.

    Returns:
        Path of the report.

    Raises:
        ReportError: The report cannot be written.
    """
    return publish_brief(out / "stress.json", _brief(result), result)


def _brief(result: StabilityMap) -> Brief:
    """What the report holds."""
    physical, limits = result.physical, result.limits
    stable = (
        f"{physical.stable} of {physical.cells} cells that are physical and below {limits.dt_over_limit:g} of the time "
        "step's limit are stable"
    )
    rest = (
        "all others ended for a named reason"
        if not result.unexplained
        else f"{result.unexplained} cells are unexplained"
    )
    failed = [c for c in result.cells if c.status == "unexplained" or c.name in physical.not_stable]
    parts = [
        ReportPart("How the runs ended", table=_ends(result)),
        ReportPart("Cells that failed", table=_failed(failed)) if failed else ReportPart("Cells that failed", "None."),
        ReportPart("Balances of the stable runs", BALANCES, table=_balances(result.cells)),
        ReportPart("The map", MAP, _picture(result.cells), FIGURE_ALT, apart=True),
    ]
    longest = f"after {limits.particle_steps:.3g} particle steps or {duration(limits.time_s)}"
    return Brief(
        kind="Stability of the solver",
        name="Where the solver is stable",
        passed=result.passed,
        sentence=f"{capital(stable)}, and {rest}.",
        facts=[
            ("Cells", str(len(result.cells))),
            ("Seed of the particles", str(result.seed)),
            ("A run ends by itself", longest),
        ],
        parts=parts,
        limits=NOT_SHOWN,
    )


def _ends(result: StabilityMap) -> ReportTable:
    reasons = {"stable": "reached the end; momentum and energy balance", **result.reasons}
    order = sorted(result.counts.items(), key=lambda item: -item[1])
    rows = [[in_words(reason), reasons.get(reason, ""), str(count)] for reason, count in order]
    return ReportTable(("End", "Meaning", "Cells"), ("36mm", "1fr", "16mm"), rows, left=2)


def _failed(cells: Sequence[CellResult]) -> ReportTable:
    rows = [[breakable(c.name), in_words(c.reason or c.status), capital(c.message)] for c in cells]
    return ReportTable(("Cell", "End", "Why"), ("60mm", "30mm", "1fr"), rows, left=3)


def _balances(cells: Sequence[CellResult]) -> ReportTable:
    """Worst balances of each family's stable runs."""
    rows = []
    for family in dict.fromkeys(c.family for c in cells):
        own = [c for c in cells if c.family == family and c.stable]
        if own:
            momenta = [abs(c.momentum_residual) for c in own if c.momentum_residual is not None]
            gains = [abs(c.energy_gain) for c in own if c.energy_gain is not None]
            worst = [quantity(max(found, default=None), "fraction", digits=2) for found in (momenta, gains)]
            rows.append([in_words(family), str(len(own)), *worst])
    head = ("Family", "Stable runs", "Momentum, largest", "Energy gain, largest")
    return ReportTable(head, ("1fr", "auto", "auto", "auto"), rows)


def _picture(cells: Sequence[CellResult]) -> bytes:
    others = [c for c in cells if c.family not in PLANES]
    rows = max(math.ceil(len(others) / LIST_COLUMNS), 1)

    def draw(figure: Figure) -> None:
        panels = figure.subplot_mosaic(
            [["E and nu", "E and R"], ["dt and dx", "dt and nu"], ["rest", "rest"]],
            height_ratios=[1.0, 1.0, LINE * rows / 52.0],
        )
        for family, plane in PLANES.items():
            _draw_plane(panels[family], [c for c in cells if c.family == family], plane)
        _draw_list(panels["rest"], others, rows)
        seen = {_mark_name(c) for c in cells}
        marks = [_legend_entry(name) for name in MARKERS if name in seen]
        marks.append(
            Line2D([], [], marker="o", ls="none", ms=9.0, mfc="none", mec=BLACK, label="must be stable, is not")
        )
        figure.legend(handles=marks, loc="outside upper left", ncols=6, handlelength=1.2)

    return svg(draw, 118.0 + LINE * rows)


def _mark_name(cell: CellResult) -> str:
    """Name of the mark of a cell."""
    return cell.reason if cell.status == "stopped" else cell.status


def _legend_entry(name: str) -> Line2D:
    return Line2D([], [], ls="none", label=name.replace("_", " "), **{"ms": 4.5, **MARKERS[name]})


def _draw_mark(axes: Axes, x: float, y: float, cell: CellResult) -> None:
    """Mark of a cell; a ring where it must be stable and is not."""
    axes.plot(x, y, ls="none", clip_on=False, zorder=3, **{"ms": 4.5, **MARKERS[_mark_name(cell)]})
    if cell.physical and not cell.stable:
        axes.plot(x, y, "o", ms=9.0, mfc="none", mec=BLACK, clip_on=False)


def _draw_plane(axes: Axes, cells: Sequence[CellResult], plane: tuple[str, str, str, str]) -> None:
    """All cells of a pair of values, at equal distances."""
    x, y, x_label, y_label = plane
    across, up = (sorted({_number(c, name) for c in cells}) for name in (x, y))
    for cell in cells:
        _draw_mark(axes, across.index(_number(cell, x)), up.index(_number(cell, y)), cell)
    axes.set_xticks(range(len(across)), [f"{v:g}" for v in across])
    axes.set_yticks(range(len(up)), [f"{v:g}" for v in up])
    axes.set_xlim(-0.6, max(len(across), 1) - 0.4)
    axes.set_ylim(-0.6, max(len(up), 1) - 0.4)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)


def _number(cell: CellResult, name: str) -> float:
    """A number that is varied in a cell."""
    value = cell.values.get(name)
    if not isinstance(value, (int, float)):
        raise ReportError(f"stress.json: {cell.name} has no number {name}; {AGAIN}")
    return value


def _draw_list(axes: Axes, cells: Sequence[CellResult], rows: int) -> None:
    """All other cells by name."""
    axes.set_axis_off()
    axes.set_xlim(0.0, LIST_COLUMNS)
    axes.set_ylim(rows - 0.5, -0.5)
    for k, cell in enumerate(cells):
        column, line = divmod(k, rows)
        _draw_mark(axes, column + 0.03, line, cell)
        axes.text(column + 0.06, line, cell.name, va="center", fontsize=6.0)
