"""A screening on coarse cells: where its descents begin, and what of their ends is run on fine cells."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib.fit import search
from calib.fit.options import FitOptions
from calib.fit.search import ALIKE_ON_COARSE, Search
from calib.problem.scored_run import ScoredRun
from tests.calib.fake import FIVE, Fake, goal

TRUTH = {"E": 3.0e5, "yield_stress": 4.0e4, "R": 500.0, "R_skin": 200.0, "mu": 0.2}


def test_a_descent_begins_where_the_line_of_its_guess_is_best() -> None:
    """A guess with half the force of the truth is taken at twice its stress-like values; the best run of the design is
    a start as well where it lies elsewhere."""
    guess = FIVE.to_vector(TRUTH | {"R_skin": 300.0}) - np.log(2.0) * FIVE.stress_like()
    objective = replace(goal(TRUTH), guesses=(guess,))
    fake = Fake(noisy=0.0)
    made = Search(objective, fake, fake, FitOptions(), None)
    made.screening = True
    made._design([FIVE.start])
    (plain,) = made._descended([guess])
    (scaled,) = (run for run in made._guessed() if np.ptp((run.z - guess)[FIVE.stress_like() > 0]) < 1e-2)
    assert scaled.misfit < 0.5 * plain.misfit
    made._evaluate([FIVE.to_vector(TRUTH)], "design")
    best, second = made._guessed()
    assert best is made.best and second is scaled


def test_a_start_that_broke_down_does_not_take_the_place_of_one_that_did_not() -> None:
    """Where the line of a guess is best the food breaks down: the descent begins at the guess."""
    guess = FIVE.to_vector(TRUTH) - np.log(4.0) * FIVE.stress_like()
    fake = Fake(noisy=0.0, breaks=lambda p: 400.0 < p["R"] < 600.0)
    made = Search(replace(goal(TRUTH), guesses=(guess,)), fake, fake, FitOptions(), None)
    made.screening = True
    made._design([FIVE.start])
    starts = made._guessed()
    assert any(not run.ok for run in made.runs) and all(run.ok for run in starts)
    assert np.abs(starts[-1].z - guess).max() < 1e-2
    assert [run.misfit for run in starts] == sorted(run.misfit for run in starts)


@pytest.mark.parametrize("later", [None, 0.5])
@pytest.mark.parametrize(("others", "run"), [((1.1, 1.2), 4), ((1.1, 1.5), 3), ((3.0, 9.0), 2)])
def test_ends_that_coarse_cells_do_not_tell_apart_are_all_run_on_fine_cells(
    others: tuple[float, ...], run: int, later: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those up to ALIKE_ON_COARSE times the least chi-square, and where the surrogate expects it; two at least. The
    first is the best run, also where the rounds after the descents have found it."""
    assert 1.2 < ALIKE_ON_COARSE < 1.5
    fake = Fake()
    made = Search(replace(goal(TRUTH), guesses=(FIVE.start,)), fake, fake, FitOptions(), None)

    def ends(descents: Any) -> list[ScoredRun]:
        best = made.best
        apart = [
            replace(best, z=FIVE.clip(best.z + 0.3 * k), residual=best.residual * np.sqrt(f))
            for k, f in enumerate(others, 1)
        ]
        return [*reversed(apart), best]

    monkeypatch.setattr(search, "race", ends)

    def rounds(search: Search) -> str:
        if later is not None:
            best = search.best
            search.runs.append(replace(best, z=FIVE.clip(best.z - 0.3), residual=best.residual * np.sqrt(later)))
        return "converged"

    monkeypatch.setattr(Search, "_rounds", rounds)
    points, count = made._screen([FIVE.start], downhill=True)
    least = min(made.runs, key=lambda found: found.misfit)
    assert count == (run if later is None else 2) and np.array_equal(points[1], least.z)
