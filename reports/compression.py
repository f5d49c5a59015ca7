"""The figure of a compression test: measured and fitted stress over strain, and their difference."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from reports.base.figures import HATCHED, MEASURED, SIMULATED, svg


def write_figure(out: Path) -> None:
    """Draw compress.svg from compress.json and curves.csv in ``out``."""
    document = json.loads((out / "compress.json").read_text(encoding="utf-8"))
    curves = pd.read_csv(out / "curves.csv")
    x = 100 * curves["strain"]
    mean, fitted = (curves[name] / 1e3 for name in ("measured_Pa", "fitted_Pa"))
    repeats = curves.filter(regex="^repeat_") / 1e3
    low, high = repeats.min(axis=1), repeats.max(axis=1)
    modulus = document["E"]["mean_Pa"] / 1e3
    several = repeats.shape[1] > 1

    def draw(figure: Figure) -> None:
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 1.0])
        if several:
            top.fill_between(x, low, high, label=f"range of {repeats.shape[1]} repeats", **HATCHED)
            below.fill_between(x, low - mean, high - mean, **HATCHED)
        top.plot(x, mean, label="measured, mean" if several else "measured", **MEASURED)
        top.plot(x, fitted, label=f"fitted, E = {modulus:.4g} kPa over 0-{x.iloc[-1]:g} % strain", **SIMULATED)
        top.set_ylabel("force / first area [kPa]")
        top.set_ylim(bottom=0.0)
        below.axhline(0.0, **MEASURED)
        below.plot(x, fitted - mean, **SIMULATED)
        below.set_ylabel("less measured [kPa]")
        below.set_xlabel("compression / height [%]")
        below.set_xlim(0.0, float(x.iloc[-1]))
        figure.align_ylabels()
        figure.legend(loc="outside upper left", ncols=3)

    (out / "compress.svg").write_bytes(svg(draw, 90.0))
