"""Arguments of a wrong kind: one sentence that says which, what was given, and what to give."""

from __future__ import annotations

from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

from calib.io.wording import quoted
from mpm.scene.errors import CutcalError

FLAG, TEXT = ((bool,), "True or False"), ((str,), "text")
FILE, FOLDER = ((str, PathLike), "the path of a file"), ((str, PathLike), "the path of a folder")
NAMED = ((str, Path), "a name or a YAML file")
COLUMN = ((str,), "the name of a column")
NUMBER = ((Real,), "a number")
"""What an argument may be, and in words."""


def check_kind(call: str, name: str, value: Any, kinds: tuple[type, ...], give: str) -> None:
    """Insist on a kind of value.

    Args:
        call: What it is an argument of, such as ``Calibration``.
        name: Its name.
        value: What was given.
        kinds: What it may be.
        give: The same in words.

    Raises:
        CutcalError: It is something else.
    """
    if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
        raise CutcalError(f"{call}: {name} = {quoted(value)}; give {give}")
