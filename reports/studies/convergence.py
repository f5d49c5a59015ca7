"""Figure and report of a convergence study: the force on every grid, and how far from an infinitely fine one it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reports.base.brief import Brief, ReportPart, ReportTable
from reports.base.figures import BLACK, BLUE, GREEN, GREY, LIGHT, ORANGE, RED, SKY, stroke_axis, svg
from reports.base.format import count, duration, listed, quantity
from reports.base.labels import capital, in_words
from reports.web.brief import publish_brief

if TYPE_CHECKING:
    from studies.convergence.gci import Estimate
    from studies.convergence.result import AxisResult, ConvergenceResult, ForceCurves, RunResult

AXIS_MEANINGS = {
    "safety": "time step over its limit",
    "mach": "speed of the blade over the P-wave's",
    "ppc": "particles per cell and direction",
    "offset": "place of the blade in the grid [cells]",
    "repeat": "other particles, grid elsewhere (runs)",
}
FIGURE_ALT = (
    "Force over stroke on every grid with the numerical uncertainty, and peak and work over the cell size against the "
    "finest grid"
)
CURVES = (
    "Peak and work are of the record as it is. The curves are drawn as a calibration compares them, filtered along the "
    "stroke, so that their peak is a little lower."
)
ESTIMATES = (
    "Order from the three finest grids; grid convergence index (GCI) with a factor of safety after Roache, which is "
    "1.25 where the order is as expected and 3 elsewhere; uncertainty of the finest grid by least squares over all "
    "grids (Eça and Hoekstra 2014). A trend that is smaller than what other particles change is called noise-limited: "
    "it has no order."
)
APART = (
    "Each is varied with all else as on the coarsest grid, repeats on the second; peak and work are within so much of "
    "their mean."
)
NOT_SHOWN = (
    "The work on all grids is that of the same laws: whether these are the food's is not asked here.",
    "The specimen has one size: what a longer or wider one would need is not in the uncertainty.",
    "A smaller cell does not make a better food: the values were those of one default or calibrated material.",
)
LINE_STYLES: tuple[dict[str, Any], ...] = (
    {"color": BLACK, "lw": 1.6},
    {"color": RED, "lw": 1.2, "dashes": (4.5, 1.4)},
    {"color": BLUE, "lw": 1.0, "dashes": (1.2, 1.2)},
    {"color": GREEN, "lw": 1.0, "dashes": (7.0, 1.6, 1.2, 1.6)},
    {"color": ORANGE, "lw": 0.9, "dashes": (2.5, 1.0)},
    {"color": SKY, "lw": 0.9},
)


def write_figure(result: ConvergenceResult, curves: ForceCurves, out: Path) -> None:
    """Draw ``converge.svg``.

    Args:
        result: The finished study.
        curves: The force on every grid.
        out: Folder that it is written to.
    """
    (out / "converge.svg").write_bytes(_picture(result, curves))


def write_report(result: ConvergenceResult, curves: ForceCurves, out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``converge.json``.

    Args:
        result: The finished study.
        curves: The force on every grid.
        out: Its folder.

    Returns:
        Path of the report.

    Raises:
        ReportError: The report cannot be written.
    """
    return publish_brief(out / "converge.json", _brief(result, curves), result)


def _numbers(result: ConvergenceResult) -> list[tuple[str, str, Estimate]]:
    """Name, unit and estimate of what is estimated."""
    return [("work", "J", result.work), ("peak", "N", result.peak)]


def _brief(result: ConvergenceResult, curves: ForceCurves) -> Brief:
    """What the report holds."""
    allowed = (("work", result.limits.work), ("peak", result.limits.peak))
    limits = ", ".join(f"{name} within {quantity(limit, 'fraction', digits=None)}" for name, limit in allowed)
    index = quantity(result.limits.gci, "fraction", digits=None)
    index = f"; grid convergence index (GCI) of both at most {index}" if result.limits.gci is not None else ""
    verdicts = listed([f"{name} {estimate.verdict}" for name, _, estimate in _numbers(result)])
    said = "Converged" if result.converged else "Not converged"
    shape = result.shape
    size = " × ".join(quantity(side, "m") for side in (shape.length, shape.width, shape.height))
    return Brief(
        kind="Convergence of a simulated cut",
        name=result.food.replace("_", " ").capitalize(),
        passed=result.converged,
        sentence=f"{said}: between the two finest grids {_changes(result)}; {_indices(result)}. "
        f"Trend over the grids: {verdicts}.",
        facts=[
            ("Knife", result.knife),
            ("Food", f"{in_words(shape.kind)}, {size} (across the blade, along it, height)"),
            ("Passed where", f"between the two finest grids {limits}{index}"),
        ],
        parts=[
            ReportPart(
                "Force on every grid",
                CURVES,
                picture=_picture(result, curves),
                alt=FIGURE_ALT,
                table=_grids(result.grids, curves),
            ),
            ReportPart("Order and uncertainty", ESTIMATES, table=_estimates(result)),
            *([ReportPart("Apart from the grid", APART, table=_apart(result))] if _seen(result) else []),
        ],
        limits=[*NOT_SHOWN, *_not_varied(result)],
        warnings=[capital(text) for text in result.warnings],
    )


def _changes(result: ConvergenceResult) -> str:
    return listed(
        [
            f"{name} changes by {quantity(estimate.change, 'fraction', digits=2, signed=True)}"
            for name, _, estimate in _numbers(result)
        ]
    )


def _indices(result: ConvergenceResult) -> str:
    gci = [f"{quantity(e.gci, 'fraction', digits=2)} ({name})" for name, _, e in _numbers(result)]
    return f"GCI of the finest grid {listed(gci)}"


def _grids(grids: tuple[RunResult, ...], curves: ForceCurves) -> ReportTable:
    rows = []
    for g in grids:
        drawn = float(curves.forces[g.dx_m].max()) if g.dx_m is not None and g.dx_m in curves.forces else None
        cell = quantity(g.dx_m, "m")
        if not g.ok:
            rows.append([cell, f"broke down: {in_words(g.reason)}", *[""] * 6])
            continue
        rows.append([
            cell, quantity(g.peak_N, "N", digits=4), quantity(drawn, "N", digits=4),
            quantity(g.work_J, "J", digits=4), count(g.particles), count(g.steps),
            quantity(g.momentum_residual, "fraction"), duration(g.wall_s),
        ])  # fmt: skip
    head = ("Cell", "Peak", "Peak drawn", "Work", "Particles", "Time steps", "Momentum", "Run time")
    return ReportTable(head, ("1fr", *["auto"] * 7), rows)


def _estimates(result: ConvergenceResult) -> ReportTable:
    rows = [
        [
            name.capitalize(), estimate.verdict, quantity(estimate.order, "-"),
            quantity(estimate.gci, "fraction", digits=2), quantity(estimate.gci_coarsest, "fraction", digits=2),
            quantity(estimate.uncertainty, "fraction", digits=2), quantity(estimate.fitted, unit, digits=4),
        ]
        for name, unit, estimate in _numbers(result)
    ]  # fmt: skip
    median = quantity(result.gci_curve_median, "fraction", digits=2)
    largest = quantity(result.gci_curve_max, "fraction", digits=2)
    rows.append(["Curve, median", "", quantity(result.order_curve, "-", digits=2), median, "", "", ""])
    rows.append(["Curve, largest", "", "", largest, "", "", ""])
    head = ("", "Trend", "Order", "GCI", "GCI, coarsest", "Uncertainty", "Limit of the fit")
    return ReportTable(head, ("1fr", *["auto"] * 6), rows, left=2)


def _seen(result: ConvergenceResult) -> bool:
    """Whether anything was varied apart from the grid."""
    return bool(_varied(result) or result.constants_seen)


def _varied(result: ConvergenceResult) -> list[str]:
    """Axes whose spread is known."""
    return [name for name in AXIS_MEANINGS if result.axis(name) is not None]


def _apart(result: ConvergenceResult) -> ReportTable:
    rows = []
    for name, meaning in AXIS_MEANINGS.items():
        axis = result.axis(name)
        if axis is None:
            continue
        tried = [getattr(row, name) for row in axis.rows if row.ok]
        values = f"{len(tried) - 1}" if name == "repeat" else listed([f"{v:g}" for v in tried])
        rows.append([meaning, values, *_spread(axis)])
    for constant in result.constants_seen.values():
        given = listed([f"{row.value:g}" for row in constant.rows if row.ok and row.value is not None])
        rows.append([constant.name, given, *_spread(constant)])
    head = ("What is varied", "Values", "Peak within", "Work within")
    return ReportTable(head, ("1fr", "auto", "auto", "auto"), rows, left=2)


def _spread(axis: AxisResult) -> list[str]:
    """How far peak and work are from their mean."""
    return [quantity(part, "fraction", digits=2) for part in (axis.spread_peak, axis.spread_work)]


def _not_varied(result: ConvergenceResult) -> list[str]:
    varied = _varied(result)
    absent = [meaning for name, meaning in AXIS_MEANINGS.items() if name not in varied and name != "repeat"]
    absent += [] if result.constants_seen else ["constants of the method (--numerics)"]
    return [f"Not varied here: {listed(absent)}."] if absent else []


def _picture(result: ConvergenceResult, curves: ForceCurves) -> bytes:
    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=[1.6, 1.0])
        _draw_forces(left, curves)
        _draw_numbers(right, result)
        figure.legend(loc="outside upper left", ncols=4)

    return svg(draw, 78.0)


def _draw_forces(axes: Axes, curves: ForceCurves) -> None:
    x = 1e3 * curves.stroke
    cells = sorted(curves.forces)
    finest = curves.forces[cells[0]]
    axes.fill_between(
        x,
        finest - 2 * curves.u_num,
        finest + 2 * curves.u_num,
        facecolor=LIGHT,
        edgecolor=GREY,
        hatch="////",
        lw=0.0,
        label="numerical uncertainty (95 %)",
    )
    for dx, style in zip(cells, LINE_STYLES * (1 + len(cells) // len(LINE_STYLES)), strict=False):
        axes.plot(x, curves.forces[dx], label=f"{1e3 * dx:g} mm", **style)
    axes.set_ylabel("force on the knife [N]")
    stroke_axis(axes, x)


def _draw_numbers(axes: Axes, result: ConvergenceResult) -> None:
    """Peak and work over those of the finest grid, and where the least-squares fit ends."""
    good = sorted(
        (g.dx_m, g.work_J, g.peak_N)
        for g in result.grids
        if g.ok and g.dx_m is not None and g.work_J is not None and g.peak_N is not None
    )
    cells, works, peaks = zip(*good, strict=True)
    for name, estimate, values, marker, color in (
        ("work", result.work, works, "o", BLACK),
        ("peak", result.peak, peaks, "^", BLUE),
    ):
        base = values[0]
        axes.plot(
            [1e3 * dx for dx in cells],
            [100 * (value / base - 1) for value in values],
            marker=marker,
            ms=4,
            lw=0.9,
            color=color,
            label=name,
        )
        limit = estimate.fitted or estimate.extrapolated
        if limit is not None:
            axes.plot([0.0], [100 * (limit / base - 1)], marker=marker, ms=5, mfc="none", color=color, ls="none")
    axes.axhline(0.0, color=BLACK, lw=0.5)
    axes.set_xlim(left=-0.1)
    axes.set_xlabel("cell [mm]; open marks: extrapolated")
    axes.set_ylabel("against the finest grid [%]")
