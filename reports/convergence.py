"""Figure and report of a convergence study: the force on every grid, peak and work over the cell size, order and uncertainty."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports import ReportError
from reports.base.brief import AGAIN, Brief, Part, Table, write_brief
from reports.base.figures import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, RED, SKY, stroke_axis, svg
from reports.base.format import count, duration, listed, quantity
from reports.base.labels import capital, words
from reports.base.run_folder import Data

ESTIMATED = {"work": "J", "peak": "N"}
AXES = {
    "safety": "time step over its limit",
    "mach": "speed of the blade over the P-wave's",
    "ppc": "particles per cell and direction",
    "offset": "place of the blade in the grid [cells]",
    "repeat": "other particles, grid elsewhere (runs)",
}
ALT = "Force over stroke on every grid with the numerical uncertainty, and peak and work over the cell size against the finest grid"
ESTIMATES = (
    "Order from the three finest grids; grid convergence index (GCI) with a factor of safety after Roache, which is 1.25 where the order is as "
    "expected and 3 elsewhere; uncertainty of the finest grid by least squares over all grids (Eça and Hoekstra 2014). A trend that is smaller than "
    "what other particles change is called noise-limited: it has no order."
)
APART = "Each is varied with all else as on the coarsest grid, repeats on the second; peak and work are within so much of their mean."
LIMITS = (
    "The work on all grids is that of the same laws: whether these are the food's is not asked here.",
    "The specimen has one size: what a longer or wider one would need is not in the uncertainty.",
    "A smaller cell does not make a better food: the values were those of one default or calibrated material.",
)

LOOKS: tuple[dict[str, Any], ...] = (
    {"color": BLACK, "lw": 1.6},
    {"color": RED, "lw": 1.2, "dashes": (4.5, 1.4)},
    {"color": BLUE, "lw": 1.0, "dashes": (1.2, 1.2)},
    {"color": GREEN, "lw": 1.0, "dashes": (7.0, 1.6, 1.2, 1.6)},
    {"color": ORANGE, "lw": 0.9, "dashes": (2.5, 1.0)},
    {"color": SKY, "lw": 0.9},
)


def write_figure(out: Path) -> None:
    """Draw converge.svg from converge.json and curves.csv in ``out``."""
    document = json.loads((out / "converge.json").read_text(encoding="utf-8"))
    (out / "converge.svg").write_bytes(_picture(document, pd.read_csv(out / "curves.csv")))


def write_report(out: Path) -> Path:
    """Write report.pdf from converge.json and curves.csv in ``out``.

    Raises:
        ReportError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    try:
        curves = pd.read_csv(out / "curves.csv")
    except (OSError, ValueError) as e:
        raise ReportError(f"{out / 'curves.csv'}: cannot be read ({e}); {AGAIN}") from None
    return write_brief(out / "converge.json", lambda document: _brief(document, curves))


def _brief(d: Data, curves: pd.DataFrame) -> Brief:
    """What the report holds."""
    limits = ", ".join(f"{name} within {quantity(d['limits'][name], 'fraction', digits=None)}" for name in ESTIMATED)
    verdicts = listed([f"{name} {d[name]['verdict']}" for name in ESTIMATED])
    said = "Converged" if d["converged"] else "Not converged"
    size = " × ".join(quantity(d["shape"][k], "m") for k in ("length", "width", "height"))
    return Brief(
        kind="Convergence of a simulated cut",
        name=str(d["food"]).replace("_", " ").capitalize(),
        passed=bool(d["converged"]),
        sentence=f"{said}: between the two finest grids {_changes(d)}. Trend over the grids: {verdicts}.",
        facts=[
            ("Knife", str(d["knife"])),
            ("Food", f"{words(d['shape']['kind'])}, {size} (across the blade, along it, height)"),
            ("Passed where", f"between the two finest grids {limits}"),
        ],
        parts=[
            Part("Force on every grid", picture=_picture(d, curves), alt=ALT, table=_grids(d)),
            Part("Order and uncertainty", ESTIMATES, table=_estimates(d)),
            *([Part("Apart from the grid", APART, table=_apart(d))] if _spreads(d) else []),
        ],
        limits=[*LIMITS, *_not_run(d)],
        warnings=[capital(text) for text in d["warnings"]],
    )


def _changes(d: Data) -> str:
    return listed(
        [f"{name} changes by {quantity(d[name]['change'], 'fraction', digits=2, signed=True)}" for name in ESTIMATED]
    )


def _grids(d: Data) -> Table:
    rows = []
    for g in d["grids"]:
        cell = quantity(g["dx_m"], "m")
        if g["status"] != "ok":
            rows.append([cell, f"broke down: {words(g['reason'])}", "", "", "", "", ""])
            continue
        rows.append([
            cell, quantity(g["peak_N"], "N", digits=4), quantity(g["work_J"], "J", digits=4), count(g["particles"]),
            count(g["steps"]), quantity(g["momentum_residual"], "fraction"), duration(g["wall_s"]),
        ])  # fmt: skip
    head = ("Cell", "Peak", "Work", "Particles", "Time steps", "Momentum left over", "Run time")
    return Table(head, ("1fr", *["auto"] * 6), rows)


def _estimates(d: Data) -> Table:
    rows = [
        [
            name.capitalize(), d[name]["verdict"], quantity(d[name]["order"], "-"),
            quantity(d[name]["gci"], "fraction", digits=2), quantity(d[name]["gci_coarsest"], "fraction", digits=2),
            quantity(d[name]["uncertainty"], "fraction", digits=2), quantity(d[name]["fitted"], unit, digits=4),
        ]
        for name, unit in ESTIMATED.items()
    ]  # fmt: skip
    curve = [quantity(d[k], unit, digits=2) for k, unit in (("order_curve", "-"), ("gci_curve_median", "fraction"))]
    rows.append(["Curve, median", "", *curve, "", "", ""])
    rows.append(["Curve, largest", "", "", quantity(d["gci_curve_max"], "fraction", digits=2), "", "", ""])
    head = ("", "Trend", "Order", "GCI", "GCI, coarsest", "Uncertainty", "Limit of the fit")
    return Table(head, ("1fr", *["auto"] * 6), rows, left=2)


def _spreads(d: Data) -> list[str]:
    return [axis for axis in AXES if d.get(axis) is not None and "spread_work" in d[axis]]


def _apart(d: Data) -> Table:
    rows = []
    for axis in _spreads(d):
        tried = [row[axis] for row in d[axis]["rows"] if row["status"] == "ok"]
        values = f"{len(tried) - 1}" if axis == "repeat" else listed([f"{v:g}" for v in tried])
        spread = [quantity(d[axis][f"spread_{name}"], "fraction", digits=2) for name in ("peak", "work")]
        rows.append([AXES[axis], values, *spread])
    return Table(
        ("What is varied", "Values", "Peak within", "Work within"), ("1fr", "auto", "auto", "auto"), rows, left=2
    )


def _not_run(d: Data) -> list[str]:
    absent = [words for axis, words in AXES.items() if axis not in _spreads(d) and axis != "repeat"]
    return [f"Not varied here: {listed(absent)}."] if absent else []


def _picture(document: Data, curves: pd.DataFrame) -> bytes:
    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=[1.6, 1.0])
        _forces(left, curves, document)
        _numbers(right, document)
        figure.legend(loc="outside upper left", ncols=4)

    return svg(draw, 78.0)


def _forces(axes: Axes, curves: pd.DataFrame, document: dict[str, Any]) -> None:
    x = 1e3 * curves["stroke_m"].to_numpy()
    cells = sorted(g["dx_m"] for g in document["grids"] if g["status"] == "ok")
    finest = curves[f"force_dx_{cells[0]:g}_N"]
    axes.fill_between(
        x,
        finest - 2 * curves["u_num_N"],
        finest + 2 * curves["u_num_N"],
        facecolor=LIGHT,
        edgecolor=GREY,
        hatch="////",
        lw=0.0,
        label="numerical uncertainty (95 %)",
    )
    for dx, look in zip(cells, LOOKS * (1 + len(cells) // len(LOOKS)), strict=False):
        axes.plot(x, curves[f"force_dx_{dx:g}_N"], label=f"{1e3 * dx:g} mm", **look)
    axes.set_ylabel("force on the knife [N]")
    stroke_axis(axes, x)


def _numbers(axes: Axes, document: dict[str, Any]) -> None:
    """Peak and work over those of the finest grid, and where the least-squares fit ends."""
    good = sorted((g for g in document["grids"] if g["status"] == "ok"), key=lambda g: g["dx_m"])
    for name, column, marker, color in (("work", "work_J", "o", BLACK), ("peak", "peak_N", "^", BLUE)):
        base = good[0][column]
        axes.plot(
            [1e3 * g["dx_m"] for g in good],
            [100 * (g[column] / base - 1) for g in good],
            marker=marker,
            ms=4,
            lw=0.9,
            color=color,
            label=name,
        )
        limit = document[name]["fitted"] or document[name]["extrapolated"]
        if limit is not None:
            axes.plot([0.0], [100 * (limit / base - 1)], marker=marker, ms=5, mfc="none", color=color, ls="none")
    axes.axhline(0.0, color=BLACK, lw=0.5)
    axes.set_xlim(left=-0.1)
    axes.set_xlabel("cell [mm]; open marks: extrapolated")
    axes.set_ylabel("against the finest grid [%]")
