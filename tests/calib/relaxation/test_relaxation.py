"""Prony series against closed forms, and what a hold tells of one."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import CurveError, TraceError
from calib.relaxation.hold import find_hold
from calib.relaxation.relaxation_fit import fit_relaxation
from calib.texture.prony_series import PronySeries
from tests.calib.texture.made_bites import DEPTH, held, record, two_bites

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


def test_the_truth_is_found_and_told():
    """Three branches under noise of 0.1 % of the peak: their number by evidence, shares and times within 1 and 4 %,
    and the truth in each interval of a time."""
    fit = fit_relaxation(find_hold(held(THREE, noise=0.005)))
    assert len(fit.branches) == 3 and all(one.identified for one in fit.branches)
    for one, share, tau in zip(fit.branches, THREE.shares, THREE.times, strict=True):
        assert one.share == pytest.approx(share, abs=0.01)
        assert one.time_s == pytest.approx(tau, rel=0.04)
        assert one.time_low_s / 1.05 < tau < 1.05 * one.time_high_s
    assert fit.stiffness == pytest.approx(2000.0, rel=0.01)
    assert fit.equilibrium == pytest.approx(0.4, abs=0.005) and fit.nrmse < 0.003


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
    with pytest.raises(TraceError, match="samples from the largest load on until the plate leaves its place"):
        find_hold(record(time, way, 8.0 * way / DEPTH))
    with pytest.raises(TraceError, match="so the ramp has relaxed already"):
        find_hold(held(THREE, ramp=10.0, hold=12.0))
