"""The figure of a compression test: measured and fitted stress over strain, and their difference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from reports.base.figures import HATCHED, MEASURED, SIMULATED, svg
from reports.base.format import quantity

if TYPE_CHECKING:
    from calib.compression.result import CompressionResult, StressCurves


def write_figure(result: CompressionResult, curves: StressCurves, out: Path) -> None:
    """Draw ``compress.svg`` into a folder.

    Args:
        result: The calibrated modulus.
        curves: Stress over strain.
        out: The folder.
    """
    x = 100 * curves.strain
    mean, fitted = curves.measured / 1e3, curves.fitted / 1e3
    repeats = np.array(list(curves.repeats.values())) / 1e3
    low, high = repeats.min(axis=0), repeats.max(axis=0)
    several = len(repeats) > 1

    def draw(figure: Figure) -> None:
        top, below = figure.subplots(2, 1, sharex=True, height_ratios=[2.4, 1.0])
        if several:
            top.fill_between(x, low, high, label=f"range of {len(repeats)} repeats", **HATCHED)
            below.fill_between(x, low - mean, high - mean, **HATCHED)
        top.plot(x, mean, label="measured, mean" if several else "measured", **MEASURED)
        modulus = f"E = {quantity(result.E.mean_Pa, 'Pa')} over 0 to {x[-1]:g} % strain"
        top.plot(x, fitted, label=f"fitted, {modulus}", **SIMULATED)
        top.set_ylabel("force / first area [kPa]")
        top.set_ylim(bottom=0.0)
        below.axhline(0.0, **MEASURED)
        below.plot(x, fitted - mean, **SIMULATED)
        below.set_ylabel("fitted −\nmeasured\n[kPa]")
        below.set_xlabel("compression / height [%]")
        below.set_xlim(0.0, float(x[-1]))
        figure.align_ylabels()
        figure.legend(loc="outside upper left", ncols=3)

    (out / "compress.svg").write_bytes(svg(draw, 90.0))
