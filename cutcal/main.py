"""``cutcal``: dispatch to the sub-commands, and turn expected errors into one line and exit code 1.

Every worker process imports this module again, as the program it was started by: nothing is imported before it is needed.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from calib._version import __version__

if TYPE_CHECKING:
    from cutcal.parsing import Parser

# The fit's matrices are small and the simulations have the cores: more threads for linear algebra only get in their way.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

DESCRIPTION = "Calibrate cutting simulations of food against measured knife forces."
EPILOG = """example:
  cutcal calibrate --food banana --trace cut.csv --out runs/banana

cutcal COMMAND --help explains a command.
Exit codes: 0 done and passed, 1 error in input or run, 2 ran but did not pass."""
COMMANDS = {
    "calibrate": "calibration",
    "compress": "calibration",
    "converge": "solver",
    "coverage": "calibration",
    "bench": "solver",
    "stress": "solver",
    "predict": "calibration",
    "simulate": "solver",
    "evaluate": "dataset",
    "dataset": "dataset",
    "verify": "solver",
    "report": "calibration",
    "foods": "catalogue",
    "knives": "catalogue",
    "doctor": "catalogue",
    "prior": "calibration",
    "regress": "solver",
    "scalars": "calibration",
    "schema": "catalogue",
    "completion": "catalogue",
}
"""The folder of each command, in the order of the help."""
CLOSED = 141  # what a shell reports for a program whose reader has gone
INTERRUPTED = 130  # what a shell reports for a program ended by Ctrl-C


def command(name: str) -> Any:
    """The module of a command."""
    return import_module(f"cutcal.commands.{COMMANDS[name]}.{name}")


def parser(names: Iterable[str] = COMMANDS) -> Parser:
    """The command line with these commands."""
    from cutcal.parsing import Parser

    top = Parser(prog="cutcal", description=DESCRIPTION, epilog=EPILOG, add_help=True)
    top.add_argument("--version", action="version", version=f"cutcal {__version__}")
    sub = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name in names:
        module = command(name)
        one = sub.add_parser(
            name,
            help=module.HELP,
            description=module.DESCRIPTION,
            epilog=module.EPILOG,
        )
        module.add_args(one)
        one.finish()
    return top


def calibrate() -> int:
    """Entry point of the ``calibrate`` script."""
    return main(["calibrate", *sys.argv[1:]])


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    from cutcal.parsing import Misused, parse
    from mpm.scene.errors import CutcalError

    words = sys.argv[1:] if argv is None else argv
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal or pipe that has no degree sign gets a question mark
    try:
        try:
            args = parse(parser([word for word in words[:1] if word in COMMANDS] or COMMANDS), words)
        except Misused:
            args = parse(parser(), words)  # says of an option that another command has it
        code: int = command(args.command).run(args)
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
