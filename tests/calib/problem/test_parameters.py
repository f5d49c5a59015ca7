"""Parameters: coordinates, priors, bounds, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from calib.errors import MaterialError
from calib.problem.parameters import LOG_STEP, Z95, Parameter, ParameterSet

E = Parameter("E", 4e5, 1e4, 1e7, "Pa", 1e5, 1e6)
NU = Parameter("nu", 0.4, 0.0, 0.499, "-", 0.3, 0.49, "linear")
MU = Parameter("mu", 0.3, 0.0, 1.5, "-", 0.1, 0.5, "linear")
R = Parameter("R", 300.0, 1.0, 1e4, "J/m^2", 100.0, 900.0)


def test_prior_ends_lie_at_the_95_percent_points() -> None:
    """The literature's range is the central 95 % of the prior, on a log and on a linear scale."""
    for parameter in (E, NU):
        for end, value in ((-Z95, parameter.prior_low), (Z95, parameter.prior_high)):
            z = (parameter.to_internal(value) - parameter.prior_mean) / parameter.prior_sd
            assert z == pytest.approx(end, rel=1e-12)


def test_prior_centre_is_geometric_on_a_log_scale() -> None:
    """The median of a log-normal prior is the geometric mean of its range, of a normal one the middle."""
    assert E.prior_centre == pytest.approx(math.sqrt(1e5 * 1e6))
    assert NU.prior_centre == pytest.approx(0.395)


@pytest.mark.parametrize("parameter", [E, NU, MU, R], ids=lambda p: p.name)
def test_round_trip(parameter: Parameter) -> None:
    """Value -> internal -> value is the identity to rounding between the hard bounds."""
    assert parameter.round_trip_error() < 1e-14
    assert parameter.from_internal(parameter.to_internal(parameter.value)) == pytest.approx(parameter.value, rel=1e-14)


def test_values_never_leave_the_bounds() -> None:
    """exp(log(bound)) may round to beyond the bound; the value that is simulated may not."""
    for low in np.geomspace(1e-3, 1e9, 200):
        p = Parameter("E", 2 * low, low, 3 * low, "Pa", 1.5 * low, 2.5 * low)
        assert low <= p.from_internal(math.log(low)) and p.from_internal(math.log(3 * low)) <= 3 * low
        assert p.from_internal(-1e3) == low and p.from_internal(1e3) == 3 * low


def test_steps_are_wide() -> None:
    """Differences are taken over 10 %: of the value on a log scale, of the prior range on a linear one."""
    assert E.step == LOG_STEP == pytest.approx(math.log(1.1))
    assert MU.step == pytest.approx(0.04)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"value": math.nan}, "not finite"),
        ({"scale": "sqrt"}, "scale 'sqrt'"),
        ({"low": -1.0}, "not positive"),
        ({"low": 1e8}, "bounds"),
        ({"prior_high": 1e5}, "prior range"),
        ({"value": 2e7}, "value 2e\\+07 outside"),
        ({"prior_low": 1e6, "prior_high": 1e9, "value": 1e6}, "prior centre"),
    ],
)
def test_nonsense_is_refused(change: dict[str, float], words: str) -> None:
    """Each impossible parameter is refused on creation, naming parameter, unit and number."""
    given = {"name": "E", "value": 4e5, "low": 1e4, "high": 1e7, "unit": "Pa"}
    given |= {"prior_low": 1e5, "prior_high": 1e6}
    with pytest.raises(MaterialError, match=r"parameter E \[Pa\].*" + words):
        Parameter(**(given | change))


def test_vector_and_dictionary_are_inverse() -> None:
    """A dictionary goes through the internal vector and back, in the order of the set."""
    parameters = ParameterSet((E, MU))
    z = parameters.to_vector({"mu": 0.2, "E": 1e5, "R": 1.0})
    assert z == pytest.approx([math.log(1e5), 0.2])
    assert parameters.to_dict(z) == pytest.approx({"E": 1e5, "mu": 0.2})
    assert parameters.to_dict(parameters.start) == pytest.approx({"E": 4e5, "mu": 0.3})
    assert [p.log for p in parameters] == [True, False] and parameters["mu"] is MU


def test_missing_and_impossible_values_are_named() -> None:
    """A set of values without one of the parameters, or with a log of zero, is refused by name."""
    parameters = ParameterSet((E, MU))
    with pytest.raises(MaterialError, match="parameter mu has no value"):
        parameters.to_vector({"E": 1.0})
    with pytest.raises(MaterialError, match="parameter E = 0 Pa must be positive"):
        parameters.to_vector({"E": 0.0, "mu": 0.1})


def test_prior_residual_and_its_jacobian() -> None:
    """Residual 0 at the centre, 1.96 at the end of the range; its derivative is the stated Jacobian."""
    parameters = ParameterSet((E, MU))
    assert parameters.prior_residual(parameters.prior_mean) == pytest.approx([0.0, 0.0])
    z = parameters.to_vector({"E": 1e6, "mu": 0.1})
    assert parameters.prior_residual(z) == pytest.approx([Z95, -Z95])
    for j, move in enumerate(np.eye(2) * 1e-3):
        change = (parameters.prior_residual(z + move) - parameters.prior_residual(z - move)) / 2e-3
        assert change == pytest.approx(parameters.prior_jacobian()[:, j], abs=1e-9)


def test_box_is_the_prior_range_inside_the_bounds() -> None:
    """The box of the design ends at the hard bound where the prior range reaches beyond it."""
    parameters = ParameterSet((E, Parameter("mu", 0.3, 0.2, 1.5, "-", 0.1, 0.5, "linear")))
    low, high = parameters.box
    assert low == pytest.approx([math.log(1e5), 0.2]) and high == pytest.approx([math.log(1e6), 0.5])
    assert parameters.clip(np.array([0.0, 9.0])) == pytest.approx([math.log(1e4), 1.5])


def test_only_stress_like_log_parameters_scale_the_force() -> None:
    """Scaling E and R by k scales the force; nu and mu have no unit of stress and stay."""
    assert ParameterSet((E, NU, R, MU)).stress_like() == pytest.approx([1.0, 0.0, 1.0, 0.0])


def test_set_refuses_none_and_doubles() -> None:
    """A fit of nothing, and a parameter given twice, are refused."""
    with pytest.raises(MaterialError, match="no parameter to fit"):
        ParameterSet(())
    with pytest.raises(MaterialError, match="E is given more than once"):
        ParameterSet((E, E))


def test_with_values_keeps_the_rest() -> None:
    """New values replace the present ones; bounds, priors and unmentioned parameters stay."""
    changed = ParameterSet((E, MU)).with_values({"E": 2e5})
    assert changed["E"].value == 2e5 and changed["E"].prior_low == E.prior_low and changed["mu"] == MU
