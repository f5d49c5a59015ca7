"""What limits R is what a design would measure next."""

from __future__ import annotations

import numpy as np
import pytest

from calib.material.food import load_food
from calib.problem.food_parameters import fit_parameters
from calib.problem.nuisance import Nuisance
from calib.problem.objective import Objective
from calib.problem.target import Target
from calib.uncertainty.intervals import LinearisedLikelihood, Uncertainty, uncertainty
from calib.uncertainty.limiting import limiting

FORCE = np.full(50, 10.0)
"""A made-up curve [N]."""


def fitted(rows: np.ndarray, gain_sd: float, first: str = "R") -> tuple[Objective, Uncertainty]:
    """A fit whose data have these rows by the parameters [-], and a gain that is known to ``gain_sd`` [-]."""
    parameters = fit_parameters(load_food("potato"), (first, "roundness"))
    gain = Nuisance("gain", "-", gain_sd, FORCE, 10.0, searched=False)
    target = Target(np.linspace(0.0, 1.0, 50), FORCE, 0.1, 0.1, np.interp)
    open_ended = np.zeros((len(rows), 1))
    open_ended[0] = -10.0 * gain_sd
    data = LinearisedLikelihood(rows, np.zeros(len(rows)), open_ended, float(len(rows)), np.ones(len(rows)))
    return Objective(target, parameters, nuisances=(gain,)), uncertainty(parameters, data)


def test_a_shape_that_trades_with_the_resistance_limits_it() -> None:
    """The conditional and the marginal variance of two parameters seen as one sum, in closed form."""
    found = limiting(*fitted(np.array([[10.0, 10.0], [0.0, 0.1]]), gain_sd=1e-3))
    assert found is not None and found.most == "roundness"
    r, shape = (p.prior_sd for p in fit_parameters(load_food("potato"), ("R", "roundness")))
    information = np.array([[100.0 + r**-2, 100.0], [100.0, 100.01 + shape**-2]])
    whole = np.linalg.inv(information)[0, 0]
    assert found.parts["roundness"] == pytest.approx((1.0 / information[0, 0] / whole) ** 0.5, rel=1e-3)
    assert found.sentence is not None and found.sentence.startswith("The shape limits R: ")
    assert "--outline" in found.sentence and found.parts["gain"] > 0.99


def test_a_sensor_limits_where_the_shape_is_seen() -> None:
    """A gain that nobody knows, beside a shape that has rows of its own: known, R would have its own row's interval."""
    objective, seen = fitted(np.array([[10.0, 0.0], [0.0, 100.0]]), gain_sd=0.2)
    found = limiting(objective, seen)
    assert found is not None and found.most == "gain"
    assert found.parts["roundness"] == pytest.approx(1.0)
    prior = objective.parameters["R"].prior_sd ** -2
    assert found.parts["gain"] == pytest.approx((100.0 / (1.0 + 4.0) + prior) ** 0.5 / (100.0 + prior) ** 0.5, rel=1e-6)


def test_nothing_is_said_where_nothing_limits() -> None:
    """Where all is known well, and where R is not asked for."""
    found = limiting(*fitted(np.array([[10.0, 0.0], [0.0, 100.0]]), gain_sd=1e-6))
    assert found is not None and found.most is None and found.sentence is None
    assert limiting(*fitted(np.array([[10.0, 0.0], [0.0, 9.0]]), 0.1, "E")) is None
