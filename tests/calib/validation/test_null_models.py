"""Null models: exact where they should be, and of the size that real cuts leave."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from calib.errors import CurveError
from calib.trace.conditioning import condition
from calib.trace.trace import read_trace
from calib.validation.metrics import Metrics
from calib.validation.null_models import ThreeTermCurve, fit_three_term, null_models
from tests.data_dir import data_file

S = np.linspace(0.0, 0.04, 240)
TRUE = {
    "edge_N": 8.0,
    "rise_m": 1.5e-3,
    "skin_N": 12.0,
    "skin_centre_m": 5e-3,
    "skin_width_m": 1.2e-3,
    "face_N_per_m": 900.0,
    "face_depth_m": 0.013,
}


def test_ramp_is_exact_on_a_ramp() -> None:
    """A linear spring is the ramp: that null model has no error, and ends at the measured peak."""
    null = null_models(S, 500.0 * S)["ramp"]
    assert null.metrics.nrmse == pytest.approx(0.0, abs=1e-12)
    assert null.curve[0] == 0.0
    assert null.curve[-1] == pytest.approx(20.0)


def test_half_sine_is_exact_on_a_half_sine() -> None:
    """A half sine over the stroke is met exactly, a ramp is not."""
    nulls = null_models(S, 7.0 * np.sin(np.pi * S / 0.04))
    assert nulls["half_sine"].metrics.nrmse == pytest.approx(0.0, abs=1e-3)  # the peak lies between two samples
    assert nulls["ramp"].metrics.nrmse > 0.3
    assert nulls["ramp"].metrics.peak_error == pytest.approx(0.0)


def test_three_term_by_hand() -> None:
    """Each of the three terms alone has the value that its formula gives."""
    s = np.array([0.0, 2e-3, 0.04])
    edge = ThreeTermCurve(8.0, 2e-3, 0.0, 0.0, 1e-3, 0.0, 0.01).force(s)
    np.testing.assert_allclose(edge, 8.0 * (1.0 - np.exp([0.0, -1.0, -20.0])))
    skin = ThreeTermCurve(0.0, 1e-3, 5.0, 2e-3, 1e-3, 0.0, 0.01).force(s)
    np.testing.assert_allclose(skin, 5.0 * np.exp([-2.0, 0.0, -722.0]))
    face = ThreeTermCurve(0.0, 1e-3, 0.0, 0.0, 1e-3, 100.0, 0.01).force(s)
    np.testing.assert_allclose(face, [0.0, 0.2, 1.0])


def test_three_term_fit_recovers_its_own_curve() -> None:
    """A curve made of the three terms is found again, numbers included, through 0.5 % of noise."""
    clean = ThreeTermCurve(**TRUE).force(S)
    real = clean + 0.005 * clean.max() * np.random.default_rng(0).normal(size=len(S))
    null = null_models(S, real)["three_term"]
    assert null.metrics.nrmse < 0.006
    for name, value in TRUE.items():
        assert null.parameters[name] == pytest.approx(value, rel=0.12), name


def test_fit_does_not_depend_on_units() -> None:
    """A curve a thousand times stronger over a stroke ten times longer gives the same numbers, scaled."""
    real = ThreeTermCurve(**TRUE).force(S)
    one, two = (asdict(fit_three_term(k * S, f * real)) for k, f in ((1.0, 1.0), (10.0, 1000.0)))
    for name, value in one.items():
        factor = {"_N": 1e3, "_m": 10.0, "er_m": 100.0}["er_m" if name.endswith("per_m") else name[-2:]]
        assert two[name] == pytest.approx(factor * value, rel=1e-6), name


def test_nulls_carry_their_comparison() -> None:
    """Three models, each with its curve on the grid and metrics against the measured curve."""
    nulls = null_models(S, ThreeTermCurve(**TRUE).force(S))
    assert list(nulls) == ["ramp", "half_sine", "three_term"]
    for name, null in nulls.items():
        assert null.name == name
        assert null.curve.shape == S.shape
        assert isinstance(null.metrics, Metrics)


def test_unusable_curves_are_refused() -> None:
    """A curve without force, or with NaN, has no null model."""
    with pytest.raises(CurveError, match="no positive force"):
        null_models(S, 0.0 * S)
    with pytest.raises(CurveError, match="not finite"):
        null_models(S, S * np.nan)


@pytest.mark.parametrize(
    ("cut", "air", "left"),
    [
        ("apple1_edc_cut1", "apple_session_edc_air", 0.021),
        ("cucumber_edc_cut1", "cucumber_session_edc_air1", 0.068),
        ("cucumber_edc_cut2", "cucumber_session_edc_air1", 0.032),
        ("potato_edc_slow_cut1", "potato_session_edc_air1", 0.047),
        ("potato_edc_slow_cut2", "potato_session_edc_air1", 0.022),
    ],
)
def test_three_terms_describe_real_cuts(cut: str, air: str, left: float) -> None:
    """On robot cuts of three foods the description leaves as little as expected, and ramps leave much."""
    folder = "franka_knife_cutting"
    real = condition(read_trace(data_file(folder, f"{cut}.csv")), air=read_trace(data_file(folder, f"{air}.csv")))
    nulls = null_models(real.stroke, real.curve)
    assert 0.7 * left < nulls["three_term"].metrics.nrmse < 1.1 * left
    assert nulls["ramp"].metrics.nrmse > 0.2
    assert nulls["half_sine"].metrics.nrmse > 0.2
