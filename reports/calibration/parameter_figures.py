"""Figures of the fitted parameters, readable in black and white."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter, NullLocator

from reports.base.figures import BLACK, BLUE, GREY, HATCHED, LIGHT, ORANGE, log_ticks, svg

if TYPE_CHECKING:
    from calib.calibration.result_parts import SobolIndices

#: Axis of the parameter figure: at most this factor either side of the middle of the literature's range.
LARGEST_FACTOR = 1e3
#: Rise of chi-square at the ends of a 95 % interval, and where the axis of the profiles ends.
RISE, TOP = 3.84, 8.0
#: Correlations from here on are bold: an interval is 2.3 times as wide as it would be if the other one were known.
STRONG_PAIR = 0.9
#: Height of a letter of a tilted name [mm].
TILTED = 0.9
#: Panels side by side.
ACROSS = 4
#: A log axis that spans less than this factor has the ticks of a linear one.
NARROW = 5.0
#: From this factor on only powers of ten have room under a panel.
SHORT_AXIS = 40.0
WITH_PRIOR: dict[str, Any] = {"color": BLACK, "lw": 1.4}
TRACE_ALONE: dict[str, Any] = {"color": BLUE, "lw": 1.2, "dashes": (3.5, 1.5)}


@dataclass(frozen=True)
class ParameterRange:
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


@dataclass(frozen=True, eq=False)
class Panel:
    """The profile of one parameter, in the unit that people use.

    Attributes:
        title: Name and unit.
        x: Values along the profile (k,), rising.
        rise: Rise of chi-square with the literature (k,).
        alone: Rise by the trace alone (k,).
        value: Fitted value, None where it is not known.
        ends: Ends of its 95 % interval, None where there is none.
        prior: The literature's range, None where there is none.
        log: Whether the axis is logarithmic.
    """

    title: str
    x: np.ndarray
    rise: np.ndarray
    alone: np.ndarray
    value: float | None
    ends: tuple[float, float] | None
    prior: tuple[float, float] | None
    log: bool

    @property
    def level(self) -> float:
        """Rise at the fitted value [-], from which its interval is counted: 0 where it lies at the valley's bottom."""
        return 0.0 if self.value is None else float(np.interp(self.value, self.x, self.rise))


def ranges(rows: Sequence[ParameterRange]) -> bytes:
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

    return svg(draw, 20.0 + 7.6 * max(len(rows), 2))


def profile_panels(panels: Sequence[Panel]) -> bytes:
    """Rise of chi-square along each parameter, in small panels."""
    rows = -(-len(panels) // ACROSS)

    def draw(figure: Figure) -> None:
        grid = figure.subplots(rows, ACROSS, sharey=True, squeeze=False)
        for axes, panel in zip(grid.flat, panels, strict=False):
            _profile(axes, panel)
        grid[0, 0].set_ylim(-0.6, max(TOP, max(panel.level for panel in panels) + 1.3 * RISE))
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes in grid[:, 0]:
            axes.set_ylabel("rise of chi-square")
        handles = {
            label: one for axes in grid.flat for one, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        figure.legend(list(handles.values()), list(handles), loc="outside upper left", ncols=3)

    return svg(draw, 14.0 + 31.0 * rows)


def _profile(axes: Axes, panel: Panel) -> None:
    low, high = float(panel.x[0]), float(panel.x[-1])
    if panel.log:
        axes.set_xscale("log")
        if high / low < NARROW:
            axes.xaxis.set_major_locator(MaxNLocator(3, min_n_ticks=2))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
            axes.xaxis.set_minor_locator(NullLocator())
            axes.xaxis.set_minor_formatter(NullFormatter())
        else:
            log_ticks(axes.xaxis, low, high, SHORT_AXIS)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(4))
    if panel.prior is not None and panel.prior[0] < high and panel.prior[1] > low:
        axes.axvspan(max(panel.prior[0], low), min(panel.prior[1], high), 0.0, 0.06,
                     label="range of the literature", **HATCHED)  # fmt: skip
    axes.axhline(panel.level + RISE, color=GREY, lw=0.9, dashes=(1.0, 1.5), label=f"{RISE} above the fitted value")
    axes.plot(panel.x, panel.alone, label="trace alone", **TRACE_ALONE)
    axes.plot(panel.x, panel.rise, label="with the literature", **WITH_PRIOR)
    if panel.value is not None:
        axes.plot(panel.value, panel.level, marker="o", ms=4.5, color=BLACK, ls="none", zorder=4, clip_on=False,
                  label="fitted value")  # fmt: skip
    if panel.ends is not None:
        inside = [end for end in panel.ends if low <= end <= high]
        axes.plot(inside, np.full(len(inside), panel.level + RISE), marker="|", ms=9.0, mew=1.4, color=BLACK, ls="none",
                  zorder=4, label="ends of the 95 % interval")  # fmt: skip
    axes.set_xlim(low, high)
    axes.set_title(panel.title)


def influence(found: Mapping[str, Mapping[str, SobolIndices]], labels: Mapping[str, str]) -> bytes:
    """Sobol indices: a panel for each quantity, a row for each parameter.

    Args:
        found: The indices by quantity and parameter.
        labels: What the quantities are called.
    """
    names = list(next(iter(found.values())))

    def draw(figure: Figure) -> None:
        grid = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
        y = np.arange(len(names))
        for axes, (quantity, rows) in zip(grid, found.items(), strict=True):
            first, total, half = (
                np.array([_number(rows.get(name), key) for name in names]) for key in ("first", "total", "total_conf")
            )
            axes.barh(y, total, height=0.66, label="with its interactions (whisker: 95 %)", **(HATCHED | {"lw": 0.6}))
            axes.barh(
                y, np.maximum(first, 0.0), height=0.3, facecolor=ORANGE, edgecolor=BLACK, lw=0.6, label="on its own"
            )
            axes.errorbar(total, y, xerr=half, color=BLACK, fmt="none", capsize=2.0, lw=0.9)
            axes.set_xlim(0.0, 1.05)
            axes.set_title(labels.get(quantity, quantity))
            axes.grid(visible=False, axis="y")
        grid[0].set_yticks(y, names)
        grid[0].set_ylim(len(names) - 0.5, -0.5)
        figure.supxlabel("part of the variance", fontsize=7.5)
        figure.legend(*grid[0].get_legend_handles_labels(), loc="outside upper left", ncols=2)

    return svg(draw, 22.0 + max(3.5, 5.5 - 0.15 * len(names)) * len(names))


def correlations(names: Sequence[str], matrix: np.ndarray) -> bytes:
    """Posterior correlations of the parameters: the lower half of their matrix, with numbers.

    Args:
        names: The parameters.
        matrix: Their correlations (k, k), NaN where one is not known.

    Returns:
        An SVG document.
    """
    size = len(names)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        shown = np.where(np.tri(size, k=-1, dtype=bool), matrix, np.nan)[1:, :-1]
        axes.imshow(shown, cmap="PuOr", vmin=-1.5, vmax=1.5, aspect="auto")
        for (i, j), r in np.ndenumerate(shown):
            if np.isfinite(r):
                strong = abs(r) >= STRONG_PAIR
                axes.text(j, i, _correlation(r), ha="center", va="center",
                          fontweight="bold" if strong else "normal")  # fmt: skip
        axes.set_yticks(range(size - 1), names[1:])
        axes.set_xticks(range(size - 1), names[:-1], rotation=40.0, ha="right", rotation_mode="anchor")
        axes.tick_params(length=0)
        axes.grid(visible=False)
        for spine in axes.spines.values():
            spine.set_visible(False)

    return svg(draw, 8.0 + 5.0 * size + TILTED * max(map(len, names[:-1])))


def _correlation(r: float) -> str:
    """A correlation with two decimals and its sign, which nought has not."""
    text = f"{r:+.2f}".replace("-", "\u2212")
    return text if text.strip("+\u22120.") else "0.00"


def _number(row: SobolIndices | None, key: str) -> float:
    x: float | None = getattr(row, key, None)
    return np.nan if x is None else x


def _interval(axes: Axes, i: int, row: ParameterRange) -> None:
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


def _factors(rows: Sequence[ParameterRange]) -> tuple[float, float]:
    """Limits of the axis that hold all positive numbers: a factor 3 to LARGEST_FACTOR either side."""
    numbers = [x for r in rows for x in (r.value, r.low, r.high, r.prior_low, r.prior_high)]
    positive = [x for x in numbers if x is not None and x > 0.0]
    low = max(min([1 / 3.0, *positive]) / 1.3, 1.0 / LARGEST_FACTOR)
    high = min(max([3.0, *positive]) * 1.3, LARGEST_FACTOR)
    return low, high
