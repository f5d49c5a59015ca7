"""``cutcal``: dispatch to the sub-commands, and turn expected errors into one line and exit code 1."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Sequence

import calib
from calib.cli import (
    bench,
    calibrate,
    completion,
    compress,
    converge,
    coverage,
    dataset,
    doctor,
    evaluate,
    foods,
    knives,
    predict,
    prior,
    regress,
    report,
    scalars,
    schema,
    simulate,
    stress,
    verify,
)
from calib.cli.parsing import Parser, parse
from mpm.errors import CutcalError

DESCRIPTION = "Calibrate cutting simulations of food against measured knife forces."
EPILOG = """example:
  cutcal calibrate --food banana --trace cut.csv --out runs/banana

cutcal COMMAND --help explains a command.
Exit codes: 0 done and passed, 1 error in input or run, 2 ran but did not pass."""
COMMANDS = {
    "calibrate": calibrate,
    "compress": compress,
    "converge": converge,
    "coverage": coverage,
    "bench": bench,
    "stress": stress,
    "predict": predict,
    "simulate": simulate,
    "evaluate": evaluate,
    "dataset": dataset,
    "verify": verify,
    "report": report,
    "foods": foods,
    "knives": knives,
    "doctor": doctor,
    "prior": prior,
    "regress": regress,
    "scalars": scalars,
    "schema": schema,
    "completion": completion,
}
CLOSED = 141  # what a shell reports for a program whose reader has gone
INTERRUPTED = 130  # what a shell reports for a program ended by Ctrl-C


def parser() -> Parser:
    """The whole command line."""
    top = Parser(prog="cutcal", description=DESCRIPTION, epilog=EPILOG, add_help=True)
    top.add_argument("--version", action="version", version=f"cutcal {calib.__version__}")
    sub = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        one = sub.add_parser(
            name,
            help=module.HELP,
            description=module.DESCRIPTION,
            epilog=module.EPILOG,
        )
        module.add_args(one)
        one.finish()
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal or pipe that has no degree sign gets a question mark
    try:
        args = parse(parser(), argv)
        code: int = COMMANDS[args.command].run(args)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # the reader, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED
    except CutcalError as e:
        print(f"cutcal: {e}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("cutcal: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
