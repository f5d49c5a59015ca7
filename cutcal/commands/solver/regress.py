"""``cutcal regress``: whether cuts are still those that were recorded."""

from __future__ import annotations

import argparse
import math
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from calib.errors import RegressionError
from calib.io.typed_document import to_document
from calib.material.food import load_food, load_foods
from calib.material.knife import load_knife
from cutcal.options import RUN, add_arch, add_json, add_workers, print_json, say, titled, workers_of
from mpm.scene import CONTACTS

if TYPE_CHECKING:
    from studies.regression.result import CutComparison, NumberChange, RegressionResult

HELP = "are cuts still those that were recorded, or what changed?"
DESCRIPTION = """Simulate the default cut of each food, with each kind of contact, on a coarse
grid, and compare it with the curves recorded in force_data/reference: same (but
for rounding), within (no further away than a run with other particles, in 95 of
100) or OUTSIDE. With --update, record what has changed and say what there is to
argue over: peak, work and shape, beside what other particles change."""
EPILOG = """examples:
  cutcal regress
  cutcal regress grape cherry --contact cohesive
  cutcal regress banana --update

Ctrl-C keeps the references that were recorded so far and leaves the others as
they were; the same command goes on, and keeps what is recorded to the byte.
Exit codes: 0 all same or within (--update: all recorded), 1 error in input or
run, 2 some outside, or a cut that did not reach its end."""
WIDTHS = "{:13s} {:9s} {:>8s} {:>7s} {:>8s} {:>7s} {:>7s} {:>7s}  {:28s} {}"


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("names", nargs="*", metavar="FOOD", help="foods of materials.yaml; all of them by default")
    p.add_argument("--contact", choices=CONTACTS, metavar="KIND", help="cohesive or nodal (default: both)")
    p.add_argument("--update", action="store_true", help="record what has changed in the checkout's references")
    add_workers(p, "simulations")
    run = titled(p, RUN)
    run.add_argument("--out", metavar="DIR", help="folder for the curves and regress.json (default: none)")
    add_arch(run)
    add_json(run)


def run(args: argparse.Namespace) -> int:
    """Compare or record; prints the table, or regress.json."""
    from calib.io.folder import prepare
    from studies.regression.baseline import RECORDED_KNIFE, baseline_cuts
    from studies.regression.reference_curves import References
    from studies.regression.result import write_result
    from studies.regression.suite import compare_with_references, record_changes, regression_result

    if args.update and args.arch != "cpu":
        raise RegressionError(
            f"--update --arch {args.arch}: references are recorded on the processor; leave --arch out"
        )
    known, knife = load_foods(), load_knife(RECORDED_KNIFE)
    foods = [known[name] if name in known else load_food(name) for name in dict.fromkeys(args.names)] or list(
        known.values()
    )
    todo = baseline_cuts(foods, knife, CONTACTS if args.contact is None else (args.contact,))
    references = References()
    with nullcontext() if args.out is None else prepare(Path(args.out), "regress", resume=False):
        with workers_of(args, say) as pool:
            if args.update:
                order = [cut.name for food in known.values() for cut in baseline_cuts([food], knife)]
                found = record_changes(todo, references, pool, say, order)
            else:
                found = compare_with_references(todo, references, pool, say)
        result = regression_result(found, args.arch, update=args.update)
        if args.out is not None:
            write_result(result, Path(args.out))
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        if args.out is not None:
            print(f"wrote {args.out}")
    return 0 if result.passed else 2


def table(result: RegressionResult) -> str:
    """What the terminal shows at the end: a line for each cut, and what to argue over where it is not the same."""
    from studies.regression.result import VERDICT_MEANINGS

    head = WIDTHS.format(
        "food", "contact", "peak [N]", "change", "moved", "work", "shape", "NRMSE", "largest deviation", "verdict"
    )
    cuts = result.cases
    lines = [head.rstrip(), *(line(one, result.update) for one in cuts)]
    for one in cuts:
        if one.verdict in ("within", "outside") and (not result.update or one.recorded):
            lines += ["", *argument(one)]
    said = ", ".join(f"{count} {verdict} ({VERDICT_MEANINGS[verdict]})" for verdict, count in result.counts.items())
    lines += ["", f"{len(cuts)} {'cut' if len(cuts) == 1 else 'cuts'}: {said}"]
    if result.update:
        written = sum(one.recorded for one in cuts)
        lines.append(f"{written} recorded, {len(cuts) - written} kept as they were")
    return "\n".join(lines)


def line(one: CutComparison, recording: bool = False) -> str:
    """One cut in the table."""
    verdict = "OUTSIDE" if one.verdict == "outside" else one.verdict
    verdict += f": {one.reason}" if one.reason else ""
    if recording:
        verdict += ", recorded" if one.recorded else ", kept"
    cells = ["-"] * 7
    if one.results is not None:
        cells[0] = f"{one.results.peak_N.now:.4g}"
    if one.results is not None and one.largest is not None:
        far = one.largest
        cells[1:] = [
            percent(one.results.peak_N),
            f"{signed((one.results.peak_stroke_m.change or 0.0) * 1e3, 1)} mm",
            percent(one.results.work_J),
            *("-" if x is None or math.isnan(x) else f"{x:.4f}" for x in (one.shape_error, one.nrmse)),
            f"{far.over_tolerance:.2f} of {far.column}'s tolerance",
        ]
    return WIDTHS.format(one.food, one.contact, *cells, verdict)


def argument(one: CutComparison) -> list[str]:
    """Why a reviewer should look: each change beside what another seed changes, and what else has changed."""
    far, results, shape = one.largest, one.results, one.shape_error
    if far is None or results is None:
        return []
    peak, work, moved = results.peak_N, results.work_J, round((results.peak_stroke_m.change or 0.0) * 1e3, 1)
    when = f"reached {abs(moved)} mm {'later' if moved > 0 else 'earlier'}" if moved else "at the same place"
    without = shape is None or math.isnan(shape)
    form = "no force to compare the shape of" if without else f"shape error {shape:.4f}"
    unit = far.column.rpartition("_")[2]
    because = "; ".join(one.because) or "nothing that a record knows of (food, knife, scene, solver, libraries)"
    return [
        f"{one.food}, {one.contact}:",
        f"  peak {peak.before:.4g} -> {peak.now:.4g} N ({percent(peak)}, {seeds(peak)}), {when}",
        f"  work {work.before:.4g} -> {work.now:.4g} J ({percent(work)}, {seeds(work)})",
        f"  {form}; furthest away is {far.column}, by {far.difference:.3g} {unit} at {far.stroke_m * 1e3:.1f} mm, "
        f"{far.over_tolerance:.1f} of its tolerance",
        f"  changed since it was recorded: {because}",
    ]


def percent(number: NumberChange) -> str:
    """A change as a part of what was before."""
    if not number.before or number.change is None:
        return "-"
    return f"{signed(100 * number.change / number.before, 1)} %"


def signed(x: float, digits: int) -> str:
    """A number with its sign, and no minus before a zero."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def seeds(number: NumberChange) -> str:
    """A change beside the repeatability limit."""
    return f"{number.over_limit:.1f} times what another seed changes"
