"""Order, index and verdict of sequences of grids: published worked examples and exact sequences."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import CurveError
from studies.convergence.gci import curve_estimate, estimate

H = np.array([1.0, 1.5, 2.0, 3.0])


def test_worked_example_of_celik_2008():
    """Celik et al. (2008), table 1, first column: p 1.53, extrapolated 6.1685, GCI 2.2 %."""
    e = estimate([1.0, 1.5, 1.5 * 1.3333], [6.063, 5.972, 5.863])
    assert e.verdict == "monotone"
    assert e.order == pytest.approx(1.534, abs=2e-3)
    assert e.extrapolated == pytest.approx(6.1685, abs=2e-4)
    assert e.change == pytest.approx(0.0150, abs=1e-4)
    assert e.gci == pytest.approx(0.0217, abs=1e-4)


def test_oscillatory_example_of_celik_2008():
    """The second column changes its direction: p 1.51, extrapolated 6.0269, GCI 0.47 %."""
    e = estimate([1.0, 2.0, 2.0 * 2.1429], [6.0042, 5.9624, 6.0909])
    assert e.verdict == "oscillatory"
    assert e.order == pytest.approx(1.51, abs=5e-3)
    assert e.extrapolated == pytest.approx(6.0269, abs=2e-4)
    assert e.gci == pytest.approx(0.0047, abs=1e-4)


@pytest.mark.parametrize("order", [0.7, 1.0, 1.5, 2.0])
def test_exact_power_is_recovered(order):
    """phi0 + a h^p gives back phi0 and p, from three grids and from the least squares of four,
    in any order of input.
    """
    e = estimate(H[::-1], 5.0 + 0.1 * H[::-1] ** order)
    assert e.verdict == "monotone"
    assert e.order == pytest.approx(order, abs=1e-3)
    assert e.extrapolated == pytest.approx(5.0, abs=1e-3)
    assert e.fitted == pytest.approx(5.0, abs=2e-3)
    assert e.fitted_order == pytest.approx(order, abs=0.01)
    assert 1.24 * 0.1 / 5.1 < e.uncertainty < 3.0 * 0.1 / 5.1
    assert e.gci == pytest.approx(1.25 * 0.1 / 5.1, rel=1e-3)
    assert e.gci_coarsest == pytest.approx(1.25 * 0.1 * 3.0**order / 5.1, rel=1e-3)


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
def test_least_squares_band_holds_the_limit_of_noisy_data(order):
    """With scatter on all four grids the band holds the true limit about 9 times in 10."""
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(200):
        values = 5.0 + 0.1 * H**order + rng.normal(0.0, 0.01, 4)
        e = estimate(H, values)
        held += abs(values[0] - 5.0) <= e.uncertainty * abs(values[0])
    assert held >= 170


def test_growing_differences_are_called_divergent():
    """The finest grid moves away: no order, nothing extrapolated, and the large factor of safety."""
    e = estimate([1.0, 2.0, 4.0], [5.4, 5.1, 5.0])
    assert (e.verdict, e.order, e.extrapolated) == ("divergent", None, None)
    assert e.gci == pytest.approx(3.0 * 0.3 / 5.4, rel=1e-9)


def test_differences_below_repeatability_are_noise():
    """What is smaller than 2.8 standard deviations between equal runs is no trend."""
    values = [5.00, 5.01, 5.03]
    assert estimate(H[:3], values).verdict == "monotone"
    e = estimate(H[:3], values, repeat_sd=0.02)
    assert e.verdict == "noise-limited"
    assert e.order is None  # 3.1 is not credible
    straight = [5.00, 5.01, 5.02]
    assert estimate(H[:3], straight, repeat_sd=0.02).order == pytest.approx(1.0, abs=1e-6)
    odd = [5.00, 5.01, 5.011]
    assert estimate(H[:3], odd).verdict == "divergent"
    e = estimate(H[:3], odd, repeat_sd=0.02)
    assert (e.verdict, e.order, e.extrapolated) == ("noise-limited", None, None)
    assert e.gci == pytest.approx(3.0 * (0.01 / 5.00) / (1.5 - 1), rel=1e-9)  # first order, the large factor of safety


def test_two_grids_take_the_factor_three():
    """Roache: two grids prove no order, so first order and a factor of safety of 3."""
    e = estimate([1.0, 2.0], [10.0, 10.2])
    assert e.verdict == "two grids"
    assert e.gci == pytest.approx(3 * 0.02)
    assert e.gci_coarsest == pytest.approx(3 * 0.04)


@pytest.mark.parametrize(
    ("h", "values", "word"),
    [([1.0], [1.0], "at least 2"), ([1.0, 1.0], [1.0, 2.0], "differ"), ([1.0, 2.0], [1.0, np.nan], "not finite")],
)
def test_what_cannot_be_judged_is_refused(h, values, word):
    """One grid, equal cells and a broken run are said, not guessed."""
    with pytest.raises(CurveError, match=word):
        estimate(h, values)


def test_curve_converges_with_one_order():
    """A curve whose error is a h^p g(s) has order p everywhere, also where g passes zero."""
    s = np.linspace(0, 1, 101)
    curves = [np.sin(np.pi * s) + 0.02 * h**1.5 * np.cos(4 * np.pi * s) for h in H]
    c = curve_estimate(H, curves)
    assert c.order == pytest.approx(1.5, abs=1e-3)
    truth = np.abs(curves[0] - np.sin(np.pi * s))
    np.testing.assert_allclose(c.u_num, 1.25 * truth / 2, rtol=2e-3, atol=1e-9)
    np.testing.assert_allclose(c.u_coarsest, 3.0**1.5 * c.u_num, rtol=2e-3, atol=1e-9)
    with pytest.raises(CurveError, match="different lengths"):
        curve_estimate(H[:2], [s, s[1:]])


def test_noise_widens_the_uncertainty_but_not_the_index():
    """Two standard deviations between runs that should agree are added in squares; of a curve at each of its points."""
    values = 5.0 + 0.1 * H
    quiet, noisy = estimate(H, values), estimate(H, values, repeat_sd=0.01)
    assert noisy.gci == quiet.gci
    assert noisy.uncertainty == pytest.approx(np.hypot(quiet.uncertainty, 2 * 0.01 / values[0]), rel=1e-9)
    s = np.linspace(0, 1, 11)
    curves = [np.sin(np.pi * s) + 0.02 * h for h in H]
    sd = 0.03 * s
    calm, wild = curve_estimate(H, curves), curve_estimate(H, curves, sd)
    np.testing.assert_allclose(wild.u_num, np.hypot(calm.u_num, sd), rtol=1e-12)
    np.testing.assert_allclose(wild.gci, calm.gci, rtol=1e-12)
