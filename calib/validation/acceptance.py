"""The lines of a report's verdict table: value, limit, passed; and in words what was not shown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from calib.problem.nuisance import OUTSIDE
from calib.problem.parameters import plain
from calib.simulation.evaluation import PARTED
from calib.validation.metrics import Metrics
from calib.validation.numerical_checks import FINER, FINER_GRID, Check

# Limits of a single in-sample calibration. Peak: the figure that published work quotes (CulinaryCut, "within 5 %").
# Curve and shape: twice the target of a validated model (5 %), because absolute forces of the sensors that such traces
# come from are themselves uncertain by 10 % and more.
PEAK_LIMIT = 0.05
NRMSE_LIMIT = 0.08
SHAPE_LIMIT = 0.08
MOMENTUM_LIMIT = 0.01
CHANGE_LIMIT = 0.05  # of peak and work by numerical choices: as much as the peak may miss the trace
LOSS_LIMIT = 0.05  # energy lost by the discretisation, of all work: the force is too large by about that
PRESSED, PRESSED_LIMIT = "food pressed away, not parted", round(1.0 - PARTED, 6)
KINETIC_LIMIT = 0.10  # explicit quasi-static practice: kinetic energy below 5 to 10 % of internal energy
# Ends of what is physically possible: a fit that ends there found a one-sided answer (the cut shows no friction, say),
# whereas one that ends on a bound of ours asks for a value that it was not allowed.
NATURAL_LIMITS = {"mu": 0.0}
SIZE = "height"  # the specimen's, bounded by what is possible: a bound that is reached is a result


@dataclass(frozen=True)
class Verdict:
    """One line of the table. ``passed`` None: not run."""

    name: str
    value: float | None
    limit: float | None
    unit: str
    passed: bool | None
    note: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        return asdict(self)


def _below(name: str, value: float, limit: float, unit: str = "fraction", note: str = "") -> Verdict:
    return Verdict(name, value, limit, unit, bool(abs(value) <= limit), note)


def changes(checks: Sequence[Check]) -> list[Verdict]:
    """Lines of what numerical choices change, and of what the finer grid says of the energy that is lost."""
    return [*(_change(c) for c in checks), *(_loss(c) for c in checks if c.name == FINER_GRID)]


def _change(check: Check) -> Verdict:
    change = check.change
    if change is None:
        return Verdict(check.name, None, CHANGE_LIMIT, "fraction", False, f"broke down: {check.reason}")
    note = f"peak {check.peak_change:+.1%}, work {check.work_change:+.1%}"
    return Verdict(check.name, change, CHANGE_LIMIT, "fraction", change <= CHANGE_LIMIT, note)


JUDGED = {"lag": "delay of the trace within its uncertainty", "gain": "sensor's gain within its uncertainty"}
"""Nuisances that the validation hangs on, in words: a trace that asks for more of them than its sensor leaves open fails."""


def _nuisance(name: str, n: Mapping[str, Any]) -> Verdict:
    size = abs(n["value"]) / n["prior_sd"]
    unit = "" if n["unit"] == "-" else f" {n['unit']}"
    note = f"{name} {n['value']:+.2g} ± {n['sd']:.1g}{unit}, expected 0 ± {n['prior_sd']:.1g}{unit}"
    return Verdict(JUDGED[name], size, OUTSIDE, "sd", not n["outside"], note)


WORTH_SAYING = 0.1  # energy released ahead of the edge, over that spent at it


def _loss(finer: Check) -> Verdict:
    """What of the energy that no law has taken follows the grid, as a first-order error; the rest is released by the crack."""
    name, change = "energy lost by the discretisation", finer.unbooked_change
    if change is None:
        return Verdict(name, None, LOSS_LIMIT, "fraction", False, f"{finer.name} broke down")
    note = f"of the work; what no law took changes by {change:+.1%} on {finer.name}"
    return _below(name, abs(change) / (1 - FINER), LOSS_LIMIT, note=note)


def balances(momentum_residual: float, ke_over_ie: float, parted: float) -> list[Verdict]:
    """Lines of what every evaluation keeps: momentum, kinetic energy, and whether the food was cut.

    Args:
        momentum_residual: Momentum balance that does not close, part of the peak [-].
        ke_over_ie: Kinetic over internal energy [-].
        parted: Energy of the edge over R times the new area [-]; NaN where there is nothing to judge, and no line.
    """
    note = f"the edge took {parted:.0%} of R times the new area"
    cut = [] if math.isnan(parted) else [_below(PRESSED, max(0.0, 1.0 - parted), PRESSED_LIMIT, note=note)]
    return [
        *cut,
        _below("momentum balance residual", momentum_residual, MOMENTUM_LIMIT, note="part of the peak force"),
        _below("kinetic over internal energy", ke_over_ie, KINETIC_LIMIT),
    ]


def agreement(metrics: Metrics) -> list[Verdict]:
    """Lines of the agreement with the trace: peak, curve, shape."""
    return [
        _below("peak force error", metrics.peak_error, PEAK_LIMIT),
        _below("curve error (NRMSE)", metrics.nrmse, NRMSE_LIMIT),
        _below("normalised-shape error", metrics.shape_error, SHAPE_LIMIT),
    ]


def _at_natural_limit(name: str, parameter: Mapping[str, Any]) -> bool:
    """Whether a parameter at a bound is at the end of what is possible: its interval reaches there, and its value is nearer to that end."""
    limit = NATURAL_LIMITS.get(name, -math.inf)
    value, low, high = (parameter[q] for q in ("value", "low95", "high95"))
    return bool(low <= limit and value - limit < high - value)


def judge(
    metrics: Metrics,
    nulls: Mapping[str, Metrics],
    *,
    momentum_residual: float,
    ke_over_ie: float,
    parted: float = math.nan,
    parameters: Mapping[str, Mapping[str, Any]],
    checks: Sequence[Check] = (),
    nuisances: Mapping[str, Mapping[str, Any]] | None = None,
) -> list[Verdict]:
    """The verdict table of a calibration.

    Args:
        metrics: Simulation against trace.
        nulls: Null models against trace.
        momentum_residual: Momentum balance that does not close, part of the peak [-].
        ke_over_ie: Kinetic over internal energy [-].
        parted: Energy of the edge over R times the new area [-].
        parameters: Fitted parameters with their verdicts.
        checks: What numerical choices change; none were made where the fit was interrupted.
        nuisances: What the fit says of the measurement: value, sd, prior_sd, unit and outside, by name.

    Returns:
        All lines; those with ``passed`` None were not run and decide nothing.
    """
    lines = agreement(metrics)
    simple = {n: m for n, m in nulls.items() if n in ("ramp", "half_sine")}
    best = min(simple, key=lambda n: simple[n].shape_error)
    lines.append(
        Verdict(
            "shape better than ramp and half sine",
            metrics.shape_error,
            simple[best].shape_error,
            "fraction",
            metrics.shape_error < simple[best].shape_error,
            f"best null model: {best.replace('_', ' ')}",
        )
    )
    lines += [*balances(momentum_residual, ke_over_ie, parted), *changes(checks)]
    lines += [_nuisance(name, n) for name, n in (nuisances or {}).items() if name in JUDGED]
    on = [n for n, p in parameters.items() if p["verdict"] == "at_bound"]
    stuck = [n for n in on if n != SIZE and not _at_natural_limit(n, parameters[n])]
    note = ", ".join(stuck + [f"{n} at its natural limit" for n in on if n not in stuck])
    lines.append(Verdict("parameters at a bound", len(stuck), 0, "", not stuck, note))
    for name in ("held-out specimens", "grid convergence of the calibrated force", "repeated cuts"):
        lines.append(Verdict(name, None, None, "", None, "not run"))
    return lines


HELD_WEAK = {"R": 0.92, "R_skin": 0.90, "E": 0.88, "yield_stress": 0.80, "initiation_depth": 0.84}
"""Part of the weak 95 % intervals that held the truth on 100 made-up bananas, where it is less and there are
more than ten (docs/pitfalls.md, how far to trust an interval)."""


def limits(
    label: str,
    stroke_source: str,
    baseline_kind: str,
    verdicts: list[Verdict],
    parameters: Mapping[str, Mapping[str, Any]],
    assumptions: list[str],
    fracture: Mapping[str, float] | None = None,
) -> list[str]:
    """What the calibration does not show, one sentence each."""
    said = []
    if label != "measured":
        said.append(f"The trace is {label}, not a measurement: agreement with it says nothing about a real food.")
    said.append("All figures are in-sample: the same trace was fitted and compared. Nothing here is validated.")
    said += [f"{v.name}: failed; see the first page." for v in verdicts if v.passed is False]
    unseen = [n for n, p in parameters.items() if p["verdict"] in ("not_seen", "weak", "one_sided")]
    if unseen:
        said.append(
            f"The trace hardly sees {', '.join(unseen)}: these values are the literature's as much as the trace's."
        )
    held = [
        f"{HELD_WEAK[plain(n)]:.0%} for {n}"
        for n, p in parameters.items()
        if p["verdict"] == "weak" and plain(n) in HELD_WEAK
    ]
    if held:
        said.append(
            f"Weak intervals hold the truth less often than in 95 %: of 100 made-up banana cuts in {', '.join(held)}."
        )
    if stroke_source != "position":
        how = (
            "one constant speed" if stroke_source == "speed" else "one constant speed and a stroke of the food's height"
        )
        said.append(f"The trace has no position: its stroke axis rests on {how}.")
    if baseline_kind == "constant":
        said.append("A constant baseline was subtracted: drift of the sensor along the stroke is in the force.")
    said += [a[0].upper() + a[1:] + "." for a in assumptions]
    if fracture is not None and fracture["released_J_m2"] > WORTH_SAYING * fracture["edge_J_m2"]:
        edge, released = fracture["edge_J_m2"], fracture["released_J_m2"]
        said.append(
            f"R is the resistance at the edge, not all that new surface costs: {edge:.3g} J/m² went there and {released:.3g} J/m² were "
            "released where the blade bends the halves apart ahead of it. Compare their sum with published works of fracture."
        )
    said.append("One cut of one specimen says nothing about the scatter between specimens.")
    said.append(
        "The laws are independent of rate; relaxation, adhesion and moisture were not simulated, and the lower skin of a "
        "whole fruit is not cut."
    )
    said.append(
        "The blade lay on a plane of the grid's nodes. Between two planes the same values give other work, by 1 % in a stiff food "
        "with little friction and by 10 to 20 % where a soft one flows or rubs hard (cutcal converge --material --offset 0.5 measures it)."
    )
    said.append(
        "One finer grid was tried, which gives a difference but neither an order nor an uncertainty (cutcal converge --material "
        "measures both; calibrate --u-num takes them into the likelihood)."
    )
    said += [f"{remedy[0].upper()}{remedy[1:]}." for remedy in map(remedied, verdicts) if remedy]
    return said


def remedied(line: Verdict) -> str:
    """What to do about a line of the table that failed, where a command does it; empty for all others."""
    if line.name != FINER_GRID or line.passed is not False:
        return ""
    return (
        "values and intervals answer for these cells alone: cutcal converge --material measures what they leave out, and the same "
        "calibration with --u-num takes it into the likelihood"
    )
