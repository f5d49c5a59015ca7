"""Figures that are stable, need no font and no colour, and hide no sample of the record."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np

from reports import figures
from reports.calibration import write_report
from tests.reports import sample
from tests.reports.sample import pages


def test_figures_are_stable_and_need_no_font() -> None:
    """The same curves give the same bytes, letters are paths, and a dollar sign is no formula."""
    curves = sample.curves()
    made = [figures.forces(curves, "cost $5 and $6", "b", 80.0) for _ in range(2)]
    assert made[0] == made[1] and b"<text" not in made[0] and b"<dc:date>" not in made[0]


def test_figures_do_not_change_the_users_style() -> None:
    """Drawing leaves matplotlib's settings as they were, and the user's settings do not reach the report."""
    plain = figures.nulls(sample.curves(), "measured")
    with matplotlib.rc_context({"axes.facecolor": "red", "lines.linewidth": 9.0}):
        assert figures.nulls(sample.curves(), "measured") == plain
        assert matplotlib.rcParams["lines.linewidth"] == 9.0


def test_curves_differ_without_colour() -> None:
    """Measured, simulated, edge and face parts have four different dash patterns."""
    looks = (figures.MEASURED, figures.SIMULATED, figures.EDGE, figures.FACE)
    assert len({look.get("dashes") for look in looks}) == 4


def test_envelope_keeps_extremes_and_order() -> None:
    """A spike of one sample in a million survives; a short record is unchanged."""
    t = np.arange(1_000_000) * 1e-3
    y = np.sin(t)
    y[123_456], y[654_321] = 50.0, -40.0
    x, few = figures.envelope(t, y)
    assert len(x) <= 2 * figures.COLUMNS and np.all(np.diff(x) > 0.0)
    assert few.max() == 50.0 and few.min() == -40.0
    assert np.array_equal(figures.envelope(t[:100], y[:100]), (t[:100], y[:100]))


def test_marks_of_the_conditioning_are_drawn_when_known(tmp_path: Path) -> None:
    """A saved baseline window and the end's uncertainty change the figure."""
    s = sample.summary()
    time, raw, tared = sample.record()
    draw = {"time": time, "raw": raw, "tared": tared, "onset": s["onset_s"], "onset_sd": 0.006,
            "end": s["end_s"], "baseline_kind": "constant", "peak": 10.8, "peak_sd": 0.1}  # fmt: skip
    bare = figures.conditioning(figures.Record(**draw, window=None, end_sd=None), sample.curves())
    full = figures.conditioning(figures.Record(**draw, window=(0.1, 0.7), end_sd=0.02), sample.curves())
    assert len(full) > len(bare)
    run = sample.write_run(tmp_path, baseline_window_s=[0.1, 0.7], end_sd_s=0.02)
    assert pages(write_report(run).read_bytes()) == 5
