"""The figure of prior predictives: one small panel for each food."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from reports.base.figures import BLACK, RED, svg

COLUMNS = 4
PANEL = 34.0  # height of a panel [mm]
WIDE, NARROW = "#dcdcdc", "#b0b0b0"
DEFAULT: dict[str, Any] = {"color": RED, "lw": 1.4, "dashes": (4.5, 1.4)}


def write_figure(out: Path) -> None:
    """Draw prior.svg from prior.json and the foods' CSV files in ``out``."""
    names = foods(out)
    (out / "prior.svg").write_bytes(svg(lambda figure: draw(figure, out, names), height(names)))


def foods(folder: Path) -> list[str]:
    """Names of the foods in a folder, in their order."""
    return list(json.loads((folder / "prior.json").read_text(encoding="utf-8"))["foods"])


def height(names: Sequence[str]) -> float:
    """Height of the figure of these foods [mm]."""
    return 14.0 + PANEL * math.ceil(len(names) / COLUMNS)


def draw(figure: Figure, folder: Path, names: Sequence[str]) -> None:
    """Fill a figure with a panel for each food: bands of 95 and 50 % of the draws, their median, the default values.

    Args:
        figure: The figure.
        folder: Folder with a CSV file of each food.
        names: The foods.
    """
    columns = min(COLUMNS, len(names))
    rows = math.ceil(len(names) / columns)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes, name in zip(panels, names, strict=False):
        _panel(axes, name, pd.read_csv(folder / f"{name}.csv", comment="#"))
    for axes in panels[len(names) :]:
        axes.set_axis_off()
    figure.supxlabel("stroke [mm]", fontsize=7.5)
    figure.supylabel("force on the knife [N]", fontsize=7.5)
    marks = [
        Line2D([], [], label="values of materials.yaml", **DEFAULT),
        Line2D([], [], color=BLACK, lw=0.8, label="median of the draws"),
        Patch(color=NARROW, label="50 % of them"),
        Patch(color=WIDE, label="95 %"),
    ]
    figure.legend(handles=marks, loc="outside upper left", ncols=4)


def _panel(axes: Axes, name: str, curves: pd.DataFrame) -> None:
    """One food."""
    s = curves["stroke_m"] * 1e3
    axes.fill_between(s, curves["q025_N"], curves["q975_N"], color=WIDE, lw=0)
    axes.fill_between(s, curves["q25_N"], curves["q75_N"], color=NARROW, lw=0)
    axes.plot(s, curves["q50_N"], color=BLACK, lw=0.8)
    axes.plot(s, curves["default_N"], **DEFAULT)
    axes.set_xlim(0.0, float(s.iloc[-1]))
    axes.set_ylim(0.0, None)
    axes.set_title(name.replace("_", " "))
