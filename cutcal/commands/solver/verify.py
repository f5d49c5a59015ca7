"""``cutcal verify``: the solver against closed forms and the finite-element reference."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from cutcal.options import (
    RESUME_HELP,
    RUN,
    add_run,
    add_workers,
    print_json,
    say,
    titled,
    workers_of,
)

if TYPE_CHECKING:
    from studies.verification.result import Verification

HELP = "compare the solver with closed forms and finite elements"
DESCRIPTION = """Compare the solver with closed forms, and with finite elements of the same law:
laws at a point, conservation, waves, vibration, friction, impact, a
manufactured solution, presses, and the cutting force of a thin blade. The
finite elements are themselves compared with known answers. Writes verify.json,
verify.svg, report.pdf and report.html to --out."""
EPILOG = """examples:
  cutcal verify --quick
  cutcal verify --only press --out runs/presses

Ctrl-C keeps the cases that ended; the same command with --resume goes on.
Exit codes: 0 all rows pass, 1 error in input or run, 2 a row fails."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("--quick", action="store_true", help="coarse versions of the fast cases: a minute")
    p.add_argument("--only", metavar="TEXT", help="only cases with this in their name")
    add_workers(p, "cases")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Run the cases; prints their table, or verify.json."""
    from studies.verification.case import SuiteOptions
    from studies.verification.suite import run_suite

    out = Path(args.out or "cutcal-verify")
    command = ("verify", *(a for a in sys.argv[1:] if a != "verify"))

    with workers_of(args, say) as pool:
        options = SuiteOptions(args.quick, args.seed, args.arch)
        result = run_suite(out, options, pool, only=args.only, command=command, resume=args.resume, say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(f"{table(result)}\n  wrote {out}")
    return 0 if result.passed else 2


def table(result: Verification) -> str:
    """What the terminal shows at the end."""
    lines, group = [], None
    for row in result.rows:
        if row.group != group:
            group = row.group
            lines.append(f"{group}")
        sign = ">=" if row.least else "  "
        got, error = (x if math.isfinite(x) else math.nan for x in (row.got, row.error))
        numbers = f"{sign} {row.expected:11.5g} {got:11.5g} {error:+9.2g} {row.tolerance:8.1g}"
        lines.append(f"  {'ok  ' if row.passed else 'FAIL'} {numbers}  {row.case}: {row.quantity}")
    lines += [f"  FAIL {name} broke down: {why}" for name, why in result.broken.items()]
    failed = sum(not row.passed for row in result.rows) + len(result.broken)
    head = f"{'':9}{'expected':>11} {'got':>11} {'error':>9} {'allowed':>8}"
    return "\n".join([head, *lines, f"{len(result.rows)} rows, {failed or 'none'} failed"])
