"""The progress line: what it says, and that it behaves on a terminal and in a log file."""

from __future__ import annotations

import io
import math
from dataclasses import replace

import pytest

from calib.io.progress import Countdown, Progress, ProgressBar, clock


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        """Pretend."""
        return True


def progress(done: int, misfit: float = 12.3456, failed: int = 0) -> Progress:
    """A state of a fit with a budget of 80 simulations."""
    return Progress(done, float(done), 80.0, failed, misfit, 75.0, "round")


def test_line_tells_count_budget_failures_misfit_and_time() -> None:
    """Everything that a user wants to know is in the line, and nothing that is not known is made up."""
    assert progress(12, failed=2).line() == (
        "12 simulations, 12 of a budget of 80, 2 failed, chi2 12.35, at most 1:15 left, round"
    )
    assert "chi2 -" in progress(1, math.inf).line() and "failed" not in progress(1).line()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0:00"),
        (59.6, "1:00"),
        (3599.7, "1:00:00"),
        (3675.0, "1:01:15"),
        (-1.0, "0:00"),
        (math.nan, "?"),
    ],
)
def test_clock(seconds: float, text: str) -> None:
    """Durations are rounded before they are split, so that there is no 0:60."""
    assert clock(seconds) == text


def test_countdown_goes_by_cost() -> None:
    """A quarter of the cost took 30 s, so the rest takes 90 s; half of it done after 40 s, as long again."""
    times = iter([0.0, 30.0, 40.0])
    rest = Countdown(8.0, now=lambda: next(times))
    assert [rest.left(2.0), rest.left(2.0)] == ["about 1:30 left", "about 0:40 left"]


def test_terminal_line_is_rewritten() -> None:
    """On a terminal there is one line, overwritten completely by a shorter one, and ended on leaving."""
    stream = Terminal()
    with ProgressBar(stream) as bar:
        bar(progress(40, failed=11))
        bar(progress(60))
    pieces = stream.getvalue().split("\r")
    assert stream.getvalue().count("\n") == 1 and stream.getvalue().endswith("\n")
    assert pieces[1].startswith("[##########..........] 40") and pieces[2].startswith("[###############.....] 60")
    assert len(pieces[2].rstrip("\n")) >= len(pieces[1])


def test_bar_is_full_at_the_budget_and_not_beyond() -> None:
    """Half-spent is half the bar, and rounding never draws more than the whole."""
    stream = Terminal()
    ProgressBar(stream)(Progress(99, 80.0000001, 80.0, 0, 1.0, 0.0, "round"))
    assert "[" + "#" * 20 + "]" in stream.getvalue()


def test_log_file_gets_a_plain_line_now_and_then() -> None:
    """Without a terminal there are whole lines without carriage returns, at most one per interval."""
    stream, now = io.StringIO(), [0.0]
    with ProgressBar(stream, interval_s=30.0, now=lambda: now[0]) as bar:
        for k in range(10):
            now[0] = 10.0 * k
            bar(progress(k + 1))
    lines = stream.getvalue().splitlines()
    assert [line.split()[0] for line in lines] == ["1", "4", "7", "10"]
    assert "\r" not in stream.getvalue()


def test_default_is_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    """Standard output stays clean for --json."""
    ProgressBar()(progress(3))
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.startswith("3 simulations")


def test_typical_and_longest_time_are_told_apart() -> None:
    """A typical run's time stands before the longest; where no time is known none is said."""
    known = replace(progress(12), typical_s=40.0)
    assert "about 0:40 left, at most 1:15, round" in known.line()
    assert "left" not in replace(progress(1), eta_s=math.nan).line()


def test_bar_follows_the_part_of_all_stages() -> None:
    """Where the part of all the work is known, the bar has it, and not that of the budget."""
    stream = Terminal()
    ProgressBar(stream)(replace(progress(60), part=0.5))
    assert "[##########..........]" in stream.getvalue()


def test_a_dumb_terminal_gets_plain_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal that cannot rewrite a line gets whole lines; nothing is coloured, NO_COLOR or not."""
    monkeypatch.setenv("TERM", "dumb")
    stream = Terminal()
    ProgressBar(stream)(progress(3))
    assert stream.getvalue().startswith("3 simulations") and "\r" not in stream.getvalue()
    monkeypatch.setenv("TERM", "xterm")
    ProgressBar(stream)(progress(4))
    assert "\x1b" not in stream.getvalue()


def test_a_note_does_not_stand_in_the_bar() -> None:
    """What is said while the bar is shown has a line of its own; the bar is drawn again after it."""
    stream = Terminal()
    with ProgressBar(stream) as bar:
        bar(progress(40))
        bar.note(lambda text: print(text, file=stream), "note: something")
        bar(progress(41))
    shown = [line.split("\r")[-1] for line in stream.getvalue().split("\n")]
    assert shown[0] == "note: something" and "41 simulations" in shown[1]
