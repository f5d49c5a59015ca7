"""The upward half of a trace: cut out of the record, put beside the cut, and what it tells apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from calib.errors import TraceError
from calib.material.food import load_food
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.request import Request
from calib.problem.scored_run import ScoredRun
from calib.problem.setup import set_up
from calib.problem.target import Target
from calib.problem.withdrawal import (
    BothWays,
    BothWaysEvaluator,
    both_ways,
    smooth_pull,
    with_withdrawal,
    withdrawal_of,
    withdrawn,
)
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore
from calib.simulation.workers import evaluation_of
from calib.trace.conditioning import condition
from calib.trace.trace import Trace
from calib.uncertainty.intervals import Uncertainty, linearised_likelihood, uncertainty
from mpm.scene import Motion
from tests.mpm.scenes import PRISM, WEDGE, cut

LENGTH, RELEASE, RATE = 0.032, 2e-3, 200.0
NOISE = 0.02


def pull_of(way: np.ndarray) -> np.ndarray:
    """What holds the knife back in the made-up record [N]: it rises over the release and falls with what is in."""
    return np.interp(way, [0.0, RELEASE, LENGTH], [-8.0, 3.0, 0.0])


def record(*, up_to: float = 0.06, push: bool = False) -> Trace:
    """Down at 20 mm/s into a food of 32 mm, a pause of 0.2 s, and up at 40 mm/s to a height [m] at its end."""
    down = 0.06 - 0.02 * np.arange(0.0, 2.6, 1 / RATE)
    height = np.concatenate([down, np.full(40, down[-1]), np.arange(down[-1], up_to, 0.04 / RATE)])
    depth = LENGTH - (height - height.min())
    load = np.where(depth > 0.0, np.interp(depth, [0.0, 0.022, LENGTH], [0.0, 12.0, 8.0]), 0.0)
    turn = len(down) + 40
    load[turn:] = -pull_of(height[turn:] - height.min()) * (depth[turn:] > 0.0) * (-1.0 if push else 1.0)
    load = load + NOISE * np.random.default_rng(3).normal(size=len(load))
    time = np.arange(len(load)) / RATE
    return Trace(time, 3.0 + load, height, "made.csv", "", {"force": "force_N", "time": "time_s"})


def test_the_way_up_is_taken_from_the_record():
    """Pull over the way from the release to where the edge is out, within the noise; the curve of the cut is the same
    as of a record that ends at the turn."""
    whole = condition(record())
    found = withdrawal_of(whole, RELEASE)
    assert found.way[0] == RELEASE and found.way[-1] == pytest.approx(LENGTH, abs=3e-4)
    inner = (found.way > 4e-3) & (found.way < 0.03)
    np.testing.assert_allclose(found.pull[inner], pull_of(found.way[inner]), atol=0.05)
    assert found.speed == pytest.approx(0.04, rel=0.02)
    assert 0.1 * NOISE < found.noise_sd_N < NOISE and found.level_sd_N > 0.0
    ended = condition(record().until(2.75))
    np.testing.assert_allclose(whole.curve, ended.curve, atol=0.02)


def test_a_record_without_a_way_up_says_so():
    """No position, an end soon after the turn, and a food that pushes the knife out: each has its reason."""
    with pytest.raises(TraceError, match="the record ends .* above the lowest point"):
        withdrawal_of(condition(record(up_to=0.012)), RELEASE)
    with pytest.raises(TraceError, match="pushes the knife out"):
        withdrawal_of(condition(record(push=True)), 4e-3)
    blind = condition(replace(record().until(2.6), position=None), speed=0.02)
    with pytest.raises(TraceError, match="needs the knife's position"):
        withdrawal_of(blind, RELEASE)


def test_a_stroke_that_may_be_a_whole_one_is_one():
    """A turn a little above the board leaves a tie that holds the halves together: not where the contact's own doubt
    reaches to the board, as that of a cut to it does."""
    height = PRISM.food.shape.height
    for above, doubt, left in ((1e-4, 2e-4, 0.0), (3e-4, 2e-4, 3e-4), (-1e-4, 0.0, 0.0), (1e-4, 0.0, 1e-4)):
        turned = withdrawn(PRISM, height - above, 4e-3, doubt)
        assert turned.motion.stroke == pytest.approx(height - left, abs=1e-12)


def test_one_simulation_brings_both_ways():
    """Its path goes on rising behind the turn, so that it is kept as any other; apart again, the ways have the forces
    of the record, and a run that broke down on its way down has no way up."""
    scene = withdrawn(replace(PRISM, knife=WEDGE, motion=Motion(0.02, 0.02)).with_material(mu=0.3), 8e-3, 4e-3)
    assert scene.motion.stroke == 8e-3 and scene.motion.retract > 4e-3 + 0.5 * scene.numerics.dx
    done = cut(scene)
    run = evaluation_of(done)
    assert (np.diff(run.stroke) > -1e-9).all()
    assert run.until(run.scalars["turn_m"])[0] == pytest.approx(done.peak, abs=1e-5)  # here it is at the turn
    joint = next(BothWaysEvaluator(Given(run)).evaluate([{}]))
    down, up = joint.parts
    n = done.cut_rows
    np.testing.assert_allclose(down.stroke, done.stroke[:n], atol=1e-9)
    np.testing.assert_allclose(up.stroke, done.stroke[n - 1] - done.stroke[n:], atol=2e-9)
    np.testing.assert_allclose(up.force, -done.resolved[n:], atol=1e-6)
    broken = replace(run, status="failed", fraction=0.3, stroke=run.stroke[:9], force=run.force[:9], scalars={})
    assert both_ways(broken).parts[1].stroke.size == 0 and both_ways(broken).parts[0].stroke.size == 9


class Given:
    """Brings one run, whatever it is asked for."""

    def __init__(self, run: Evaluation) -> None:
        self.run = run

    def evaluate(self, batch):
        """The run for each."""
        return iter([replace(self.run, index=k, parameters=dict(values)) for k, values in enumerate(batch)])


FOUR = ParameterSet(
    (
        Parameter("E", 5e5, 2e4, 1e7, "Pa", 1e5, 2e6),
        Parameter("R", 300.0, 10.0, 5e3, "J/m^2", 80.0, 1200.0),
        Parameter("mu", 0.3, 0.0, 1.2, "-", 0.05, 0.6, "linear"),
        Parameter("adhesion_energy", 2.0, 0.02, 50.0, "J/m^2", 0.1, 20.0),
    )
)
TRUTH = {p.name: p.value for p in FOUR}
PATH = np.linspace(1e-4, 2 * LENGTH - 1e-4, 800)


def formula(p: Mapping[str, float]) -> Evaluation:
    """A cut and its withdrawal: R and the faces' pressure p A (tan h + mu) down, p A (mu - tan h) and adhesion up.

    On the way up the pressure is a third: the food springs back by that much. Adhesion is taken off by the wedge where
    the edge leaves, at its work over a way.
    """
    width, tan = 0.03, 0.1
    depth = np.where(PATH <= LENGTH, PATH, 2 * LENGTH - PATH)
    faces = 0.05 * p["E"] * width * depth
    down = width * p["R"] * (1 - np.exp(-depth / 2e-3)) + 0.1 * faces * (tan + p["mu"])
    up = 0.033 * faces * (tan - p["mu"]) - 2 * width * p["adhesion_energy"] * np.minimum(depth / 6e-3, 1.0)
    force = np.where(PATH <= LENGTH, down, up)
    return both_ways(Evaluation(0, dict(p), "ok", "", 1.0, PATH, force, {"turn_m": LENGTH}))


def ways() -> tuple[Objective, JointObjective]:
    """Objectives of the made-up cut alone and with its withdrawal."""
    down, up = formula(TRUTH).parts
    stroke, way = np.linspace(1e-3, LENGTH - 1e-3, 240), np.linspace(RELEASE, LENGTH - 1e-3, 240)
    alone = Objective(Target(stroke, np.interp(stroke, down.stroke, down.force), NOISE, NOISE, np.interp), FOUR)
    pull = smooth_pull(way, up.stroke, up.force)
    return alone, with_withdrawal(alone, Target(way, pull, NOISE, NOISE, smooth_pull))


def at_the_truth(objective: Objective | JointObjective) -> tuple[ScoredRun, Uncertainty]:
    """The run of the truth, and the linearised posterior there."""

    def score(z: np.ndarray) -> ScoredRun:
        run = formula(FOUR.to_dict(z))
        return objective.score(run if isinstance(objective, JointObjective) else run.parts[0])

    z, slopes = FOUR.start, []
    for k, step in enumerate(FOUR.steps):
        aside = step * np.eye(len(z))[k]
        slopes.append((score(z + aside).residual - score(z - aside).residual) / (2 * step))
    best = score(z)
    return best, uncertainty(FOUR, linearised_likelihood(objective, best, np.array(slopes).T))


def test_the_withdrawal_tells_friction_adhesion_and_resistance_apart():
    """Of a formula in which they are known: down alone says nothing of adhesion and next to nothing of friction. With
    the way up adhesion is known to an eighth of its prior, and friction and R better by a quarter."""
    alone, both = ways()
    (first, cut_only), (second, with_up) = at_the_truth(alone), at_the_truth(both)
    assert first.misfit < 1e-3 + float(FOUR.prior_residual(FOUR.start) @ FOUR.prior_residual(FOUR.start))
    assert second.misfit == pytest.approx(first.misfit, abs=1e-3)
    sd = {name: np.sqrt(np.diag(u.covariance)) / FOUR.prior_sd for name, u in (("cut", cut_only), ("both", with_up))}
    where = FOUR.names.index
    assert sd["cut"][where("adhesion_energy")] > 0.99 and sd["both"][where("adhesion_energy")] < 0.15
    for name in ("mu", "R"):
        assert sd["both"][where(name)] < 0.75 * sd["cut"][where(name)]
    verdicts = [{i.parameter.name: i.verdict for i in found.intervals} for found in (cut_only, with_up)]
    assert [v["adhesion_energy"] for v in verdicts] == ["not_seen", "identified"]


def test_a_way_up_that_contradicts_costs():
    """Twice the adhesion of the truth is free on the way down and dear on the way up."""
    alone, both = ways()
    other = formula({**TRUTH, "adhesion_energy": 4.0})
    right = formula(TRUTH)
    assert alone.score(other.parts[0]).misfit - alone.score(right.parts[0]).misfit < 1.0
    assert both.score(other).misfit - both.score(right).misfit > 10.0


class OneRun:
    """In place of processes: each scene that is asked for has the same run."""

    def __init__(self, run: Evaluation) -> None:
        self.run, self.scenes = run, []

    def evaluator(self, scene, kept=()):
        """What brings the run."""
        self.scenes.append(scene)
        return Given(self.run)


def test_a_calibration_is_set_up_for_both_ways(tmp_path):
    """The simulated blade turns where that of the trace did and goes up as far as is compared, in every fidelity; the
    gain of the sensor is left open of both ways, the width that nobody measured too."""
    food = load_food("banana").with_values({"adhesion": 5e3, "adhesion_energy": 2.0})
    setup = set_up(Request(food, record(), speed=0.02, fit=("R", "mu", "adhesion_energy")))
    both = BothWays.of(setup)
    assert both.objective.parameters.names == setup.objective.parameters.names
    assert [t.name for t in both.objective.terms] == ["cut", "withdrawal"]
    assert both.objective.terms[1].objective.target.peak == pytest.approx(float(both.withdrawal.pull.max()))
    assert {n.name for n in both.objective.terms[1].objective.nuisances} == {"tare", "gain", "width"}
    down, up = (np.linspace(0.0, LENGTH + 1e-3, 300) for _ in range(2))
    path = np.concatenate([down, LENGTH + 1e-3 + up[1:]])
    run = Evaluation(0, {}, "ok", "", 1.0, path, np.sin(path), {"turn_m": float(down[-1])}, 1.0)
    pool = OneRun(run)
    with EvaluationStore(tmp_path / "runs.h5", setup.header) as store:
        found = both.evaluators(pool, store)
        joint = next(iter(found.fine.evaluate([{"R": 200.0, "mu": 0.2, "adhesion_energy": 1.0}])))
    assert len(pool.scenes) == 3 and np.isfinite(both.objective.score(joint).residual).all()
    for scene in pool.scenes:
        assert scene.motion.stroke == pytest.approx(min(setup.curve.stroke_length_m, scene.food.shape.height))
        assert scene.motion.retract > both.withdrawal.way[-1]
    with pytest.raises(TraceError, match="low-pass"):
        BothWays.of(replace(setup, bandwidth=15.0))
