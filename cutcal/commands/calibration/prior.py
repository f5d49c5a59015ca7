"""``cutcal prior``: what the literature predicts of a cut before any trace is seen."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from calib.material.food import load_food, load_foods
from calib.material.knife import load_knife
from calib.material.remarks import notes
from cutcal.options import (
    KNIFE_HELP,
    RESUME_HELP,
    RUN,
    add_run,
    add_workers,
    print_json,
    say,
    titled,
    whole,
    workers_of,
)

HELP = "forces that the literature predicts before any trace"
DESCRIPTION = """Simulate the default cut of a food at its values of materials.yaml and at draws
from the priors of its default fit, on the coarse grid that a fit screens with.
Writes the quantiles of the force over stroke (FOOD.csv), of peak and work
(prior.json) and a figure (prior.svg) to --out. A trace far outside the band is
of another specimen or knife, in another unit, or worth a look."""
EPILOG = """examples:
  cutcal prior banana cherry
  cutcal prior --out runs/prior --workers 4

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 the default values of every food finish the cut, 1 error in input
or run, 2 they do not."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("names", nargs="*", metavar="FOOD", help="foods of materials.yaml; all of them by default")
    p.add_argument(
        "--draws", type=whole(1), default=32, metavar="N", help="draws from the priors of each food (default 32)"
    )
    p.add_argument("--knife", default="kitchen", metavar="NAME", help=KNIFE_HELP)
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Simulate; prints the table, or prior.json."""
    from calib.validation.prior_predictive import PriorStudy
    from calib.validation.prior_predictive import run as study

    foods = [load_food(name) for name in dict.fromkeys(args.names)] or list(load_foods().values())
    out = Path(args.out or "cutcal-prior")

    with workers_of(args, say) as pool:
        asked = PriorStudy(tuple(foods), load_knife(args.knife), args.draws, args.seed)
        document = study(asked, out, pool, resume=args.resume, say=say)
    if args.json:
        print_json(document)
        return 0 if document["passed"] else 2
    for food in foods:
        for warning in notes(food):
            print(f"note: {warning}", file=sys.stderr)
    print(table(document))
    print(f"wrote {out}")
    return 0 if document["passed"] else 2


def table(document: dict[str, Any]) -> str:
    """What the terminal shows at the end."""
    lines = [
        f"{'food':13s} {'peak [N]':>9s} {'95 % of the draws':>19s} {'work [J]':>9s} {'pressed away':>13s}  "
        "draws that broke down"
    ]
    for name, row in document["foods"].items():
        peak, work = row["peak_N"], row["work_J"]
        span = f"{peak['q025']:.3g} to {peak['q975']:.3g}"
        failed = ", ".join(f"{count} {reason}" for reason, count in row["failed"].items()) or "-"
        if row["default_status"] != "ok":
            failed = f"DEFAULT VALUES: {row['default_status']}; {failed}"
        lines.append(
            f"{name:13s} {peak['default']:9.3g} {span:>19s} {work['default']:9.3g} {row['pressed']:>13d}  {failed}"
        )
    return "\n".join(lines)
