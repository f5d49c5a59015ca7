"""``cutcal predict``: a measured cut against a food that was calibrated on another one."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.errors import MaterialError
from cutcal.commands.calibration.calibrate import add_trace, measured
from cutcal.options import add_food, add_run, note, print_json

if TYPE_CHECKING:
    from calib.validation.prediction import PredictionResult

HELP = "predict a measured cut with values calibrated on another"
DESCRIPTION = """Simulate the cut of a trace with the values of --material, without fitting
any of them, and compare. Writes summary.json and curves.csv to --out."""
EPILOG = """example:
  cutcal predict --food potato --material runs/cut1/material.yaml \\
      --trace cut2.csv --air air.csv --scale-width --out runs/cut2

Exit codes: 0 NRMSE at most 0.10 and ISO rating at least 0.80, 1 error, 2 worse."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    add_food(p)
    add_trace(p)
    p.add_argument(
        "--scale-width",
        action="store_true",
        help="fit one number: a factor for the specimen's width",
    )
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Predict; prints the agreement, or the summary as JSON."""
    from calib.validation.prediction import run as predict
    from calib.validation.prediction import to_document

    if args.material is None:
        raise MaterialError("predict needs the calibrated food: add --material with the material.yaml of a calibration")
    request = measured(args, ["predict", *(a for a in sys.argv[1:] if a != "predict")])
    out = Path(args.out or f"cutcal-predict-{request.food.name}-{request.stem}")

    result = predict(request, out, scale_width=args.scale_width, say=note)
    if args.json:
        print_json(to_document(result))
    else:
        print(agreement_text(result))
        print(f"  wrote {out}")
    return 0 if result.passed else 2


def agreement_text(result: PredictionResult) -> str:
    """What the terminal shows at the end."""
    m, scale, limits = result.metrics, result.width_scale, result.limits
    factor = "" if scale is None else f" but one factor {scale:.3g} for the width"
    how = f"predicted without fitting{factor}" if result.held_out else f"in-sample, fitted to this trace{factor}"
    lines = [
        f"{result.food}: {'passed' if result.passed else 'not passed'}, {how}",
        f"  peak {m.peak_sim_N:.2f} N against {m.peak_real_N:.2f} N ({m.peak_error:+.1%}), "
        f"NRMSE {m.nrmse:.3f} (limit {limits.nrmse:.2f}), ISO rating {m.iso18571.R:.3f} (limit {limits.rating:.2f}), "
        f"shape {m.shape_error:.3f}, work {m.work_error:+.1%}",
    ]
    return "\n".join([*lines, *([f"  {m.iso18571.caveat}"] if m.iso18571.caveat else [])])
