"""``python -m studies.discrimination``: judge the pairs of the study and print the table."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from calib.simulation.process_pool import Pool
from studies.discrimination.pair_set import PAIRS
from studies.discrimination.study import BUDGET, passed, run, table, told


def main(arguments: list[str] | None = None) -> int:
    """Run the study; the exit code says whether it passed (0) or not (2)."""
    p = argparse.ArgumentParser(prog="python -m studies.discrimination", description=__doc__)
    p.add_argument("names", nargs="*", metavar="PAIR", help="pairs, by their name or how it begins; all by default")
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder; the pairs it knows are kept")
    p.add_argument("--workers", type=int, default=2, metavar="N", help="simulations at a time (default 2)")
    p.add_argument("--budget", type=float, default=BUDGET, metavar="N", help=f"simulations of a pair ({BUDGET:g})")
    args = p.parse_args(arguments)
    chosen = [pair for pair in PAIRS if not args.names or pair.name.startswith(tuple(args.names))]
    with Pool(args.workers, "cpu") as pool:
        found = run(chosen, args.out, pool, budget=args.budget, say=_say)
    _say(table(found))
    refused, wrong, kept, right = told(found)
    _say(f"{refused} of {wrong} wrong pairs refused, {kept} of {right} right pairs passed")
    return 0 if passed(found) else 2


def _say(text: str) -> None:
    """A line of the table."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
