"""Curve metrics against closed forms, published worked examples, and a published calibration."""

from __future__ import annotations

import json

import numpy as np
import pytest

from calib.errors import CurveError
from calib.trace.trace import read_trace
from calib.validation.metrics import (
    ISO_SAMPLES,
    Metrics,
    compare,
    iso18571,
    russell_from_integrals,
    sprague_geers_from_integrals,
)
from mpm.scene.errors import CutcalError
from tests.data_dir import data_file

N = 2001
S = np.linspace(0.0, 0.03, N)
HALF_SINE = 12.0 * np.sin(np.pi * S / 0.03)


def test_equal_curves_are_perfect() -> None:
    """A curve compared with itself has no error in any metric and the full rating."""
    m = compare(S, HALF_SINE, HALF_SINE)
    for name in (
        "peak_error",
        "peak_position_error",
        "shape_error",
        "shape_ramp",
        "shape_peak",
        "shape_release",
    ):
        assert getattr(m, name) == 0.0, name
    for name in ("nrmse", "relative_l2", "work_error", "stiffness_error"):
        assert getattr(m, name) == 0.0, name
    assert m.best_scale == 1.0
    assert m.best_scale_residual == pytest.approx(0.0, abs=1e-7)
    assert (m.sprague_geers.M, m.sprague_geers.C) == pytest.approx((0.0, 0.0), abs=1e-7)
    assert m.iso18571.R == pytest.approx(1.0)
    assert (m.iso18571.shift, m.iso18571.at_bound) == (0, False)


def test_ten_percent_too_strong() -> None:
    """1.1 times a half sine: the closed forms of every scalar, and no error of shape."""
    m = compare(S, HALF_SINE, 1.1 * HALF_SINE)
    assert m.peak_error == pytest.approx(0.1)
    assert m.nrmse == pytest.approx(0.1 / np.sqrt(2.0), rel=1e-6)  # 0.07071
    assert m.relative_l2 == pytest.approx(0.1)
    assert m.work_error == pytest.approx(0.1)
    assert m.stiffness_error == pytest.approx(0.1)
    assert m.shape_error == pytest.approx(0.0, abs=1e-12)
    assert m.best_scale == pytest.approx(1.0 / 1.1)
    assert m.best_scale_residual == pytest.approx(0.0, abs=1e-7)
    assert (m.sprague_geers.M, m.sprague_geers.P, m.sprague_geers.C) == pytest.approx((0.1, 0.0, 0.1), abs=1e-7)
    assert (m.russell.M, m.russell.C) == pytest.approx((0.0759, 0.0672), abs=5e-5)
    assert m.work_real_J == pytest.approx(12.0 * 0.03 * 2.0 / np.pi, rel=1e-6)
    assert m.peak_sim_N == pytest.approx(13.2)


def test_nrmse_is_over_the_peak_not_the_range() -> None:
    """A curve from 6 N to 12 N that is 0.6 N off has an NRMSE of a twentieth; over its range it would be a tenth."""
    real = np.linspace(6.0, 12.0, N)
    assert compare(S, real, real + 0.6).nrmse == pytest.approx(0.05, rel=1e-9)


def test_work_is_the_trapezium_sum() -> None:
    """A straight line's work is exact on any grid; sums from the left or the right miss half a step of its height."""
    line = 400.0 * S
    m = compare(S, line, 1.5 * line)
    exact = 0.5 * 400.0 * S[-1] ** 2
    assert (m.work_real_J, m.work_sim_J) == pytest.approx((exact, 1.5 * exact), rel=1e-12)
    step = S[1] - S[0]
    assert abs(float(np.sum(line[:-1]) * step) / exact - 1.0) > 1e-4 < abs(float(np.sum(line[1:]) * step) / exact - 1.0)


def test_shifted_sine_shows_in_the_phase_alone() -> None:
    """A full-period sine shifted by a fraction d of the period has M = 0 and P = 2 d."""
    x = np.linspace(0.0, 1.0, N)
    for d in (0.05, 0.1, 0.2):
        # an offset-free sine does no net work and is no cut, so the integrals are taken here
        r, m = np.sin(2 * np.pi * x[:-1]), np.sin(2 * np.pi * (x[:-1] - d))
        sg = sprague_geers_from_integrals(float(m @ m), float(r @ r), float(m @ r))
        assert sg.M == pytest.approx(0.0, abs=1e-9)
        assert sg.P == pytest.approx(2.0 * d, abs=1e-6)


def test_sprague_geers_worked_examples() -> None:
    """Two sets of sums printed with their results in the documentation of Altair's tools."""
    first = sprague_geers_from_integrals(143.5, 143.5, 77.0)
    assert (first.M, first.P) == pytest.approx((0.0, 0.31971), abs=5e-6)
    second = sprague_geers_from_integrals(13.9628, 6.67958, 9.59216)
    assert (second.M, second.P) == pytest.approx((0.44581, 0.03702), abs=5e-6)
    assert second.C == pytest.approx(np.hypot(second.M, second.P))
    swapped = sprague_geers_from_integrals(6.67958, 13.9628, 9.59216)
    assert swapped.M == pytest.approx(-0.308, abs=5e-4)  # not symmetric: which curve is the reference matters


def test_russell_is_symmetric_in_the_curves() -> None:
    """Exchanging model and reference changes the sign of Russell's magnitude error and nothing else."""
    a, b = (
        russell_from_integrals(13.9628, 6.67958, 9.59216),
        russell_from_integrals(6.67958, 13.9628, 9.59216),
    )
    assert a.M == pytest.approx(-b.M)
    assert (a.P, a.C) == pytest.approx((b.P, b.C))


def test_zero_curves_have_no_phase() -> None:
    """Integrals of a curve that is zero cannot be rated."""
    with pytest.raises(CurveError, match="is zero"):
        sprague_geers_from_integrals(0.0, 1.0, 0.0)


def test_peak_position_and_best_scale() -> None:
    """A triangle that peaks at 60 % instead of 40 % of the stroke is late by 0.2; scaling cannot cure it."""
    x = np.linspace(0.0, 1.0, N)
    early, late = np.minimum(x / 0.4, (1 - x) / 0.6), np.minimum(x / 0.6, (1 - x) / 0.4)
    m = compare(x, early, late)
    assert m.peak_position_error == pytest.approx(0.2, abs=1e-3)
    # by hand: the product of the triangles integrates to 17/54, each square to 1/3
    assert m.best_scale == pytest.approx(17.0 / 18.0, rel=1e-5)
    assert m.best_scale_residual == pytest.approx(np.sqrt(1.0 - (17.0 / 18.0) ** 2), rel=1e-5)


def test_stiffness_is_that_of_the_first_rise() -> None:
    """Bilinear curves: the error is the ratio of the first slopes, whatever follows at the peak."""
    real = np.where(S < 0.01, 1000.0 * S, 10.0 + 500.0 * (S - 0.01))
    sim = np.where(S < 0.01, 1300.0 * S, 13.0 + 350.0 * (S - 0.01))
    assert compare(S, real, sim).stiffness_error == pytest.approx(0.3, abs=1e-6)


def test_late_start_is_not_a_soft_start() -> None:
    """A model that rises as steeply but 9 mm later has no stiffness error: the slope is that of the rise."""
    late = np.interp(S, [0.0, 0.009, 0.019, 0.03], [0.0, 0.0, 10.0, 10.0])
    early = np.interp(S, [0.0, 0.01, 0.03], [0.0, 10.0, 10.0])
    assert compare(S, early, late).stiffness_error == pytest.approx(0.0, abs=0.01)


def test_shape_windows_find_where_the_shape_is_wrong() -> None:
    """A release that comes too early is seen in the release window and in no other."""
    real = 10.0 * np.clip(np.minimum(S / 0.01, (0.03 - S) / 0.005), 0.0, 1.0)
    sim = 10.0 * np.clip(np.minimum(S / 0.01, (0.0295 - S) / 0.0045), 0.0, 1.0)
    m = compare(S, real, sim)
    assert m.shape_ramp == 0.0
    assert m.shape_release > 10.0 * m.shape_peak
    rising = compare(S, S * 300.0, S * 310.0)
    assert np.isnan(rising.shape_release)
    assert rising.as_dict()["shape_release"] is None


def test_dictionary_goes_into_json() -> None:
    """The nested dictionary has the documented keys and survives strict JSON."""
    d = json.loads(json.dumps(compare(S, S * 300.0, HALF_SINE).as_dict(), allow_nan=False))
    assert set(d["sprague_geers"]) == {"M", "P", "C"}
    assert set(d["iso18571"]) == {"Z", "EP", "EM", "ES", "R", "shift", "at_bound", "without_phase"}
    assert set(d) == set(Metrics.__dataclass_fields__)


def test_iso_corridor_by_hand() -> None:
    """A constant offset of 20 % of the peak gives Z = ((0.5 - 0.2) / 0.45)^2; 4 % gives 1, 60 % gives 0."""
    for offset, corridor in ((0.2, (0.3 / 0.45) ** 2), (0.04, 1.0), (0.6, 0.0)):
        rating = iso18571(S, HALF_SINE, HALF_SINE + offset * HALF_SINE.max())
        assert rating.Z == pytest.approx(corridor, rel=1e-3)
        assert rating.EP == 1.0
        assert rating.ES == pytest.approx(1.0)


def test_iso_phase_counts_samples() -> None:
    """A pulse 12 of 240 samples late has shift 12 and phase 1 - 12/48, and is perfect once moved back."""
    x = np.arange(ISO_SAMPLES, dtype=float)

    def pulse(centre: float) -> np.ndarray:
        return np.asarray(np.exp(-0.5 * ((x - centre) / 12.0) ** 2))

    late = iso18571(x, pulse(110.0), pulse(122.0))
    assert (late.shift, late.at_bound) == (12, False)
    assert late.EP == pytest.approx(0.75)
    assert late.EM == pytest.approx(1.0, abs=1e-3)
    assert late.ES == pytest.approx(1.0, abs=1e-3)
    assert iso18571(x, pulse(122.0), pulse(110.0)).shift == -12
    assert late.R == pytest.approx(0.4 * late.Z + 0.2 * (late.EP + late.EM + late.ES))


def test_iso_magnitude_by_hand() -> None:
    """A plateau 10 % too high cannot be warped away: EM = 1 - 0.1 / 0.5."""
    x = np.arange(ISO_SAMPLES, dtype=float)
    plateau = np.full(ISO_SAMPLES, 5.0)
    plateau[0] = 5.0 + 1e-9  # a constant has no correlation
    assert iso18571(x, plateau, 1.1 * plateau).EM == pytest.approx(0.8, abs=1e-6)


def test_iso_slope_by_hand() -> None:
    """A line of half the slope has the slope error 0.5 and ES = 0.75; the opposite slope has ES = 0."""
    line = 100.0 * S
    assert iso18571(S, line, 0.5 * line).ES == pytest.approx(0.75)
    assert iso18571(S, line, 3.0 - line).ES == pytest.approx(0.0, abs=1e-9)


def test_iso_phase_of_a_ramp_says_that_it_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """A slower exponential rise is matched by shifting to the bound; the rating flags it, and gives that of the other
    parts unshifted."""
    x = np.linspace(0.0, 1.0, ISO_SAMPLES)
    rating = iso18571(x, 1.0 - np.exp(-4.0 * x), 0.8 * x**1.2)
    assert rating.at_bound
    assert rating.EP == 0.0
    assert rating.without_phase is not None and rating.without_phase < 0.3  # a curve that is far off stays so
    assert f"without it the ISO rating is {rating.without_phase:.3f}" in rating.caveat
    assert iso18571(x, x, x).without_phase is None and iso18571(x, x, x).caveat == ""
    monkeypatch.setattr("calib.validation.metrics._best_shift", lambda *_: 0)
    unshifted = iso18571(x, 1.0 - np.exp(-4.0 * x), 0.8 * x**1.2)
    assert unshifted.EP == 1.0 and rating.without_phase == pytest.approx((unshifted.R - 0.2) / 0.8)


def test_iso_warping_stays_in_its_window() -> None:
    """A spike moved by less than a tenth of the curve is warped away, one moved by more is not."""
    x = np.arange(ISO_SAMPLES, dtype=float)
    base = np.sin(np.pi * x / 239.0) * 5.0

    def spiked(at: int) -> np.ndarray:
        return np.asarray(base + 3.0 * np.exp(-0.5 * ((x - at) / 2.0) ** 2))

    near, far = iso18571(x, spiked(100), spiked(112)), iso18571(x, spiked(100), spiked(160))
    assert near.EM > 0.99
    assert far.EM < 0.97


@pytest.mark.parametrize(
    ("stroke", "real", "sim", "message"),
    [
        (S, HALF_SINE[:-1], HALF_SINE, "shapes"),
        (S[:10], HALF_SINE[:10], HALF_SINE[:10], "10 samples cannot be rated"),
        (S, HALF_SINE, HALF_SINE * np.nan, "simulated curve is not finite at sample 0"),
        (np.where(S == S[7], np.inf, S), HALF_SINE, HALF_SINE, "stroke is not finite at sample 7"),
        (S[::-1], HALF_SINE, HALF_SINE, "stroke does not increase at sample 1"),
        (S, 0.0 * S, HALF_SINE, "measured curve has no positive force"),
        (S, HALF_SINE, -HALF_SINE, "simulated curve has no positive force"),
        (S, HALF_SINE - 11.0, HALF_SINE, "measured curve does no work"),
    ],
)
def test_curves_that_cannot_be_compared(stroke: np.ndarray, real: np.ndarray, sim: np.ndarray, message: str) -> None:
    """Each unusable input is named; the error is both a ValueError and one that the command line prints."""
    with pytest.raises(ValueError, match=message):
        compare(stroke, real, sim)
    with pytest.raises(CutcalError, match=message):
        compare(stroke, real, sim)


def test_metrics_do_not_depend_on_the_unit_of_length() -> None:
    """Stretching the stroke tenfold scales the work and leaves every fraction alone."""
    sim = 11.0 * np.sin(np.pi * S / 0.03) ** 1.3
    a, b = compare(S, HALF_SINE, sim).as_dict(), compare(10.0 * S, HALF_SINE, sim).as_dict()
    for name, value in a.items():
        if isinstance(value, float):
            factor = 10.0 if name.endswith("_J") else 1.0
            assert b[name] == pytest.approx(factor * value, rel=1e-9), name
    assert a["iso18571"] == pytest.approx(b["iso18571"])


@pytest.mark.parametrize(
    ("food", "peak", "nrmse", "work", "phase", "rating", "at_bound"),
    [
        ("cucumber", 0.072, 0.057, -0.031, 0.026, 0.89, False),
        ("potato", 0.184, 0.123, -0.023, 0.051, 0.59, True),
    ],
)
def test_published_calibration(
    food: str, peak: float, nrmse: float, work: float, phase: float, rating: float, at_bound: bool
) -> None:
    """The published fits of SliceIt! (arXiv 2404.02569) rate as in an independent reading of the figure.

    The tolerances are those of reading the same figure twice: the cucumber's curves differ by 1.3 % of the
        peak.
    """
    path = data_file("sliceit_digitised", f"{food}_20mms.csv")
    real, sim = read_trace(path), read_trace(path, force_col="disect_fit_N")
    m = compare(0.02 * real.time, real.force, sim.force)
    assert m.peak_error == pytest.approx(peak, abs=0.005)
    assert m.nrmse == pytest.approx(nrmse, abs=0.014)
    assert m.work_error == pytest.approx(work, abs=0.01)
    assert m.sprague_geers.P == pytest.approx(phase, abs=0.007)
    assert m.iso18571.R == pytest.approx(rating, abs=0.012)
    assert m.iso18571.at_bound == at_bound
