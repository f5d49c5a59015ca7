"""Arguments of the interface in Python: what they may be, and one sentence about one that cannot be."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

from calib.errors import OutputError
from calib.io.progress import Progress, ProgressBar
from calib.io.wording import quoted


def listeners(
    call: str,
    progress: Callable[[Progress], None] | bool | None,
    say: Callable[[str], None] | None,
    shown: ExitStack,
) -> Callable[[Progress], None] | None:
    """Who is told after each simulation, with both listeners checked before there is one.

    Args:
        call: What they are arguments of, such as ``Calibration.run``.
        progress: Called after each simulation; True for a bar on standard error.
        say: Called with each sentence.
        shown: Ends the bar.

    Returns:
        The listener, or None.

    Raises:
        OutputError: One of them cannot be called.
    """
    if not (progress is None or isinstance(progress, bool) or callable(progress)):
        raise OutputError(f"{call}: progress = {quoted(progress)}; give True for a bar, or a function")
    if not (say is None or callable(say)):
        raise OutputError(f"{call}: say = {quoted(say)}; give a function that takes a sentence, such as print")
    if isinstance(progress, bool):
        return shown.enter_context(ProgressBar()) if progress else None
    return progress


def check_flag(call: str, name: str, value: Any) -> None:
    """Insist on True or False.

    Args:
        call: What it is an argument of.
        name: Its name.
        value: What was given.

    Raises:
        OutputError: It is something else.
    """
    if not isinstance(value, bool):
        raise OutputError(f"{call}: {name} = {quoted(value)}; give True or False")
