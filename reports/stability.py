"""Figure and report of a stability map: four planes of pairs, and a list of all other cells."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from reports.base.brief import Brief, Part, Table, write_brief
from reports.base.figures import BLACK, BLUE, GREEN, GREY, ORANGE, RED, svg
from reports.base.format import breakable, duration, quantity
from reports.base.labels import capital, words
from reports.base.run_folder import Data

PLANES = {
    "E and nu": ("E_Pa", "nu", "stiffness [Pa]", "Poisson's ratio"),
    "E and R": ("E_Pa", "R_over_E_m", "stiffness [Pa]", "resistance / stiffness [m]"),
    "dt and dx": ("dt_over_limit", "dx_m", "time step / its limit", "cell [m]"),
    "dt and nu": ("dt_over_limit", "nu", "time step / its limit", "Poisson's ratio"),
}
LOOKS: dict[str, dict[str, Any]] = {
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
ALT = "Runs over stiffness and Poisson's ratio, stiffness and resistance, time step and cell, time step and Poisson's ratio, and all others"
MAP = "A mark for each run; marks in a circle should be stable and are not. Framed cells are refused; where a mark is in the frame they were run in spite of that."
AUDITED = ("momentum_residual", "energy_gain")
BALANCES = "Momentum that does not balance, over the largest force; energy that came from nothing, over the work that was put in."
LIMITS = (
    "Cells are small cuts of simple blocks: a large food of odd shape may break down where none of these does.",
    "Stable is not accurate: that is the business of cutcal verify and cutcal converge.",
    "Between the values that were tried nothing is known.",
)
COLUMNS = 3
LINE = 3.4  # height of a line of the list [mm]


def write_figure(out: Path) -> None:
    """Draw stress.svg from stress.json in ``out``."""
    cells = json.loads((out / "stress.json").read_text(encoding="utf-8"))["cells"]
    (out / "stress.svg").write_bytes(_picture(cells))


def write_report(out: Path) -> Path:
    """Write report.pdf from stress.json in ``out``.

    Raises:
        ReportError: The file is missing, damaged or incomplete, or the report cannot be written.
    """
    return write_brief(out / "stress.json", _brief)


def _brief(d: Data) -> Brief:
    """What the report holds."""
    physical, cells, limits = d["physical"], d["cells"], d["limits"]
    stable = f"{physical['stable']} of {physical['cells']} cells that are physical and below {limits['dt_over_limit']:g} of the time step's limit are stable"
    rest = (
        "all others ended for a named reason" if not d["unexplained"] else f"{d['unexplained']} cells are unexplained"
    )
    named = [c for c in cells if c["status"] == "unexplained" or c["name"] in physical["not_stable"]]
    parts = [
        Part("How the runs ended", table=_ends(d)),
        Part("Cells that failed", table=_failed(named)) if named else Part("Cells that failed", "None."),
        Part("Balances of the stable runs", BALANCES, table=_balances(cells)),
        Part("The map", MAP, _picture(cells), ALT, apart=True),
    ]
    return Brief(
        kind="Stability of the solver",
        name="Where the solver is stable",
        passed=bool(d["passed"]),
        sentence=f"{capital(stable)}, and {rest}.",
        facts=[
            ("Cells", str(len(cells))),
            ("Seed of the particles", str(d["seed"])),
            (
                "A run ends by itself",
                f"after {limits['particle_steps']:.3g} particle steps or {duration(limits['time_s'])}",
            ),
        ],
        parts=parts,
        limits=LIMITS,
    )


def _ends(d: Data) -> Table:
    reasons = {"stable": "reached the end; momentum and energy balance", **d["reasons"]}
    order = sorted(d["counts"].items(), key=lambda item: -item[1])
    rows = [[words(reason), reasons.get(reason, ""), str(count)] for reason, count in order]
    return Table(("End", "Meaning", "Cells"), ("36mm", "1fr", "16mm"), rows, left=2)


def _failed(cells: list[Data]) -> Table:
    rows = [[breakable(c["name"]), words(c["reason"] or c["status"]), capital(str(c["message"]))] for c in cells]
    return Table(("Cell", "End", "Why"), ("60mm", "30mm", "1fr"), rows, left=3)


def _balances(cells: list[Data]) -> Table:
    """Worst balances of each family's stable runs."""
    rows = []
    for family in dict.fromkeys(c["family"] for c in cells):
        own = [c for c in cells if c["family"] == family and c["status"] == "stable"]
        if own:
            worst = [max((abs(c[k]) for c in own if c.get(k) is not None), default=None) for k in AUDITED]
            rows.append([words(family), str(len(own)), *(quantity(w, "fraction", digits=2) for w in worst)])
    return Table(
        ("Family", "Stable runs", "Momentum, largest", "Energy gain, largest"), ("1fr", "auto", "auto", "auto"), rows
    )


def _picture(cells: list[Data]) -> bytes:
    others = [c for c in cells if c["family"] not in PLANES]
    rows = max(math.ceil(len(others) / COLUMNS), 1)

    def draw(figure: Figure) -> None:
        panels = figure.subplot_mosaic(
            [["E and nu", "E and R"], ["dt and dx", "dt and nu"], ["rest", "rest"]],
            height_ratios=[1.0, 1.0, LINE * rows / 52.0],
        )
        for family, plane in PLANES.items():
            _plane(panels[family], [c for c in cells if c["family"] == family], *plane)
        _list(panels["rest"], others, rows)
        seen = {_look(c) for c in cells}
        marks = [_mark(name) for name in LOOKS if name in seen]
        marks.append(
            Line2D([], [], marker="o", ls="none", ms=9.0, mfc="none", mec=BLACK, label="must be stable, is not")
        )
        figure.legend(handles=marks, loc="outside upper left", ncols=6, handlelength=1.2)

    return svg(draw, 118.0 + LINE * rows)


def _look(cell: dict[str, Any]) -> str:
    """Name of the mark of a cell."""
    if cell["status"] == "stopped":
        return str(cell["reason"])
    return str(cell["status"])


def _mark(name: str) -> Line2D:
    """Entry of the legend."""
    return Line2D([], [], ls="none", label=name.replace("_", " "), **{"ms": 4.5, **LOOKS[name]})


def _put(axes: Axes, x: float, y: float, cell: dict[str, Any]) -> None:
    """Mark of a cell; a ring where it must be stable and is not."""
    axes.plot(x, y, ls="none", clip_on=False, zorder=3, **{"ms": 4.5, **LOOKS[_look(cell)]})
    if cell["physical"] and cell["status"] != "stable":
        axes.plot(x, y, "o", ms=9.0, mfc="none", mec=BLACK, clip_on=False)


def _plane(axes: Axes, cells: list[dict[str, Any]], x: str, y: str, x_label: str, y_label: str) -> None:
    """All cells of a pair, at equal distances."""
    across, up = (sorted({c[name] for c in cells}) for name in (x, y))
    for cell in cells:
        _put(axes, across.index(cell[x]), up.index(cell[y]), cell)
    axes.set_xticks(range(len(across)), [f"{v:g}" for v in across])
    axes.set_yticks(range(len(up)), [f"{v:g}" for v in up])
    axes.set_xlim(-0.6, max(len(across), 1) - 0.4)
    axes.set_ylim(-0.6, max(len(up), 1) - 0.4)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)


def _list(axes: Axes, cells: list[dict[str, Any]], rows: int) -> None:
    """All other cells by name."""
    axes.set_axis_off()
    axes.set_xlim(0.0, COLUMNS)
    axes.set_ylim(rows - 0.5, -0.5)
    for k, cell in enumerate(cells):
        column, line = divmod(k, rows)
        _put(axes, column + 0.03, line, cell)
        axes.text(column + 0.06, line, cell["name"], va="center", fontsize=6.0)
