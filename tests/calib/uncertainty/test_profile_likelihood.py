"""Profiles: the normal approximation where chi-square is a parabola, and what the trace alone bounds where it is
not."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from calib.fit.multistart import FitResult, multistart_search
from calib.fit.options import FitOptions
from calib.fit.surrogate import Surrogate
from calib.problem.objective import Objective
from calib.problem.parameters import Z95, Parameter, ParameterSet
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation
from calib.uncertainty.analysis import CLOSE, END_ROUNDS, UncertaintyAnalysis, analyse
from calib.uncertainty.intervals import linearised_likelihood
from calib.uncertainty.predictive import error_draws, pointwise_band
from calib.uncertainty.profile_likelihood import RISE, Profile, _Profiler, with_profile_intervals
from tests.calib.fake import GRID, NOISE, STROKE, Fake, goal, noise, three_terms


def parabola(centre: float, sd: float, share: float) -> Profile:
    """A profile with the given standard deviation, to which the trace contributes a share of the curvature."""
    z = centre + sd * np.linspace(-4.0, 4.0, 33)
    rise = ((z - centre) / sd) ** 2
    return Profile("E", z, rise, share * rise, z[:, None], 0)


def test_ends_of_a_parabola_are_at_1_96_standard_deviations() -> None:
    """Interpolated in the root of the rise, a parabola's ends are exact although no point lies there."""
    profile = parabola(2.0, 0.3, 0.5)
    for side in (-1, 1):
        assert profile.end(side, profile.rise) == pytest.approx(2.0 + side * Z95 * 0.3, abs=1e-9)
    assert RISE == pytest.approx(3.8415, abs=1e-4)


def test_a_side_that_does_not_rise_has_no_end() -> None:
    """One-sided: the trace bounds the parameter from below only."""
    profile = parabola(0.0, 1.0, 1.0)
    data = np.where(profile.z > 0.0, 0.2 * profile.data, profile.data)
    assert profile.end(-1, data) == pytest.approx(-Z95, abs=1e-9)
    assert profile.end(1, data) is None


def test_an_interval_reaches_behind_the_last_valley() -> None:
    """A profile that falls below the limit once more has a second food there; where it stays there the side is open."""
    profile = parabola(0.0, 1.0, 1.0)
    second = np.minimum(profile.rise, 0.5 + ((profile.z - 3.0) / 0.2) ** 2)
    assert profile.end(-1, second) == pytest.approx(-Z95, abs=1e-9)
    assert profile.end(1, second) == pytest.approx(3.0 + 0.2 * math.sqrt(RISE - 0.5), abs=0.05)
    assert profile.end(1, np.where(profile.z > 3.5, 1.0, profile.rise)) is None
    both = replace(profile, data=second)
    ends = [float(z[0]) for z in both.end_points()]
    assert ends == pytest.approx([-2.0, 3.5], abs=0.26) and ends[1] > 3.2


ONE_SIDED = ParameterSet(
    (
        Parameter("E", 5e5, 2e4, 1e7, "Pa", 1e5, 2e6),
        Parameter("yield_stress", 2e5, 2e3, 5e6, "Pa", 1e4, 3e6),
        Parameter("R", 300.0, 10.0, 5e3, "J/m^2", 80.0, 1200.0),
    )
)


def elastic(p: dict[str, float]) -> np.ndarray:
    """A cut in which flow shows only near 40 kPa and below: a plateau for R, a wedge for E, softened by yield."""
    soft = 1.0 / (1.0 + (4e4 / p["yield_stress"]) ** 2)
    return 0.03 * p["R"] * (1.0 - np.exp(-STROKE / 0.002)) + 6.0 * (p["E"] / 5e5) * soft * STROKE / STROKE[-1]


@pytest.fixture(scope="module")
def one_sided() -> tuple[Objective, FitResult, UncertaintyAnalysis]:
    """A fit of the elastic cut with 0.2 % of noise; at 0.4 % rounding decides where the search ends, and so the upper
    end."""
    truth = {"E": 5e5, "yield_stress": 4e5, "R": 300.0}
    curve = np.interp(GRID, STROKE, elastic(truth))
    objective = Objective(Target(GRID, curve, 0.05, 0.05, np.interp), ONE_SIDED)
    simulator = Fake(elastic, noisy=0.002)
    result = multistart_search(objective, simulator, coarse=simulator, options=FitOptions(budget=60))
    analysis = analyse(objective, result, coarse=simulator, fine=simulator)
    assert analysis is not None
    return objective, result, analysis


def test_verdicts_say_what_the_trace_bounds(one_sided: tuple[Objective, FitResult, UncertaintyAnalysis]) -> None:
    """R is identified; a yield stress that nothing reaches is bounded from below and left to the literature above."""
    analysis = one_sided[2]
    found = {i.parameter.name: i for i in analysis.uncertainty.intervals}
    assert found["R"].verdict == "identified" and found["R"].low95 < 300.0 < found["R"].high95
    assert found["yield_stress"].verdict == "one_sided"
    assert found["yield_stress"].high95 > 2e6 and found["yield_stress"].low95 > 2e4
    walked = {p.name: p for p in analysis.profiles}
    above = walked["yield_stress"].end(1, walked["yield_stress"].data)
    assert above is None or math.exp(above) > 3e6


def test_what_would_have_an_interval_was_tried_at_both_ends(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """Runs that count are made where R would end, and again where that turns out to lie elsewhere, and for nothing that
    is open; coarse ones at the ends of all."""
    objective, result, analysis = one_sided
    runs = analysis.result.history[len(result.history) :]
    judged = [t.z - result.best.z for t in runs if not t.coarse]
    r = objective.parameters.names.index("R")
    below, above = ([abs(d[r]) for d in judged if (d[r] > 0.0) == up] for up in (False, True))
    assert 1 <= len(below) <= END_ROUNDS and 1 <= len(above) <= END_ROUNDS
    sd = objective.parameters.prior_sd
    for a, b in combinations(judged, 2):
        assert np.any(np.abs(a - b) > CLOSE * sd)
    assert sum(t.coarse for t in runs) > 2 * len(objective.parameters)


def test_a_better_run_at_the_end_of_an_interval_becomes_the_best(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """Where the process was wrong and a run at an end is better than the answer of the search, values and intervals are
    about it."""
    objective, result, _ = one_sided
    values = dict(result.best.evaluation.parameters)
    poor = objective.score(next(iter(Fake(elastic).evaluate([values | {"R": 1.15 * values["R"]}]))), stage="round")
    history = (*result.history, poor)
    assert result.surrogate is not None and poor.misfit > result.best.misfit + 10.0
    before = replace(result, best=poor, history=history, surrogate=Surrogate(objective, history, poor))
    after = analyse(objective, before, fine=Fake(lambda _: elastic(values)))
    assert after is not None
    best = after.result.best
    assert best.stage == "profile" and best.misfit < poor.misfit - 5.0
    assert [i.parameter.value for i in after.uncertainty.intervals] == list(best.evaluation.parameters.values())
    assert after.result.surrogate is not None and after.result.surrogate.best is best


class _Parabolas(_Profiler):
    """The profiler of one parameter whose trace and literature are parabolas, five standard deviations apart."""

    def __init__(self) -> None:
        self.parameters = ParameterSet((Parameter("E", 5e5, 1.0, 1e9, "Pa", 1e4, 4e4),))
        self.i, self.low, self.high = 0, self.parameters.lower, self.parameters.upper
        self.found = SimpleNamespace(covariance=np.array([[self.parameters.prior_sd[0] ** 2]]))  # type: ignore[assignment]
        self.posterior = SimpleNamespace(optimum=lambda z, held: z)  # type: ignore[assignment]
        self.seen = self.parameters.prior_mean[0] + 5.0 * self.parameters.prior_sd[0]

    def cost(self, z: np.ndarray) -> tuple[float, float]:
        """The same width for both."""
        alone = ((z[0] - self.seen) / self.parameters.prior_sd[0]) ** 2
        return float(alone + self.own(z[0])), float(alone)

    def feigned(self) -> float:
        """No noise."""
        return 0.0

    def one_run(self) -> float:
        """No noise."""
        return 0.0


def test_a_profile_goes_on_until_both_have_risen() -> None:
    """The literature pulls down where the trace has long risen: the interval ends where their sum has, and not at the
    hard bound, to which a profile that had stopped before would have left it."""
    profiler = _Parabolas()
    mean, sd = profiler.parameters.prior_mean[0], profiler.parameters.prior_sd[0]
    p = replace(profiler.parameters.items[0], value=float(np.exp(profiler.seen)))
    profiler.parameters = ParameterSet((p,))
    profile = profiler.profile()
    at = float(np.interp(profiler.seen, profile.z, profile.rise))
    assert at == pytest.approx(2 * 2.5**2, abs=0.02)  # their common valley is in the middle
    end = profile.end(-1, np.maximum(profile.rise - at, 0.0))
    assert end == pytest.approx(mean + sd * (2.5 - math.sqrt((at + RISE) / 2)), abs=0.05 * sd)


@pytest.mark.parametrize("walked", [0.5, 1.5])
def test_the_prior_ends_what_was_not_walked_to_its_end(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis], walked: float
) -> None:
    """The trace objects to nothing and the walk stops before the prior has: the interval is the prior's, not that
    between the hard bounds; a bound that is nearer ends it, and only then is it clipped."""
    uncertainty = one_sided[2].uncertainty
    wide = Parameter("E", 2e4, 1.0, 1e9, "Pa", 1e4, 4e4)
    near = replace(wide, high=3e4)
    mean, sd = wide.prior_mean, wide.prior_sd
    z = mean + sd * np.linspace(-walked, walked, 9)
    profile = Profile("E", z, ((z - mean) / sd) ** 2, np.zeros(9), z[:, None], 0)
    for parameter, high, clipped in ((wide, 4e4, False), (near, 3e4, True)):
        item = replace(uncertainty.intervals[0], parameter=parameter)
        (found,) = with_profile_intervals(replace(uncertainty, intervals=(item,)), [profile]).intervals
        assert (found.low95, found.high95) == pytest.approx((1e4, high), rel=1e-6)
        assert found.clipped is clipped and found.verdict == "not_seen"


def test_an_interval_holds_the_best_value(one_sided: tuple[Objective, FitResult, UncertaintyAnalysis]) -> None:
    """Where the surrogate puts the optimum beside the best run, the interval reaches to that run's value."""
    analysis = one_sided[2]
    moved = tuple(
        replace(i, parameter=replace(i.parameter, value=1.1 * i.high95)) if i.parameter.name == "R" else i
        for i in analysis.uncertainty.intervals
    )
    found = with_profile_intervals(replace(analysis.uncertainty, intervals=moved), analysis.profiles).intervals
    for i in found:
        assert i.low95 * (1.0 - 1e-9) <= i.parameter.value <= i.high95 * (1.0 + 1e-9)


def test_an_interval_is_about_the_value_that_is_reported(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """A value where the profile has risen by 1 belongs to the interval of what has risen by 3.84 more: it ends at 2.2
    standard deviations from the optimum on both sides, not at 1.96."""
    uncertainty = one_sided[2].uncertainty
    found = uncertainty.intervals[0]
    p = found.parameter
    profile = parabola(math.log(p.value), 0.1, 1.0)
    beside = replace(found, parameter=replace(p, value=p.value * math.exp(0.1)))
    (interval,) = with_profile_intervals(replace(uncertainty, intervals=(beside,)), [profile]).intervals
    ends = np.log([interval.low95, interval.high95]) - math.log(p.value)
    assert ends == pytest.approx([-0.1 * math.sqrt(RISE + 1.0), 0.1 * math.sqrt(RISE + 1.0)], abs=2e-3)


def test_nothing_is_identified_where_the_curve_is_not_explained(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """The same profiles with a chi-square of three for each degree of freedom: R, which was identified, is weak."""
    analysis = one_sided[2]
    assert analysis.uncertainty.explained
    off = replace(analysis.uncertainty, reduced_chi2=3.0)
    assert not off.explained
    assert [i.verdict for i in analysis.uncertainty.intervals].count("identified") == 1
    assert [i.verdict for i in with_profile_intervals(off, analysis.profiles).intervals][-1] == "weak"


def test_a_curve_that_is_off_for_long_stretches_is_not_explained(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """Its residuals look like few independent rows, so that their chi-square is nothing odd; the search's own is, and R
    is weak."""
    objective, result, analysis = one_sided
    assert result.jacobian is not None and linearised_likelihood(objective, result.best, result.jacobian).met
    rows = objective.effective_rows
    for size, met in ((1.5, True), (2.0, False)):  # chi-square over 21 rows: 99 % quantile 38.9
        best = replace(result.best, residual=result.best.residual * math.sqrt(size * rows / result.best.misfit))
        assert linearised_likelihood(objective, best, result.jacobian).met is met
    off = replace(analysis.uncertainty, data=replace(analysis.uncertainty.data, met=False))
    assert not off.explained
    assert [i.verdict for i in with_profile_intervals(off, analysis.profiles).intervals][-1] == "weak"


def test_profile_of_a_known_parameter_is_that_of_the_curvature(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """Where chi-square is a parabola, profile and normal approximation agree to a quarter in the width."""
    analysis = one_sided[2]
    i = analysis.uncertainty.intervals[2]
    sd = math.sqrt(analysis.uncertainty.covariance[2, 2])
    assert math.log(i.high95 / i.low95) == pytest.approx(2.0 * Z95 * sd, rel=0.25)


def test_the_band_holds_the_curve_it_was_drawn_about(
    one_sided: tuple[Objective, FitResult, UncertaintyAnalysis],
) -> None:
    """Nearly all of the measured curve lies in its band, and a curve that is 15 % off does not."""
    objective, _, analysis = one_sided
    band = analysis.bands[0]
    assert band.inside > 0.9
    off = 1.15 * objective.target.curve
    assert np.mean((off >= band.low) & (off <= band.high)) < 0.5


def test_band_of_normal_draws_is_1_96_wide() -> None:
    """The pointwise band of 4000 draws of unit variance ends at 1.96 to 0.15, and holds 95 % of another one."""
    random = np.random.default_rng(0)
    band = pointwise_band(random.standard_normal((4000, 50)), np.zeros(50))
    assert np.abs(band.high - Z95).max() < 0.15 and np.abs(band.low + Z95).max() < 0.15 and band.inside == 1.0


def test_errors_have_the_size_and_the_length_that_they_should() -> None:
    """Variance of each point is sigma^2, and half a correlation length away the correlation is exp(-pi/4)."""
    objective = goal({"E": 3e5, "yield_stress": 4e4, "R": 500.0, "R_skin": 200.0, "mu": 0.2})
    drawn = error_draws(objective, 0.1, 2.0, 4000, np.random.default_rng(1))
    assert np.sqrt((drawn**2).mean()) == pytest.approx(2.0 * objective.sigma, rel=0.03)
    half = round(0.05 * 239)
    seen = np.mean(drawn[:, 100] * drawn[:, 100 + half]) / np.mean(drawn[:, 100] ** 2)
    assert seen == pytest.approx(math.exp(-math.pi * (half / 239 / 0.1) ** 2), abs=0.05)


def test_an_interrupted_search_has_no_doubt() -> None:
    """Fewer runs than parameters: nothing is said instead of something wrong."""
    objective = goal({"E": 3e5, "yield_stress": 4e4, "R": 500.0, "R_skin": 200.0, "mu": 0.2})
    result = multistart_search(objective, Fake(interrupt_after=3), options=FitOptions(budget=60))
    assert result.status == "interrupted" and analyse(objective, result) is None


def test_fake_and_noise_are_repeatable() -> None:
    """What these tests rest on: the same parameters give the same run."""
    values = {"E": 3e5, "yield_stress": 4e4, "R": 500.0, "R_skin": 200.0, "mu": 0.2}
    first, second = (next(iter(Fake().evaluate([values]))) for _ in range(2))
    assert isinstance(first, Evaluation) and np.array_equal(first.force, second.force)
    assert not np.array_equal(noise(values, NOISE), noise(values | {"mu": 0.21}, NOISE))
    assert three_terms(values).shape == STROKE.shape
