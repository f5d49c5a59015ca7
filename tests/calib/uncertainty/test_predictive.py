"""The predictive band: what the surrogate does not know is neither taken for an explanation nor for a prediction."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.problem.objective import Objective
from calib.problem.parameters import Parameter, ParameterSet
from calib.problem.target import ErrorModel, Target
from calib.uncertainty.predictive import POSTERIOR_DRAWS, posterior_draws, predictive_bands

STROKE = np.linspace(0.0, 0.02, 41)
CURVE = 10.0 * np.minimum(STROKE / 5e-3, 1.0)
LINE = ParameterSet((Parameter("R", 100.0, 1.0, 1e4, "J/m^2", 20.0, 500.0),))
GOAL = Objective(Target(STROKE, CURVE, 0.1, 0.1, np.interp), LINE, ErrorModel(discrepancy=0.05))


def surrogate(sd_far: float) -> Any:
    """A surrogate whose curve is the measured one everywhere; beyond 0.3 of the best it does not know by ``sd_far``."""

    def predict(z: np.ndarray) -> tuple[np.ndarray, float, float]:
        return CURVE, sd_far if abs(z[0] - LINE.start[0]) > 0.3 else 0.01, 1.0

    def unknown_residual(curves: np.ndarray, sds: np.ndarray) -> np.ndarray:
        return sds * np.sqrt(GOAL.effective_points) / GOAL.sigma

    process = SimpleNamespace(objective=GOAL, predict=predict, unknown_residual=unknown_residual)
    residual = lambda z: GOAL.residual(CURVE, 1.0, z)  # noqa: E731
    return SimpleNamespace(objective=GOAL, each=[process], residual=residual)


def uncertainty(error_variance: float = 1.0) -> Any:
    """Of one parameter, with a standard deviation of 0.6 where the errors are those stated."""
    prior = float(LINE.prior_jacobian()[0, 0])
    seen = np.array([[math.sqrt(1.0 / 0.36 - prior**2)]])
    data = SimpleNamespace(weights=np.ones(GOAL.data_rows), lengths=(0.1,), jacobian=seen)
    return SimpleNamespace(error_variance=error_variance, data=data)


def test_what_is_not_known_is_no_explanation() -> None:
    """Foods whose curves could be anything are drawn less, though the curve expected of them is the measured one."""
    far = {}
    for sd in (0.01, 30.0):
        drawn = posterior_draws(surrogate(sd), LINE.start, uncertainty(), np.random.default_rng(0))
        assert drawn.shape == (POSTERIOR_DRAWS, 1)
        far[sd] = float(np.mean(np.abs(drawn[:, 0] - LINE.start[0]) > 0.3))
    assert far[0.01] > 0.4 and far[30.0] < 0.01


@pytest.mark.parametrize("sd", [0.01, 30.0])
def test_band_is_no_wider_than_the_errors_of_the_fit(sd: float) -> None:
    """However little the surrogate knows elsewhere; the band used to be as wide as that."""
    (band,) = predictive_bands(surrogate(sd), LINE.start, uncertainty())
    assert np.max(band.high - band.low) < 6.0 * GOAL.sigma and band.inside > 0.95


def test_band_is_as_wide_as_the_errors_are_expected_to_be() -> None:
    """Errors of twice the size have a band of twice the width."""
    widths = []
    for variance in (1.0, 4.0):
        (band,) = predictive_bands(surrogate(0.01), LINE.start, uncertainty(variance))
        widths.append(float(np.mean(band.high - band.low)))
    assert widths[1] / widths[0] == pytest.approx(2.0, rel=0.03)
