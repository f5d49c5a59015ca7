"""The parameters that are fitted of a food, from the ranges that the literature gives for it."""

from __future__ import annotations

import math

from calib.errors import MaterialError
from calib.material.food import FoodSpec
from calib.material.form import ROUNDNESS, open_shape
from calib.material.properties import rule_of
from calib.problem.parameters import Z95, Parameter, ParameterSet

BOUND_FACTOR = 5.0
"""Hard bounds reach this factor beyond the literature's range [-], so that a trace may contradict the literature."""
LINEAR = {"nu": (0.0, 0.49), "mu": (0.0, 1.2)}
"""Properties that are fitted on a linear scale, with their hard bounds."""
Heights = tuple[float, float, float]
"""Lowest, likely and largest height of a specimen [m]."""


def fit_parameters(food: FoodSpec, names: tuple[str, ...], heights: Heights | None = None) -> ParameterSet:
    """The fitted properties with start value, hard bounds and literature prior.

    Args:
        food: The food.
        names: Properties, and ``height`` and ``roundness`` for the specimen's.
        heights: Lowest, likely and largest height of the specimen [m]; None where it is known.

    Returns:
        The parameters, in the order of their names.

    Raises:
        MaterialError: An unknown or repeated name, a property without a literature range, a height that is known, or
            a roundness that the food does not leave open.
    """
    chosen = []
    for name in names:
        if name == "height":
            if heights is None:
                raise MaterialError(
                    "--fit height: the height is known (given, or the trace ends released); leave one of both out"
                )
            low, likely, high = heights
            chosen.append(Parameter(name, likely, low, high, "m", low, high))
            continue
        if name == ROUNDNESS:
            chosen.append(_roundness(food))
            continue
        rule, (low, high) = rule_of(name), food.prior(name)
        value = food.value(name)
        assert value is not None  # prior() has a range only where there is a value
        if name in LINEAR:
            bottom, top = LINEAR[name]
            chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high, scale="linear"))
            continue
        if low <= 0:
            raise MaterialError(f"{food.name}: {name} cannot be fitted from a range that starts at {low:g} {rule.unit}")
        bottom, top = max(rule.low, low / BOUND_FACTOR), min(rule.high, high * BOUND_FACTOR)
        chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high))
    return ParameterSet(tuple(chosen))


def _roundness(food: FoodSpec) -> Parameter:
    """The roundness of a specimen whose shape is open: any in the food's range is as likely.

    A prior is normal here; this one has the standard deviation of the uniform one, the range over the root of 12.
    """
    open_shape(food)
    known = food.roundness
    assert known is not None  # or its shape is not open
    middle, reach = (known.low + known.high) / 2.0, Z95 * (known.high - known.low) / math.sqrt(12.0)
    return Parameter(
        ROUNDNESS, known.value, known.low, known.high, known.unit, middle - reach, middle + reach, scale="linear"
    )


def size_relative_sd(food: FoodSpec, size: str) -> float:
    """Relative standard deviation of a size of the food, whose 95 % range is that of the literature [-]."""
    known = food.dims[size]
    return math.log(known.high / known.low) / (2.0 * Z95)
