"""The way up of a calibration: what was compared, in words, and its figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from reports.base.figures import BLACK, MEASURED, SIMULATED, predictive, svg
from reports.base.format import compared, plain, quantity
from reports.base.run_folder import Data
from reports.calibration import measurement

if TYPE_CHECKING:
    from calib.calibration.withdrawal_result import FitWithout, WithdrawalAgreement

NAMED = {"R": "the cutting resistance", "mu": "friction", "adhesion_energy": "adhesion"}
STRENGTHS = ((10.0, "very strong"), (6.0, "strong"), (2.0, "positive"), (0.0, "not worth more than a mention"))
"""Evidence from which on it is called so (Kass and Raftery 1995)."""
EVIDENCE = (
    "Evidence is the difference of Bayesian information criteria [@Schwarz 1978], without the property less with it, "
    "in the words of [@Kass 1995]. The property is held at the least that it may have, and all others are fitted again."
)

TOLD = (
    "On the way up nothing is parted: friction has turned round, and what sticks is taken off. So this curve tells "
    "friction and adhesion from the cutting resistance. In the fit the pull and the force on the way down weigh alike: "
    "each is compared to a part of its own largest value. The pull cannot exceed what holds the food on the board."
)


def withdrawal(found: WithdrawalAgreement) -> Data:
    """What a report says of the way up.

    Args:
        found: The way up against the trace.

    Returns:
        ``told``, sentences; ``rows``, pairs of a name and a value; ``left_open``, lines of
        :func:`reports.calibration.measurement.left_open`.
    """
    inside = found.predictive_inside
    return {
        "told": f"{TOLD} {EVIDENCE}" if found.without else TOLD,
        "rows": [
            ["Compared", f"from {quantity(found.from_m, 'm')} to {quantity(found.to_m, 'm')} above the lowest point"],
            ["Speed", f"{quantity(found.speed_m_s, 'm/s')} on average"],
            ["Largest pull", f"measured {compared(found.peak_real_N, 'N')}, simulated "
                             f"{compared(found.peak_sim_N, 'N')}"],
            ["Work", f"measured {compared(found.work_real_J, 'J')}, simulated {compared(found.work_sim_J, 'J')}"],
            ["Curve error (NRMSE)", f"{quantity(found.nrmse, 'fraction')}, over the largest measured pull"],
            ["Within the 95 % band", "not determined" if inside is None else quantity(inside, "fraction", digits=2)],
            *([f"Evidence for {NAMED[name]}", _evidence(one)] for name, one in found.without.items()),
        ],
        "left_open": [measurement.left_open(name, n, up=True) for name, n in found.nuisances.items()],
    }  # fmt: skip


def _evidence(found: FitWithout) -> str:
    """How strong it is, and what it is made of."""
    size = next((word for least, word in STRENGTHS if found.evidence >= least), "the trace does not ask for it")
    rise = found.chi_square - found.whole
    how = f"{'rises' if rise >= 0.0 else 'falls'} by {plain(abs(rise))}"
    return f"{plain(found.evidence)}, {size}: without it the least chi-square {how}"


def figure(curves: Mapping[str, np.ndarray], trace: str) -> bytes:
    """Measured and simulated pull over the way up.

    Args:
        curves: Columns of ``withdrawal.csv``, each (n,).
        trace: What the real curve is called: measured or reconstructed.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        axes, way = figure.subplots(), 1e3 * curves["way_m"]
        axes.axhline(0.0, color=BLACK, lw=0.5)
        predictive(axes, way, dict(curves), "band_low_N", "band_high_N", "95 % predictive band")
        axes.plot(way, curves["real_N"], label=trace, **MEASURED)
        axes.plot(way, curves["sim_N"], label="simulated", **SIMULATED)
        axes.set_xlim(0.0, float(way[-1]))
        axes.set_xlabel("way up from the lowest point [mm]")
        axes.set_ylabel("pull on the knife [N]")
        figure.legend(loc="outside upper left", ncols=3)

    return svg(draw, 60.0)
