"""One line about a running fit: a terminal and a notebook rewrite it in place, elsewhere it is printed now and then."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import TextIO

#: Width of the bar in characters.
BAR = 20

#: Package of the streams of a notebook, which rewrite a line after a carriage return though they are no terminal.
NOTEBOOK = "ipykernel"

#: Kind of terminal (TERM) that cannot rewrite a line, as in an editor.
DUMB = "dumb"

#: Without a terminal (log file, pipe) a line is printed at most this often [s].
PLAIN_INTERVAL_S = 30.0


@dataclass(frozen=True)
class Progress:
    """Where a fit stands.

    Attributes:
        done: Simulations finished, failed ones included.
        spent: Budget spent, in simulations on the fine grid [-].
        budget: Budget, in the same measure [-].
        failed: Simulations that did not finish their stroke.
        misfit: Smallest chi-square of a finished run so far [-]; infinite while there is none.
        eta_s: Time that the rest of the budget takes at most [s]; a fit that converges ends earlier.
        stage: What the last simulation was run for.
        typical_s: Time that is left in a typical run [s]; NaN where that is not known.
        part: Part of all the work that is done [-]; None where only the budget tells it.
    """

    done: int
    spent: float
    budget: float
    failed: int
    misfit: float
    eta_s: float
    stage: str
    typical_s: float = math.nan
    part: float | None = None

    def line(self) -> str:
        """One line of plain text without bar, such as ``12 simulations, 3 of a budget of 80, ...``."""
        many = "" if self.done == 1 else "s"
        parts = [f"{self.done} simulation{many}, {self.spent:.4g} of a budget of {self.budget:.4g}"]
        if self.failed:
            parts.append(f"{self.failed} failed")
        parts.append(f"chi2 {self.misfit:.4g}" if math.isfinite(self.misfit) else "chi2 -")
        parts += self._left()
        parts.append(self.stage)
        return ", ".join(parts)

    def _left(self) -> list[str]:
        """What is known of the time left, in words."""
        most = f"at most {clock(self.eta_s)}"
        if not math.isfinite(self.eta_s):
            return []
        return [f"about {clock(self.typical_s)} left, {most}" if math.isfinite(self.typical_s) else f"{most} left"]


def clock(seconds: float) -> str:
    """A duration [s] as ``m:ss`` or ``h:mm:ss``; ``?`` when it is not known.

    >>> clock(75.2), clock(3675), clock(float("nan"))
    ('1:15', '1:01:15', '?')
    """
    if not math.isfinite(seconds):
        return "?"
    minutes, rest = divmod(round(max(seconds, 0.0)), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


class Countdown:
    """How long the rest of some work takes, from what its finished part took.

    Args:
        total: Cost of all of it, in any measure.
        now: Clock [s].
    """

    def __init__(self, total: float, now: Callable[[], float] = time.monotonic) -> None:
        self._total, self._spent, self._now = total, 0.0, now
        self._began = now()

    def left(self, cost: float) -> str:
        """The time left, in words, after a part of this cost is done too."""
        self._spent += cost
        took = self._now() - self._began
        return f"about {clock(took * (self._total - self._spent) / self._spent)} left"


def rewrites(stream: TextIO) -> bool:
    """Whether a line on a stream can be written anew: on a terminal that is not dumb, and in a notebook."""
    notebook = type(stream).__module__.startswith(NOTEBOOK)
    return notebook or (stream.isatty() and os.environ.get("TERM") != DUMB)


class ProgressBar:
    """Callback that shows :class:`Progress` on a stream; a context manager that ends the line it rewrites.

    Args:
        stream: Where to write; standard error when None, so that ``--json`` output stays clean.
        interval_s: Shortest time between two lines when the stream is no terminal [s].
        now: Clock [s] for that interval.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        *,
        interval_s: float = PLAIN_INTERVAL_S,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._interval = interval_s
        self._now = now
        self._terminal = rewrites(self._stream)
        self._width = 0
        self._last = -math.inf

    def __call__(self, progress: Progress) -> None:
        """Show ``progress``."""
        if self._terminal:
            self._rewrite(progress)
        elif self._now() - self._last >= self._interval:
            self._last = self._now()
            print(progress.line(), file=self._stream, flush=True)

    def _rewrite(self, progress: Progress) -> None:
        """Replace the line on the terminal."""
        part = progress.spent / progress.budget if progress.part is None else progress.part
        full = min(BAR, int(BAR * part))
        text = f"[{'#' * full}{'.' * (BAR - full)}] {progress.line()}"
        print("\r" + text.ljust(self._width), end="", file=self._stream, flush=True)
        self._width = len(text)

    def note(self, say: Callable[[str], None], text: str) -> None:
        """Say something on a line of its own: the bar is wiped before, and comes back with what is told next."""
        if self._width:
            print("\r" + " " * self._width + "\r", end="", file=self._stream, flush=True)
            self._width = 0
        say(text)

    def __enter__(self) -> ProgressBar:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._width:
            print(file=self._stream, flush=True)
            self._width = 0
