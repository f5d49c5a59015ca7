"""The directive ``commands``: options of every command, written by the parsers themselves."""

from __future__ import annotations

import argparse
import os
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from cutcal.main import COMMANDS, parser

WIDTH = "100"
"""Columns of the help texts."""


def helps() -> dict[str, str]:
    """What ``cutcal COMMAND --help`` prints, by command."""
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = WIDTH
    try:
        (sub,) = (a for a in parser()._actions if isinstance(a, argparse._SubParsersAction))
        return {name: sub.choices[name].format_help() for name in COMMANDS}
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before


class Commands(SphinxDirective):
    """A section for each command, with its help."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        text = "\n".join(f"## cutcal {name}\n\n~~~text\n{words}~~~\n" for name, words in helps().items())
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def setup(app: Sphinx) -> dict[str, Any]:
    """Make the directive known."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "env_version": 1}
