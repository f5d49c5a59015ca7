"""What is left of a budget, as it is told."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from calib.fit.budget import COARSE_TIME, longest_time_left, progress_of_all
from calib.fit.options import FitOptions
from calib.io.progress import Progress


def test_another_search_is_told_as_part_of_all() -> None:
    """Its runs, budget and failures are counted with those before it, and its time is that of what all have left."""
    seen: list[Progress] = []
    before = [
        SimpleNamespace(coarse=k < 4, ok=k > 0, misfit=9.0) for k in range(10)
    ]  # four coarse runs: 7 of the budget
    told = progress_of_all(seen.append, before, before[-1], FitOptions(budget=80.0))  # type: ignore[arg-type]
    assert told is not None
    told(Progress(5, 5.0, 39.0, 1, 12.0, 68.0, "round"))
    assert seen == [Progress(15, 12.0, 80.0, 2, 9.0, 136.0, "round")]
    assert progress_of_all(None, before, before[-1], FitOptions()) is None  # type: ignore[arg-type]


def test_time_left_is_that_of_default_runs() -> None:
    """Coarse runs take less of the time than of the budget, and the rest may be spent on default ones; with no such run
    yet they tell, but for the first of each worker, which compile."""
    runs = [
        SimpleNamespace(coarse=coarse, evaluation=SimpleNamespace(seconds=s))
        for coarse, s in ((True, 9.0), (True, 0.5), (True, 0.7), (False, 6.0), (False, 8.0))
    ]
    options = FitOptions(budget=80.0, batch=2)
    assert longest_time_left(runs, 10.0, options) == pytest.approx(35.0)  # type: ignore[arg-type]
    assert longest_time_left(runs[:3], 10.0, options) == pytest.approx(2.5 / COARSE_TIME)  # type: ignore[arg-type]
    assert math.isnan(longest_time_left(runs[:2], 10.0, options))  # type: ignore[arg-type]
