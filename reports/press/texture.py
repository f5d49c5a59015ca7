"""Report of texture profiles: groups with their scatter, bites over time, specimens, ratio of directions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from reports.base.brief import Brief, ReportPart, ReportTable
from reports.base.figures import HATCHED, MEASURED, SIMULATED, svg
from reports.base.format import breakable, plain, quantity
from reports.press.law import law_parts
from reports.press.tables import between, mean_and_sd, sentences
from reports.web.brief import Chart, Panel, publish_brief

if TYPE_CHECKING:
    from calib.texture.texture_result import BiteCurves, TextureResult

NAMES = {
    "hardness_N": ("Hardness", "N"),
    "cohesiveness": ("Cohesiveness", ""),
    "springiness": ("Springiness", ""),
    "resilience": ("Resilience", ""),
    "adhesiveness_Ns": ("Adhesiveness", "N s"),
}
DEFINITIONS = (
    "Hardness: largest load of the first bite. Cohesiveness: area under the second bite over that under the first. "
    "Springiness: way of the plate from contact to peak, second bite over first. Resilience: area of the first bite "
    "behind its peak over that before it. Adhesiveness: area below load zero between the bites. Areas are of load over "
    "time, from contact until the load has fallen back to the trigger (Friedman et al. 1963, Bourne 1978)."
)
BITES = "The bites"
"""Title of the part that shows them."""
ALT = "Load over time of the two bites of each group: mean of the repeats and their range"
COLUMNS, PANEL = 2, 40.0


def write_report(result: TextureResult, curves: Sequence[BiteCurves], out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``tpa.json``.

    Args:
        result: The texture profiles.
        curves: Loads of each group.
        out: The folder.

    Returns:
        Path of ``report.pdf``.

    Raises:
        ReportError: The report cannot be written.
    """
    count = sum(len(group.repeats) for group in result.groups)
    trigger = "5 % of the first peak" if math.isnan(result.trigger_N) else quantity(result.trigger_N, "N", digits=None)
    parts = [
        ReportPart("Groups: mean and standard deviation", DEFINITIONS, table=_groups(result)),
    ]
    if result.ratios:
        parts.append(ReportPart("Along over across the fibres", RATIO, table=_ratios(result)))
    if result.laws:
        parts += law_parts(result)
    parts.append(ReportPart(BITES, picture=picture(curves), alt=ALT))
    parts.append(ReportPart("Each specimen", table=_specimens(result), apart=count > 12))
    brief = Brief(
        kind="Texture profile",
        name="Two bites",
        passed=result.passed if result.verdicts else None,
        sentence=_sentence(result),
        facts=[
            ("Specimens", f"{count} in {len(result.groups)} {'group' if len(result.groups) == 1 else 'groups'}"),
            ("Contact", trigger),
            ("Seed of the draws", str(result.seed)),
        ],
        parts=parts,
        limits=sentences(result.not_shown),
    )
    return publish_brief(out / "tpa.json", brief, result, _chart(curves))


def _chart(curves: Sequence[BiteCurves]) -> Chart:
    """The load of each group to point at, and how far the law of the other speeds is from it."""
    panels = []
    for one in curves:
        mean = one.loads.mean(axis=0)
        drawn = {"measured": ("mean of the repeats" if len(one.loads) > 1 else "measured", mean)}
        if one.predicted is not None:
            drawn["fitted"] = ("law of the other speeds", one.predicted)
        band = (one.loads.min(axis=0), one.loads.max(axis=0)) if len(one.loads) > 1 else None
        left = None if one.predicted is None else one.predicted - mean
        panels.append(Panel(one.group, one.time, drawn, band, left))
    axes = ("time from the first peak", "s"), ("load", "N")
    return Chart(BITES, *axes, panels, "Group", "range of the repeats", "law − mean of the repeats")


RATIO = "Ratio of the means; the interval is that of the bootstrap over specimens."


def _sentence(result: TextureResult) -> str:
    """The first group's texture in words, or the ratio of hardness."""
    hardness = [one for one in result.ratios if one.quantity == "hardness_N"]
    if hardness:
        ratio = hardness[0].ratio
        return (
            f"The hardness along the fibres is {plain(ratio.value)} times that across them "
            f"(95 % interval {between(ratio.low, ratio.high)})."
        )
    first, count = result.groups[0], len(result.groups[0].repeats)
    of = "one specimen" if count == 1 else f"means of {count}"
    return (
        f"Hardness {quantity(first.hardness_N.mean, 'N')}, cohesiveness {plain(first.cohesiveness.mean)}, springiness "
        f"{plain(first.springiness.mean)}, resilience {plain(first.resilience.mean)} at a descent of "
        f"{quantity(first.descent_s, 's')}: {of}."
    )


def _groups(result: TextureResult) -> ReportTable:
    """A row for each group."""
    head = ("Group", "n", *(f"{name} [{unit}]" if unit else name for name, unit in NAMES.values()))
    rows = [
        [group.name, str(len(group.repeats)), *(mean_and_sd(getattr(group, key)) for key in NAMES)]
        for group in result.groups
    ]
    return ReportTable(head, ("1fr", *["auto"] * (len(head) - 1)), rows)


def _ratios(result: TextureResult) -> ReportTable:
    """A row for each quantity, a column for each speed."""
    speeds = list(dict.fromkeys(_speed(one.descent_s) for one in result.ratios))
    cells = {(one.quantity, _speed(one.descent_s)): one.ratio for one in result.ratios}
    rows = [
        [
            name,
            *(
                f"{plain(r.value)} ({between(r.low, r.high)})" if r else "–"
                for r in (cells.get((key, s)) for s in speeds)
            ),
        ]
        for key, (name, _) in NAMES.items()
    ]
    return ReportTable(("Quantity", *speeds), ("auto", *["1fr"] * len(speeds)), rows)


def _speed(descent: float) -> str:
    """What a column of ratios is of."""
    return "All speeds" if math.isnan(descent) else f"{descent:.2g} s"


def _specimens(result: TextureResult) -> ReportTable:
    """A row for each specimen."""
    head = ("Specimen", "Hardness [N]", "Cohesiveness", "Springiness", "Resilience", "Adhesiveness [N s]")
    rows = [
        [breakable(one.name), *(plain(getattr(one.profile, key)) for key in NAMES)]
        for group in result.groups
        for one in group.repeats
    ]
    return ReportTable(head, ("1fr", *["auto"] * 5), rows)


def picture(curves: Sequence[BiteCurves]) -> bytes:
    """Load over time of each group.

    Args:
        curves: Loads of each group.

    Returns:
        An SVG document.
    """
    rows = math.ceil(len(curves) / COLUMNS)

    def draw(figure: Figure) -> None:
        panels = list(figure.subplots(rows, min(COLUMNS, len(curves)), squeeze=False).flat)
        for axes, one in zip(panels, curves, strict=False):
            if len(one.loads) > 1:
                axes.fill_between(one.time, one.loads.min(axis=0), one.loads.max(axis=0), label="range", **HATCHED)
            axes.plot(one.time, one.loads.mean(axis=0), label="mean of the repeats", **{**MEASURED, "lw": 1.2})
            if one.predicted is not None:
                axes.plot(one.time, one.predicted, label="law of the other speeds", **{**SIMULATED, "lw": 1.2})
            axes.set_title(one.group)
            axes.set_xlim(float(one.time[0]), float(one.time[-1]))
        for axes in panels[len(curves) :]:
            axes.set_axis_off()
        figure.supxlabel("time from the first peak [s]", fontsize=7.5)
        figure.supylabel("load [N]", fontsize=7.5)
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)

    return svg(draw, 16.0 + PANEL * rows)
