"""``cutcal converge``: one cut over grid, time step, speed and particles."""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from calib.material.knife import load_knife
from calib.material.remarks import notes
from calib.material.scene import blade_warnings, cut_scene, specimen
from cutcal.options import (
    RESUME_HELP,
    RUN,
    add_food,
    add_run,
    add_workers,
    food_of,
    number,
    numbers,
    print_json,
    say,
    sizing_of,
    titled,
    whole,
    workers_of,
)

if TYPE_CHECKING:
    from studies.convergence.result import AxisResult, ConvergenceResult, RunResult

HELP = "repeat a cut on finer grids: order, numerical uncertainty"
DESCRIPTION = """Repeat one cut on finer grids, and apart from that with other time steps,
speeds and particles. Writes converge.json, curves.csv (with the standard
numerical uncertainty over the stroke, u_num_N of the finest grid and
u_num_coarsest_N of the coarsest), converge.svg, report.pdf
and report.html to --out."""
EPILOG = """examples:
  cutcal converge --food banana
  cutcal converge --food potato --material runs/potato/material.yaml \\
      --dx 3e-3,2e-3,1.5e-3 --mach 0.005 --safety 0.35 --ppc 3 --offset 0.5
  cutcal converge --food apple --knife edc --numerics

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 converged (work within 2 %, peak within 3 % between the two
finest grids, grid convergence index of both at most 5 %), 1 error in input
or run, 2 ran but did not converge."""
AXIS_NAMES = {"safety": "time step", "mach": "speed", "ppc": "particles", "offset": "offset", "repeat": "repeats"}
REFINED = (1.0, 2 / 3, 1 / 2, 1 / 3)  # default cells over the scene's own one, which comes first


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    add_food(p, cell=False)
    p.add_argument(
        "--dx",
        type=numbers(1e-4, 0.02, "m"),
        metavar="M,...",
        help="cells [m] (default: the food's, 2/3, 1/2, 1/3 of it)",
    )
    p.add_argument(
        "--safety",
        type=numbers(0, 0.9, "of the stability limit"),
        metavar="F,...",
        help="time steps to try, over their limit",
    )
    p.add_argument("--mach", type=numbers(0, 0.05, "-"), metavar="F,...", help="blade speeds to try, over the P-wave's")
    p.add_argument("--ppc", type=numbers(0.5, 8.5, ""), metavar="N,...", help="particles per cell and direction to try")
    p.add_argument(
        "--offset",
        type=numbers(-1, 1, "cells"),
        metavar="C,...",
        help="places of the blade against the grid",
    )
    p.add_argument(
        "--numerics",
        action="store_true",
        help="halve and double every constant of the method as well",
    )
    p.add_argument(
        "--repeats",
        type=whole(0),
        default=3,
        metavar="N",
        help="runs of other particles: what is noise (default 3)",
    )
    p.add_argument(
        "--stroke", type=number(1e-4, 1, "m"), metavar="M", help="way of the edge [m] (default: the whole height)"
    )
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Run the study; prints its table, or converge.json."""
    from studies.convergence.plan import CutDescription, RefinementPlan
    from studies.convergence.refinement import refine

    food, knife = food_of(args), load_knife(args.knife)
    shape, assumed = specimen(food, None, sizing_of(args))
    assumed += blade_warnings(shape, knife)
    scene = cut_scene(food, shape, knife, stroke=args.stroke, dx=max(args.dx) if args.dx else None, seed=args.seed)
    default = cut_scene(food, shape, knife)
    zone, cell = default.edge.zone, default.numerics.dx
    if scene.edge.zone > zone:
        assumed.append(
            f"the coarsest cell is larger than three quarters of the process zone of {zone * 1e3:g} mm, so all grids "
            f"have one of {scene.edge.zone * 1e3:.3g} mm: this is not the cut of the other commands; start from "
            f"{cell * 1e3:g} mm or less"
        )
    axes = {"dx": args.dx or tuple(math.floor(scene.numerics.dx * part * 1e7 + 1e-3) / 1e7 for part in REFINED)}
    axes |= {name: getattr(args, name) for name in ("safety", "mach", "ppc", "offset") if getattr(args, name)}
    out = Path(args.out or f"cutcal-converge-{food.name}")
    command = ("converge", *(a for a in sys.argv[1:] if a != "converge"))
    cut = CutDescription(food.name, knife.name, shape, command, (*food.warnings(), *assumed))

    for text in (*notes(food), *assumed):
        say(f"note: {text}")
    with workers_of(args, say) as pool:
        result = refine(
            RefinementPlan(scene, axes, args.repeats, args.numerics), cut, out, pool, resume=args.resume, say=say
        )
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        print(f"  wrote {out}")
    return 0 if result.converged else 2


def table(result: ConvergenceResult) -> str:
    """What the terminal shows at the end."""
    lines = [f"  {'dx [mm]':>8s}{'peak [N]':>10s}{'work [J]':>10s}{'particles':>11s}{'steps':>8s}{'time [s]':>10s}"]
    lines += [_grid_line(grid) for grid in result.grids]
    for name, estimate in (("work", result.work), ("peak", result.peak)):
        order = "-" if estimate.order is None else f"{estimate.order:.2f}"
        lines.append(
            f"  {name}: {estimate.verdict}, order {order}, {estimate.change:+.2%} between the two finest, uncertainty "
            f"{estimate.uncertainty:.2%}, GCI {estimate.gci:.2%}, of the coarsest grid {estimate.gci_coarsest:.2%}"
        )
    lines.append(
        f"  curve: GCI {result.gci_curve_median:.2%} of the peak (median), {result.gci_curve_max:.2%} (largest)"
    )
    for name, words in AXIS_NAMES.items():
        axis = result.axis(name)
        if axis is not None:
            slope = f", log-log slope of the peak {axis.slope_peak:+.3f}" if axis.slope_peak is not None else ""
            lines.append(_axis_line(words, axis) + slope)
    lines += [_axis_line(constant.name, constant) for constant in result.constants_seen.values()]
    head = f"{result.food}: {'converged' if result.converged else 'not converged'}"
    return "\n".join([head, *lines])


def _axis_line(words: str, axis: AxisResult) -> str:
    """What one thing changes that was varied apart from the cell size."""
    return f"  {words}: work within {axis.spread_work:.2%}, peak within {axis.spread_peak:.2%} of the mean"


def _grid_line(grid: RunResult) -> str:
    """The run on one grid."""
    cell = f"  {(grid.dx_m or math.nan) * 1e3:8.3g}"
    if not grid.ok:
        return f"{cell}  broke down: {grid.reason}"
    numbers = f"{grid.peak_N:10.3f}{grid.work_J:10.4f}{grid.particles:11.0f}{grid.steps:8.0f}"
    return f"{cell}{numbers}{grid.wall_s:10.1f}"
