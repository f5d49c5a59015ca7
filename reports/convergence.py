"""The figure of a convergence study: the force on every grid, and peak and work over the cell size."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.figures import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, RED, SKY, stroke_axis, svg

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
    curves = pd.read_csv(out / "curves.csv")

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=[1.6, 1.0])
        _forces(left, curves, document)
        _numbers(right, document)
        figure.legend(loc="outside upper left", ncols=4)

    (out / "converge.svg").write_bytes(svg(draw, 78.0))


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
