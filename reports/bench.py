"""The figure of a benchmark: error over run time, one mark for each way of simulating the same cut."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from reports.figures import BLACK, BLUE, GREY, svg

FLOOR = 1e-4  # smaller errors are drawn here
CLOSE = 0.15  # marks that are nearer than this part of their place share a label


def write_figure(out: Path) -> None:
    """Draw bench.svg from bench.json in ``out``."""
    document = json.loads((out / "bench.json").read_text(encoding="utf-8"))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        rows: list[dict[str, Any]] = [{"name": "default", "time_ratio": 1.0, **document["default_cut"]}]
        rows += [row for row in document["ablations"] if "nrmse" in row]
        for k, row in enumerate(rows):
            x = row["time_ratio"]
            for name, marker, color in (("nrmse", "o", BLACK), ("work_error", "^", BLUE)):
                label = {"nrmse": "NRMSE", "work_error": "|work error|"}[name] if k == 0 else None
                axes.plot(x, 100 * max(abs(row[name]), FLOOR), marker, ms=4, color=color, label=label)
        for numbers, at in _labels(rows):
            axes.annotate(numbers, at, (0, 5), textcoords="offset points", fontsize=7)
        for axis in (axes.xaxis, axes.yaxis):
            axis.axes.set(**{f"{axis.axis_name}scale": "log"})
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("run time over that of the default cut")
        axes.set_ylabel("error against the reference [%]")
        axes.margins(x=0.15, y=0.25)
        names = "\n".join(f"{k} {row['name']}" for k, row in enumerate(rows, 1))
        axes.text(1.02, 1.0, names, transform=axes.transAxes, va="top", fontsize=7, color=GREY)
        axes.legend(loc="lower left", bbox_to_anchor=(1.0, 0.0))

    (out / "bench.svg").write_bytes(svg(draw, 90.0))


def _labels(rows: list[dict[str, Any]]) -> list[tuple[str, tuple[float, float]]]:
    """Numbers of the marks of NRMSE and where they are written; marks that lie on each other share a label."""
    labels: list[tuple[list[int], tuple[float, float]]] = []
    for number, row in enumerate(rows, 1):
        x, y = row["time_ratio"], 100 * max(row["nrmse"], FLOOR)
        near = next(
            (label for label in labels if max(abs(x / label[1][0] - 1), abs(y / label[1][1] - 1)) < CLOSE), None
        )
        if near is None:
            labels.append(([number], (x, y)))
        else:
            near[0].append(number)
    return [(", ".join(map(str, numbers)), at) for numbers, at in labels]
