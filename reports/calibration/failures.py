"""Where simulations broke down: the two parameters in which failed and finished ones lie furthest apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from reports.base.figures import BLACK, GREY, LIGHT, RED, log_ticks, svg
from reports.base.format import interval, listed, plain, quantity, rung
from reports.base.run_folder import Runs

if TYPE_CHECKING:
    from calib.uncertainty.estimates import FittedParameter

#: Fewer failed or finished runs than these have no region.
FEWEST = 3
#: Half of a normal distribution lies within this many standard deviations on both sides of its median, together.
HALF_SPREAD = 1.349
#: Parameters whose medians differ by less than this many standard deviations do not separate the runs.
APART = 1.0
FINISHED: dict[str, Any] = {"marker": "o", "ms": 4.2, "mfc": LIGHT, "mec": GREY, "mew": 0.6}
FAILED: dict[str, Any] = {"marker": "X", "ms": 6.5, "mfc": RED, "mec": BLACK, "mew": 0.7, "zorder": 4}


@dataclass(frozen=True, eq=False)
class Split:
    """One parameter in failed and finished runs.

    Attributes:
        name: The parameter.
        unit: Its SI unit.
        values: Its values [unit] (m,).
        apart: Median of the failed less that of the finished runs, over the spread of all [-]; in logarithms where
            ``log``.
        log: Whether its axis is logarithmic.
    """

    name: str
    unit: str
    values: np.ndarray
    apart: float
    log: bool


def splits(runs: Runs, fitted: Mapping[str, FittedParameter]) -> list[Split]:
    """All parameters that failed and finished runs have, the one that separates them best first; none for too few runs.

    Args:
        runs: The simulations.
        fitted: The fitted parameters by name.

    Returns:
        The parameters with their values in both kinds of runs.
    """
    if min(np.count_nonzero(runs.failed), np.count_nonzero(~runs.failed)) < FEWEST:
        return []
    found = []
    for name, values in runs.parameters.items():
        known = np.isfinite(values)
        failed, finished = known & runs.failed, known & ~runs.failed
        if name not in fitted or min(np.count_nonzero(failed), np.count_nonzero(finished)) < FEWEST:
            continue
        unit = fitted[name].unit
        log = unit != "-" and bool(np.all(values[known] > 0.0))
        z = np.log(values) if log else values
        low, high = np.percentile(z[known], [25.0, 75.0])
        if high > low:
            apart = (np.median(z[failed]) - np.median(z[finished])) / ((high - low) / HALF_SPREAD)
            found.append(Split(name, unit, values, float(apart), log))
    return sorted(found, key=lambda split: -abs(split.apart))


def sentence(runs: Runs, found: list[Split]) -> str:
    """Where the failed runs lie."""
    if not found:
        return ""
    clear = [s for s in found if abs(s.apart) >= APART]
    if not clear:
        return (
            f"No parameter separates failed from finished simulations: in {found[0].name}, where they differ most, "
            f"their medians are {plain(abs(found[0].apart), 2)} standard deviations apart."
        )
    said = []
    for s in clear[:2]:
        medians = [float(np.nanmedian(s.values[which])) for which in (runs.failed, ~runs.failed)]
        more = "high" if s.apart > 0.0 else "low"
        failed = s.values[runs.failed & np.isfinite(s.values)]
        said.append(
            f"{more} {s.name} (median {quantity(medians[0], s.unit)} against {quantity(medians[1], s.unit)}; "
            f"all at {interval(float(failed.min()), float(failed.max()), s.unit)})"
        )
    return f"Simulations failed at {listed(said)}. In that region the fit is blind."


def picture(runs: Runs, found: list[Split]) -> bytes:
    """Failed and finished runs over the two parameters that separate them best; over one where there is only one."""

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        x, y = _shown(found[0]), _shown(found[1]) if len(found) > 1 else np.zeros(len(runs.failed))
        for name, which, look in (("finished", ~runs.failed, FINISHED), ("failed", runs.failed, FAILED)):
            n = int(np.count_nonzero(which & np.isfinite(x + y)))
            axes.plot(x[which], y[which], ls="none", label=f"{name} ({n} with values of their own)", **look)
        _axis(axes, "x", found[0], x)
        if len(found) > 1:
            _axis(axes, "y", found[1], y)
        else:
            axes.set_yticks([])
        figure.legend(loc="outside upper left", ncols=2)

    return svg(draw, 54.0 if len(found) > 1 else 32.0)


def _shown(split: Split) -> np.ndarray:
    """Its values in the unit that people use."""
    out: np.ndarray = split.values / rung(split.unit, float(np.nanmax(np.abs(split.values))))[0]
    return out


def _axis(axes: Axes, which: str, split: Split, shown: np.ndarray) -> None:
    """Scale, ticks and label of one axis."""
    axis = axes.xaxis if which == "x" else axes.yaxis
    unit = rung(split.unit, float(np.nanmax(np.abs(split.values))))[1]
    (axes.set_xlabel if which == "x" else axes.set_ylabel)(f"{split.name} [{unit}]" if unit else split.name)
    if split.log:
        (axes.set_xscale if which == "x" else axes.set_yscale)("log")
        log_ticks(axis, float(np.nanmin(shown)), float(np.nanmax(shown)))
    else:
        axis.set_major_locator(MaxNLocator(6))
