"""What a fit is worth without one of its properties."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calib.fit.multistart import FitResult, multistart_search
from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.target import Target
from calib.uncertainty.analysis import analyse
from calib.uncertainty.nested_models import ROUNDS, nested_models, with_nested_runs
from tests.calib.fake import GRID, STROKE, Fake

PAIR = ParameterSet(
    (
        Parameter("R", 300.0, 1.0, 5e3, "J/m^2", 80.0, 1200.0),
        Parameter("mu", 0.3, 0.0, 1.0, "-", 0.0, 0.6, "linear"),
    )
)


def ramp(p) -> np.ndarray:
    """A plateau for R, and a ramp for mu [N] (500,)."""
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + 20.0 * p["mu"] * STROKE / STROKE[-1]


def plateau(p) -> np.ndarray:
    """A plateau for both [N] (500,): what is without friction has more R."""
    return (0.03 * p["R"] + 20.0 * p["mu"]) * (1.0 - np.exp(-STROKE / 0.002))


def fitted(force, truth, breaks=lambda p: False) -> tuple[Objective, FitResult, Fake]:
    """A fit to the cut of a truth, known to 0.3 N."""
    fake = Fake(force, noisy=0.002, breaks=breaks)
    goal = Objective(Target(GRID, np.interp(GRID, STROKE, force(truth)), 0.3, 0.3, np.interp), PAIR)
    return goal, multistart_search(goal, fake, options=FitOptions(budget=30)), fake


def test_what_the_curve_shows_has_evidence_and_what_it_does_not_has_none() -> None:
    """A ramp is friction's alone; without a ramp the criterion takes the logarithm of the number of data."""
    goal, fit, fake = fitted(ramp, {"R": 300.0, "mu": 0.2})
    said: list[str] = []
    after = with_nested_runs(goal, fit, fake, ["mu"], said.append)
    (mu,) = nested_models(goal, after, ["mu"])
    assert mu.name == "mu" and mu.value == 0.0 and mu.evidence > 10.0 and mu.chi_square > mu.whole + 10.0
    more = after.history[len(fit.history) :]
    assert 1 <= len(more) <= ROUNDS and all(run.stage == "without" and run.z[1] == 0.0 for run in more)
    assert len(said) == len(more) and said[0] == "without mu, round 1 of 5 at most"
    goal, fit, fake = fitted(ramp, {"R": 300.0, "mu": 0.0})
    (mu,) = nested_models(goal, with_nested_runs(goal, fit, fake, ["mu"]), ["mu"])
    assert -math.log(goal.effective_rows) - 0.5 < mu.evidence < 0.0


def test_all_others_are_fitted_again() -> None:
    """Where R can take the place of friction, nothing speaks for friction: found from values at which chi-square rises
    by hundreds."""
    goal, fit, fake = fitted(plateau, {"R": 300.0, "mu": 0.2})
    best = fit.best.evaluation.parameters
    held = goal.score(next(iter(fake.evaluate([{**best, "mu": 0.0}]))))
    after = with_nested_runs(goal, fit, fake, ["mu"])
    (mu,) = nested_models(goal, after, ["mu"])
    assert held.misfit > 20.0 * mu.chi_square and mu.evidence < 0.0
    run = min((r for r in after.history if r.stage == "without"), key=lambda r: r.misfit)
    assert run.evaluation.parameters["R"] == pytest.approx(best["R"] + 20.0 / 0.03 * best["mu"], rel=0.03)


def test_each_is_simulated_and_a_model_that_breaks_down_is_left_out() -> None:
    """Two models of one fit, each held at its own least value; no figure without a simulation that ends its stroke."""
    goal, fit, fake = fitted(ramp, {"R": 300.0, "mu": 0.2}, breaks=lambda p: p["R"] < 2.0)
    before = fake.runs
    after = with_nested_runs(goal, fit, fake, ["R", "mu"])
    assert [model.name for model in nested_models(goal, after, ["R", "mu"])] == ["mu"]
    assert fake.runs - before == len(after.history) - len(fit.history)
    assert min(run.evaluation.parameters["R"] for run in after.history[len(fit.history) :]) == pytest.approx(1.0)
    assert with_nested_runs(goal, fit, fake, []) is fit and nested_models(goal, fit, []) == ()


def test_the_intervals_know_what_was_simulated_without() -> None:
    """A profile does not say that the trace has no objection where a simulation has shown that it has."""
    goal, fit, fake = fitted(ramp, {"R": 300.0, "mu": 0.2})
    few = replace(fit, history=tuple(run for run in fit.history if run.z[1] > 0.15), surrogate=None)
    few = replace(few, surrogate=Surrogate(goal, few.history, few.best))
    after = with_nested_runs(goal, few, fake, ["mu"])
    assert after.surrogate is not None and after.surrogate is not few.surrogate
    (mu,) = nested_models(goal, after, ["mu"])
    rise = after.surrogate.expected(min(after.history, key=lambda run: run.z[1]).z, 0.0) - after.best.misfit
    assert rise == pytest.approx(mu.chi_square - mu.whole, rel=0.2)
    analysis = analyse(goal, after, seed=0)
    assert analysis is not None and analysis.uncertainty.intervals[1].low95 > 0.05
