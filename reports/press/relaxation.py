"""Report of relaxation tests: verdict, holds over the logarithm of time, Prony series and what tells it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from reports.base.brief import Brief, ReportPart, ReportTable
from reports.base.figures import MEASURED, SIMULATED, log_ticks, svg
from reports.base.format import breakable, interval, plain, quantity
from reports.press.tables import MARKS, mean_and_sd, sentences, verdict_table, with_sd
from reports.web.brief import Chart, Panel, publish_brief

if TYPE_CHECKING:
    from calib.relaxation.relaxation_result import HoldCurve, RelaxationResult

HOLDS = "The holds"
"""Title of the part that shows them."""
ALT = "Load of each specimen over the logarithm of the time of the hold, measured and fitted"
CRITERION = (
    "Bayesian information criterion of each number of branches, less that of the best, summed over the specimens; "
    "ten and more are very strong evidence against a number."
)


def write_report(result: RelaxationResult, curves: Sequence[HoldCurve], out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``relax.json``.

    Args:
        result: The relaxation.
        curves: The holds.
        out: The folder.

    Returns:
        Path of ``report.pdf``.

    Raises:
        ReportError: The report cannot be written.
    """
    shape = result.specimen
    first = result.repeats[0]
    brief = Brief(
        kind="Relaxation",
        name="A plate that holds",
        passed=result.passed,
        sentence=_sentence(result),
        facts=[
            (
                "Specimens",
                f"{len(result.repeats)}, {shape.kind.replace('_', ' ')}, area {plain(1e6 * shape.area_m2)} mm²",
            ),
            (
                "First specimen",
                f"strain {plain(first.strain)}, ramp {plain(first.ramp_s)} s, hold {plain(first.hold_s)} s",
            ),
            ("Branches", "chosen by the criterion" if result.chosen else "given"),
        ],
        parts=[
            ReportPart("Verdict", table=verdict_table(result.verdicts)),
            ReportPart(HOLDS, picture=picture(curves), alt=ALT),
            ReportPart("Prony series of the repeats", table=_series(result)),
            ReportPart("How many branches", CRITERION, table=_criterion(result)),
            ReportPart("Each specimen", table=_specimens(result), apart=len(result.repeats) > 6),
        ],
        limits=sentences(result.not_shown),
    )
    return publish_brief(out / "relax.json", brief, result, _chart(curves))


def _chart(curves: Sequence[HoldCurve]) -> Chart:
    """The load of each specimen to point at, and what the series leaves."""
    panels = []
    for one in curves:
        later = one.time > 0.0
        measured, fitted = one.measured[later], one.fitted[later]
        drawn = {"measured": ("measured", measured), "fitted": ("fitted", fitted)}
        panels.append(Panel(one.name, one.time[later], drawn, residual=fitted - measured))
    axes = ("time from the start of the hold", "s"), ("load", "N")
    return Chart(HOLDS, *axes, panels, "Specimen", residual="fitted − measured", logarithmic=True)


def _sentence(result: RelaxationResult) -> str:
    """The result in words."""
    if not result.count:
        return f"The load does not relax: the elastic modulus is {quantity(result.E0_Pa.mean, 'Pa')}."
    times = ", ".join(plain(one.time_s) for one in result.series)
    return (
        f"Of an instantaneous modulus of {quantity(result.E0_Pa.mean, 'Pa')} a part of "
        f"{plain(result.equilibrium.mean)} remains; the rest relaxes in {times} s."
    )


def _series(result: RelaxationResult) -> ReportTable:
    rows = [
        [f"{k}", plain(one.time_s), mean_and_sd(one.share), MARKS[one.identified]]
        for k, one in enumerate(result.series, start=1)
    ]
    rows.append(
        [
            "remains",
            "–",
            mean_and_sd(result.equilibrium),
            "none" if not rows else MARKS[all(one.identified for one in result.series)],
        ]
    )
    return ReportTable(("Branch", "Time [s]", "Share, mean ± sd", "Told by all holds"), ("1fr",) * 4, rows, marked=3)


def _criterion(result: RelaxationResult) -> ReportTable:
    sums = np.sum([one.bic for one in result.repeats], axis=0)
    numbers = [str(k) for k in range(len(sums))]
    return ReportTable(
        ("Branches", *numbers), ("1fr", *["1fr"] * len(sums)), [["Criterion", *(plain(x) for x in sums - sums.min())]]
    )


def _specimens(result: RelaxationResult) -> ReportTable:
    rows = []
    for one in result.repeats:
        rows.append(
            [
                breakable(one.name),
                quantity(one.E0_Pa, "Pa"),
                "remains",
                "–",
                with_sd(one.equilibrium, one.equilibrium_sd),
                "",
            ]
        )
        for branch in one.branches:
            times = interval(branch.time_low_s, branch.time_high_s, "s")
            rows.append(
                ["", "", plain(branch.time_s), times, with_sd(branch.share, branch.share_sd), branch.why or "told"]
            )
    head = ("Specimen", "Modulus", "Time [s]", "95 % interval", "Share", "Told by the hold")
    return ReportTable(head, ("1fr", "auto", "auto", "auto", "auto", "42mm"), rows)


def picture(curves: Sequence[HoldCurve]) -> bytes:
    """Measured and fitted load of each hold over the logarithm of time.

    Args:
        curves: The holds.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, one in enumerate(curves):
            later = one.time > 0.0
            names = ("measured", "fitted") if not k else (None, None)
            axes.plot(one.time[later], one.measured[later], label=names[0], **{**MEASURED, "lw": 1.4})
            axes.plot(one.time[later], one.fitted[later], label=names[1], **{**SIMULATED, "lw": 1.2})
        axes.set_xscale("log")
        ends = [one.time[one.time > 0.0] for one in curves]
        log_ticks(axes.xaxis, min(float(x[0]) for x in ends), max(float(x[-1]) for x in ends))
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("time from the start of the hold [s]")
        axes.set_ylabel("load [N]")
        figure.legend(loc="outside upper left", ncols=2)

    return svg(draw, 70.0)
