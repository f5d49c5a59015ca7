"""Prony series against closed forms, and what a hold tells of one."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import CurveError, TraceError
from calib.relaxation.branch_search import fastest_seen
from calib.relaxation.hold import find_hold
from calib.relaxation.relaxation_fit import fit_relaxation
from calib.texture.prony_series import PronySeries
from tests.calib.texture.made_bites import DEPTH, HEIGHT, held, record, two_bites

THREE = PronySeries((0.3, 0.2, 0.1), (0.3, 3.0, 20.0))


def test_a_solid_relaxes_as_its_closed_form():
    """Behind a ramp of time T a branch has its share times (e^(T/tau) - 1) tau / T e^(-t/tau): to rounding at any
    step."""
    ramp = 2.0
    time = np.unique(np.concatenate([np.linspace(0.0, ramp, 7), ramp + np.geomspace(1e-3, 60.0, 40)]))
    load = THREE.stress(time, np.minimum(time / ramp, 1.0))
    want = np.full(len(time), THREE.equilibrium)
    for share, tau in zip(THREE.shares, THREE.times, strict=True):
        want += share * np.expm1(ramp / tau) * tau / ramp * np.exp(-time / tau)
    late = time >= ramp
    np.testing.assert_allclose(load[late], want[late], rtol=1e-9)
    np.testing.assert_allclose(THREE.stress(time, np.ones(len(time))), THREE.relaxation(time), rtol=1e-9)


@pytest.mark.parametrize("frequency", [0.03, 0.3, 3.0, 30.0])
def test_storage_and_loss_are_those_of_the_oscillation(frequency):
    """The stress under a sine, walked in time, has the storage and the loss modulus of the closed form within 1 %,
    over three decades about the relaxation times."""
    beats = max(4, int(frequency * 5 * max(THREE.times) / (2 * np.pi)) + 2)
    time = np.linspace(0.0, beats * 2 * np.pi / frequency, 200 * beats + 1)
    load = THREE.stress(time, np.sin(frequency * time))
    last = slice(-201, None)
    phase, t = frequency * time[last], time[last]
    storage, loss = (np.trapezoid(load[last] * f(phase), t) / np.pi * frequency for f in (np.sin, np.cos))
    assert storage == pytest.approx(THREE.storage(np.array([frequency]))[0], rel=0.01)
    assert loss == pytest.approx(THREE.loss(np.array([frequency]))[0], rel=0.01)


@pytest.mark.parametrize("trigger", [None, 0.06, 1.0])
def test_the_truth_is_found_and_told(trigger):
    """Three branches under noise of 0.1 % of the peak, a rest before contact and a ramp of 200 samples: their number by
    evidence, shares and stiffness within 1 %, times within 4 %, and the truth in each interval of a time. A trigger of
    1 to 20 % of the peak moves none of it, as contact is where the load would begin."""
    fit = fit_relaxation(find_hold(held(THREE, noise=0.005, ramp=0.4, step=0.002, rest=0.5), trigger))
    assert len(fit.branches) == 3 and all(one.identified for one in fit.branches)
    for one, share, tau in zip(fit.branches, THREE.shares, THREE.times, strict=True):
        assert one.share == pytest.approx(share, rel=0.01)
        assert one.time_s == pytest.approx(tau, rel=0.04)
        assert one.time_low_s / 1.05 < tau < 1.05 * one.time_high_s
    assert fit.stiffness == pytest.approx(2000.0, rel=0.01)
    assert fit.equilibrium == pytest.approx(0.4, rel=0.01) and fit.nrmse < 0.003
    assert fit.hold.way[-1] == pytest.approx(0.3 * HEIGHT, rel=0.005)


@pytest.mark.parametrize(("noise", "within"), [(0.0005, 0.03), (0.005, 0.25)])
@pytest.mark.parametrize("ramp", [4.0, 10.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_slow_ramp_invents_no_fast_branch(ramp, noise, within, seed):
    """Ramps of 13 and 33 times the fastest branch, noise of 0.06 and 0.6 % of the peak: what evidence takes is the
    truth, and each share lies within 3.5 of its standard uncertainties, which are so small that E0 is known to 3 %, or
    to 25 % where noise is ten times as large."""
    made = held(THREE, stiffness=1571.0 / 3, ramp=ramp, noise=noise, step=0.01, rest=0.5, seed=seed)
    fit = fit_relaxation(find_hold(made))
    assert len(fit.branches) == 3 and all(one.identified for one in fit.branches)
    for one, share, tau in zip(fit.branches, THREE.shares, THREE.times, strict=True):
        assert abs(one.share - share) < 3.5 * one.share_sd < 0.25
        assert one.time_s == pytest.approx(tau, rel=0.05 if noise < 0.001 or tau > 1.0 else 0.5)
    assert fit.stiffness == pytest.approx(1571.0 / 3, rel=within)


def test_a_fast_branch_within_the_noise_is_not_told():
    """A branch of 0.03 s behind a ramp of 10 s adds 0.1 % of the peak for three samples: evidence does not take it, and
    where it is asked for it is not told. The fit says below which time it sees nothing."""
    series = PronySeries((0.3, 0.3), (0.03, 3.0))
    for seed in range(3):
        hold = find_hold(held(series, ramp=10.0, noise=0.02, step=0.01, rest=0.5, seed=seed))
        fit = fit_relaxation(hold)
        assert [one.time_s for one in fit.branches] == pytest.approx([3.0], rel=0.05)
        assert 0.03 < fastest_seen(fit.hold, fit.stiffness, 0.3) < 0.3
        asked = fit_relaxation(hold, 2)
        assert not all(one.identified for one in asked.branches)


def test_a_branch_that_the_load_asks_for_is_no_noise():
    """Of a branch of 0.2 s in a record of two samples a second nobody knows the stiffness, but the load behind the ramp
    has it, ten times above the noise. It is not left out: it is not told, and so the test does not pass."""
    series = PronySeries((0.3, 0.3), (0.2, 8.0))
    for seed in range(3):
        fit = fit_relaxation(find_hold(held(series, ramp=5.0, hold=35.0, step=0.5, rest=0.5, noise=0.004, seed=seed)))
        fast, slow = fit.branches
        assert slow.identified and slow.time_s == pytest.approx(8.0, rel=0.02)
        assert not fast.identified


def test_the_hold_begins_where_the_way_stays():
    """With noise that puts the largest load behind the ramp, the hold begins at the end of the ramp, as it does
    without, within 1 % of the ramp. With noise of the way of 0.2 %, three of whose standard deviations it lies within
    the place, within 2 %."""
    series = PronySeries((0.1,), (20.0,))
    calm = find_hold(held(series, ramp=2.0, step=0.01, rest=0.5))
    assert calm.time[calm.start] == pytest.approx(2.0, abs=0.01)
    for seed in range(3):
        made = held(series, ramp=2.0, noise=0.2, step=0.01, rest=0.5, seed=seed)
        assert made.time[np.argmax(made.load)] > 2.6
        shaken = made.way + 6e-6 * np.random.default_rng(seed).standard_normal(len(made.way))
        for way, within in ((made.way, 0.02), (shaken, 0.04)):
            assert find_hold(record(made.time, way, made.load)).duration == pytest.approx(calm.duration, abs=within)


def test_samples_count_by_their_noise():
    """Means of the hold have the noise of one load over the root of their number, within 10 %; a constant is added
    that a body which is no series leaves."""
    hold = find_hold(held(THREE, noise=0.02, step=0.002, rest=0.5))
    assert hold.noise[1] == pytest.approx(0.02, rel=0.1)
    assert hold.noise[-1] == pytest.approx(0.02 / np.sqrt(30000 * (1 - 30000 ** (-1 / 149))), rel=0.1)
    made = held(THREE, noise=0.02, step=0.002, rest=0.5)
    rung = record(made.time, made.way, made.load * (1 + 0.02 * np.sin(np.log(0.01 + made.time) * 6)))
    found = fit_relaxation(find_hold(rung)).hold
    assert found.noise[-1] > 10 * hold.noise[-1]


def test_more_branches_than_decades_are_refused():
    """One line that says how many a hold tells, at once."""
    hold = find_hold(held(THREE))
    with pytest.raises(CurveError, match="50 branches; a hold of 58.4 s .* give at most 4 with --branches"):
        fit_relaxation(hold, 50)


def test_a_trigger_above_the_load_is_refused():
    """With what texture profiles say of it."""
    with pytest.raises(TraceError, match="which is not above the trigger of 100 N; give a smaller --trigger"):
        find_hold(held(THREE), 100.0)


def test_evidence_takes_no_more_branches_than_there_are():
    """None of an elastic body, one of one, and the criterion's least value is the one that is taken."""
    for series in (PronySeries((), ()), PronySeries((0.5,), (2.0,))):
        fit = fit_relaxation(find_hold(held(series, noise=0.01)))
        assert len(fit.branches) == len(series.shares) == int(np.argmin(fit.bic))


def test_a_branch_beyond_the_hold_is_not_told():
    """Of a branch of 400 s in a hold of 60 s the report says that its share is not told from what remains."""
    fit = fit_relaxation(find_hold(held(PronySeries((0.3, 0.2), (1.0, 400.0)), noise=0.005)))
    fast, slow = fit.branches
    assert fast.identified and not slow.identified
    assert "longer than the hold" in slow.why or "not told" in slow.why


def test_series_that_cannot_be_are_refused():
    """Shares above 1 together or below 0, and times of nothing."""
    for shares, times in (((0.6, 0.5), (1.0, 2.0)), ((-0.1,), (1.0,)), ((0.1,), (0.0,)), ((0.1,), ())):
        with pytest.raises(CurveError):
            PronySeries(shares, times)
    assert PronySeries((0.4, 0.6), (1.0, 2.0)).equilibrium == pytest.approx(0.0, abs=1e-12)


def test_what_is_no_hold_is_refused():
    """Two bites, and a hold as short as its ramp."""
    time, way = two_bites()
    with pytest.raises(TraceError, match="samples from the end of the ramp until the plate leaves its place"):
        find_hold(record(time, way, 8.0 * way / DEPTH))
    with pytest.raises(TraceError, match="so the ramp has relaxed already"):
        find_hold(held(THREE, ramp=10.0, hold=12.0))
