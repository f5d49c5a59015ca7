"""Figure and report of a benchmark: error over run time, one mark for each way of simulating the same cut."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from reports.base.brief import Brief, Part, Table, write_brief
from reports.base.figures import BLACK, BLUE, GREY, svg
from reports.base.format import breakable, count, duration, quantity
from reports.base.run_folder import Data

ERRORS = ("peak_error", "work_error", "nrmse")
KERNELS = "On a block at rest, in one run side by side; only the ratios mean something on another machine."
PEERS = "The same particles, grid and elastic block through their own packages, in single precision, in one run."
LIMITS = (
    "Run times are those of one machine on one day; ratios carry over to others better than times.",
    "The published configuration was not run to its end: its steps were timed and multiplied.",
    "The reference is this solver's own cut on a finer grid: that its laws are the food's is not asked here.",
)
FLOOR = 1e-4  # smaller errors are drawn here
CLOSE = 0.15  # marks that are nearer than this part of their place share a label


def write_figure(out: Path) -> None:
    """Draw bench.svg from bench.json in ``out``."""
    document = json.loads((out / "bench.json").read_text(encoding="utf-8"))
    (out / "bench.svg").write_bytes(_picture(document))


def write_report(out: Path) -> Path:
    """Write report.pdf from bench.json in ``out``.

    Raises:
        ReportError: The file is missing, damaged or incomplete, or the report cannot be written.
    """
    return write_brief(out / "bench.json", _brief)


def _brief(d: Data) -> Brief:
    """What the report holds."""
    cut, paper, rate = d["default_cut"], d["paper_config"], d["throughput"]
    error = quantity(max(abs(cut[k]) for k in ERRORS), "fraction", digits=2)
    parts = [
        Part("Run time against error", "Errors against the same cut on cells of " + quantity(cut["reference_dx_m"], "m") + ".",
             _picture(d), "Error over run time of the default cut and of the same with one thing changed", _ablations(d)),
        Part("Kernels", KERNELS, table=_kernels(rate, d.get("processes"))),
    ]  # fmt: skip
    if d.get("peers"):
        parts.append(Part("Other codes", PEERS, table=_peers(d["peers"])))
    processes = d.get("processes") or {}
    facts = [
        ("Device", f"{d['device']}, {d['threads']} threads"),
        ("Published configuration", f"{paper['nodes']}³ nodes, {count(paper['particles'])} particles, time step {paper['dt_s'] * 1e6:g} µs: "
         f"{duration(paper['wall_s_extrapolated'])}, extrapolated from its steps"),
        ("Time over particles", f"power {quantity(d.get('exponent'), '-')} of particles times steps"),
    ]  # fmt: skip
    if processes:
        facts.append(
            (f"{processes['processes']} processes", f"{quantity(processes['speed_up'], '-')} times the cuts of one")
        )
    if "start_up_s" in processes:
        facts.append(("A further process", f"starts in {quantity(processes['start_up_s'], 's')}"))
    for row in (d.get("batches") or [])[1:]:
        facts.append((f"{row['cuts']} cuts side by side", f"{quantity(row['per_cut'], '-')} of the time of one each"))
    return Brief(
        kind="Run time against error",
        name=str(d["food"]).replace("_", " ").capitalize(),
        passed=None,
        sentence=f"The default cut takes {duration(cut['wall_s'])}, 1/{count(round(d['ratio_to_paper']))} of the published configuration, "
        f"and is off by {error} at most (peak, work, curve).",
        facts=facts,
        parts=parts,
        limits=LIMITS if d.get("complete") else (*LIMITS, "The benchmark was interrupted: some of it is missing."),
    )


def _rows(d: Data) -> list[Data]:
    """The default cut and those with one thing changed that have an error."""
    rows: list[Data] = [{"name": "default", "time_ratio": 1.0, **d["default_cut"]}]
    return rows + [row for row in d["ablations"] if "nrmse" in row]


def _ablations(d: Data) -> Table:
    lines = []
    for k, row in enumerate(_rows(d), 1):
        errors = [quantity(row[name], "fraction", digits=2, signed=name != "nrmse") for name in ERRORS]
        lines.append(
            [
                str(k),
                str(row["name"]),
                quantity(row["time_ratio"], "-"),
                count(row["particles"]),
                count(row["steps"]),
                *errors,
            ]
        )
    lines += [
        ["", str(row["name"]) if row.get("status") == "done" else f"{row['name']}: {row.get('status', 'not run')}", quantity(row.get("time_ratio"), "-"), *[""] * 5]
        for row in d["ablations"] if "nrmse" not in row
    ]  # fmt: skip
    head = ("", "What is changed", "Time", "Particles", "Steps", "Peak", "Work", "NRMSE")
    return Table(head, ("auto", "1fr", *["auto"] * 6), lines, left=2)


def _kernels(rate: Data, processes: Data | None) -> Table:
    rows = [
        ["all physics, block", quantity(rate["full_physics_Mps"], "-")],
        ["all physics, in the default cut", quantity(rate["cut_Mps"], "-")],
        ["textbook kernel with the same physics", quantity(rate["textbook_Mps"], "-")],
        ["what the memory would bear", quantity(rate["memory_bound_Mps"], "-")],
    ]
    if "single_Mps" in rate:
        rows.insert(1, ["the same in single precision", quantity(rate["single_Mps"], "-")])
    if processes and "cut_Mps" in processes:
        cuts = f"{processes['processes']} default cuts in as many processes"
        rows.insert(-2, [cuts, quantity(processes["cut_Mps"], "-")])
    return Table(("Kernel", "Million particle steps a second"), ("1fr", "60mm"), rows)


def _peers(peers: list[Data]) -> Table:
    """Rates of other codes; one that could not be measured says why."""
    rows = []
    for p in peers:
        if "error" in p:
            rows.append([p["name"], f"not measured: {breakable(str(p['error']))}", "", ""])
        else:
            rates = [quantity(p[name], "-") for name in ("Mps", "ours_Mps", "ratio")]
            rows.append([f"{p['name']} {p.get('version', '')}", *rates])
    return Table(("Code", "Its rate", "Ours", "Ours over its"), ("1fr", "auto", "auto", "auto"), rows)


def _picture(document: Data) -> bytes:
    rows = _rows(document)

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for k, row in enumerate(rows):
            x = row["time_ratio"]
            for name, marker, color in (("nrmse", "o", BLACK), ("work_error", "^", BLUE)):
                label = {"nrmse": "NRMSE", "work_error": "|work error|"}[name] if k == 0 else None
                axes.plot(x, 100 * max(abs(row[name]), FLOOR), marker, ms=4, color=color, label=label)
        for numbers, at in _labels(rows):
            axes.annotate(numbers, at, (0, 5), textcoords="offset points", fontsize=7)
        for axis in (axes.xaxis, axes.yaxis):
            axis.axes.set(**{f"{axis.axis_name}scale": "log"})
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(FormatStrFormatter("%g"))
            axis.set_minor_formatter(NullFormatter())
        axes.set_xlabel("run time over that of the default cut")
        axes.set_ylabel("error against the reference [%]")
        axes.margins(x=0.15, y=0.25)
        names = "\n".join(f"{k} {row['name']}" for k, row in enumerate(rows, 1))
        axes.text(1.02, 1.0, names, transform=axes.transAxes, va="top", fontsize=7, color=GREY)
        axes.legend(loc="lower left", bbox_to_anchor=(1.0, 0.0))

    return svg(draw, 90.0)


def _labels(rows: list[dict[str, Any]]) -> list[tuple[str, tuple[float, float]]]:
    """Numbers of the marks of NRMSE and where they are written; marks that lie on each other share a label."""
    labels: list[tuple[list[int], tuple[float, float]]] = []
    for number, row in enumerate(rows, 1):
        x, y = row["time_ratio"], 100 * max(row["nrmse"], FLOOR)
        near = next(
            (label for label in labels if max(abs(x / label[1][0] - 1), abs(y / label[1][1] - 1)) < CLOSE), None
        )
        if near is None:
            labels.append(([number], (x, y)))
        else:
            near[0].append(number)
    return [(", ".join(map(str, numbers)), at) for numbers, at in labels]
