"""Figures of the fitted parameters, readable in black and white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.figures import BLACK, GREY, LIGHT, log_ticks, svg

#: Axis of the parameter figure: at most this factor either side of the middle of the literature's range.
LARGEST_FACTOR = 1e3


@dataclass(frozen=True)
class Row:
    """One fitted parameter of the parameter figure; numbers over the middle of the literature's range [-].

    Attributes:
        name: Name as in ``materials.yaml``.
        note: Text at the right: value and verdict.
        value: Fitted value.
        low, high: Its 95 % interval, None where there is none.
        prior_low, prior_high: The literature's range, None where there is none.
    """

    name: str
    note: str
    value: float
    low: float | None
    high: float | None
    prior_low: float | None
    prior_high: float | None


def ranges(rows: Sequence[Row]) -> bytes:
    """Fitted values with their intervals against the literature's ranges, one row each, on a log axis."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        low, high = _factors(rows)
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        log_ticks(axes.xaxis, low, high)
        for i, row in enumerate(rows):
            if row.prior_low is not None and row.prior_high is not None:
                ends = np.clip([row.prior_low, row.prior_high], low, high)
                axes.barh(i, ends[1] - ends[0], left=ends[0], height=0.46, facecolor=LIGHT, edgecolor=GREY,
                          lw=0.7)  # fmt: skip
            x = float(np.clip(row.value, low, high))
            axes.plot(x, i, marker="o", ms=5.0, color=BLACK, ls="none", zorder=3)
            _interval(axes, i, row)
            axes.annotate(row.note, (1.0, i), xycoords=axes.get_yaxis_transform(), xytext=(9, 0),
                          textcoords="offset points", va="center", linespacing=1.15,
                          annotation_clip=False)  # fmt: skip
        axes.axvline(1.0, color=GREY, lw=0.6)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_yticks(range(len(rows)), [row.name for row in rows])
        axes.tick_params(axis="y", length=0, pad=7.0)
        axes.grid(visible=False, axis="y")
        axes.spines["left"].set_visible(False)
        axes.set_xlabel("value / middle of the literature's range")

    return svg(draw, 20.0 + 8.5 * max(len(rows), 2))


def _interval(axes: Axes, i: int, row: Row) -> None:
    """The 95 % interval in row ``i``; an arrow where it leaves the axis or has no end."""
    if row.low is None and row.high is None:
        return
    low, high = axes.get_xlim()
    ends = (row.low if row.low is not None else 0.0, row.high if row.high is not None else np.inf)
    span = np.clip(ends, low, high)
    axes.plot(span, [i, i], color=BLACK, lw=1.6, zorder=3, solid_capstyle="butt")
    for at, end, arrow in zip(span, ends, ("<", ">"), strict=True):
        inside = low < end < high
        axes.plot(at, i, marker="|" if inside else arrow, ms=7.0 if inside else 5.0, color=BLACK, ls="none",
                  zorder=3, clip_on=False)  # fmt: skip


def _factors(rows: Sequence[Row]) -> tuple[float, float]:
    """Limits of the axis that hold all positive numbers: a factor 3 to LARGEST_FACTOR either side."""
    numbers = [x for r in rows for x in (r.value, r.low, r.high, r.prior_low, r.prior_high)]
    positive = [x for x in numbers if x is not None and x > 0.0]
    low = max(min([1 / 3.0, *positive]) / 1.3, 1.0 / LARGEST_FACTOR)
    high = min(max([3.0, *positive]) * 1.3, LARGEST_FACTOR)
    return low, high
