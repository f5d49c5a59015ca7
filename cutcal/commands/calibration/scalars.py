"""``cutcal scalars``: from published numbers of one cut to those of another."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from calib.material.knife import load_knife
from cutcal.options import (
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

if TYPE_CHECKING:
    from calib.scalars.result import FittedNumbers

HELP = "fit properties to published peaks and energies"
DESCRIPTION = """Fit properties (R and mu, or those of the file) to the given numbers of FILE, a
largest force or an energy per cut area, and predict its other numbers, with a
band from draws of what is not fitted. The fit is least squares on logarithms,
with the priors of materials.yaml. Writes scalars.json to --out."""
EPILOG = """examples:
  cutcal scalars force_data/kachru1995.yaml
  cutcal scalars force_data/kachru1995.yaml --fit R,R_initiation --draws 16
  cutcal scalars FILE --together --fit R,mu,R_initiation

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 the given numbers are met within two of their standard deviations
and the predicted ones within the file's limit, 1 error in input or run, 2 not."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("file", metavar="FILE", help="published numbers, in YAML")
    p.add_argument("--fit", metavar="NAMES", help="properties to fit, e.g. R,mu (default: the file's)")
    p.add_argument("--knife", metavar="NAME", help="another knife than the file's")
    p.add_argument("--together", action="store_true", help="fit to all numbers: can any values meet all of them?")
    p.add_argument(
        "--draws",
        type=whole(0),
        default=32,
        metavar="N",
        help="draws of what is not fitted (default 32)",
    )
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Fit and predict; prints the table, or scalars.json."""
    from calib.scalars.published_data import load_published
    from calib.scalars.scalar_fit import fit_scalars

    published = load_published(args.file)
    if args.knife is not None:
        published = replace(published, knife=load_knife(args.knife))
    if args.together:
        published = published.all_given()
    if args.fit is not None:
        published = published.fitting(tuple(name.strip() for name in args.fit.split(",")))
    out = Path(args.out or f"cutcal-scalars-{Path(args.file).stem}")

    with workers_of(args, say) as pool:
        result = fit_scalars(
            published,
            out,
            pool,
            draws=args.draws,
            seed=args.seed,
            resume=args.resume,
            say=say,
        )
    if args.json:
        print_json(to_document(result))
    else:
        print(f"{table(result.fitted)}\nwrote {out}")
    return 0 if result.fitted.passed else 2


def table(result: FittedNumbers) -> str:
    """What the terminal shows at the end."""
    lines = [f"{'':18s} {'value':>10s} {'95 % of the draws':>22s} {'prior':>22s}"]
    for name, one in result.parameters.items():
        span, prior = _span(one.low95, one.high95), _span(one.prior_low, one.prior_high)
        lines.append(f"{name:18s} {one.value:10.4g} {span:>22s} {prior:>22s}  {one.unit}, {one.role}")
    lines += ["", f"{'':18s} {'':12s} {'published':>10s} {'simulated':>10s} {'error':>8s} {'95 % of the draws':>22s}"]
    for row in result.numbers:
        lines.append(
            f"{row.specimen:18s} {row.quantity:12s} {row.published:10.4g} {row.simulated:10.4g} "
            f"{row.error:+8.1%} {_span(row.low95, row.high95):>22s}  {row.role}"
        )
    lines += ["", "largest over mean force: published, simulated, and where the force goes with the width"]
    for cut in result.fullness:
        known = "-" if cut.published is None else f"{cut.published:.3f}"
        lines.append(f"{cut.specimen:18s} {known:>8s} {cut.simulated:8.3f} {cut.uniform:8.3f}")
    draws = result.draws
    lines += [
        "",
        f"draws: {draws.met} met the given numbers, {draws.unmet} could not, {draws.broke_down} broke down",
    ]
    if result.consistent:
        lines.append("ok   given numbers met within two of their standard deviations")
    else:
        lines.append("FAIL the given numbers contradict each other: no values within the bounds meet all of them")
    if any(row.role == "predicted" for row in result.numbers):
        word = "ok  " if result.predicted else "FAIL"
        lines.append(f"{word} predicted numbers within {result.limit:.0%}")
    return "\n".join(lines)


def _span(low: float, high: float) -> str:
    """Two ends; a dash where there are none."""
    return "-" if math.isnan(low) else f"{low:.3g} to {high:.3g}"
