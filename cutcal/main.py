"""``cutcal``: dispatch to the sub-commands, and turn expected errors into one line and exit code 1.

Every worker process imports this module again, as the program it was started by: nothing is imported before it is
needed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

from calib._version import __version__
from cutcal.surroundings import INTERRUPTED as INTERRUPTED
from cutcal.surroundings import check_limits, fit_process, interrupted, silence

if TYPE_CHECKING:
    from cutcal.parsing import Parser

DESCRIPTION = "Calibrate cutting simulations of food against measured knife forces."
EPILOG = """example:
  cutcal calibrate --food banana --trace cut.csv --out runs/banana

cutcal COMMAND --help explains a command.
Exit codes: 0 done and passed, 1 error in input or run, 2 ran but did not pass."""
COMMANDS = {
    "calibrate": "calibration",
    "press": "calibration",
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
    "design": "calibration",
    "regress": "solver",
    "scalars": "calibration",
    "schema": "catalogue",
    "completion": "catalogue",
}
"""The folder of each command, in the order of the help."""
CLOSED = 141  # what a shell reports for a program whose reader has gone
FAILED = 1  # an error in input or run


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
    return main(sys.argv[1:] if sys.argv[1:] == ["--version"] else ["calibrate", *sys.argv[1:]])


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; returns its exit code."""
    with fit_process():
        try:
            return _run(sys.argv[1:] if argv is None else argv)
        except KeyboardInterrupt:  # before there was a command
            return interrupted(resumable=False)
        except BrokenPipeError:  # the reader, such as head, has enough
            silence(sys.stdout)
            return CLOSED


def _run(words: Sequence[str]) -> int:
    """Run the command that the words name, and say in one line why it fails.

    Raises:
        BrokenPipeError: Nobody reads the results.
    """
    from cutcal.parsing import Misused, parse
    from mpm.scene.errors import CutcalError

    resumable = False
    try:
        check_limits()
        try:
            args = parse(parser([word for word in words[:1] if word in COMMANDS] or COMMANDS), words)
        except Misused:
            args = parse(parser(), words)  # says of an option that another command has it
        resumable = hasattr(args, "resume")
        code: int = command(args.command).run(args)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        return interrupted(resumable=resumable)
    except BrokenPipeError:
        raise
    except CutcalError as e:
        why = str(e)
    except MemoryError:
        why = "out of memory; end other programs, or use fewer --workers or coarser cells"
    except OSError as e:  # a full disk, a name that is too long, a file that has gone: nothing wrong with cutcal
        why = f"{e.filename}: {e.strerror}; check path and disk" if e.filename else f"{e}; check the disk"
    print(f"cutcal: {why}", file=sys.stderr)
    return FAILED


if __name__ == "__main__":
    sys.exit(main())
