"""Figure and report of a benchmark: error over run time, one mark for each way of simulating the same cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from reports import ReportError
from reports.base.brief import AGAIN, Brief, ReportPart, ReportTable
from reports.base.figures import BLACK, BLUE, GREY, svg
from reports.base.format import breakable, count, duration, quantity
from reports.web.brief import publish_brief

if TYPE_CHECKING:
    from studies.speed.result import (
        Ablation,
        BenchmarkResult,
        CutErrors,
        DefaultCut,
        PeerResult,
        ProcessScaling,
        PublishedConfiguration,
        Throughput,
    )

KERNELS = "On a block at rest, in one run side by side; only the ratios mean something on another machine."
PEERS = (
    "An elastic block whose weight is put on at once, through their own packages: the same particles and grid, in "
    "single precision, in one run. The error is that of the force on the floor over a period, root mean square over "
    "its peak, against the closed form. The implicit code takes one step where the others take ten."
)
NOT_SHOWN = (
    "Run times are those of one machine on one day; ratios carry over to others better than times.",
    "The published configuration was not run to its end: its steps were timed and multiplied.",
    "The reference is this solver's own cut on a finer grid: that its laws are the food's is not asked here.",
)
FIGURE_ALT = "Error over run time of the default cut and of the same with one thing changed"
LEAST_ERROR = 1e-4  # smaller errors are drawn here
CLOSE = 0.15  # marks that are nearer than this part of their place share a label


@dataclass(frozen=True)
class Measured:
    """What a report needs of a benchmark: a benchmark that was interrupted early has not measured all of it.

    Attributes:
        rate: Rates of the kernels.
        paper: The published configuration.
        cut: The default cut.
        ratio_to_paper: Run time of the published configuration over that of the default cut [-].
        ablations: The default cut with one thing changed.
    """

    rate: Throughput
    paper: PublishedConfiguration
    cut: DefaultCut
    ratio_to_paper: float
    ablations: Sequence[Ablation]


@dataclass(frozen=True)
class Mark:
    """A mark of the figure: a way of simulating the cut.

    Attributes:
        name: Its name.
        time_ratio: Run time over that of the default cut [-].
        particles: Particles.
        steps: Time steps.
        errors: Errors against the reference.
    """

    name: str
    time_ratio: float
    particles: int
    steps: int
    errors: CutErrors


def write_figure(result: BenchmarkResult, out: Path) -> None:
    """Draw ``bench.svg`` into a folder.

    Args:
        result: The benchmark.
        out: The folder.

    Raises:
        ReportError: Too little was measured.
    """
    (out / "bench.svg").write_bytes(_picture(_marks(_measured(result, out))))


def write_report(result: BenchmarkResult, out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``bench.json``.

    Args:
        result: The benchmark.
        out: Its folder.

    Returns:
        Path of the report.

    Raises:
        ReportError: Too little was measured, or the report cannot be written.
    """
    return publish_brief(out / "bench.json", _brief(result, _measured(result, out)), result)


def _measured(result: BenchmarkResult, out: Path) -> Measured:
    """What was measured; an error where the benchmark was interrupted before the first ablation."""
    rate, paper, cut = result.throughput, result.paper_config, result.default_cut
    if rate is None or paper is None or cut is None or result.ratio_to_paper is None or result.ablations is None:
        path = out / "bench.json"
        raise ReportError(f"{path}: the benchmark was interrupted before the default cut was compared; {AGAIN}")
    return Measured(rate, paper, cut, result.ratio_to_paper, result.ablations)


def _brief(result: BenchmarkResult, found: Measured) -> Brief:
    """What the report holds."""
    cut, errors, marks = found.cut, found.cut.errors, _marks(found)
    largest = max(abs(e) for e in (errors.peak_error, errors.work_error, errors.nrmse))
    finest = quantity(cut.reference_dx_m, "m")
    parts = [
        ReportPart(
            "Run time against error",
            f"Errors against the same cut on cells of {finest}.",
            _picture(marks),
            FIGURE_ALT,
            _ablations(marks, found.ablations),
        ),
        ReportPart("Kernels", KERNELS, table=_kernels(found.rate, result.processes)),
    ]
    if result.peers:
        parts.append(ReportPart("Other codes", PEERS, table=_peers(result.peers)))
    part_of_paper = count(round(found.ratio_to_paper))
    return Brief(
        kind="Run time against error",
        name=result.food.replace("_", " ").capitalize(),
        passed=None,
        sentence=f"The default cut takes {duration(cut.wall_s)}, 1/{part_of_paper} of the published configuration, "
        f"and is off by {quantity(largest, 'fraction', digits=2)} at most (peak, work, curve).",
        facts=_facts(result, found.paper),
        parts=parts,
        limits=NOT_SHOWN if result.complete else (*NOT_SHOWN, "The benchmark was interrupted: some of it is missing."),
    )


def _facts(result: BenchmarkResult, paper: PublishedConfiguration) -> list[tuple[str, str]]:
    """What was done, and what it gave beside the tables."""
    facts = [
        ("Device", f"{result.device}, {result.threads} threads"),
        (
            "Published configuration",
            f"{paper.nodes}³ nodes, {count(paper.particles)} particles, time step {paper.dt_s * 1e6:g} µs: "
            f"{duration(paper.wall_s_extrapolated)}, extrapolated from its steps",
        ),
        ("Time over particles", f"power {quantity(result.exponent, '-')} of particles times steps"),
    ]
    if result.processes is not None:
        gain = f"{quantity(result.processes.speed_up, '-')} times the cuts of one"
        facts.append((f"{result.processes.processes} processes", gain))
        if result.processes.start_up_s is not None:
            facts.append(("A further process", f"starts in {quantity(result.processes.start_up_s, 's')}"))
    for one in (result.batches or ())[1:]:
        facts.append((f"{one.cuts} cuts side by side", f"{quantity(one.per_cut, '-')} of the time of one each"))
    return facts


def _marks(found: Measured) -> list[Mark]:
    """The default cut and those with one thing changed that have an error."""
    cut = found.cut
    others = [
        Mark(one.name, one.time_ratio, one.particles, one.steps, one.errors)
        for one in found.ablations
        if one.errors is not None
    ]
    return [Mark("default", 1.0, cut.particles, cut.steps, cut.errors), *others]


def _ablations(marks: Sequence[Mark], ablations: Sequence[Ablation]) -> ReportTable:
    lines = [
        [
            str(k), mark.name, quantity(mark.time_ratio, "-"), count(mark.particles), count(mark.steps),
            quantity(mark.errors.peak_error, "fraction", digits=2, signed=True),
            quantity(mark.errors.work_error, "fraction", digits=2, signed=True),
            quantity(mark.errors.nrmse, "fraction", digits=2),
        ]
        for k, mark in enumerate(marks, 1)
    ]  # fmt: skip
    for one in ablations:
        if one.errors is None:
            name = one.name if one.status == "done" else f"{one.name}: {one.status}"
            lines.append(["", name, quantity(one.time_ratio, "-"), *[""] * 5])
    head = ("", "What is changed", "Time", "Particles", "Steps", "Peak", "Work", "NRMSE")
    return ReportTable(head, ("auto", "1fr", *["auto"] * 6), lines, left=2)


def _kernels(rate: Throughput, processes: ProcessScaling | None) -> ReportTable:
    rows = [
        ["all physics, block", quantity(rate.full_physics_Mps, "-")],
        ["all physics, in the default cut", quantity(rate.cut_Mps, "-")],
        ["textbook kernel with the same physics", quantity(rate.textbook_Mps, "-")],
        ["what the memory would bear", quantity(rate.memory_bound_Mps, "-")],
    ]
    if rate.single_Mps is not None:
        rows.insert(1, ["the same in single precision", quantity(rate.single_Mps, "-")])
    if processes is not None and processes.cut_Mps is not None:
        cuts = f"{processes.processes} default cuts in as many processes"
        rows.insert(-2, [cuts, quantity(processes.cut_Mps, "-")])
    return ReportTable(("Kernel", "Million particle steps a second"), ("1fr", "60mm"), rows)


def _peers(peers: Sequence[PeerResult]) -> ReportTable:
    """Rates of other codes; one that could not be measured says why."""
    rows = []
    for peer in peers:
        if hasattr(peer, "error"):
            rows.append([peer.name, f"not measured: {breakable(peer.error)}", "", "", "", ""])
        else:
            rates = [quantity(rate, "-") for rate in (peer.Mps, peer.ours_Mps, peer.ratio)]
            errors = [f"{error:.1%}" for error in (peer.force_error, peer.ours_force_error)]
            rows.append([f"{peer.name} {peer.version}", *rates, *errors])
    head = ("Code", "Its rate", "Ours", "Its time over ours", "Its error", "Ours")
    return ReportTable(head, ("1fr", *["auto"] * 5), rows)


def _picture(marks: Sequence[Mark]) -> bytes:
    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, mark in enumerate(marks):
            for label, error, marker, color in (
                ("NRMSE", mark.errors.nrmse, "o", BLACK),
                ("|work error|", mark.errors.work_error, "^", BLUE),
            ):
                y = 100 * max(abs(error), LEAST_ERROR)
                axes.plot(mark.time_ratio, y, marker, ms=4, color=color, label=label if k == 0 else None)
        for numbers, at in _labels(marks):
            axes.annotate(numbers, at, (0, 5), textcoords="offset points", fontsize=7)
        for axis in (axes.xaxis, axes.yaxis):
            axis.axes.set(**{f"{axis.axis_name}scale": "log"})
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("run time over that of the default cut")
        axes.set_ylabel("error against the reference [%]")
        axes.margins(x=0.15, y=0.25)
        names = "\n".join(f"{k} {mark.name}" for k, mark in enumerate(marks, 1))
        axes.text(1.02, 1.0, names, transform=axes.transAxes, va="top", fontsize=7, color=GREY)
        axes.legend(loc="lower left", bbox_to_anchor=(1.0, 0.0))

    return svg(draw, 90.0)


def _labels(marks: Sequence[Mark]) -> list[tuple[str, tuple[float, float]]]:
    """Numbers of the marks of NRMSE and where they are written; marks that lie on each other share a label."""
    labels: list[tuple[list[int], tuple[float, float]]] = []
    for number, mark in enumerate(marks, 1):
        x, y = mark.time_ratio, 100 * max(mark.errors.nrmse, LEAST_ERROR)
        near = next(
            (label for label in labels if max(abs(x / label[1][0] - 1), abs(y / label[1][1] - 1)) < CLOSE), None
        )
        if near is None:
            labels.append(([number], (x, y)))
        else:
            near[0].append(number)
    return [(", ".join(map(str, numbers)), at) for numbers, at in labels]
