"""Figures for scripts and notebooks: axes that the caller keeps, on pyplot where it gives none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mpm.output.number_text import quantity
from reports.base.figures import GREY, MEASURED, PREDICTIVE, SIMULATED, log_ticks

Curves = Mapping[str, Any]
"""Columns of ``curves.csv`` by name, each of shape (n,)."""
ROOM = 1.2
"""Room beside the widest range, as a factor on a log axis."""


def fit_axes(curves: Curves, axes: Sequence[Axes] | None, title: str) -> tuple[Axes, Axes]:
    """Draw a measured and a simulated curve with the 95 % band, and the residual below them.

    Args:
        curves: Columns of ``curves.csv``: ``stroke_m`` [m], forces [N].
        axes: Two axes, of the forces and of the residual; None for a new figure.
        title: Title of the upper one.

    Returns:
        The two axes.
    """
    upper, lower = _pair() if axes is None else axes
    x = 1e3 * np.asarray(curves["stroke_m"], dtype=float)
    if "band_low_N" in curves:
        upper.fill_between(x, curves["band_low_N"], curves["band_high_N"], label="95 % band", **PREDICTIVE)
    upper.plot(x, curves["real_N"], label="trace", **MEASURED)
    upper.plot(x, curves["sim_N"], label="simulated", **SIMULATED)
    upper.set_ylabel("force [N]")
    upper.set_title(title)
    upper.legend(frameon=False)
    lower.axhline(0.0, color=GREY, lw=0.8)
    lower.plot(x, curves["residual_N"], color=SIMULATED["color"], lw=1.2)
    lower.set_ylabel("simulated\n− trace [N]")
    lower.set_xlabel("stroke [mm]")
    return upper, lower


def trace_axes(time: np.ndarray, force: np.ndarray, axes: Axes | None, title: str) -> Axes:
    """Draw a record.

    Args:
        time: Time of each sample [s], shape (n,).
        force: Force [N], shape (n,).
        axes: Where; None for a new figure.
        title: Title of the axes.

    Returns:
        The axes.
    """
    drawn = _single(4.0) if axes is None else axes
    drawn.plot(time, force, color=MEASURED["color"], lw=1.0)
    drawn.set_xlabel("time [s]")
    drawn.set_ylabel("force [N]")
    drawn.set_title(title)
    return drawn


def range_axes(ranges: Mapping[str, tuple[float, float, float, str]], axes: Axes | None, title: str) -> Axes:
    """Draw ranges over their values on a log axis: 1 is the value, and an arrow stands where a range begins at 0.

    Args:
        ranges: Low end, value, high end and SI unit, by name; values of 0 are left out.
        axes: Where; None for a new figure.
        title: Title of the axes.

    Returns:
        The axes.
    """
    shown = {name: r for name, r in ranges.items() if r[1] > 0.0}
    drawn = _single(1.2 + 0.25 * len(shown)) if axes is None else axes
    ends = [end / value for low, value, high, _ in shown.values() for end in (low, value, high) if end > 0.0]
    left, right = min(ends, default=1.0) / ROOM, max(ends, default=1.0) * ROOM
    for row, (low, value, high, _) in enumerate(shown.values()):
        begin = low / value if low > 0.0 else left
        drawn.plot([begin, high / value], [row, row], color=GREY, lw=4.0, solid_capstyle="butt")
        drawn.plot([1.0], [row], "o", color=MEASURED["color"], ms=4.0)
        if low <= 0.0:
            drawn.plot([left], [row], "<", color=GREY, ms=8.0, clip_on=False)
    labels = [f"{name} = {quantity(value, unit, digits=None)}" for name, (_, value, _, unit) in shown.items()]
    drawn.set_yticks(range(len(shown)), labels)
    drawn.invert_yaxis()
    drawn.set_xscale("log")
    drawn.set_xlim(left, right)
    log_ticks(drawn.xaxis, left, right)
    drawn.set_xlabel("95 % range of the literature, over the value [-]")
    drawn.set_title(title)
    return drawn


def _pair() -> tuple[Axes, Axes]:
    """Two axes of a new figure, one above the other."""
    from matplotlib import pyplot

    _, (upper, lower) = pyplot.subplots(
        2, 1, sharex=True, figsize=(7.0, 5.0), layout="constrained", height_ratios=(3, 1)
    )
    return upper, lower


def _single(height: float) -> Axes:
    """The axes of a new figure, of a height in inches."""
    from matplotlib import pyplot

    return pyplot.subplots(figsize=(7.0, height), layout="constrained")[1]
