"""The lines of a report's verdict table: value, limit, passed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from calib.io.typed_document import ANY, FORMER, to_document
from calib.problem.nuisance import OUTSIDE
from calib.problem.objective import EXPLAINED
from calib.simulation.evaluation import FULLY_PARTED, Evaluation
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.validation.bounds import AT_BOUND, AT_LIMIT, bound_word
from calib.validation.metrics import Metrics
from calib.validation.numerical_checks import (
    CHANGE_LIMIT,
    HALF_SPEED,
    QUARTER_SPEED,
    VARIANTS,
    Check,
    at_rest,
)
from calib.validation.predictive_score import PredictiveScore
from calib.validation.prior_conflict import PriorConflict
from mpm.output.number_text import before_and_after, quantity

# Limits of a single in-sample calibration. Peak: the figure that published work quotes (CulinaryCut, "within 5 %").
# Curve and shape: twice the target of a validated model (5 %), because absolute forces of the sensors that such traces
# come from are themselves uncertain by 10 % and more.
PEAK_LIMIT = 0.05
FIT_NRMSE_LIMIT = 0.08
SHAPE_LIMIT = 0.08
MOMENTUM_BALANCE_LIMIT = 0.01
LOSS_LIMIT = 0.05  # energy lost by the discretisation, of all work: the force is too large by about that
CURVE_LINE = "curve error (NRMSE)"
CONSTANTS_LINE = "constants of the method halved and doubled"
LOST = "energy lost by the discretisation"
PRESSED, PRESSED_LIMIT = "food pressed away, not parted", round(1.0 - FULLY_PARTED, 6)
KINETIC_LIMIT = 0.10  # explicit quasi-static practice: kinetic energy below 5 to 10 % of internal energy
EXPLAINED_LINE, EXPLAINED_LIMIT = "curve explained by the food", round(1.0 - EXPLAINED, 6)
CONFLICT_LINE, CONFLICT_LIMIT = "values those of the food", EXPLAINED_LIMIT
SIZE_LINE = "specimen no larger than the food"
BAND_LIMIT = 0.5  # a band wider than a quarter of the peak either way predicts nothing that anyone would use
NUISANCE_LINES = {"lag": "delay of the trace within its uncertainty", "gain": "sensor's gain within its uncertainty"}
"""Nuisances that the validation hangs on, and their lines: a trace that asks for more of one than its sensor leaves
open fails."""


@dataclass(frozen=True)
class Verdict:
    """One line of the verdict table.

    Attributes:
        name: What is judged.
        value: Its value [unit]; None where it was not run or broke down.
        limit: Largest value that passes [unit].
        unit: Unit of value and limit: ``fraction``, ``sd`` (standard deviations), or empty for a number of things.
        passed: Whether it passes; None: not run, decides nothing.
        note: Detail in words, may be empty.
        relation: ``<=`` or ``>=`` between value and limit, where the document of another version says so.
    """

    name: str
    value: float | None = field(metadata=ANY)
    limit: float | None = field(metadata=ANY)
    unit: str | None
    passed: bool | None
    note: str | None = ""
    relation: str | None = field(default=None, metadata=FORMER)

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return to_document(self)


@dataclass(frozen=True)
class Conservation:
    """What a simulated cut should keep.

    Attributes:
        momentum_residual: Momentum balance that does not close, part of the peak [-].
        ke_over_ie: Kinetic over internal energy [-].
        parted: Energy of new surface over R times its area [-]; NaN where there is nothing to judge.
        unbooked: Part of the work that no law has taken [-]; NaN where there is nothing to judge.
    """

    momentum_residual: float
    ke_over_ie: float
    parted: float = math.nan
    unbooked: float = math.nan

    @classmethod
    def of(cls, run: Evaluation) -> Conservation:
        """Of a simulation as it is stored."""
        return cls(run.scalars["momentum_residual"], run.scalars["ke_over_ie"], run.parted, run.unbooked)


def _below(name: str, value: float, limit: float, unit: str = "fraction", note: str = "") -> Verdict:
    return Verdict(name, value, limit, unit, bool(abs(value) <= limit), note)


def changes(checks: Sequence[Check]) -> list[Verdict]:
    """Lines of what numerical choices change: one each, and one for all constants of the method.

    What half the speed changes is carried on to rest (:func:`calib.validation.numerical_checks.at_rest`).
    """
    own = {c.name: [c] for c in checks if c.name in VARIANTS}
    own.get(HALF_SPEED, []).extend(c for c in checks if c.name == QUARTER_SPEED)
    others = [c for c in checks if c.name not in (*VARIANTS, QUARTER_SPEED)]
    return [*(_change(name, runs) for name, runs in own.items()), *([_constants(others)] if others else [])]


def _change(name: str, runs: Sequence[Check]) -> Verdict:
    """The line of one numerical choice: a single run, or those at smaller speeds."""
    broken = [c for c in runs if c.change is None]
    if broken:
        return Verdict(name, None, CHANGE_LIMIT, "fraction", False, f"broke down: {broken[0].reason}")
    peak, work, rest = runs[0].peak_change, runs[0].work_change, ""
    if name == HALF_SPEED:
        peak, work = at_rest(runs, lambda c: c.peak_change), at_rest(runs, lambda c: c.work_change)
        rest = ", extrapolated to rest" + (" from half and a quarter of it" if len(runs) > 1 else "")
    change = max(abs(peak or 0.0), abs(work or 0.0))
    return Verdict(name, change, CHANGE_LIMIT, "fraction", change <= CHANGE_LIMIT, _changed(peak, work) + rest)


def _changed(peak: float | None, work: float | None) -> str:
    """What a numerical choice changes, in words."""
    peak_text, work_text = (quantity(x, "fraction", signed=True) for x in (peak, work))
    return f"peak {peak_text}, work {work_text}"


def _constants(checks: Sequence[Check]) -> Verdict:
    """The line of the constants of the method: the largest change that halving or doubling one of them makes."""
    broken = [c for c in checks if c.change is None]
    if broken:
        note = f"{broken[0].name} broke down: {broken[0].reason}"
        return Verdict(CONSTANTS_LINE, None, CHANGE_LIMIT, "fraction", False, note)
    worst = max(checks, key=lambda c: c.change or 0.0)
    size = worst.change or 0.0
    note = f"most by {worst.name}: {_changed(worst.peak_change, worst.work_change)}"
    return Verdict(CONSTANTS_LINE, size, CHANGE_LIMIT, "fraction", size <= CHANGE_LIMIT, note)


def _nuisance(name: str, n: FittedNuisance) -> Verdict:
    size = abs(n.value) / n.prior_sd
    unit = "fraction" if n.unit == "-" else n.unit
    before, after = before_and_after(n.value, n.sd, n.prior_sd, unit)
    note = f"{name} {after}, expected {before}"
    return Verdict(NUISANCE_LINES[name], size, OUTSIDE, "sd", not n.outside, note)


def balances(kept: Conservation) -> list[Verdict]:
    """Lines of what every evaluation keeps: momentum, energy, little motion, and whether the food was cut.

    Args:
        kept: What a simulated cut kept; NaN where there is nothing to judge, and no line.

    Returns:
        The lines.
    """
    note = f"{quantity(kept.parted, 'fraction')} of R times the new area was taken"
    cut = [] if math.isnan(kept.parted) else [_below(PRESSED, max(0.0, 1.0 - kept.parted), PRESSED_LIMIT, note=note)]
    lost = [] if math.isnan(kept.unbooked) else [_below(LOST, kept.unbooked, LOSS_LIMIT, note="of the work")]
    momentum = kept.momentum_residual
    return [
        *cut,
        _below("momentum balance residual", momentum, MOMENTUM_BALANCE_LIMIT, note="part of the peak force"),
        _below("kinetic over internal energy", kept.ke_over_ie, KINETIC_LIMIT),
        *lost,
    ]


def agreement(metrics: Metrics) -> list[Verdict]:
    """Lines of the agreement with the trace: peak, curve, shape."""
    return [
        _below("peak force error", metrics.peak_error, PEAK_LIMIT),
        _below(CURVE_LINE, metrics.nrmse, FIT_NRMSE_LIMIT),
        _below("normalised-shape error", metrics.shape_error, SHAPE_LIMIT),
    ]


def discrimination(found: PredictiveScore) -> list[Verdict]:
    """Lines that a wrong food, a wrong knife or a band that holds anything does not pass.

    Args:
        found: How good the band is, and how probable the misfit.

    Returns:
        The lines.
    """
    name, limit = found.simple
    explained = bool(found.explained >= EXPLAINED_LIMIT)
    note = "probability of a larger misfit"
    return [
        Verdict(EXPLAINED_LINE, found.explained, EXPLAINED_LIMIT, "fraction", explained, note),
        *([] if found.conflict is None else [_conflict(found.conflict)]),
        *([] if found.size is None else [_size(found.size)]),
        _below("width of the 95 % band", found.width, BAND_LIMIT, note="mean, of the peak"),
        Verdict(
            "interval score better than null models",
            found.score,
            limit,
            "fraction",
            found.score < limit,
            f"{name.replace('_', ' ')}{_seven_numbers(found)}",
        ),
    ]


def _size(probability: float) -> Verdict:
    """The line of a specimen that is larger than the food is."""
    note = "probability of a whole food as large"
    return Verdict(SIZE_LINE, probability, CONFLICT_LIMIT, "fraction", bool(probability >= CONFLICT_LIMIT), note)


def _seven_numbers(found: PredictiveScore) -> str:
    """Whether the description with seven numbers, fitted alike, has the better score; it decides nothing."""
    score = found.null_scores.get("three_term")
    if score is None:
        return ""
    text = quantity(score, "fraction")
    return f"; no better than seven numbers ({text})" if score < found.score else f"; seven numbers: {text}"


def _conflict(found: PriorConflict) -> Verdict:
    """The line of values that the literature does not expect of the food."""
    told = f"{found.directions} combination{'s' * (found.directions > 1)}" if found.directions else "no combination"
    note = f"probability of values as far out; the trace tells {told}"
    if found.directions and found.furthest:
        note += f"; furthest: {found.furthest}, by {abs(found.distance):.1f} sd"
    passed = bool(found.probability >= CONFLICT_LIMIT)
    return Verdict(CONFLICT_LINE, found.probability, CONFLICT_LIMIT, "fraction", passed, note)


def judge(
    metrics: Metrics,
    nulls: Mapping[str, Metrics],
    *,
    conservation: Conservation,
    fitted: Mapping[str, FittedParameter],
    checks: Sequence[Check] = (),
    nuisances: Mapping[str, FittedNuisance] | None = None,
    predictive: PredictiveScore | None = None,
) -> list[Verdict]:
    """The verdict table of a calibration.

    Args:
        metrics: Simulation against trace.
        nulls: Null models against trace, by name.
        conservation: What the simulation kept.
        fitted: Fitted parameters by name.
        checks: What numerical choices change; none were made where the fit was interrupted.
        nuisances: What the fit says of the measurement, by name.
        predictive: How good the band is; None where the fit ended too early for one.

    Returns:
        All lines; those with ``passed`` None were not run and decide nothing.
    """
    lines = [*agreement(metrics), _against_nulls(metrics, nulls)]
    lines += [] if predictive is None else discrimination(predictive)
    lines += [*balances(conservation), *changes(checks)]
    lines += [_nuisance(name, n) for name, n in (nuisances or {}).items() if name in NUISANCE_LINES]
    lines.append(_bounds(fitted))
    for name in ("held-out specimens", "grid convergence of the calibrated force", "repeated cuts"):
        lines.append(Verdict(name, None, None, "", None, "not run"))
    return lines


def _against_nulls(metrics: Metrics, nulls: Mapping[str, Metrics]) -> Verdict:
    """The line of the shape against the better one of two null models."""
    simple = {n: m for n, m in nulls.items() if n in ("ramp", "half_sine")}
    best = min(simple, key=lambda n: simple[n].shape_error)
    limit = simple[best].shape_error
    return Verdict(
        "shape better than ramp and half sine",
        metrics.shape_error,
        limit,
        "fraction",
        metrics.shape_error < limit,
        f"best null model: {best.replace('_', ' ')}",
    )


def _bounds(fitted: Mapping[str, FittedParameter]) -> Verdict:
    """The line of parameters that ran into a bound of ours."""
    on = [n for n, p in fitted.items() if p.verdict in (AT_BOUND, AT_LIMIT)]
    stuck = [n for n in on if bound_word(n, fitted[n]) == AT_BOUND]
    note = ", ".join(stuck + [f"{n} at its natural limit" for n in on if n not in stuck])
    return Verdict("parameters at a bound", len(stuck), 0, "", not stuck, note)


def identified_words(fitted: Mapping[str, FittedParameter]) -> str:
    """How many of the fitted parameters the trace identifies, and which."""
    names = [name for name, p in fitted.items() if p.verdict == "identified"]
    which = f": {', '.join(names)}" if names else ""
    return f"{len(names)} of {len(fitted)} parameters identified{which}"
