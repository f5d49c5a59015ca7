"""``cutcal coverage``: whether the intervals of a calibration hold the truth, on cuts whose truth is known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from cutcal.options import (
    RESUME_HELP,
    RUN,
    add_food,
    add_run,
    add_workers,
    food_of,
    print_json,
    say,
    titled,
    whole,
    workers_of,
)

HELP = "calibrate made-up traces: do the intervals hold the truth?"
DESCRIPTION = """Simulate cuts with values drawn from the food's ranges, measure them with a
made-up sensor (25 N baseline, drift, gain, noise and ripple like a robot's),
calibrate each, and count how often the 95 % intervals hold the truth. It also
says, before a knife is lifted, which properties such a measurement could tell.
Writes coverage.json and a line for each trace to --out."""
EPILOG = """example:
  cutcal coverage --food banana --traces 100 --out runs/coverage

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 intervals of identified properties hold the truth in 90 % or more
(of a hundred in 90 to 99), with a median error of at most 10 %, 1 error in
input or run, 2 they do not."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    add_food(p)
    p.add_argument("--traces", type=whole(1), default=100, metavar="N", help="how many (default 100)")
    p.add_argument("--sample", action="store_true", help="sample each posterior, as calibrate --sample does")
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Run the study; prints its table, or coverage.json."""
    from calib.posterior.sampling import check_installed
    from calib.validation.interval_coverage import CoveragePlan
    from calib.validation.interval_coverage import run as study

    food = food_of(args)
    command = ("coverage", *(a for a in sys.argv[1:] if a != "coverage"))
    plan = CoveragePlan(food, args.traces, args.knife, args.dx, args.seed, sample=args.sample, command=command)
    if args.sample:
        check_installed()
    out = Path(args.out or f"cutcal-coverage-{food.name}")

    with workers_of(args, say) as pool:
        document = study(plan, out, pool, resume=args.resume, say=say)
    if args.json:
        print_json(document)
    else:
        print(table(document))
        print(f"  wrote {out}")
    return 0 if document["passed"] else 2


def table(document: dict[str, Any]) -> str:
    """What the terminal shows at the end."""
    lines = [
        f"{document['food']}: {'passed' if document['passed'] else 'not passed'}; {document['calibrated']} of "
        f"{document['traces']} made-up traces calibrated, {document['wall_s']:.0f} s",
        f"  {'':18s}{'holds truth':>12s}{'identified':>12s}{'holds truth':>12s}{'median error':>14s}  verdicts",
    ]
    for name, p in document["parameters"].items():
        verdicts = ", ".join(f"{n} {v.replace('_', ' ')}" for v, n in p["verdicts"].items())
        held, error = p["covered_identified"], p["median_error_identified"]
        lines.append(
            f"  {name:18s}{p['covered']:12.0%}{p['identified']:12d}{'' if held is None else f'{held:.0%}':>12s}"
            f"{'' if error is None else f'{error:.1%}':>14s}  {verdicts}"
        )
    lines += [f"  not calibrated: {text}" for text in document["errors"]]
    return "\n".join(lines)
