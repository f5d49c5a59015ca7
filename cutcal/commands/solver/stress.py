"""``cutcal stress``: where the solver is stable, and how it ends where it is not."""

from __future__ import annotations

import argparse
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
    from studies.stability.result import StabilityMap

HELP = "map of where the solver is stable"
DESCRIPTION = """Run some 250 small cuts with one or two things pushed to the end of their
range or past it: stiffness, Poisson's ratio, time step, cell, speed, density,
yield stress, cutting resistance, blades that miss the food, food in the air or
a hundred times too dense. Each must end stable, or refused or stopped for a
reason that is named; momentum and energy are audited. Writes stress.json,
stress.svg, report.pdf and report.html to --out."""
EPILOG = """examples:
  cutcal stress --quick
  cutcal stress --out runs/stress --workers 4

Ctrl-C keeps what was computed; the same command with --resume goes on.
Exit codes: 0 every physical cell below 0.8 of the time step's limit is stable
and all others are explained, 1 error in input or run, 2 they are not."""
NAMED = 12  # cells that the table names


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("--quick", action="store_true", help="a dozen coarse cells instead of the whole map")
    add_workers(p, "simulations")
    titled(p, RUN).add_argument("--resume", action="store_true", help=RESUME_HELP)
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Run the map; prints its table, or stress.json."""
    from studies.stability.families import map_cells, quick_map_cells
    from studies.stability.stability_map import run_map

    out = Path(args.out or "cutcal-stress")
    command = ("stress", *(a for a in sys.argv[1:] if a != "stress"))

    with workers_of(args, say) as pool:
        cells = (quick_map_cells if args.quick else map_cells)(args.seed)
        result = run_map(cells, out, pool, command=command, seed=args.seed, resume=args.resume, say=say)
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        print(f"  wrote {out}")
    return 0 if result.passed else 2


def table(result: StabilityMap) -> str:
    """What the terminal shows at the end."""
    physical, limit = result.physical, result.limits.dt_over_limit
    lines = [
        f"{len(result.cells)} cells: {'passed' if result.passed else 'not passed'}",
        f"  {physical.stable} of {physical.cells} physical cells below {limit:g} of the time step's limit are stable",
    ]
    for reason, count in sorted(result.counts.items(), key=lambda item: -item[1]):
        meaning = result.reasons.get(reason, "reached the end, momentum and energy balance")
        lines.append(f"  {count:4d} {reason}: {meaning}")
    reasons = {cell.name: cell.reason for cell in result.cells}
    for title, names in (
        ("physical, but not stable", physical.not_stable),
        ("unexplained", result.unexplained_cells),
    ):
        lines += [f"  {title}: {name} ({reasons[name]})" for name in names[:NAMED]]
        if len(names) > NAMED:
            lines.append(f"  {title}: {len(names) - NAMED} more, see stress.json")
    return "\n".join(lines)
