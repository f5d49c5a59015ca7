"""``cutcal bench``: run time against error, what each economy brings, the rate of the kernels."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path
from typing import Any

from calib.errors import CurveError
from calib.material.food import load_food
from cutcal.options import (
    KNIFE_HELP,
    add_run,
    number,
    print_json,
    whole,
)

HELP = "run time against error on this machine"
DESCRIPTION = """Measure on this machine: the rate of the kernels beside that of a textbook
solver with the same physics, the time of the default cut beside that of the
published configuration (120^3 nodes, dt 2e-5 s), and time and error of the
cut with one thing changed. Writes bench.json,
bench.svg and report.pdf to --out.

Only the ratios mean something elsewhere: each is of runs that took turns."""
EPILOG = """example:
  cutcal bench --food banana --out runs/bench

Ctrl-C keeps what was measured. Times of two sessions are not comparable, so
there is no --resume. Nothing else should run meanwhile; about ten minutes."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("--food", default="banana", metavar="NAME", help="food of materials.yaml (default banana)")
    p.add_argument("--knife", default="kitchen", metavar="NAME", help=KNIFE_HELP)
    p.add_argument(
        "--repeats", type=whole(1), default=3, metavar="N", help="turns that each of two runs takes (default 3)"
    )
    p.add_argument("--threads", type=whole(0), default=0, metavar="N", help="CPU threads (default 0: all cores)")
    p.add_argument(
        "--reference-dx",
        type=number(1e-4, 0.02, "m"),
        default=1.5e-3,
        metavar="M",
        help="cells of the reference [m] (default 1.5e-3)",
    )
    p.add_argument(
        "--peers",
        metavar="PYTHON",
        help="interpreter with warp-lang or genesis-world to measure",
    )
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Measure; prints a table, or bench.json."""
    from mpm.runtime import Runtime
    from studies.speed.study import run as study

    if args.peers is not None and shutil.which(args.peers) is None:
        raise CurveError(f"--peers {args.peers}: no such program; give the Python of an environment with the peers")
    out = Path(args.out or f"cutcal-bench-{args.food}")
    document = study(
        load_food(args.food),
        args.knife,
        out,
        runtime=Runtime(args.arch, args.threads),
        repeats=args.repeats,
        finest=args.reference_dx,
        seed=args.seed,
        say=lambda text: print(text, file=sys.stderr, flush=True),
        peers=args.peers,
        command=["bench", *(a for a in sys.argv[1:] if a != "bench")],
    )
    if args.json:
        print_json(document)
    else:
        print(table(document))
        print(f"  wrote {out}")
    return 0


def table(document: dict[str, Any]) -> str:
    """What the terminal shows at the end."""
    t, d = document["throughput"], document["default_cut"]
    lines = [
        f"{document['food']} on {document['device']}, up to {document['threads']} threads",
        f"  {t['full_physics_Mps']:.2f} million particle steps a second, {t['ratio']:.1f} times the textbook kernel; "
        f"{t['single_Mps']:.2f} in single precision, {t['cut_Mps']:.2f} inside the cut",
        f"  default cut {d['wall_s']:.2f} s, 1/{document['ratio_to_paper']:.0f} of the published configuration",
        f"  {'':50s}{'time':>7s}{'peak':>8s}{'work':>8s}{'NRMSE':>8s}",
        _line("default", {"time_ratio": 1.0, **d}),
    ]
    lines += [_line(row["name"], row) for row in document["ablations"]]
    p = document["processes"]
    lines.append(
        f"  {p['processes']} processes do {p['speed_up']:.2f} times the cuts of one, {p['cut_Mps']:.2f} million a second; "
        f"a further one starts in {p['start_up_s']:.2f} s"
    )
    lines += [
        f"  elastic block: {row['ratio']:.1f} times {row['name']} {row['version']} ({row['Mps']:.2f} million a second)"
        if "ratio" in row
        else f"  elastic block in {row['name']}: not measured, {row['error']}"
        for row in document["peers"]
    ]
    return "\n".join([*lines, f"  time grows with particles times steps to the power {document['exponent']:.2f}"])


def _line(name: str, row: dict[str, Any]) -> str:
    if "nrmse" not in row:
        return f"  {name:50s}{row['time_ratio']:7.2f}   (another food)"
    return f"  {name:50s}{row['time_ratio']:7.2f}{row['peak_error']:+8.1%}{row['work_error']:+8.1%}{row['nrmse']:8.3f}"
