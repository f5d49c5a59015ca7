"""How the command line reads and speaks: help that fits a screen, and one line for whatever was not understood."""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from calib.io.yaml_checks import suggest
from mpm.scene.errors import CutcalError

COLUMN = 24  # where the explanations of options begin


class NamedBeside(argparse._StoreAction):
    """An option that the help of the one before names: it has no line of its own."""


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Help of one line an option where it can be, and groups without blank lines between them."""

    def __init__(self, prog: str, **how: Any) -> None:
        super().__init__(prog, **{"max_help_position": COLUMN, **how})

    def add_argument(self, action: argparse.Action) -> None:
        """Take one more option; the names of commands are measured as deep as they stand."""
        if isinstance(action, NamedBeside):
            return
        super().add_argument(action)
        if isinstance(action, argparse._SubParsersAction):
            deep = self._current_indent + self._indent_increment
            self._action_max_length = max(self._action_max_length, deep + max(map(len, action.choices)))

    def format_help(self) -> str:
        """The whole text."""
        return re.sub(r"(\n  [^\n]+\n)\n(?=[^\n]+:\n  -)", r"\1", super().format_help())


class Misused(CutcalError):
    """A command line that cannot be read."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are those of everything else: one line and exit code 1; 2 is what ran and did not pass."""

    def __init__(self, **how: Any) -> None:
        super().__init__(**{"formatter_class": Formatter, "add_help": False, **how})

    def error(self, message: str) -> NoReturn:
        """Raise the message as it is meant.

        Args:
            message: As argparse says it.

        Raises:
            Misused: Always.
        """
        raise Misused(f"{_meant(message)}; see {self.prog} --help")

    def finish(self) -> None:
        """Add --help to the last group of options, and show in the first line only what must be given."""
        self._action_groups[-1].add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)
        needed = [a for a in self._actions if a.option_strings and a.required]
        words = [f"{a.option_strings[0]} {a.metavar or a.dest.upper()}" for a in needed]
        for a in self._actions:
            if not a.option_strings:
                name = str(a.metavar or a.dest.upper())
                words.append({"?": f"[{name}]", "*": f"[{name} ...]"}.get(str(a.nargs), name))
        self.usage = self.usage or " ".join([self.prog, *words, "[options]"])


def commands(top: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Parser of each command."""
    return next(dict(a.choices) for a in top._actions if isinstance(a, argparse._SubParsersAction))


def parse(top: Parser, argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read a command line; an option that the command has not is named before what is missing for want of it.

    Args:
        top: The whole command line.
        argv: Its words; those of the process by default.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    known = commands(top)
    if not words:
        top.error("name a command")
    own = known.get(words[0], top)
    given = words[: words.index("--")] if "--" in words else words
    for name in (word.partition("=")[0] for word in given):
        if name.startswith("--") and not any(o.startswith(name) for o in own._option_string_actions):
            own.error(f"there is no option {name} here{_elsewhere(name, own, known)}")
        if own is top and not name.startswith("-"):
            break  # a command that is not known, and its own options
    args, more = top.parse_known_args(words)
    if more:
        own.error(f"{' '.join(more)} is too much: each value stands after its option")
    return args


def _elsewhere(name: str, own: argparse.ArgumentParser, known: dict[str, argparse.ArgumentParser]) -> str:
    """The nearest option of the command, or the commands that have this one."""
    having = [c for c, p in known.items() if name in p._option_string_actions]
    if having:
        return f"; {', '.join(having)} {'has' if len(having) == 1 else 'have'} it"
    near = difflib.get_close_matches(name[2:], [o[2:] for o in own._option_string_actions if o.startswith("--")], n=1)
    return f", did you mean --{near[0]}?" if near else ""


def _meant(message: str) -> str:
    """The message, with the nearest of several words in place of them all."""
    found = re.fullmatch(r"(?:argument (.*): )?invalid choice: '(.*)' \(choose from (.*)\)", message)
    if found is None:
        return message.removeprefix("argument ")
    where, value, listed = found.groups()
    near = suggest(value, [w.strip("'") for w in listed.split(", ")])
    if where.isupper():
        return f"there is no {where.lower()} {value!r}{near}"
    return f"{where}: there is no {value!r}{near}"
