"""A second search: it confirms what one search has found, or takes back what it claimed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calib import second
from calib.doubt import Doubt, doubt_of
from calib.fit import FitResult, calibrate
from calib.objective import Objective, Target
from calib.options import FitOptions
from calib.parameters import Parameter, ParameterSet
from calib.progress import Progress
from calib.second import infer
from calib.surrogate import Surrogate
from tests.calib.fake import GRID, STROKE, Fake

TWO = ParameterSet(
    (
        Parameter("E", 4e5, 2e4, 1e7, "Pa", 5e4, 3e6),
        Parameter("R", 300.0, 10.0, 5e3, "J/m^2", 80.0, 1200.0),
    )
)
MIDDLE, APART = 4e5, 1.0
TRUTH = {"E": MIDDLE * math.exp(APART), "R": 300.0}


def twofold(p: dict[str, float]) -> np.ndarray:
    """A cut that a food stiffer than :data:`MIDDLE` and one as much softer explain alike [N] (500,)."""
    ramp = 3.0 * abs(math.log(p["E"] / MIDDLE))
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + ramp * STROKE / STROKE[-1]


def onefold(p: dict[str, float]) -> np.ndarray:
    """One that a single food explains [N] (500,)."""
    ramp = 3.0 * (1.0 + math.log(p["E"] / MIDDLE) / 2)
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + ramp * STROKE / STROKE[-1]


def objective(force) -> Objective:
    """The cut of the truth, without noise, known to 0.05 N."""
    return Objective(Target(GRID, np.interp(GRID, STROKE, force(TRUTH)), 0.05, 0.05, np.interp), TWO)


def inferred(force, seed: int, budget: float = 100, told: list[Progress] | None = None) -> tuple[FitResult, Doubt, int]:
    """A fit with its second search, and how many runs the first one took."""
    fake, options = Fake(force, noisy=0.002), FitOptions(budget=budget, seed=seed)
    goal = objective(force)
    first = calibrate(goal, fake, coarse=fake, replicate=fake, options=options)
    alone = doubt_of(goal, first, scout=fake, judge=fake, seed=seed)
    report = None if told is None else told.append
    result, doubt = infer(goal, fake, coarse=fake, again=fake, options=options, progress=report)
    assert doubt is not None and alone is not None
    return result, doubt, len(alone.result.history)


def verdicts(doubt: Doubt) -> dict[str, str]:
    """By name."""
    return {i.parameter.name: i.verdict for i in doubt.uncertainty.intervals}


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_another_food_that_explains_the_curve_takes_a_claim_back(seed):
    """Which food one search ends at is chance; where the second ends at the other, the interval reaches to it and nothing is claimed."""
    _, doubt, _ = inferred(twofold, seed)
    e = doubt.uncertainty.intervals[0]
    assert e.verdict == "weak" and verdicts(doubt)["R"] == "identified"
    assert e.low95 < MIDDLE * math.exp(-0.9 * APART) and e.high95 > MIDDLE * math.exp(0.9 * APART)
    assert len(doubt.said) == 1 and doubt.said[0].startswith("E: a second search found another food")


@pytest.mark.parametrize("seed", range(3))
def test_what_is_found_again_is_claimed_still(seed):
    """The second search ends as soon as it is where the first has ended, after few runs that count; all runs are in the history."""
    told: list[Progress] = []
    result, doubt, first = inferred(onefold, seed, told=told)
    r = doubt.uncertainty.intervals[1]
    assert r.verdict == "identified" and r.low95 < TRUTH["R"] < r.high95
    more = result.history[first:]
    assert 0 < sum(not t.coarse for t in more) <= 6 < len(more) and doubt.said == ()
    assert told[-1].done == len(result.history) - sum(t.stage == "profile" for t in more)
    assert all(b.done >= a.done and b.spent >= a.spent for a, b in zip(told[:-1], told[1:], strict=True))
    assert {p.budget for p in told} == {100}


def test_a_better_food_becomes_the_answer(monkeypatch):
    """Where the first search has ended in a basin that explains the curve less well, values and intervals are about the second's."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.002)
    options = FitOptions(seed=0)
    right = calibrate(goal, fake, coarse=fake, replicate=fake, options=options)
    values = dict(right.best.evaluation.parameters)
    poor = goal.trial(next(iter(fake.evaluate([values | {"R": 1.03 * values["R"]}]))), stage="round")
    history = (*(t for t in right.history if t.misfit > poor.misfit), poor)
    surrogate = Surrogate(goal, history, poor)
    stuck = replace(
        right,
        best=poor,
        history=history,
        parameters=right.parameters.with_values(poor.evaluation.parameters),
        surrogate=surrogate,
        jacobian=surrogate.jacobian(poor.z),
    )
    monkeypatch.setattr(second, "calibrate", lambda *args, **how: stuck)
    monkeypatch.setattr(second, "RISE", -math.inf)  # so that the second search goes on to its own end
    result, doubt = infer(goal, fake, coarse=fake, again=fake, options=options)
    assert doubt is not None and poor.misfit > right.best.misfit + 5.0
    assert result.best.misfit < poor.misfit - 5.0 and result.best.stage != "profile"
    assert [i.parameter.value for i in doubt.uncertainty.intervals] == list(result.best.evaluation.parameters.values())
    assert result.surrogate is not None and result.surrogate.best is result.best
    assert "better, by" in doubt.said[0]
    assert verdicts(doubt)["R"] == "identified", "the first answer lies in its interval"
    far = next(iter(fake.evaluate([values | {"R": 1.5 * values["R"]}])))
    alone = second._unconfirmed(doubt.uncertainty, goal.trial(far, stage="round"))
    assert alone.intervals[1].verdict == "weak", "found by one search alone"
    assert alone.intervals[1].low95 == doubt.uncertainty.intervals[1].low95


def test_what_cannot_be_searched_twice_is_not_claimed():
    """Nothing is begun that cannot be paid, and what one search alone has found is weak."""
    result, doubt, first = inferred(onefold, 0, budget=20)
    assert len(result.history) == first and verdicts(doubt)["R"] == "weak"
    r = doubt.uncertainty.intervals[1]
    assert r.low95 < TRUTH["R"] < r.high95 and "a budget of 40 may" in doubt.said[0]


def test_an_interrupted_search_simulates_nothing_more():
    """After Ctrl-C what there is has its intervals, without another run."""
    goal = objective(onefold)
    fake = Fake(onefold, noisy=0.002, interrupt_after=25)
    result, doubt = infer(goal, fake, coarse=fake, again=fake, options=FitOptions())
    assert result.status == "interrupted" and doubt is not None and fake.runs == 25
