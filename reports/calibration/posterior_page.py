"""The sampled posterior in a report: its modes, the combinations that the cut sees, and how good the emulator was."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from reports.base.format import breakable, count, interval, listed, quantity
from reports.base.run_folder import Data

if TYPE_CHECKING:
    from calib.posterior.estimates import ModeSummary, PosteriorSummary
    from calib.uncertainty.estimates import FittedParameter


def identified(fitted: Mapping[str, FittedParameter]) -> str:
    """The line above the verdict: how many parameters the trace identifies, and which."""
    names = [name for name, p in fitted.items() if p.verdict == "identified"]
    which = f": {listed(names)}" if names else ""
    return breakable(f"{len(names)} of {len(fitted)} parameters identified{which}.")


def posterior(found: PosteriorSummary | None, fitted: Mapping[str, FittedParameter]) -> Data | None:
    """The part of the page of parameters on the posterior; None where it was not sampled.

    Args:
        found: The posterior.
        fitted: The fitted parameters, for their units.

    Returns:
        Its text.
    """
    if found is None:
        return None
    differ = [name for name in fitted if name not in found.alike]
    return {
        "combinations": [
            [breakable(formula), quantity(r.median, "-"), interval(r.low95, r.high95, "-")]
            for formula, r in found.combinations.items()
        ],
        "modes": [_mode(number, mode) for number, mode in enumerate(found.modes, 1)],
        "values": [
            [breakable(name), *(_values(mode, name, p.unit) for mode in found.modes)] for name, p in fitted.items()
        ],
        "differ": listed(differ) if differ else "",
        "waves": [
            [
                str(number),
                count(w.runs),
                count(w.cut),
                "prior" if w.temperature is None else quantity(w.temperature, "-"),
                quantity(w.error, "fraction"),
                quantity(w.error90, "fraction"),
                quantity(w.moved, "fraction", digits=2),
            ]
            for number, w in enumerate(found.waves, 1)
        ],
        "converged": found.converged,
        "judged": "" if found.judged is None else quantity(found.judged, "fraction"),
        "judged90": quantity(found.judged90, "fraction"),
        "explained": quantity(found.explained, "-"),
        "evidence": f"{found.log_evidence:.1f} ± {found.log_evidence_sd:.1f}",
    }


def _mode(number: int, mode: ModeSummary) -> list[str]:
    misfit = "none was cut" if mode.misfit is None else quantity(mode.misfit, "-")
    return [str(number), quantity(mode.weight, "fraction"), f"{mode.log_evidence:.1f}", misfit]


def _values(mode: ModeSummary, name: str, unit: str) -> str:
    """Median and interval of a parameter in a mode."""
    r = mode.ranges[name]
    return f"{quantity(r.median, unit)} ({interval(r.low95, r.high95, unit, like=r.median)})"
