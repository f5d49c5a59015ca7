"""Laws of rate judged by the speeds that they have not seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import t as student

from calib.errors import TraceError
from calib.texture.bite_path import BitePath
from calib.texture.law_fit import PARAMETERS, LawFit, SpeedGroup, fit_law
from calib.texture.law_result import LawParameter, LawResult, LeftOutSpeed, PredictedQuantity
from calib.texture.plate_record import PlateRecord, RecordedFile
from calib.texture.repeats import area_metric, scatter
from calib.texture.texture_profile import TextureProfile, in_words, texture_profile
from mpm.arrays import FloatArray

LOADED = 0.05
"""Part of the peak of a mean bite above which the curve is judged [-]: below it the load is that of the sensor."""
INSIDE = 0.95
"""Least part of a curve within the scatter."""
OTHER_BATCH = 2.0
"""Standard deviations of a group's factor beyond which its specimens are of another stiffness."""
JUDGED = ("hardness_N", "cohesiveness", "springiness", "resilience")
JUDGED_TOTAL = len(JUDGED) + 1
"""Quantities of a speed that are judged: those, and the curve."""
RESAMPLED = 4000
"""Samples of a predicted record, whose texture profile is taken as of a measured one."""


def law_of_direction(
    direction: str, groups: Sequence[SpeedGroup], profiles: Sequence[Sequence[TextureProfile]], area: float
) -> tuple[LawResult, dict[str, FloatArray]]:
    """The law of all speeds of a direction, and each speed by the law of the others.

    Damage is in the law where the information criterion of the fit to all speeds is for it.

    Args:
        direction: Its name.
        groups: Groups of the direction.
        profiles: Texture profiles of the repeats of each group.
        area: Area of the specimens [m^2].

    Returns:
        The law, and the predicted stress of each group that was left out at the times of its path [Pa], shape (n,).

    Raises:
        CurveError: There is one speed alone.
    """
    without, with_damage = (fit_law(groups, damaged=damaged) for damaged in (False, True))
    evidence = without.bic - with_damage.bic
    whole = with_damage if evidence > 0.0 else without
    told: list[LeftOutSpeed] = []
    curves: dict[str, FloatArray] = {}
    for k, group in enumerate(groups):
        others = [*groups[:k], *groups[k + 1 :]]
        if len(others) < 2:
            break
        fit = fit_law(others, damaged=evidence > 0.0)
        curves[group.name] = fit.law.stress(*group.path.history())
        speeds = [other.path.descent_s for other in others]
        beyond = not min(speeds) < group.path.descent_s < max(speeds)
        one = _judged(group, curves[group.name], profiles[k], area)
        one = replace(one, parameters=_parameters(fit), extrapolated=beyond, factor=whole.factors[k])
        told.append(replace(one, why=_why(one, group, others)))
    return LawResult(direction, _parameters(whole), evidence, tuple(told)), curves


def _parameters(fit: LawFit) -> tuple[LawParameter, ...]:
    """The parameters with their intervals."""
    values = zip(PARAMETERS, fit.low, fit.high, strict=True)
    return tuple(LawParameter(name, float(getattr(fit.law, name)), low, high) for name, low, high in values)


def _judged(group: SpeedGroup, predicted: FloatArray, profiles: Sequence[TextureProfile], area: float) -> LeftOutSpeed:
    """A prediction against the scatter of the repeats.

    Args:
        group: The group.
        predicted: Predicted stress at the times of its path [Pa], shape (n,).
        profiles: Texture profiles of its repeats.
        area: Area of the specimens [m^2].

    Returns:
        The speed; what is known of the fits is still to be filled in.
    """
    found = predicted_profile(group.path, predicted, area)
    quantities = []
    for name in JUDGED:
        values = np.array([getattr(one, name) for one in profiles])
        spread, value = scatter(values), float(getattr(found, name))
        quantities.append(
            PredictedQuantity(
                name,
                value,
                spread.mean,
                spread.next_low,
                spread.next_high,
                spread.next_low <= value <= spread.next_high if spread.repeats > 1 else None,
                area_metric(value, values) / abs(spread.mean),
                area_metric(spread.mean, values) / abs(spread.mean),
            )
        )
    return LeftOutSpeed(
        group.name, group.path.descent_s, (), tuple(quantities), _inside(group, predicted), False, 1.0,
        group.factor_sd, "",
    )  # fmt: skip


def _inside(group: SpeedGroup, predicted: FloatArray) -> float:
    """Part of the loaded curve within Student's 95 % scatter of one more repeat [-]; NaN for one repeat."""
    n = len(group.stress)
    if n < 2:
        return math.nan
    wide = float(student.ppf(0.975, n - 1)) * math.sqrt(1 + 1 / n) * group.stress.std(axis=0, ddof=1)
    loaded = group.mean > LOADED * group.mean.max()
    return float(np.mean(np.abs(predicted - group.mean)[loaded] <= wide[loaded]))


def predicted_profile(path: BitePath, stress: FloatArray, area: float) -> TextureProfile:
    """The texture profile of a predicted stress, taken as that of a record is.

    Args:
        path: Way of the plate.
        stress: Stress at its times [Pa], shape (n,).
        area: Area of the specimen [m^2].

    Returns:
        The profile; ways are those of a specimen of a height of 1 m.
    """
    time, strain = path.history()
    fine = np.linspace(time[0], time[-1], RESAMPLED)
    fine = np.unique(np.concatenate([fine, time]))
    way, load = np.interp(fine, time, strain), np.interp(fine, time, stress) * area
    file = RecordedFile("prediction", "", "", "", "")
    return texture_profile(PlateRecord("prediction", fine - fine[0], way, load, 1.0, file))[0]


def outside(one: LeftOutSpeed) -> int | None:
    """How many of a predicted speed's quantities and its curve lie outside the scatter of its repeats; None for one
    repeat, which has no scatter."""
    if any(each.inside is None for each in one.quantities):
        return None
    return sum(not each.inside for each in one.quantities) + (one.curve_inside < INSIDE)


def passes(one: LeftOutSpeed) -> bool | None:
    """Whether all of a predicted speed lies within the scatter of its repeats; None for one repeat."""
    count = outside(one)
    return None if count is None else not count


def _why(one: LeftOutSpeed, group: SpeedGroup, others: Sequence[SpeedGroup]) -> str:
    """Why a prediction fails, as far as the fit to all speeds and the order of the peaks tell.

    Args:
        one: The speed, judged.
        group: Its group.
        others: The other groups.

    Returns:
        The reasons; empty where it passes.
    """
    passed = passes(one)
    if passed is None:
        return "one repeat has no scatter"
    if passed:
        return ""
    out = [f"{in_words(each.quantity)} is outside" for each in one.quantities if not each.inside]
    if one.curve_inside < INSIDE:
        out.append(f"{1 - one.curve_inside:.0%} of the curve is outside")
    apart = math.log(one.factor) / one.factor_sd
    if abs(apart) > OTHER_BATCH:
        out.append(
            f"its specimens are {one.factor:.2g} times as stiff as the law of all speeds, {abs(apart):.1f} standard "
            "deviations of their mean: another batch, or no law of rate"
        )
    against = [other.name for other in others if _disordered(group, other)]
    if against:
        out.append(
            f"of it and {' and '.join(against)} the slower one is harder, beyond the scatter of the means, which "
            f"relaxation never makes"
        )
    if one.extrapolated:
        out.append("the speed lies outside those that were fitted")
    return "; ".join(out)


def _disordered(group: SpeedGroup, other: SpeedGroup) -> bool:
    """Whether the slower of two groups has the higher peak, by more than 2 standard deviations of the means."""
    slow, fast = (group, other) if group.path.descent_s > other.path.descent_s else (other, group)
    rise = math.log(float(slow.stress.max(axis=1).mean() / fast.stress.max(axis=1).mean()))
    return rise > OTHER_BATCH * math.hypot(slow.factor_sd, fast.factor_sd)


def heights_of(records: Sequence[PlateRecord], given: float | None) -> list[float]:
    """Heights of specimens [m].

    Args:
        records: Their records.
        given: Height of every specimen [m]; None for the first gap of each record.

    Returns:
        A height for each record.

    Raises:
        TraceError: A record has no gap, and no height is given.
    """
    for record in records:
        if given is None and record.gap is None:
            raise TraceError(
                f"{record.file.name}: a law needs the height of each specimen, which is the first value of a column "
                "gap; give it with --height"
            )
    return [record.height(given) for record in records]
