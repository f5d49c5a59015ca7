"""``cutcal completion``: a script with which a shell completes commands, options, foods, knives and files."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

from calib.io.schema import names
from calib.material.food import load_foods
from calib.material.knife import load_knives
from cutcal.parsing import Parser, commands

HELP = "print a script that completes cutcal and calibrate in a shell"
DESCRIPTION = """Print a script with which a shell completes commands, options, foods, knives,
files and folders of cutcal and calibrate, as they are in this version."""
EPILOG = """examples:
  cutcal completion bash
  cutcal completion zsh

in ~/.bashrc                    eval "$(cutcal completion bash)"
in ~/.zshrc, after compinit     eval "$(cutcal completion zsh)"
in ~/.config/fish/config.fish   cutcal completion fish | source
in ~/.tcshrc                    source a file that it was written to"""
SHELLS = ("bash", "zsh", "fish", "tcsh")
FILES, FOLDERS = ("FILE", "YAML", "PYTHON"), ("DIR",)
"""Metavars of what is a file, and of what is a folder."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("shell", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    print(script(args.shell))
    return 0


def script(shell: str) -> str:
    """What the shell reads: completion of both programs.

    Args:
        shell: One of :data:`SHELLS`.
    """
    import shtab

    from cutcal.commands.calibration import calibrate
    from cutcal.main import parser

    alone = Parser(prog="calibrate", description=calibrate.HELP)
    calibrate.add_args(alone)
    top = parser()
    for one in (alone, *commands(top).values()):
        for action, known in _known(one):
            if isinstance(known, list):
                action.choices = known
            else:
                action.complete = known  # type: ignore[attr-defined]
    return "\n".join(shtab.complete(one, shell, preamble=_knives(shell)) for one in (top, alone))


def _known(p: argparse.ArgumentParser) -> Iterator[tuple[argparse.Action, Any]]:
    """Actions whose values are known: a list of words, or how a shell finds them."""
    import shtab

    for action in p._actions:
        if action.dest == "food" or action.metavar == "FOOD":
            yield action, list(load_foods())
        elif action.dest == "knife" or action.metavar == "KNIFE":
            yield action, {"bash": "_cutcal_knives", "zsh": "_cutcal_knives", "tcsh": "f", "fish": _FISH}
        elif action.metavar == "DOCUMENT":
            yield action, names()
        elif action.metavar in FILES:
            yield action, shtab.FILE
        elif action.metavar in FOLDERS:
            yield action, shtab.DIRECTORY


_FISH = "(__cutcal_knives)"


def _knives(shell: str) -> str:
    """Function of a shell that offers the names of knives, and files."""
    known = " ".join(load_knives())
    return {
        "bash": f'_cutcal_knives() {{\n  compgen -W "{known}" -- "$1"\n  compgen -f -- "$1"\n}}',
        "zsh": f"_cutcal_knives() {{\n  compadd {known}\n  _files\n}}",
        "fish": f"function __cutcal_knives\n  printf '%s\\n' {known}\n  __fish_complete_path (commandline -ct)\nend",
    }.get(shell, "")
