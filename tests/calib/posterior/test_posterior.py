"""The posterior over everything plausible, with a formula in place of the particles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_food
from calib.posterior.answer import analysis_of, coordinates_of, fit_of
from calib.posterior.coordinates import Coordinates
from calib.posterior.correction import Correction
from calib.posterior.emulator import CurveEmulator
from calib.posterior.estimates import summarised
from calib.posterior.likelihood import Likelihood
from calib.posterior.modes import modes
from calib.posterior.posterior import SampledPosterior, predictive_p_value, sample_posterior
from calib.posterior.process import Process
from calib.posterior.sampling import Effort, sample
from calib.posterior.waves import Plan, first_wave, on_lattice, prediction_errors, quantiles, simulated
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.request import Request
from calib.problem.setup import set_up
from calib.simulation.evaluation import Evaluation, Evaluators
from mpm.scene.errors import SimulationError
from tests.calib.fake import FIVE, GRID, LENGTH, Fake, goal, two_terms
from tests.data_dir import ROOT

TRUTH = {"E": 6e5, "yield_stress": 6e4, "R": 400.0, "R_skin": 250.0, "mu": 0.25}
SMALL = Plan(64, 16, 4, 6, Effort(20, 5, 1.0), Effort(50, 5, 0.5), waves=4)
"""Enough for two parameters."""
BANANA = ROOT / "force_data" / "banana_reconstructed.csv"
TINY = Plan(32, 8, 4, 4, Effort(12, 3, 3.0), Effort(12, 3, 3.0), waves=2)
"""Enough to see that it runs."""
TWO = ParameterSet(tuple(FIVE[name] for name in ("R", "mu")))


def coordinates(parameters: ParameterSet = FIVE) -> Coordinates:
    """Of the made-up food, whose modulus is fitted or fixed."""
    return Coordinates(parameters, {} if parameters is FIVE else {"E": 5e5}, LENGTH)


@pytest.fixture(scope="module")
def emulated() -> tuple[Objective, CurveEmulator]:
    """An emulator of 200 runs over the prior."""
    objective = goal(TRUTH)
    runs = simulated(objective, Fake(noisy=0.002), first_wave(FIVE, 256)[:200], "wave")
    return objective, CurveEmulator(coordinates(), runs)


@pytest.fixture(scope="module")
def sampled() -> SampledPosterior:
    """A posterior of two parameters."""
    objective = goal({"R": 500.0, "mu": 0.25}, TWO, two_terms)
    fake = Fake(two_terms, noisy=0.002)
    return sample_posterior(objective, coordinates(TWO), Evaluators(fake, fake, fake), SMALL)


def test_process_interpolates_and_knows_how_well() -> None:
    """A smooth function of two axes: errors of points never seen are those that the process expects."""
    random = np.random.default_rng(0)
    x, new = random.standard_normal((60, 2)), random.standard_normal((200, 2))

    def f(x: np.ndarray) -> np.ndarray:
        return np.column_stack([np.sin(x[:, 0]) + 0.3 * x[:, 1], np.cos(x[:, 0])])

    process = Process(x, f(x) + 0.01 * random.standard_normal((60, 2)))
    mean, sd = process(new)
    scores = (mean - f(new)) / sd[:, None]
    assert np.sqrt(np.mean((mean - f(new)) ** 2)) < 0.1
    assert 0.3 < np.sqrt(np.mean(scores**2)) < 2.0
    assert np.allclose(mean, process.expected(new))
    far, doubt = process(np.full((1, 2), 9.0))
    assert doubt[0] > 10 * np.median(sd) and np.isfinite(far).all()


def test_left_out_errors_are_those_of_a_process_without_the_run() -> None:
    """The closed form against a process made anew without one run."""
    random = np.random.default_rng(1)
    x = random.standard_normal((30, 1))
    y = np.sin(2.0 * x)
    process = Process(x, y)
    errors, _ = process.left_out()
    other = Process(x[1:], y[1:], process.hyper)
    other_error = float(other.expected(x[:1])[0, 0] - y[0, 0])
    assert errors[0, 0] == pytest.approx(other_error, abs=0.02)


def test_force_scales_with_the_stress_like_parameters(emulated: tuple[Objective, CurveEmulator]) -> None:
    """All of them times k give the curve times k, however far from the runs."""
    _, emulator = emulated
    z = FIVE.to_vector(TRUTH)[None]
    along = FIVE.stress_like()
    assert np.allclose(emulator.curves(z + math.log(7.0) * along), 7.0 * emulator.curves(z))


def test_coordinates_of_a_trace_are_those_of_its_food() -> None:
    """All that a cut of a banana sees is fitted: R is the scale. With E fixed the scale is an axis of its own."""
    whole, part = (
        coordinates_of(set_up(Request(load_food("banana"), BANANA, fit=fit))) for fit in (None, ("R", "R_skin", "mu"))
    )
    assert whole.scale_name == part.scale_name == "R"
    z = whole.parameters.prior_mean[None]
    along = whole.parameters.stress_like()
    assert np.allclose(whole(z), whole(z + along)) and np.allclose(whole.scale(z + along), whole.scale(z) + 1.0)
    other = part.parameters.prior_mean[None]
    assert not np.allclose(part(other), part(other + part.parameters.stress_like()))
    assert "E R / (yield_stress^2 h)" in whole.combinations(z)
    assert whole.combinations(z)["R_skin / R"] == pytest.approx(z[0, 4] - z[0, 3])


def test_fixed_stress_keeps_the_scale_as_an_axis() -> None:
    """Where a stress-like property is not fitted the others do not scale along with it, and there is an axis more."""
    free, fixed = Coordinates(TWO, {}, LENGTH), Coordinates(TWO, {"E": 5e5, "yield_stress": 5e4}, LENGTH)
    z = first_wave(TWO, 8)
    assert free(z).shape[1] < fixed(z).shape[1]
    assert np.ptp(fixed(z)[:, 0]) > 0.0


def test_curves_never_seen_are_predicted(emulated: tuple[Objective, CurveEmulator]) -> None:
    """200 runs over the whole prior leave a median of under 5 % of the peak."""
    objective, emulator = emulated
    new = simulated(objective, Fake(noisy=0.002), first_wave(FIVE, 256)[200:], "wave")
    errors = prediction_errors(objective, emulator.curves(np.array([run.z for run in new])), new)
    assert np.median(errors) < 0.05


def test_likelihood_is_that_of_the_dense_covariance(emulated: tuple[Objective, CurveEmulator]) -> None:
    """The algebra in the small span against all 240 points."""
    objective, emulator = emulated
    likelihood = Likelihood(objective, emulator)
    z, size = FIVE.to_vector(TRUTH)[None], 0.3
    found = emulator(z)
    weights = math.sqrt(likelihood.rows / objective.target.stroke.size) / objective.sigmas
    curve = emulator.curves(z)[0]
    slopes = weights[:, None] * np.column_stack([curve, found.size[0] * emulator.components.T])
    spread = np.array([found.size_sd[0], *np.full(len(emulator.components), found.shape_sd[0])])
    t2 = math.exp(2.0 * size)
    dense = t2 * np.eye(len(weights)) + (slopes * spread**2) @ slopes.T
    row = weights * (curve - objective.target.curve)
    log_det = np.linalg.slogdet(dense)[1] - len(weights) * math.log(t2)
    expected = -0.5 * (row @ np.linalg.solve(dense, row) + log_det) - likelihood.rows * size
    assert likelihood.log(z, np.array([size]))[0] == pytest.approx(expected, rel=1e-6)


def p_value(emulator: CurveEmulator, curve: np.ndarray) -> float:
    """Posterior predictive p-value of a measured curve, by a small sample."""
    right = goal(TRUTH)
    size = 0.01 * curve.max()
    target = replace(right.target, curve=curve, noise_sd=size, peak_sd=size)
    likelihood = Likelihood(replace(right, target=target), emulator)
    found = sample(likelihood, Effort(24, 5, 1.0), 0)
    return predictive_p_value(likelihood, found.z[found.drawn(50, 0)])


def test_wrong_traces_are_refused_and_right_ones_are_not(emulated: tuple[Objective, CurveEmulator]) -> None:
    """The food's own cut, also where the specimen is 30 % wider, which only scales R; a reversed trace, a plateau and
    another kind of food, which flows all the way and has no skin."""
    objective, emulator = emulated
    right = objective.target.curve
    part = GRID / LENGTH
    for curve in (right, 1.3 * right):
        assert p_value(emulator, curve) > 0.05
    for curve in (right[::-1].copy(), np.full_like(right, right.mean()), right.max() * part**3):
        assert p_value(emulator, curve) < 0.01


def test_correction_takes_the_difference_of_cells_away(emulated: tuple[Objective, CurveEmulator]) -> None:
    """Fine curves that are 8 % larger and shifted: corrected, they are predicted as the coarse ones are."""
    objective, emulator = emulated
    z = first_wave(FIVE, 256)[200:232]
    runs = simulated(objective, Fake(lambda p: 1.08 * Fake().force(p), noisy=0.002), z, "fine", coarse=False)
    correction = Correction(emulator, runs[:16])
    before = prediction_errors(objective, emulator.curves(z[16:]), runs[16:])
    after = prediction_errors(objective, correction.curves(z[16:]), runs[16:])
    assert np.median(after) < 0.8 * np.median(before)


def test_first_wave_is_the_same_for_each_trace_and_on_the_lattice() -> None:
    """It hangs on the parameters alone, and rounding errors of other processors do not move it."""
    z = first_wave(FIVE, 32)
    assert np.array_equal(z, first_wave(FIVE, 32))
    assert np.array_equal(on_lattice(FIVE, z + 1e-9), z)
    assert np.all((z >= FIVE.lower) & (z <= FIVE.upper))


def test_modes_are_parted_by_valleys() -> None:
    """Two normal distributions are two modes of their weights; a bent ridge is one."""
    random = np.random.default_rng(2)
    centres = np.array([[-3.0, 0.0], [3.0, 1.0]])
    points = centres[(random.random(1000) < 0.3).astype(int)] + random.standard_normal((1000, 2))

    def two(x: np.ndarray) -> np.ndarray:
        gaps = np.sum((x[:, None] - centres[None]) ** 2, axis=2)
        out: np.ndarray = np.log(0.7 * np.exp(-0.5 * gaps[:, 0]) + 0.3 * np.exp(-0.5 * gaps[:, 1]))
        return out

    found = modes(points, two)
    assert [m.weight for m in found] == pytest.approx([0.7, 0.3], abs=0.05)
    assert found[0].top == pytest.approx(centres[0], abs=0.2)
    angle = random.uniform(0.0, 3.0, 1000)
    bent = np.column_stack([np.cos(angle), np.sin(angle)]) * (1.0 + 0.05 * random.standard_normal(1000))[:, None]
    (one,) = modes(bent, lambda x: -0.5 * ((np.linalg.norm(x, axis=1) - 1.0) / 0.05) ** 2 - 0.05 * x[:, 0])
    assert one.weight == 1.0


def test_quantiles_of_weighted_values() -> None:
    """Half of the weight on one of three values."""
    found = quantiles(np.array([[1.0], [2.0], [3.0]]), np.array([0.25, 0.5, 0.25]), (0.5,))
    assert found[0, 0] == pytest.approx(2.0)


def test_posterior_holds_the_truth_and_says_what_it_did(sampled: SampledPosterior) -> None:
    """Both parameters of a made-up cut, one mode, explained, and the waves that led there."""
    truth = TWO.to_vector({"R": 500.0, "mu": 0.25})
    for k, z in enumerate(truth):
        low, middle, high = sampled.interval(k)
        assert low < z < high and low < middle < high
    assert len(sampled.modes) == 1
    assert sampled.explained > 0.05
    said = summarised(sampled)
    assert said.waves[0].error is None and said.waves[-1].error90 is not None and said.waves[-1].error90 < 0.02
    assert said.alike == ("R", "mu") and said.modes[0].best is not None
    assert said.modes[0].misfit == sampled.best.misfit


class Remembering:
    """A simulator that knows the runs of an earlier start."""

    def __init__(self, known: dict[str, Evaluation]) -> None:
        self.fake, self.known = Fake(two_terms, noisy=0.002), known

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Known runs are not made again."""
        for index, values in enumerate(batch):
            key = repr(sorted(values.items()))
            if key not in self.known:
                self.known[key] = next(iter(self.fake.evaluate([values])))
            yield replace(self.known[key], index=index)


def test_a_second_start_simulates_nothing_and_finds_the_same() -> None:
    """What a kill has left behind is not made again, and leads to the same draws bit for bit."""
    objective, known = goal({"R": 500.0, "mu": 0.25}, TWO, two_terms), dict[str, Evaluation]()
    found = []
    for _ in range(2):
        simulator = Remembering(known)
        found.append(sample_posterior(objective, coordinates(TWO), Evaluators(simulator, simulator, simulator), TINY))
    assert simulator.fake.runs == 0
    assert np.array_equal(found[0].sample.z, found[1].sample.z)
    assert found[0].best.evaluation.parameters == found[1].best.evaluation.parameters


def test_answer_is_the_best_simulated_food_of_the_posterior(sampled: SampledPosterior) -> None:
    """The value shown is that of the largest density among the fine runs, and its interval is the posterior's."""
    fit = fit_of(sampled)
    analysis = analysis_of(sampled, fit)
    assert fit.best.misfit == min(run.misfit for run in sampled.fine)
    r = analysis.uncertainty.intervals[0]
    assert r.verdict == "identified" and r.low95 < r.parameter.value < r.high95
    assert r.low95 == pytest.approx(math.exp(sampled.interval(0)[0]))
    assert analysis.bands[0].inside > 0.9
    assert not analysis.remarks


def test_a_parameter_on_which_modes_differ_is_not_identified(sampled: SampledPosterior) -> None:
    """The same posterior in two halves by R."""
    half = sampled.z[:, 0] > np.median(sampled.z[:, 0])
    whole = sampled.modes[0]
    parts = [
        replace(whole, mode=replace(whole.mode, weight=0.5, members=np.flatnonzero(side))) for side in (half, ~half)
    ]
    divided = replace(sampled, modes=tuple(parts))
    analysis = analysis_of(divided, fit_of(divided))
    assert analysis.uncertainty.intervals[0].verdict == "weak"
    assert "2 modes" in analysis.remarks[0] and "R" in analysis.remarks[0]


def test_nothing_is_identified_where_fine_runs_are_not_predicted(sampled: SampledPosterior) -> None:
    """The same posterior, had its judges been 3 % off, and had its waves not settled."""
    off = replace(sampled, judged=(0.01, 0.03))
    early = replace(sampled, matched=replace(sampled.matched, converged=False))
    for posterior, said in ((off, "Fine simulations"), (early, "The waves ended")):
        analysis = analysis_of(posterior, fit_of(posterior))
        assert analysis.uncertainty.intervals[0].verdict == "weak"
        assert analysis.remarks[0].startswith(said)


def test_a_food_that_is_never_cut_is_an_error_that_says_so() -> None:
    """Nothing to learn from: one sentence, no traceback."""
    objective, fake = goal({"R": 500.0, "mu": 0.25}, TWO, two_terms), Fake(two_terms, parted=lambda p: 0.2)
    with pytest.raises(SimulationError, match="0 whole curves are too few"):
        sample_posterior(objective, coordinates(TWO), Evaluators(fake, fake, fake), SMALL)
