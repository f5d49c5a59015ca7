"""``cutcal regress``: whether cuts are still those that were recorded."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from calib.errors import RegressionError
from calib.io.schema import tag
from calib.material.food import load_food, load_foods
from calib.material.knife import load_knife
from cutcal.options import RUN, add_arch, add_json, add_workers, print_json, say, titled, workers_of
from mpm.scene import CONTACTS

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
    from studies.regression.baseline import KNIFE, cases
    from studies.regression.reference_curves import References
    from studies.regression.study import check, update

    if args.update and args.arch != "cpu":
        raise RegressionError(
            f"--update --arch {args.arch}: references are recorded on the processor; leave --arch out"
        )
    known, knife = load_foods(), load_knife(KNIFE)
    foods = [known[name] if name in known else load_food(name) for name in dict.fromkeys(args.names)] or list(
        known.values()
    )
    todo = cases(foods, knife, CONTACTS if args.contact is None else (args.contact,))
    references = References()
    if args.out is not None:
        prepare(Path(args.out), resume=False)
    with workers_of(args, say) as pool:
        if args.update:
            order = [case.name for food in known.values() for case in cases([food], knife)]
            rows = update(todo, references, pool, say, order)
        else:
            rows = check(todo, references, pool, say)
    document = document_of(rows, args)
    if args.out is not None:
        write(Path(args.out), rows, document)
    if args.json:
        print_json(document)
    else:
        print(table(rows, recording=args.update))
        if args.out is not None:
            print(f"wrote {args.out}")
    return 0 if document["passed"] else 2


def document_of(rows: Sequence[Mapping[str, Any]], args: argparse.Namespace) -> dict[str, Any]:
    """regress.json: every case, how many of each verdict, and whether all passed."""
    from calib.io.provenance import git_commit, versions

    bad = {"broke down"} if args.update else {"broke down", "outside"}
    return {
        "schema": tag("regress"),
        "passed": not any(row["verdict"] in bad for row in rows),
        "update": args.update,
        "counts": dict(Counter(row["verdict"] for row in rows)),
        "cases": [{key: value for key, value in row.items() if key != "columns"} for row in rows],
        "device": args.arch,
        "versions": versions(),
        "git": git_commit(),
    }


def write(out: Path, rows: Sequence[Mapping[str, Any]], document: dict[str, Any]) -> None:
    """The document, and the curves of the cuts that reached their end, in the layout of the references."""
    from calib.io.folder import write_csv, write_json
    from studies.regression.reference_curves import DIGITS

    for row in rows:
        if row["columns"] is not None:
            write_csv(out / f"{row['food']}-{row['contact']}.csv", row["columns"], digits=DIGITS)
    write_json(out / "regress.json", document)


def table(rows: Sequence[Mapping[str, Any]], *, recording: bool = False) -> str:
    """What the terminal shows at the end: a line for each case, and what to argue over where it is not the same."""
    from studies.regression.study import VERDICTS

    head = WIDTHS.format(
        "food", "contact", "peak [N]", "change", "moved", "work", "shape", "NRMSE", "largest deviation", "verdict"
    )
    lines = [head.rstrip(), *(line(row, recording) for row in rows)]
    for row in rows:
        if row["verdict"] in ("within", "outside") and (recording is False or row["recorded"]):
            lines += ["", *argument(row)]
    counts = Counter(row["verdict"] for row in rows)
    said = ", ".join(f"{count} {verdict} ({VERDICTS[verdict]})" for verdict, count in counts.items())
    lines += ["", f"{len(rows)} {'cut' if len(rows) == 1 else 'cuts'}: {said}"]
    if recording:
        written = sum(row["recorded"] for row in rows)
        lines.append(f"{written} recorded, {len(rows) - written} kept as they were")
    return "\n".join(lines)


def line(row: Mapping[str, Any], recording: bool = False) -> str:
    """One case in the table."""
    verdict = "OUTSIDE" if row["verdict"] == "outside" else row["verdict"]
    verdict += f": {row['reason']}" if row["reason"] else ""
    if recording:
        verdict += ", recorded" if row["recorded"] else ", kept"
    cells = ["-"] * 7
    if "largest" in row:
        peak, where, work = (row["results"][name] for name in ("peak_N", "peak_stroke_m", "work_J"))
        far = row["largest"]
        cells = [
            f"{peak['now']:.4g}",
            percent(peak),
            f"{signed(where['change'] * 1e3, 1)} mm",
            percent(work),
            *("-" if row[name] is None else f"{row[name]:.4f}" for name in ("shape_error", "nrmse")),
            f"{far['over_tolerance']:.2f} of {far['column']}'s tolerance",
        ]
    elif "results" in row:
        cells[0] = f"{row['results']['peak_N']['now']:.4g}"
    return WIDTHS.format(row["food"], row["contact"], *cells, verdict)


def argument(row: Mapping[str, Any]) -> list[str]:
    """Why a reviewer should look: each change beside what another seed changes, and what else is another than it was."""
    peak, where, work = (row["results"][name] for name in ("peak_N", "peak_stroke_m", "work_J"))
    far, moved, shape = row["largest"], round(where["change"] * 1e3, 1), row["shape_error"]
    when = f"reached {abs(moved)} mm {'later' if moved > 0 else 'earlier'}" if moved else "at the same place"
    form = "no force to compare the shape of" if shape is None else f"shape error {shape:.4f}"
    unit = far["column"].rpartition("_")[2]
    because = "; ".join(row["because"]) or "nothing that a record knows of (food, knife, scene, solver, libraries)"
    return [
        f"{row['food']}, {row['contact']}:",
        f"  peak {peak['before']:.4g} -> {peak['now']:.4g} N ({percent(peak)}, {seeds(peak)}), {when}",
        f"  work {work['before']:.4g} -> {work['now']:.4g} J ({percent(work)}, {seeds(work)})",
        f"  {form}; furthest away is {far['column']}, by {far['difference']:.3g} {unit} at {far['stroke_m'] * 1e3:.1f} mm, "
        f"{far['over_tolerance']:.1f} of its tolerance",
        f"  changed since it was recorded: {because}",
    ]


def percent(number: Mapping[str, float]) -> str:
    """A change as a part of what was before."""
    return f"{signed(100 * number['change'] / number['before'], 1)} %" if number["before"] else "-"


def signed(x: float, digits: int) -> str:
    """A number with its sign, and no minus before a zero."""
    return f"{round(x, digits) + 0.0:+.{digits}f}"


def seeds(number: Mapping[str, float]) -> str:
    """A change beside the repeatability limit."""
    return f"{number['over_limit']:.1f} times what another seed changes"
