"""A second search: it confirms what one search has found, or takes back what it claimed."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from calib.fit.multistart import FitResult, multistart_search
from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate
from calib.io.progress import Progress
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluators
from calib.uncertainty import global_search
from calib.uncertainty.analysis import UncertaintyAnalysis, analyse, search_uncertainty
from calib.uncertainty.global_search import Listener, fit_with_uncertainty
from tests.calib.fake import GRID, STROKE, Fake

TWO = ParameterSet(
    (
        Parameter("R_skin", 4e5, 2e4, 1e7, "N/m", 5e4, 3e6),
        Parameter("R", 300.0, 10.0, 5e3, "J/m^2", 80.0, 1200.0),
    )
)
MIDDLE, APART = 4e5, 1.0
TRUTH = {"R_skin": MIDDLE * math.exp(APART), "R": 300.0}


def twofold(p: dict[str, float]) -> np.ndarray:
    """A cut that a food stiffer than :data:`MIDDLE` and one as much softer explain alike [N] (500,)."""
    ramp = 6.0 * abs(math.log(p["R_skin"] / MIDDLE))
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + ramp * STROKE / STROKE[-1]


def onefold(p: dict[str, float]) -> np.ndarray:
    """One that a single food explains [N] (500,)."""
    ramp = 3.0 * (1.0 + math.log(p["R_skin"] / MIDDLE) / 2)
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + ramp * STROKE / STROKE[-1]


def objective(force) -> Objective:
    """The cut of the truth, without noise, known to 0.05 N."""
    return Objective(Target(GRID, np.interp(GRID, STROKE, force(TRUTH)), 0.05, 0.05, np.interp), TWO)


def inferred(
    force, seed: int, budget: float = 100, told: list[Progress] | None = None
) -> tuple[FitResult, UncertaintyAnalysis, int]:
    """A fit with its second search, and how many runs the first one took."""
    fake, options = Fake(force, noisy=0.002), FitOptions(budget=budget, seed=seed)
    goal = objective(force)
    first = multistart_search(goal, fake, coarse=fake, replicate=fake, options=options)
    alone = analyse(goal, first, coarse=fake, fine=fake, seed=seed)
    report = None if told is None else told.append
    result, analysis = fit_with_uncertainty(
        goal, Evaluators(fake, fake, fake), options, listener=Listener(progress=report)
    )
    assert analysis is not None and alone is not None
    return result, analysis, len(alone.result.history)


def verdicts(analysis: UncertaintyAnalysis) -> dict[str, str]:
    """By name."""
    return {i.parameter.name: i.verdict for i in analysis.uncertainty.intervals}


@pytest.mark.long
def test_another_food_that_explains_the_curve_takes_a_claim_back():
    """Which food the first search ends at is chance; the second is sent away from it and ends at the other, the
    interval reaches to it and nothing is claimed. Of 24 seeds it does so in 21 or 22, and which ones hangs on the
    processor's last bits; none claims the wrong food."""
    reached = 0
    for seed in range(1, 9):
        _, analysis, _ = inferred(twofold, seed)
        e = analysis.uncertainty.intervals[0]
        assert e.verdict == "weak"
        far = e.low95 < MIDDLE * math.exp(-0.9 * APART) and e.high95 > MIDDLE * math.exp(0.9 * APART)
        said = len(analysis.remarks) == 1 and analysis.remarks[0].startswith(
            "R_skin: a second search found another food"
        )
        reached += far and said and verdicts(analysis)["R"] == "identified"
    assert reached >= 6


@pytest.mark.parametrize("seed", range(3))
def test_what_no_other_food_refutes_is_claimed_still(seed):
    """The second search finds nothing as good; all its runs are in the history, with the chi-square of the objective
    itself."""
    told: list[Progress] = []
    result, analysis, first = inferred(onefold, seed, told=told)
    r = analysis.uncertainty.intervals[1]
    assert r.verdict == "identified" and r.low95 < TRUTH["R"] < r.high95
    more = [t for t in result.history if t.stage != "profile"]
    assert len(more) > first and analysis.remarks == ()
    goal = objective(onefold)
    assert all(t.misfit == goal.score(t.evaluation).misfit for t in result.history)
    assert told[-1].done == len(more)
    assert all(b.done >= a.done and b.spent >= a.spent for a, b in zip(told[:-1], told[1:], strict=True))
    assert {p.budget for p in told} == {100}


def test_what_is_claimed_is_barred():
    """A point within all claimed intervals has a residual more, the deeper the larger; one outside of any of them has
    none."""
    _, analysis, _ = inferred(onefold, 0)
    both = analysis.uncertainty.intervals
    barred = global_search._deflated(TWO, both)
    middle = np.array([0.5 * (i.parameter.to_internal(i.low95) + i.parameter.to_internal(i.high95)) for i in both])
    half = np.array([0.5 * (i.parameter.to_internal(i.high95) - i.parameter.to_internal(i.low95)) for i in both])
    points = middle + np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 1.5], [3.1, 0.0], [0.0, -3.1], [1.0, 1.0]]) * half
    rows = barred.prior_residual(points)
    assert rows[:, -1] == pytest.approx([10.0, 5.0, 5.0, 0.0, 0.0, 20.0 / 3.0])
    assert np.array_equal(rows[:, :-1], TWO.prior_residual(points))
    assert np.array_equal(barred.prior_residual(points[1]), rows[1])


def stuck(goal: Objective, fake: Fake, shift: float) -> FitResult:
    """A fit whose search has ended at an R so many times the right one, with no better run in its history."""
    right = multistart_search(goal, fake, coarse=fake, replicate=fake, options=FitOptions(seed=0))
    values = dict(right.best.evaluation.parameters)
    poor = goal.score(next(iter(fake.evaluate([values | {"R": shift * values["R"]}]))), stage="round")
    history = (*(t for t in right.history if t.misfit > poor.misfit), poor)
    surrogate = Surrogate(goal, history, poor)
    return replace(
        right,
        best=poor,
        history=history,
        parameters=right.parameters.with_values(poor.evaluation.parameters),
        surrogate=surrogate,
        jacobian=surrogate.jacobian(poor.z),
        replicates=(),
    )


def test_a_better_food_becomes_the_answer():
    """Where the first search has ended in a basin that explains the curve less well, values and intervals are about the
    second's, and only what holds the first's value as well is claimed."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.002)
    first = stuck(goal, fake, 1.1)
    narrow = replace(search_uncertainty(goal, first).intervals[1], verdict="identified")  # type: ignore[union-attr]
    narrow = replace(narrow, low95=0.99 * narrow.parameter.value, high95=1.01 * narrow.parameter.value)
    result = global_search._second_search(goal, first, [narrow], Evaluators(fake, fake, fake), FitOptions(seed=0), None)
    assert result.best.misfit < first.best.misfit - 5.0
    assert result.parameters.to_dict(result.best.z) == result.best.evaluation.parameters
    assert result.surrogate is not None and result.surrogate.best is result.best
    analysis = analyse(goal, result, coarse=fake, fine=fake)
    assert analysis is not None
    found = global_search._compared(analysis, first, result, [narrow])
    assert "better, by" in found.remarks[0] and verdicts(found)["R"] == "weak", "the first answer lies outside"
    assert "the food of the first search had another, so not called identified" in found.remarks[1]
    assert found.uncertainty.intervals[1].low95 == analysis.uncertainty.intervals[1].low95
    near = replace(first, best=goal.score(replace(result.best.evaluation)))
    assert verdicts(global_search._compared(analysis, near, result, [narrow]))["R"] == "identified"


def test_what_cannot_be_searched_twice_is_not_claimed():
    """Nothing is begun that cannot be paid, and what one search alone has found is weak."""
    result, analysis, first = inferred(onefold, 0, budget=20)
    assert len(result.history) == first and verdicts(analysis)["R"] == "weak"
    r = analysis.uncertainty.intervals[1]
    assert r.low95 < TRUTH["R"] < r.high95 and "a budget of 40 may" in analysis.remarks[0]


def test_what_is_not_proven_is_not_claimed():
    """A stiffness that the curve bounds as well as R is weak, and why is said."""
    stiff = replace(TWO.items[0], name="E", unit="Pa")
    named = {"E": TRUTH["R_skin"], "R": TRUTH["R"]}
    fake = Fake(lambda p: onefold({"R_skin": p["E"] ** 6 / named["E"] ** 5, "R": p["R"]}), noisy=0.002)
    target = Target(GRID, np.interp(GRID, STROKE, onefold(TRUTH)), 0.05, 0.05, np.interp)
    goal = Objective(target, ParameterSet((stiff, TWO.items[1])))
    alone = search_uncertainty(
        goal, multistart_search(goal, fake, coarse=fake, replicate=fake, options=FitOptions(seed=0))
    )
    assert alone is not None and alone.intervals[0].verdict == "identified"
    _, analysis = fit_with_uncertainty(goal, Evaluators(fake, fake, fake), FitOptions(seed=0))
    assert analysis is not None and verdicts(analysis) == {"E": "weak", "R": "identified"}
    assert any(said.startswith("E: bounded, but of made-up cuts one of four") for said in analysis.remarks)


def test_what_numerics_decide_is_not_claimed():
    """An answer that does not explain the curve at half the speed and with other particles is none; no second search is
    made for it."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.002)
    other = Fake(lambda p: onefold(p) + 0.9 * np.sin(STROKE / 0.003), noisy=0.002)
    result, analysis = fit_with_uncertainty(goal, Evaluators(fake, fake, other), FitOptions(seed=0))
    first = multistart_search(goal, fake, coarse=fake, replicate=other, options=FitOptions(seed=0))
    assert analysis is not None and verdicts(analysis)["R"] == "weak" and result.best.misfit < 2.0
    assert [t.stage for t in result.history[len(first.history) :]] == ["profile"] * (
        len(result.history) - len(first.history)
    )
    assert "R: bounded, but the same values at half the speed" in analysis.remarks[0]


def test_the_answer_is_always_run_twice():
    """Also one that was found after the finalists were; once only."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.002)
    fit = stuck(goal, fake, 1.01)
    once = global_search._replicated(goal, fit, fake)
    assert len(once.replicates) == 1 and np.array_equal(once.replicates[0].z, fit.best.z)
    assert global_search._replicated(goal, once, fake) is once and once.simulations == fit.simulations + 1


@pytest.mark.parametrize(
    ("factor", "worse", "follows"), [(1.0, 0.5, True), (1.08, 0.5, False), (1.08, 8.0, True)], ids=str
)
def test_a_better_food_is_followed_unless_its_force_does_not_stand(factor, worse, follows):
    """Where the curve tells the two apart, it is in any case."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.0)
    fit = global_search._replicated(goal, stuck(goal, fake, 1.01), fake)
    other = replace(fit.best, z=fit.best.z + 0.1, residual=fit.best.residual * 0.0)
    fit = replace(fit, best=replace(fit.best, residual=np.sqrt(worse) * np.eye(len(fit.best.residual))[0]))
    again = Fake(lambda p: factor * onefold(p), noisy=0.0)
    run = goal.score(next(iter(fake.evaluate([goal.parameters.to_dict(other.z)]))))
    run = replace(run, residual=0.0 * run.residual)
    assert global_search._may_follow(goal, fit, run, again) is follows


def test_an_interrupted_search_simulates_nothing_more():
    """After Ctrl-C what there is has its intervals, without another run."""
    goal = objective(onefold)
    fake = Fake(onefold, noisy=0.002, interrupt_after=25)
    result, analysis = fit_with_uncertainty(goal, Evaluators(fake, fake, fake), FitOptions())
    assert result.status == "interrupted" and analysis is not None and fake.runs == 25


def fit_with_both_valleys(goal: Objective, fake: Fake) -> FitResult:
    """A fit in one valley of :func:`twofold` whose history has a run of the other, as the end of an interval has."""
    fit = multistart_search(goal, fake, coarse=fake, replicate=fake, options=FitOptions(seed=0))
    mirrored = fit.best.evaluation.parameters | {"E": MIDDLE**2 / fit.best.evaluation.parameters["E"]}
    other = goal.score(next(iter(fake.evaluate([mirrored]))), stage="profile")
    return replace(fit, history=(*(t for t in fit.history if abs(t.z[0] - fit.best.z[0]) < 0.5), other))


@pytest.mark.parametrize(
    ("own", "others", "moves", "finer_runs", "repeated"),
    [(1.06, 1.005, True, 2, 1), (1.005, 1.06, False, 1, 0), (1.06, 1.06, False, 2, 0)],
    ids=["the answer hangs on the cells", "the answer stands", "both hang on the cells"],
)
def test_an_answer_that_hangs_on_the_cells_gives_way_to_one_that_does_not(own, others, moves, finer_runs, repeated):
    """Where the curve does not tell them apart; nothing else is simulated, and the intervals are about the new one."""
    stiff = ParameterSet((replace(TWO.items[0], name="E", unit="Pa"), TWO.items[1]))

    def force(p):
        return twofold({"R_skin": p["E"], "R": p["R"]})

    fake, replicate = Fake(force, noisy=0.002), Fake(force, noisy=0.002)
    goal = Objective(Target(GRID, np.interp(GRID, STROKE, twofold(TRUTH)), 0.05, 0.05, np.interp), stiff)
    fit = fit_with_both_valleys(goal, fake)
    upper = fit.best.evaluation.parameters["E"] > MIDDLE
    finer = Fake(lambda p: force(p) * (own if (p["E"] > MIDDLE) is upper else others), noisy=0.0)
    analysis = analyse(goal, fit, seed=0)
    assert analysis is not None
    before = fake.runs
    found = global_search._standing(goal, analysis, Evaluators(fake, fake, replicate, finer), 0)
    assert (fake.runs - before, replicate.runs, finer.runs) == (0, repeated, finer_runs)
    if not moves:
        assert found is analysis
        return
    assert found.result.best is fit.history[-1] and found.result.surrogate.best is fit.history[-1]
    assert found.result.parameters["E"].value == fit.history[-1].evaluation.parameters["E"]
    assert found.uncertainty.intervals[0].parameter.value == found.result.parameters["E"].value
    assert "another force on finer cells" in found.remarks[0]
    assert global_search._standing(goal, analysis, Evaluators(fake, fake, replicate), 0) is analysis


def test_remarks_are_no_stages():
    """Whoever shows what is going on is told of stages; a remark on the answer is told apart, or with them."""
    goal, fake = objective(onefold), Fake(onefold, noisy=0.002)
    stages: list[str] = []
    remarks: list[str] = []
    for remark in (remarks.append, None):
        _, analysis = fit_with_uncertainty(
            goal,
            Evaluators(fake, fake, fake),
            FitOptions(budget=20, seed=0),
            Listener(say=stages.append, remark=remark),
        )
        assert analysis is not None and [f"{said}." for said in remarks] == list(analysis.remarks) != []
        assert (remarks[0] in stages) is (remark is None) and any(said.startswith("intervals") for said in stages)
