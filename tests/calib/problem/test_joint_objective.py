"""Several traces at once: rows add up, runs are split and joined, and shared flesh is found through two specimens."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.fit.multistart import multistart_search
from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointEvaluator, JointObjective
from calib.problem.objective import Objective
from calib.simulation.evaluation import Evaluation
from tests.calib.fake import FIVE, STROKE, Fake, goal, three_terms

SHARED = ("E", "yield_stress", "R", "mu")
FLESH = {"E": 4e5, "yield_stress": 5e4, "R": 350.0, "mu": 0.25}
SKINS = {"a": 150.0, "b": 700.0}
FACTORS = {"a": 1.0, "b": 0.7}


def objectives(scaled: bool = False) -> dict[str, Objective]:
    """Two specimens of one flesh; ``b`` is narrower by a third where a factor is allowed for it."""
    out = {}
    for name, skin in SKINS.items():
        one = goal(FLESH | {"R_skin": skin})
        if scaled:
            curve = FACTORS[name] * one.target.curve
            one = Objective(replace(one.target, curve=curve), FIVE, scale_sd=0.3)
        out[name] = one
    return out


def test_names_say_what_is_shared() -> None:
    """Four shared parameters and two skins; each trace's objective sees its five."""
    joint = JointObjective.of(objectives(), SHARED)
    assert joint.parameters.names == ("E", "yield_stress", "R", "R_skin@a", "mu", "R_skin@b")
    assert [list(c.index) for c in joint.terms] == [[0, 1, 2, 3, 4], [0, 1, 2, 5, 4]]
    assert list(joint.parameters.stress_like()) == [1, 1, 1, 1, 0, 1]


def test_chi_square_is_the_sum_of_the_traces_and_each_prior_once() -> None:
    """Data rows of both, priors of six parameters: no shared prior counts twice."""
    joint = JointObjective.of(objectives(), SHARED)
    evaluator = JointEvaluator(joint, [Fake(), Fake()])
    values = {**FLESH, "R_skin@a": 200.0, "R_skin@b": 500.0, "E": 6e5}
    trial = joint.score(next(iter(evaluator.evaluate([values]))))
    singles = [
        one.score(next(iter(Fake().evaluate([FLESH | {"E": 6e5, "R_skin": values[f"R_skin@{name}"]}]))))
        for name, one in objectives().items()
    ]
    data = sum(float(np.sum(t.residual[:-5] ** 2)) for t in singles)
    prior = float(np.sum(joint.parameters.prior_residual(trial.z) ** 2))
    assert trial.misfit == pytest.approx(data + prior)
    assert joint.effective_rows == pytest.approx(sum(o.effective_rows for o in objectives().values()))


def test_guesses_of_the_traces_are_joined() -> None:
    """The first of each together: the mean of what they share, to each its own skin; a trace without a second guess
    leaves its skin at the start; without any there is none."""
    a, b = objectives().values()
    one, other, more = FIVE.start - 0.4, FIVE.start + 0.2, FIVE.start + 0.1
    joint = JointObjective.of({"a": replace(a, guesses=(one, more)), "b": replace(b, guesses=(other,))}, SHARED)
    first, second = joint.guesses
    np.testing.assert_allclose(first - joint.parameters.start, [-0.1, -0.1, -0.1, -0.4, -0.1, 0.2])
    np.testing.assert_allclose(second - joint.parameters.start, [0.1, 0.1, 0.1, 0.1, 0.1, 0.0])
    assert JointObjective.of(objectives(), SHARED).guesses == ()


def test_a_joint_run_is_as_good_as_its_worst_part() -> None:
    """One specimen breaks down at 40 %: the joint run failed, its part counts and its reason is kept."""
    joint = JointObjective.of(objectives(), SHARED)
    evaluator = JointEvaluator(joint, [Fake(), Fake(breaks=lambda p: True)])
    run = next(iter(evaluator.evaluate([{**FLESH, "R_skin@a": 200.0, "R_skin@b": 500.0}])))
    assert not run.ok and run.reason == "inverted" and run.fraction == pytest.approx(0.7)
    assert [p.ok for p in run.parts] == [True, False]
    assert np.isfinite(joint.score(run).residual).all()


def test_shared_flesh_is_found_through_two_specimens() -> None:
    """Skins over R (20 %) and the narrower specimen's factor (10 %) are found; only proportions are known."""
    joint = JointObjective.of(objectives(scaled=True), SHARED)
    fakes = [Fake(), Fake()]
    result = multistart_search(joint, JointEvaluator(joint, fakes), options=FitOptions(budget=60))
    values = result.best.evaluation.parameters
    for name, skin in SKINS.items():
        assert values[f"R_skin@{name}"] / values["R"] == pytest.approx(skin / FLESH["R"], rel=0.2)
    assert all(f.runs == result.simulations for f in fakes)
    found = {
        name: case.objective.factor(trial.curve)
        for name, case, trial in zip(SKINS, joint.terms, result.best.each, strict=True)
    }
    assert found["b"] == pytest.approx(0.7 * found["a"], rel=0.1)


def test_the_factor_pays_for_itself_in_its_logarithm() -> None:
    """A simulation five times too weak is as far from its prior as one five times too strong, and cannot hide in it."""
    one = objectives(scaled=True)["a"]
    weak, strong = (one.data_residual(k * one.target.curve) for k in (0.2, 5.0))
    assert weak @ weak == pytest.approx(strong @ strong, rel=0.02)
    assert weak @ weak == pytest.approx((np.log(5.0) / 0.3) ** 2, rel=0.1)
    assert one.factor(0.2 * one.target.curve) == pytest.approx(5.0, rel=0.05)
    assert len(weak) == one.data_rows and one.data_residual(one.target.curve) == pytest.approx(np.zeros(len(weak)))


def test_a_surrogate_of_two_traces_does_not_mix_their_skins() -> None:
    """The skin of one specimen leaves the other's rows alone, in the expected residual and in the Jacobian."""
    joint = JointObjective.of(objectives(), SHARED)
    evaluator = JointEvaluator(joint, [Fake(noisy=0.0), Fake(noisy=0.0)])
    random = np.random.default_rng(0)
    points = joint.parameters.start + 0.2 * random.standard_normal((24, 6))
    points = np.clip(points, joint.parameters.lower, joint.parameters.upper)
    runs = [joint.score(e) for e in evaluator.evaluate([joint.parameters.to_dict(z) for z in points])]
    surrogate = Surrogate(joint, runs, min(runs, key=lambda t: t.misfit))
    slope = surrogate.jacobian(surrogate.best.z)
    rows = joint.terms[0].objective.data_rows
    assert np.all(slope[:rows, 5] == 0.0) and np.all(slope[rows : 2 * rows, 3] == 0.0)
    assert np.linalg.norm(slope[:rows, 3]) > 1.0 and np.linalg.norm(slope[rows : 2 * rows, 5]) > 1.0


def test_a_joint_evaluation_is_plain_where_there_are_no_parts() -> None:
    """A trial of a single trace is its own only part."""
    one = objectives()["a"]
    values = FLESH | {"R_skin": 200.0}
    trial = one.score(Evaluation(0, values, "ok", "", 1.0, STROKE, three_terms(values)))
    assert trial.each == (trial,) and one.terms[0].objective is one
