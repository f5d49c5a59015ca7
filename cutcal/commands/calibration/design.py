"""``cutcal design``: which test of a food to make next."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.material.knife import load_knife
from cutcal.options import (
    KNIFE_HELP,
    RESUME_HELP,
    RUN,
    add_run,
    add_workers,
    food_of,
    number,
    print_json,
    say,
    titled,
    whole,
    workers_of,
)
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from calib.design.result import DesignedTest, DesignResult
    from calib.design.start import Start

HELP = "which test of a food to make next"
DESCRIPTION = """Rank the tests that a lab can make of a food by what they are expected to leave
open: of all parameters, of one, or of the peak (or work) under a knife. It
starts from a finished calibration (--run), or from the literature (--food).
Writes design.json and design.svg to --out."""
EPILOG = """examples:
  cutcal design --run runs/potato --for R --out runs/next
  cutcal design --food banana --for "peak under knife edc" --out runs/first

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 a test narrows it by a tenth or more, 1 error in input or run,
2 none does."""
DRAWS = 1


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("--run", metavar="DIR", help="start from this calibration: the folder of calibrate on one trace")
    p.add_argument("--food", metavar="NAME", help="or from the literature of a food of materials.yaml")
    p.add_argument("--material", metavar="YAML", help="take the food from this file: a material.yaml")
    p.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="give a property another value [SI]"
    )
    p.add_argument("--knife", metavar="NAME", help=f"with --food: {KNIFE_HELP}")
    p.add_argument(
        "--for",
        dest="asked",
        default="all",
        metavar="WHAT",
        help='all (default), a parameter such as R, or "peak under knife NAME", "work under knife NAME"',
    )
    p.add_argument(
        "--blade", action="append", metavar="NAME", help="another knife that the lab has (default: of knives.yaml)"
    )
    p.add_argument("--minutes", metavar="TEST=MIN", help="lab work that you know better, e.g. blade=5,compression=60")
    p.add_argument(
        "--draws", type=whole(1), default=DRAWS, metavar="N", help="foods that the tests are judged about (default 1)"
    )
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Judge the tests; prints the table, or design.json."""
    from calib.design.result import to_document
    from calib.design.run import DesignRequest
    from calib.design.run import run as design

    start = _start(args)
    blades = None if args.blade is None else tuple(load_knife(name) for name in dict.fromkeys(args.blade))
    command = ("design", *(a for a in sys.argv[1:] if a != "design"))
    request = DesignRequest(start, args.asked.strip(), blades, _minutes(args.minutes), args.draws, args.seed, command)
    out = Path(args.out or f"cutcal-design-{start.food.name}")
    with workers_of(args, say) as pool:
        result = design(request, out, pool, resume=args.resume, say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        print(f"wrote {out}")
    return 0 if result.recommended is not None else 2


def _start(args: argparse.Namespace) -> Start:
    """What the options say is known.

    Raises:
        CutcalError: Neither or both of a calibration and a food, or an option that does not go with it.
    """
    from calib.design.start import start_of_food, start_of_run

    if (args.run is None) == (args.food is None):
        raise CutcalError("design needs a start: give --run DIR of a finished calibration, or --food NAME, not both")
    if args.run is None:
        return start_of_food(food_of(args), load_knife(args.knife or "kitchen"))
    for name in ("material", "set", "knife"):
        if getattr(args, name):
            raise CutcalError(f"--{name}: the calibration of --run has its food and knife; leave it out")
    return start_of_run(Path(args.run))


def _minutes(given: str | None) -> dict[str, float]:
    """Lab work by kind of test.

    Raises:
        CutcalError: No such list.
    """
    out = {}
    for part in [] if given is None else given.split(","):
        name, sign, value = part.partition("=")
        try:
            out[name.strip()] = number(0.0, 1e5, "min")(value.strip())
        except argparse.ArgumentTypeError as e:
            raise CutcalError(f"--minutes {part}: {e}; write TEST=MINUTES, for instance blade=5") from None
        if not sign:
            raise CutcalError(f"--minutes {part}: write TEST=MINUTES, for instance blade=5")
    return out


def table(result: DesignResult) -> str:
    """What the terminal shows at the end."""
    start = f"the literature of {result.food}" if result.run is None else f"{result.food}, calibrated in {result.run}"
    lines = [f"{start}; asked: {result.asked}", *_known(result), ""]
    lines.append(f"  {'test':16s} {'minutes':>7s} {'bits':>6s}  {'expected 95 % interval':>28s} {'of now':>7s}  record")
    lines += [_row(result, test) for test in result.tests]
    lines += [f"  left out: {one.name}: {one.reason}" for one in result.left_out]
    best = next((t for t in result.tests if t.name == result.recommended), None)
    lines.append("no test narrows it by a tenth" if best is None else f"next: {best.what} ({best.minutes:g} min)")
    return "\n".join(lines)


def _known(result: DesignResult) -> list[str]:
    """What is known of what was asked for."""
    lines = []
    shown = (
        dict(result.known) if result.asked == "all" else {n: k for n, k in result.known.items() if n == result.asked}
    )
    if result.quantity is not None:
        shown[result.asked] = result.quantity
    for name, known in shown.items():
        lines.append(f"  now {name:20s} {known.value:10.4g} {known.unit:6s} {known.low95:.3g} to {known.high95:.3g}")
    return lines


def _row(result: DesignResult, test: DesignedTest) -> str:
    """One test; of all parameters the one that it narrows most."""
    name, shown = test.shown
    what = f"{shown.low95:.3g} to {shown.high95:.3g}" + ("" if name is None else f" ({name})")
    record = "no command takes it yet" if test.taken_by == "none" else test.taken_by
    return f"  {test.name:16s} {test.minutes:7g} {test.bits:6.2f}  {what:>28s} {shown.part:7.0%}  {record}"
