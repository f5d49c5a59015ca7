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
    first, *others = made._guessed()
    assert first.misfit < 0.5 * plain.misfit
    assert [made.best] == (others or [first])
    made._evaluate([FIVE.to_vector(TRUTH)], "design")
    assert made.best.misfit < first.misfit and made._guessed()[1] is made.best


@pytest.mark.parametrize(("others", "run"), [((1.1, 1.2), 4), ((1.1, 1.5), 3), ((3.0, 9.0), 2)])
def test_ends_that_coarse_cells_do_not_tell_apart_are_all_run_on_fine_cells(
    others: tuple[float, ...], run: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those up to ALIKE_ON_COARSE times the least chi-square, and where the surrogate expects it; two at least."""
    assert 1.2 < ALIKE_ON_COARSE < 1.5
    fake = Fake()
    made = Search(replace(goal(TRUTH), guesses=(FIVE.start,)), fake, fake, FitOptions(), None)

    def ends(descents: Any) -> list[ScoredRun]:
        best = made.best
        apart = [
            replace(best, z=best.z + 2.0 * k, residual=best.residual * np.sqrt(f)) for k, f in enumerate(others, 1)
        ]
        return [*reversed(apart), best]

    monkeypatch.setattr(search, "race", ends)
    monkeypatch.setattr(Search, "_rounds", lambda self: "converged")
    points, count = made._screen([FIVE.start], downhill=True)
    least = min(found.misfit for found in made.runs)
    assert count == run and any(np.array_equal(points[1], found.z) for found in made.runs if found.misfit == least)
