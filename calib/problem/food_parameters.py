"""The parameters that are fitted of a food, from the ranges that the literature gives for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from calib.errors import MaterialError
from calib.material.food import FoodSpec
from calib.material.form import ASPECT, ROUNDNESS, open_shape
from calib.material.properties import rule_of
from calib.material.scene import SizeRange
from calib.problem.parameters import Z95, Parameter, ParameterSet, PriorCorrelation
from mpm.scene.material import LARGEST_RATE_EXPONENT

BOUND_FACTOR = 5.0
"""Hard bounds reach this factor beyond the literature's range [-], so that a trace may contradict the literature."""
LINEAR = {
    "nu": (0.0, 0.49),
    "mu": (0.0, 1.2),
    "relaxing_bulk": (0.0, 1.0),
    "bow": (-0.002, 0.002),
    "rate_exponent": (-LARGEST_RATE_EXPONENT, LARGEST_RATE_EXPONENT),
}
"""Properties that are fitted on a linear scale, with their hard bounds."""
YIELD_STRAIN_FACTOR = 3.0
"""A food's yield stress over its E is this factor below or above that of the literature, at 95 % [-]. A critical strain
has been proposed as what fruit tissue fails at (Segerlind and Dal Fabbro 1978); published single values lie between 5 %
(kiwi) and 16 % (apple). The factor is assumed, materials.yaml, remark 8."""
KNOWN = {
    "height": "the height is known (given, or the trace ends released)",
    "aspect": "the width is given, or the blade reaches across the food, and then it only scales the force",
}
"""Why a size cannot be fitted, by name."""
STICKS = {"adhesion": 5e3, "adhesion_energy": 1.0}
"""How a food sticks to the blade where its withdrawal is fitted and nobody has said so [SI]. Assumed, and fitted over
the range of a given value, a hundredfold for the energy."""


def sticking(food: FoodSpec) -> tuple[FoodSpec, tuple[str, ...]]:
    """The food as a withdrawal sees it, which may stick to the blade, and what was assumed of that.

    Args:
        food: The food.

    Returns:
        The food with an adhesion, and a sentence where it had none.
    """
    if food.value("adhesion_energy") is not None:  # then its adhesion is known, too
        return food, ()
    sticky = food.with_values(STICKS, status="assumed", source="of no measurement: as wide as any food may need")
    low, high = sticky.prior("adhesion_energy")
    return sticky, (
        f"nobody has measured how {food.name} sticks to a blade: its adhesion_energy is sought from {low:g} to "
        f"{high:g} J/m^2, up to a traction of {sticky.value('adhesion'):g} Pa (assumed); --set gives other values",
    )


def fit_parameters(
    food: FoodSpec, names: tuple[str, ...], sizes: Mapping[str, SizeRange] = MappingProxyType({})
) -> ParameterSet:
    """The fitted properties with start value, hard bounds and literature prior, in which E and yield stress are tied.

    Args:
        food: The food.
        names: Properties, and ``height``, ``aspect`` and ``roundness`` for the specimen's.
        sizes: Ranges of the sizes of the specimen that nobody knows, by name.

    Returns:
        The parameters, in the order of their names.

    Raises:
        MaterialError: An unknown or repeated name, a property without a literature range, a size that is known, or
            a roundness that the food does not leave open.
    """
    chosen = []
    for name in names:
        if name in KNOWN:
            if name not in sizes:
                raise MaterialError(f"--fit {name}: {KNOWN[name]}; leave one of both out")
            low, likely, high = sizes[name]
            chosen.append(Parameter(name, likely, low, high, "-" if name == ASPECT else "m", low, high))
            continue
        if name == ROUNDNESS:
            chosen.append(_roundness(food))
            continue
        if name not in LINEAR:
            chosen.append(fitted_range(name, food))
            continue
        rule, (low, high) = rule_of(name), food.prior(name)
        value = food.value(name)
        assert value is not None  # prior() has a range only where there is a value
        bottom, top = LINEAR[name]
        chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high, scale="linear"))
    return with_yield_strain(ParameterSet(tuple(chosen)), food)


def with_yield_strain(parameters: ParameterSet, food: FoodSpec) -> ParameterSet:
    """The parameters with what the literature says of the strain at which a food yields, sigma_y / E.

    The prior of E stays as it is. That of the yield stress at some E is its own range times that of E times the strain,
    both normal in the logarithm: its range becomes narrower, and it is correlated with E.

    Args:
        parameters: With their own priors.
        food: The food, whose ranges say the usual strain.

    Returns:
        The parameters; as they were where E or the yield stress is not among them.
    """
    if not {"E", "yield_stress"} <= set(parameters.names):
        return parameters
    E, own = parameters["E"], fitted_range("yield_stress", food)
    usual = sum(s * math.log(end) for name, s in (("yield_stress", 0.5), ("E", -0.5)) for end in food.prior(name))
    strain_sd = math.log(YIELD_STRAIN_FACTOR) / Z95
    pulled = own.prior_sd**2 / (own.prior_sd**2 + strain_sd**2)  # part of a change of E that the yield stress follows
    mean = (1.0 - pulled) * own.prior_mean + pulled * (E.prior_mean + usual)
    sd = math.hypot(math.sqrt(pulled) * strain_sd, pulled * E.prior_sd)
    low, high = math.exp(mean - Z95 * sd), math.exp(mean + Z95 * sd)
    tied = replace(parameters["yield_stress"], prior_low=low, prior_high=high)
    items = tuple(tied if p.name == "yield_stress" else p for p in parameters)
    return ParameterSet(items, (PriorCorrelation("E", "yield_stress", pulled * E.prior_sd / sd),))


def fitted_range(name: str, food: FoodSpec) -> Parameter:
    """A property that is fitted by its logarithm, with the food's own range of it.

    Raises:
        MaterialError: A range from which it cannot be fitted, or no range.
    """
    rule, (low, high) = rule_of(name), food.prior(name)
    value = food.value(name)
    assert value is not None  # prior() has a range only where there is a value
    if low <= 0:
        raise MaterialError(f"{food.name}: {name} cannot be fitted from a range that starts at {low:g} {rule.unit}")
    bottom, top = max(rule.low, low / BOUND_FACTOR), min(rule.high, high * BOUND_FACTOR)
    return Parameter(name, value, bottom, top, rule.unit, low, high)


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
