"""``cutcal bench``: run time against error, what each economy brings, the rate of the kernels."""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.errors import CurveError
from calib.io.typed_document import to_document
from calib.material.food import load_food
from cutcal.options import (
    KNIFE_HELP,
    add_run,
    number,
    print_json,
    say,
    whole,
)

if TYPE_CHECKING:
    from studies.speed.result import BenchmarkResult, CutErrors, PeerResult

HELP = "run time against error on this machine"
DESCRIPTION = """Measure on this machine: the rate of the kernels beside that of a textbook
solver with the same physics, the time of the default cut beside that of the
published configuration (120^3 nodes, dt 2e-5 s), and time and error of the
cut with one thing changed. Writes bench.json,
bench.svg, report.pdf and report.html to --out.

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
    from studies.speed.benchmark import BenchmarkSettings, run_benchmark

    if args.peers is not None and shutil.which(args.peers) is None:
        raise CurveError(f"--peers {args.peers}: no such program; give the Python of an environment with the peers")
    out = Path(args.out or f"cutcal-bench-{args.food}")
    settings = BenchmarkSettings(
        load_food(args.food),
        args.knife,
        runtime=Runtime(args.arch, args.threads),
        repeats=args.repeats,
        finest=args.reference_dx,
        seed=args.seed,
        peers=args.peers,
        command=("bench", *(a for a in sys.argv[1:] if a != "bench")),
    )
    result = run_benchmark(settings, out, say)
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        print(f"  wrote {out}")
    return 0


def table(result: BenchmarkResult) -> str:
    """What the terminal shows at the end."""
    t, cut, p = result.throughput, result.default_cut, result.processes
    lines = [f"{result.food} on {result.device}, up to {result.threads} threads"]
    if t is not None:
        lines.append(
            f"  {t.full_physics_Mps:.2f} million particle steps a second, {t.ratio:.1f} times the textbook kernel; "
            f"{t.single_Mps:.2f} in single precision, {t.cut_Mps:.2f} inside the cut"
        )
    if cut is not None:
        lines += [
            f"  default cut {cut.wall_s:.2f} s, 1/{result.ratio_to_paper:.0f} of the published configuration",
            f"  {'':50s}{'time':>7s}{'peak':>8s}{'work':>8s}{'NRMSE':>8s}",
            _line("default", 1.0, cut.errors),
        ]
    lines += [_line(row.name, row.time_ratio, row.errors) for row in result.ablations or ()]
    if p is not None:
        lines.append(
            f"  {p.processes} processes do {p.speed_up:.2f} times the cuts of one, {p.cut_Mps:.2f} million a second; "
            f"a further one starts in {p.start_up_s:.2f} s"
        )
    lines += [_peer_line(peer) for peer in result.peers]
    if result.exponent is not None:
        lines.append(f"  time grows with particles times steps to the power {result.exponent:.2f}")
    return "\n".join(lines)


def _line(name: str, time_ratio: float, errors: CutErrors | None) -> str:
    if errors is None:
        return f"  {name:50s}{time_ratio:7.2f}   (another food)"
    return f"  {name:50s}{time_ratio:7.2f}{errors.peak_error:+8.1%}{errors.work_error:+8.1%}{errors.nrmse:8.3f}"


def _peer_line(peer: PeerResult) -> str:
    from studies.speed.result import UnmeasuredPeer

    if isinstance(peer, UnmeasuredPeer):
        return f"  standing block in {peer.name}: not measured, {peer.error}"
    return (
        f"  standing block: {peer.name} {peer.version} takes {peer.ratio:.1f} times our time ({peer.Mps:.2f} million a "
        f"second, error of the force {peer.force_error:.1%}, ours {peer.ours_force_error:.1%})"
    )
