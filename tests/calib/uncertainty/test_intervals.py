"""Intervals that cover, and verdicts that are earned."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t as student

from calib.problem.parameters import Z95, Parameter, ParameterSet
from calib.uncertainty.intervals import LinearisedLikelihood, Uncertainty, correlation_length, uncertainty
from tests.calib.synthetic import CORRELATION, WEIGHT, X, correlated_noise

#: Sensitivities of the curve [standard deviations per unit of the internal coordinate]: a plateau, a ramp, a
#: bump.
BASIS = np.column_stack([1.0 - np.exp(-X / 0.1), X, 1.5 * np.exp(-(((X - 0.2) / 0.1) ** 2))])


def parameters(count: int = 3, value: float = 1.0) -> ParameterSet:
    """Log parameters with priors of one unit (a factor e) standard deviation about 1."""
    end = math.exp(Z95)
    return ParameterSet(tuple(Parameter(f"p{k}", value, 1e-9, 1e9, "-", 1 / end, end) for k in range(count)))


def data_of(rows: np.ndarray, residual: np.ndarray, effective: float) -> LinearisedLikelihood:
    """The data rows of a Jacobian and a residual whose last rows are those of the priors, nothing left open."""
    p = rows.shape[1]
    return LinearisedLikelihood(
        rows[:-p], residual[:-p], np.zeros((len(rows) - p, 0)), effective, np.ones(len(rows) - p)
    )


def linear_fit(random: np.random.Generator, noise: float) -> tuple[np.ndarray, Uncertainty]:
    """Draw a truth from the prior and fit its noisy trace exactly; the truth and what the fit says of it."""
    truth = random.standard_normal(3)
    data = BASIS @ truth + noise * correlated_noise(random)
    jacobian = np.vstack([WEIGHT * BASIS, np.eye(3)])
    z = np.linalg.lstsq(jacobian, np.concatenate([WEIGHT * data, np.zeros(3)]), rcond=None)[0]
    residual = np.concatenate([WEIGHT * (BASIS @ z - data), z])
    fitted = parameters().with_values({f"p{k}": math.exp(x) for k, x in enumerate(z)})
    return truth, uncertainty(fitted, data_of(jacobian, residual, 1.0 / CORRELATION))


def coverage(noise: float) -> np.ndarray:
    """In how many of 100 synthetic traces the 95 % interval of each parameter contains the truth (3,)."""
    random = np.random.default_rng(1)
    hits = np.zeros(3, dtype=int)
    for _ in range(100):
        truth, found = linear_fit(random, noise)
        hits += [i.low95 <= math.exp(t) <= i.high95 for i, t in zip(found.intervals, truth, strict=True)]
    return hits


def test_95_percent_intervals_cover_95_percent() -> None:
    """100 synthetic traces with the stated errors: each interval contains the truth 90 to 99 times."""
    hits = coverage(noise=1.0)
    assert np.all((hits >= 90) & (hits <= 99)), hits


def test_intervals_cover_where_errors_are_three_times_the_stated_ones() -> None:
    """Understated errors show in chi-square; widened by it, the intervals still cover."""
    hits = coverage(noise=3.0)
    assert np.all(hits >= 88), hits


def known(jacobian: np.ndarray, *, reduced: float = 0.5, count: int | None = None) -> Uncertainty:
    """Uncertainty for data rows (k, p) at the prior centre with a given chi-square per row."""
    p = jacobian.shape[1] if count is None else count
    rows = np.vstack([jacobian, np.eye(p)])
    residual = np.zeros(len(rows))
    residual[0] = math.sqrt(reduced * 100.0)
    return uncertainty(parameters(p), data_of(rows, residual, 100.0))


def test_closed_form_of_one_parameter() -> None:
    """Sensitivity 3 and prior sd 1: posterior variance 1 / (9 + 1), symmetric in the logarithm."""
    found = known(np.array([[3.0]]), reduced=0.5)
    interval = found.intervals[0]
    assert interval.width == pytest.approx(math.sqrt(0.1))
    assert interval.high95 == pytest.approx(math.exp(Z95 * math.sqrt(0.1))) and interval.low95 < 1.0
    assert interval.low95 * interval.high95 == pytest.approx(1.0)
    assert interval.verdict == "identified" and not interval.clipped
    assert set(interval.as_dict()) == {
        "value",
        "unit",
        "low95",
        "high95",
        "prior_low",
        "prior_high",
        "verdict",
    }


@pytest.mark.parametrize(
    ("sensitivity", "verdict"), [(0.0, "not_seen"), (0.45, "not_seen"), (1.0, "weak"), (1.8, "identified")]
)
def test_verdict_follows_the_width(sensitivity: float, verdict: str) -> None:
    """Posterior widths 1, 0.91, 0.71 and 0.49 of the prior: not seen, not seen, weak, identified."""
    assert known(np.array([[sensitivity]])).intervals[0].verdict == verdict


def test_unseen_parameter_keeps_its_prior() -> None:
    """A misfit of the curve widens what the cut says; it does not make the literature less certain."""
    found = known(np.array([[5.0, 0.0]]), reduced=25.0)
    seen, unseen = found.intervals
    assert unseen.width == pytest.approx(1.0) and unseen.high95 == pytest.approx(unseen.parameter.prior_high)
    assert found.reduced_chi2 == pytest.approx(25.0, rel=0.02)
    tails = student.ppf(0.975, 100.0 - 25.0 / 26.0) / Z95
    assert seen.width == pytest.approx(1.0 / math.sqrt(25.0 / found.reduced_chi2 / tails**2 + 1.0))


def test_a_band_holds_another_measurement_and_few_data_do_not_blow_it_up() -> None:
    """Six data, five parameters, errors of 0.6 to 2.9 times the stated size: 95 % of new data lie in the band.

    With errors widened as those of the intervals are, which few data hardly bound, it would be a fourth wider.
    """
    random = np.random.default_rng(2)
    inside, widths = [], []
    for _ in range(400):
        rows = np.vstack([1.2 * random.standard_normal((6, 5)) * np.exp(random.standard_normal(5)), np.eye(5)])
        truth, size = random.standard_normal(5), math.sqrt(4.0 / random.chisquare(4))
        seen, again = rows[:6] @ truth + size * random.standard_normal((2, 6))
        z = np.linalg.lstsq(rows, np.concatenate([seen, np.zeros(5)]), rcond=None)[0]
        found = uncertainty(parameters(5), data_of(rows, rows @ z - np.concatenate([seen, np.zeros(5)]), 6.0))
        each = []
        for variance in (found.error_variance, found.widened):
            spread = np.linalg.inv(rows[:6].T @ rows[:6] / variance + np.eye(5))
            centre = rows[:6] @ spread @ rows[:6].T @ seen / variance
            half = Z95 * np.sqrt(np.einsum("ij,jk,ik->i", rows[:6], spread, rows[:6]) + variance)
            each.append(half.mean())
            if variance == found.error_variance:
                inside.append(np.mean(np.abs(centre - again) < half))
        widths.append(each)
    assert 0.93 < np.mean(inside) < 0.965
    own, widened = np.mean(widths, axis=0)
    assert own < 0.85 * widened


def test_a_small_misfit_does_not_narrow_the_intervals() -> None:
    """A chi-square below its expectation is luck, or errors stated too large: the interval stays."""
    assert known(np.array([[3.0]]), reduced=0.01).intervals[0].width == pytest.approx(math.sqrt(0.1))


def test_interval_ends_at_the_hard_bound() -> None:
    """Half an interval beyond a bound is cut off and flagged; an estimate on the bound is called so."""
    near = Parameter("mu", 0.02, 0.0, 1.0, "-", 0.0, 0.6, "linear")
    rows = np.array([[20.0], [1.0 / near.prior_sd]])
    for value, verdict in ((0.02, "identified"), (0.0, "at_bound")):
        found = uncertainty(ParameterSet((near,)).with_values({"mu": value}), data_of(rows, np.zeros(2), 20.0))
        interval = found.intervals[0]
        assert interval.low95 == 0.0 and interval.clipped and interval.verdict == verdict
        assert interval.high95 > value + 0.05


@pytest.mark.parametrize(("row", "combination"), [([9.0, 9.0], "p0 * p1"), ([9.0, -9.0], "p0 / p1")])
def test_only_the_product_or_the_ratio_is_known(row: list[float], combination: str) -> None:
    """Two parameters that act only together are reported as their product, or as their ratio."""
    found = known(np.array([row]))
    assert [tie.combination for tie in found.only_as_product] == [combination]
    assert abs(found.correlation[0, 1]) == pytest.approx(81.0 / 82.0)


def test_independent_parameters_are_not_tied() -> None:
    """Orthogonal sensitivities give no hint."""
    found = known(np.diag([9.0, 2.0]))
    assert found.only_as_product == () and found.correlation == pytest.approx(np.eye(2))


@pytest.mark.parametrize("length", [0.02, 0.05, 0.1])
def test_correlation_length_is_found_in_what_a_fit_leaves(length: float) -> None:
    """Five parameters fitted to noise of a known length: the estimate is within a sixth of it in the middle of 100."""
    random = np.random.default_rng(5)
    basis = np.vander(X, 5)
    found = []
    for _ in range(100):
        noise = correlated_noise(random, length)
        found.append(correlation_length(noise - basis @ np.linalg.lstsq(basis, noise, rcond=None)[0], 5.0, length))
    assert np.median(found) == pytest.approx(length, rel=1 / 6)


def test_a_residual_of_one_sign_is_no_independent_noise() -> None:
    """A constant residual is drawn from the assumed length far towards its own, half the stroke; a vanishing one says
    nothing."""
    assert correlation_length(np.ones(240), 0.0, 0.05) == pytest.approx(0.05 * 10.0 ** (0.25 / 0.41))
    assert correlation_length(np.zeros(240), 3.0, 0.05) == 0.05


def test_a_nuisance_that_was_not_searched_widens_the_interval() -> None:
    """Force in proportion to one parameter, known to 1/10, and a gain known to 1/3: variances add, as 1/100 + 1/9."""
    rows, gain = np.full((100, 1), 1.0), np.full((100, 1), 1.0 / 3.0)
    wide = uncertainty(parameters(1), LinearisedLikelihood(rows, np.zeros(100), gain, 100.0, np.ones(100))).intervals[0]
    assert wide.width == pytest.approx((1.0 + 1.0 / (1 / 100 + 1 / 9)) ** -0.5)
