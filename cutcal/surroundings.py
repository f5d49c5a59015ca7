"""What a command finds around it, made fit for use: standard streams, open files, variables of the environment.

Every worker process imports this module again: nothing is imported before it is needed.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO

LEAST_FILES = 64
"""Files that may be open at a time under which workers and their pipes do not fit; a calibration with two workers has
40."""
ENOUGH_FILES = 1024
INTERRUPTED = 130
"""What a shell reports for a program ended by Ctrl-C."""
VARIABLES = {
    "OPENBLAS_NUM_THREADS": "1",  # the simulations have the cores: more threads for small matrices get in their way
}
"""Variables that are set where they are not."""
DRAWING = {"MPLBACKEND": "agg"}
"""Variables that are set whatever they were: figures go into files, and a notebook's way of drawing is not here."""


class Stream:
    """A standard stream that a full disk does not trip.

    Args:
        stream: The stream.
        name: What an error calls it; empty where what it cannot take is dropped, as notes are.
    """

    def __init__(self, stream: TextIO, name: str = "") -> None:
        self._stream, self._name = stream, name

    def write(self, text: str) -> int:
        """Write a text.

        Raises:
            BrokenPipeError: Its reader has gone.
            CutcalError: It cannot be written, and has a name.
        """
        try:
            return self._stream.write(text)
        except (OSError, ValueError) as e:
            self._lost(e)
        return len(text)

    def flush(self) -> None:
        """Pass on what is waiting.

        Raises:
            BrokenPipeError: Its reader has gone.
            CutcalError: It cannot be written, and has a name.
        """
        try:
            self._stream.flush()
        except (OSError, ValueError) as e:
            self._lost(e)

    def _lost(self, error: OSError | ValueError) -> None:
        if self._name and isinstance(error, BrokenPipeError):
            raise error
        silence(self._stream)
        if self._name:
            from mpm.scene.errors import CutcalError

            why = getattr(error, "strerror", None) or error
            raise CutcalError(f"{self._name} cannot be written ({why}); files of the results are written before it")

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def fit_process() -> Iterator[None]:
    """Open streams that are closed, let them take every letter, and set variables; before anything else is imported.

    A file opened while a standard stream is closed would get its number, and whatever is printed would go into it.
    """
    for name, value in VARIABLES.items():
        os.environ.setdefault(name, value)
    os.environ.update(DRAWING)
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
    before = sys.stdout, sys.stderr
    sys.stdout = _fitted(sys.stdout, "stdout")
    sys.stderr = _fitted(sys.stderr, "")
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _fitted(stream: Any, name: str) -> Any:
    """The stream for a command."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    stream.reconfigure(errors="replace")  # a terminal or pipe without a degree sign gets a question mark
    return Stream(stream, name)


def check_limits() -> None:
    """Let this process open as many files as it needs.

    Raises:
        CutcalError: It may not.
    """
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = ENOUGH_FILES if hard == resource.RLIM_INFINITY else min(hard, ENOUGH_FILES)
    if 0 <= soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = most
    if 0 <= soft < LEAST_FILES:
        from mpm.scene.errors import CutcalError

        raise CutcalError(
            f"this process may have {soft} files open and {LEAST_FILES} are needed; raise the limit: "
            f"ulimit -n {ENOUGH_FILES}"
        )


def silence(stream: TextIO) -> None:
    """Send the rest of a stream nowhere, so that Python's own end does not trip over it."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, stream.fileno())
    os.close(null)


def interrupted(*, resumable: bool) -> int:
    """Say in one line that a command was ended by Ctrl-C, and how to go on with it; returns its exit code.

    Args:
        resumable: Whether it has ``--resume``.
    """
    more = "; what was computed is kept, and the same command with --resume goes on" if resumable else ""
    print(f"cutcal: interrupted{more}", file=sys.stderr)
    return INTERRUPTED
