"""What a fit says of the published numbers and of the properties, with the bands of its draws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from calib.material.properties import rule_of
from calib.scalars.gauss_newton import Minimum
from calib.scalars.published_data import CUT_ENERGY, PEAK_FORCE, PublishedCut, PublishedData, PublishedNumber
from calib.scalars.randomised_likelihood import RandomisedFits
from calib.scalars.result import DrawCounts, FittedNumbers, FullnessResult, NumberResult, PropertyResult

BAND_QUANTILES = (0.025, 0.975)


def fitted_numbers(
    published: PublishedData, best: Minimum, found: Mapping[str, Mapping[str, float]], drawn: RandomisedFits
) -> FittedNumbers:
    """Properties, each number with its prediction and band, and the fullness of each cut.

    Args:
        published: What was published.
        best: The fit.
        found: Logarithms [-] by cut and quantity on the default grid at the best values.
        drawn: The draws.

    Returns:
        The numbers.
    """
    numbers = [
        _number(cut, number, role, found[cut.name][number.quantity], drawn)
        for cut in published.cuts
        for role, numbers in (("given", cut.given), ("predicted", cut.predicted))
        for number in numbers
    ]
    return FittedNumbers(
        source=published.source,
        food=published.food.name,
        knife=published.knife.name,
        limit=published.limit,
        fit=published.fit,
        vary=published.vary,
        parameters=_properties(published, best, drawn),
        numbers=tuple(numbers),
        fullness=tuple(_fullness(cut, found[cut.name]) for cut in published.cuts),
        draws=DrawCounts(len(drawn.numbers), drawn.unmet, drawn.broken),
    )


def _number(cut: PublishedCut, number: PublishedNumber, role: str, log: float, drawn: RandomisedFits) -> NumberResult:
    """One number: published, simulated, and between which ends the draws have it."""
    error = log - math.log(number.value)
    draws = [one[cut.name, number.quantity] for one in drawn.numbers]
    low, high = (float(x) for x in np.exp(_ends(draws)))
    return NumberResult(
        specimen=cut.name,
        quantity=number.quantity,
        role=role,
        published=number.value,
        relative_sd=number.relative_sd,
        simulated=math.exp(log),
        error=math.expm1(error),
        misfit_sd=error / number.relative_sd,
        low95=low,
        high95=high,
        inside=bool(low <= number.value <= high) if draws else None,
    )


def _ends(draws: Sequence[float]) -> tuple[float, float]:
    """Ends of the band of some draws, NaN where there are none."""
    if not draws:
        return math.nan, math.nan
    low, high = np.quantile(draws, BAND_QUANTILES)
    return float(low), float(high)


def _fullness(cut: PublishedCut, found: Mapping[str, float]) -> FullnessResult:
    """Largest over mean force: as published, as simulated, and where the force goes with the width cut."""
    simulated = math.exp(found[PEAK_FORCE] - found[CUT_ENERGY]) * cut.shape.height / cut.area
    return FullnessResult(cut.name, cut.fullness, simulated, cut.uniform_fullness)


def _properties(published: PublishedData, best: Minimum, drawn: RandomisedFits) -> dict[str, PropertyResult]:
    """Each fitted and drawn property: value, where the draws that met the given numbers have it, and its prior."""
    values = [("fitted", name, x) for name, x in published.fitted.to_dict(best.z).items()]
    for name in published.vary:
        known = published.food.value(name)
        values.append(("drawn", name, math.nan if known is None else known))
    out = {}
    for role, name, value in values:
        low, high = _ends([one[name] for one in drawn.values])
        prior_low, prior_high = published.food.prior(name)
        out[name] = PropertyResult(
            role=role,
            value=value,
            unit=rule_of(name).unit,
            low95=low,
            high95=high,
            prior_low=prior_low,
            prior_high=prior_high,
        )
    return out
