"""``cutcal``: dispatch to the sub-commands, and turn expected errors into one line and exit code 1."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import calib
from calib.cli import (
    bench,
    calibrate,
    compress,
    converge,
    coverage,
    doctor,
    foods,
    knives,
    predict,
    prior,
    report,
    scalars,
    simulate,
    stress,
    verify,
)
from mpm.errors import CutcalError

COMMANDS = {
    "calibrate": calibrate,
    "compress": compress,
    "converge": converge,
    "coverage": coverage,
    "bench": bench,
    "stress": stress,
    "predict": predict,
    "simulate": simulate,
    "verify": verify,
    "report": report,
    "foods": foods,
    "knives": knives,
    "doctor": doctor,
    "prior": prior,
    "scalars": scalars,
}
INTERRUPTED = 130  # what a shell reports for a program ended by Ctrl-C


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    top = argparse.ArgumentParser(
        prog="cutcal",
        description="Calibrate cutting simulations of food against measured knife forces.",
        epilog="Exit codes: 0 done and passed, 1 error in input or run, 2 ran but did not pass.",
    )
    top.add_argument("--version", action="version", version=f"cutcal {calib.__version__}")
    sub = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        one = sub.add_parser(
            name,
            help=module.HELP,
            description=module.DESCRIPTION,
            epilog=module.EPILOG,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_args(one)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    args = parser().parse_args(argv)
    try:
        return COMMANDS[args.command].run(args)
    except CutcalError as e:
        print(f"cutcal: {e}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("cutcal: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
