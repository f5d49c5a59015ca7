"""Vector figures of a report: SVG bytes that are equal for equal data, readable in black and white.

Every curve has its own dash pattern and its own lightness besides its colour (Okabe and Ito's palette, which
readers with colour-blindness tell apart). Legends stand outside the axes, so that no text covers a curve.
Letters are drawn as paths: no font is needed to show a figure.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from mpm.output.number_text import at_axis

MM = 1.0 / 25.4
#: Width of a figure [mm]: the text width of the report, so that letters keep their size in print.
WIDTH = 170.0
#: Widths of forces and picture of the cut where they stand side by side, as a ratio.
BESIDE = (2.0, 1.0)
#: A record is drawn with its extremes in this many columns: more than a printer resolves on the page.
ENVELOPE_PARTS = 900
#: Ratio of the ends of a log axis up to which 1, 2 and 5 of each decade have room for their numbers.
FEW_DECADES = 1e3

#: Room past the end of the stroke, part of it [-], where a mark may stand at the end.
PAST_END = 0.03

BLACK, GREY, LIGHT = "#000000", "#767676", "#dddddd"
BLUE, SKY, GREEN, ORANGE, RED = "#0072B2", "#56B4E9", "#009E73", "#E69F00", "#D55E00"

STYLE: dict[str, Any] = {
    "svg.fonttype": "path",
    "svg.hashsalt": "cutcal",
    "text.parse_math": False,
    "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True,
    "font.family": "DejaVu Sans",
    "font.size": 7.5,
    "axes.labelsize": 7.5,
    "axes.titlesize": 7.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.fontsize": 7.5,
    "legend.frameon": False,
    "legend.handlelength": 3.4,
    "legend.columnspacing": 1.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.5,
}

MEASURED: dict[str, Any] = {"color": BLACK, "lw": 1.8}
SIMULATED: dict[str, Any] = {"color": RED, "lw": 1.8, "dashes": (4.5, 1.4)}
EDGE: dict[str, Any] = {"color": BLUE, "lw": 1.1, "dashes": (1.2, 1.2)}
FACE: dict[str, Any] = {"color": GREEN, "lw": 1.1, "dashes": (7.0, 1.6, 1.2, 1.6)}
HATCHED: dict[str, Any] = {"facecolor": LIGHT, "edgecolor": GREY, "hatch": "////", "lw": 0.0}
PREDICTIVE: dict[str, Any] = {"facecolor": "#ebebeb", "edgecolor": "#a8a8a8", "lw": 0.5}
NULL_STYLES: dict[str, dict[str, Any]] = {
    "ramp_N": {"label": "ramp", "color": BLUE, "lw": 0.8, "dashes": (1.5, 1.5)},
    "half_sine_N": {"label": "half sine", "color": GREEN, "lw": 0.8, "dashes": (8.0, 2.0)},
    "three_term_N": {"label": "three-term", "color": ORANGE, "lw": 0.8, "dashes": (8.0, 2.0, 1.5, 2.0)},
    "start_N": {"label": "simulation at literature values", "color": GREY, "lw": 0.8},
}

Curves = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class ConditioningRecord:
    """What the conditioning of a trace is drawn from.

    Attributes:
        time: Time of the whole record [s], shape (n,).
        raw: Force as recorded [N], shape (n,).
        tared: Force less its baseline [N], shape (n,).
        onset: Time of contact [s].
        onset_sd: Its standard uncertainty [s], or None.
        end: End of the downward stroke [s].
        end_sd: Its standard uncertainty [s], or None.
        window: Start and end of the baseline window [s], or None where it was not saved.
        baseline_kind: ``constant``, ``linear``, ``zero`` or ``air``.
        peak: Peak of the filtered curve [N].
        peak_sd: Its standard uncertainty [N], or None.
    """

    time: np.ndarray
    raw: np.ndarray
    tared: np.ndarray
    onset: float
    onset_sd: float | None
    end: float
    end_sd: float | None
    window: tuple[float, float] | None
    baseline_kind: str
    peak: float | None
    peak_sd: float | None


def forces(
    curves: Curves,
    measured: str,
    simulated: str,
    height: float,
    inside: str = "",
    beside: Callable[[Axes], None] | None = None,
) -> bytes:
    """Measured and simulated force over stroke, with the parts of the simulation and a predictive band if there is one.

    Args:
        curves: Columns of ``curves.csv``: stroke [m] and forces [N], shape (n,).
        measured, simulated: Labels of the two curves in the legend.
        height: Height of the figure [mm].
        inside: What the legend says of the trace within the band, in brackets.
        beside: Draws a picture of the cut beside the forces.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        axes = next_to(figure, beside)
        x = 1e3 * curves["stroke_m"]
        axes.axhline(0.0, color=BLACK, lw=0.5)
        predictive(axes, x, curves, "band_low_N", "band_high_N", f"95 % predictive band{inside}")
        axes.plot(x, curves["edge_N"], label="edge part of the simulation", **EDGE)
        axes.plot(x, curves["face_N"], label="face part of the simulation", **FACE)
        axes.plot(x, curves["real_N"], label=measured, **MEASURED)
        axes.plot(x, curves["sim_N"], label=simulated, **SIMULATED)
        stroke_axis(axes, x)
        axes.set_ylabel("force on the knife [N]")
        handles, labels = axes.get_legend_handles_labels()
        handles, labels = ([*items[-2:], *items[:-2]] for items in (handles, labels))
        figure.legend(handles, labels, loc="outside upper left", ncols=2)

    return svg(draw, height)


def next_to(figure: Figure, beside: Callable[[Axes], None] | None) -> Axes:
    """Axes for a curve, left of a picture if there is one to draw."""
    if beside is None:
        return figure.subplots()
    axes, picture = figure.subplots(1, 2, width_ratios=BESIDE)
    beside(picture)
    return axes


def predictive(axes: Axes, x: np.ndarray, curves: Curves, low: str, high: str, label: str) -> None:
    """A predictive band behind the curves, nothing where the columns are absent or empty.

    Args:
        axes: Where to draw.
        x: Stroke [mm], shape (n,).
        curves: Forces [N] by name of the column, each (n,).
        low: Name of the column of the lower end.
        high: Name of the column of the upper end.
        label: What the legend says.
    """
    if low in curves and high in curves and np.any(np.isfinite(curves[low])):
        axes.fill_between(x, curves[low], curves[high], label=label, zorder=0.5, **PREDICTIVE)


def conditioning(record: ConditioningRecord, curves: Curves) -> bytes:
    """Raw record with baseline, contact and end; the tared record about contact; the filtered curve."""

    def draw(figure: Figure) -> None:
        panels = figure.subplot_mosaic([["raw", "raw"], ["onset", "curve"]], height_ratios=[1.15, 1.0])
        _raw(panels["raw"], record)
        _contact(panels["onset"], record)
        _filtered(panels["curve"], record, curves)
        handles, labels = panels["raw"].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=4 if len(labels) < 5 else 3)

    return svg(draw, 78.0)


def fit(curves: Curves, noise_sd: float, trace: str) -> bytes:
    """Both curves divided by their own peak, and the residual over stroke with the noise of the trace.

    Args:
        curves: Columns of ``curves.csv``.
        noise_sd: Standard deviation of one unfiltered sample before contact [N].
        trace: What the real curve is called: measured or reconstructed.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        shape, residual = figure.subplots(2, 1, sharex=True, height_ratios=[1.5, 1.0])
        x, real, sim = 1e3 * curves["stroke_m"], curves["real_N"], curves["sim_N"]
        shape.plot(x, real / np.max(real), label=f"{trace}, over its own peak", **MEASURED)
        if np.max(sim) > 0.0:
            shape.plot(x, sim / np.max(sim), label="simulated, over its own peak", **SIMULATED)
        shape.set_ylabel("force / own peak")
        residual.axhspan(-noise_sd, noise_sd, label="± 1 sd of one raw sample before contact", **HATCHED)
        residual.axhline(0.0, color=BLACK, lw=0.5)
        residual.plot(x, sim - real, color=BLUE, lw=1.3, label=f"simulated − {trace}")
        residual.set_ylabel("residual [N]")
        residual.yaxis.set_major_locator(MaxNLocator(4))
        stroke_axis(residual, x)
        handles, labels = zip(*(a.get_legend_handles_labels() for a in (shape, residual)), strict=True)
        figure.legend(sum(handles, []), sum(labels, []), loc="outside upper left", ncols=2)
        figure.align_ylabels()

    return svg(draw, 76.0)


def null_models(curves: Curves, trace: str, peaks: Mapping[str, str]) -> bytes:
    """Real and simulated force with the null models and the simulation before the fit.

    Args:
        curves: Columns of ``curves.csv``.
        trace: What the real curve is called: measured or reconstructed.
        peaks: Peak of each null model as text, by column: named where the curve leaves the axis.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        x = 1e3 * curves["stroke_m"]
        axes.axhline(0.0, color=BLACK, lw=0.5)
        axes.plot(x, curves["real_N"], label=trace, **MEASURED)
        axes.plot(x, curves["sim_N"], label="simulated, fitted", **SIMULATED)
        top = 1.5 * max(np.max(curves["real_N"]), np.max(curves["sim_N"]))
        bottom, highest = min(0.0, np.min(curves["real_N"]), np.min(curves["sim_N"])), 0.0
        for column, look in NULL_STYLES.items():
            y = curves[column]
            if np.all(np.isnan(y)):
                continue
            peak = float(np.nanmax(y))
            named = f", peak {peaks[column]}" if column in peaks else ""
            cut = {"label": f"{look['label']} (leaves the axis{named})"} if peak > top else {}
            axes.plot(x, y, **{**look, **cut})
            highest = max(highest, min(peak, top))
        highest = max(highest, top / 1.5)
        axes.set_ylim(bottom - 0.04 * highest, 1.05 * highest)
        axes.set_ylabel("force on the knife [N]")
        stroke_axis(axes, x)
        figure.legend(loc="outside upper left", ncols=3)

    return svg(draw, 57.0)


def misfit(history: Sequence[tuple[float, float]]) -> bytes:
    """Best misfit so far over the number of simulations.

    Args:
        history: Pairs of evaluation number and best misfit [-], in order.
    """

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        x, y = np.array(history, dtype=float).T
        axes.step(x, y, where="post", color=BLACK, lw=1.4)
        axes.plot(x[-1], y[-1], marker="o", ms=4.0, color=BLACK)
        if np.all(y > 0.0) and np.max(y) > 10.0 * np.min(y):
            axes.set_yscale("log")
            log_ticks(axes.yaxis, float(np.min(y)), float(np.max(y)))
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.margins(x=0.02, y=0.08)
        axes.set_xlabel("simulation number")
        axes.set_ylabel("best chi-square so far")

    return svg(draw, 42.0)


def envelope(x: np.ndarray, y: np.ndarray, columns: int = ENVELOPE_PARTS) -> tuple[np.ndarray, np.ndarray]:
    """A long record with only the lowest and highest sample of each of ``columns`` equal parts, in order.

    Args:
        x: Times of the record [s], shape (n,).
        y: Its values [N], shape (n,).
        columns: Number of parts.

    Returns:
        The record itself if it has no more than two samples a part, else at most 2 ``columns`` samples.
    """
    if len(x) <= 2 * columns:
        return x, y
    edges = np.linspace(0, len(x), columns + 1).astype(int)
    parts = list(zip(edges[:-1], edges[1:], strict=True))
    kept = np.array(sorted({a + int(f(y[a:b])) for a, b in parts for f in (np.argmin, np.argmax)}))
    return x[kept], y[kept]


def svg(draw: Any, height: float) -> bytes:
    """SVG of a figure of the report's width and ``height`` [mm] that ``draw`` fills."""
    with style.context(["default", STYLE]):
        figure = Figure(figsize=(WIDTH * MM, height * MM), layout="constrained")
        FigureCanvasSVG(figure)
        draw(figure)
        out = io.BytesIO()
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None})
    return out.getvalue()


def stroke_axis(axes: Axes, x: np.ndarray) -> None:
    """Name and limits of the axis of the stroke ``x`` [mm]."""
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_xlabel("stroke from contact [mm]")


def log_ticks(axis: Axis, low: float, high: float, few: float = FEW_DECADES) -> None:
    """Plain numbers at 1, 2 and 5 of each decade, or at 1 only where there are many decades.

    Args:
        axis: The axis.
        low: Its lower end, in its unit.
        high: Its upper end.
        few: Ratio of the ends up to which there is room for 2 and 5.
    """
    subs = (1.0, 2.0, 5.0) if high / low < few else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda x, _: at_axis(x)))
    axis.set_minor_formatter(NullFormatter())


def _raw(axes: Axes, r: ConditioningRecord) -> None:
    """Raw record over time with what was subtracted and where the cut begins and ends."""
    x, y = envelope(r.time, r.raw)
    axes.plot(x, y, color=BLACK, lw=0.7, label="raw force")
    bx, by = envelope(r.time, r.raw - r.tared)
    name = "air run, shifted" if r.baseline_kind == "air" else "baseline"
    axes.plot(bx, by, color=RED, lw=1.2, dashes=(5.0, 2.0), label=name)
    if r.window is not None:
        axes.axvspan(*r.window, label="baseline window", **HATCHED)
    _moment(axes, r.onset, r.onset_sd, "contact", BLUE, (1.2, 1.2))
    _moment(axes, r.end, r.end_sd, "end of the downward stroke", GREEN, (7.0, 1.6, 1.2, 1.6))
    axes.set_xlim(float(r.time[0]), float(r.time[-1]))
    axes.set_title("a  whole record, as read")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("force [N]")


def _moment(axes: Axes, at: float, sd: float | None, name: str, color: str, dashes: Sequence[float]) -> None:
    """A marked time with its uncertainty."""
    label = f"{name} (band ± 1 sd)" if sd else name
    axes.axvline(at, color=color, lw=1.2, dashes=dashes, label=label)
    if sd:
        axes.axvspan(at - sd, at + sd, facecolor=color, alpha=0.25, lw=0.0)


def _contact(axes: Axes, r: ConditioningRecord) -> None:
    """Tared record around contact."""
    half = max(0.12 * (r.end - r.onset), 4.0 * (r.onset_sd or 0.0))
    inside = (r.time >= r.onset - half) & (r.time <= r.onset + half)
    axes.axhline(0.0, color=BLACK, lw=0.5)
    if np.any(inside):
        few = np.count_nonzero(inside) <= 120
        axes.plot(*envelope(r.time[inside], r.tared[inside], ENVELOPE_PARTS // 2), color=BLACK, lw=0.8,
                  marker="o" if few else None, ms=1.8)  # fmt: skip
    _moment(axes, r.onset, r.onset_sd, "contact", BLUE, (1.2, 1.2))
    axes.set_xlim(r.onset - half, r.onset + half)
    axes.set_title("b  tared, around contact")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("force less baseline [N]")
    axes.xaxis.set_major_locator(MaxNLocator(5))


def _filtered(axes: Axes, r: ConditioningRecord, curves: Curves) -> None:
    """Filtered curve over stroke with the uncertainty of its peak."""
    x, y = 1e3 * curves["stroke_m"], curves["real_N"]
    axes.axhline(0.0, color=BLACK, lw=0.5)
    axes.plot(x, y, **MEASURED)
    if r.peak is not None:
        axes.errorbar(x[np.argmax(y)], r.peak, yerr=r.peak_sd, color=RED, marker="o", ms=3.5, mfc="white",
                      capsize=2.5, lw=1.0, zorder=4)  # fmt: skip
    stroke_axis(axes, x)
    axes.set_xlim(float(x[0]), float(x[-1]) + PAST_END * float(x[-1] - x[0]))  # a peak at the end has its whole circle
    axes.set_title("c  filtered, over stroke (circle: peak ± 1 sd)")
    axes.set_ylabel("force [N]")
