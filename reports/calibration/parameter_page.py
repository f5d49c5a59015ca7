"""The page of the fitted parameters: values, intervals and what one force curve cannot tell apart."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from reports.base.format import breakable, interval, listed, plain, quantity, rung
from reports.base.labels import in_words, short, source_in_words
from reports.base.run_folder import Data
from reports.calibration.parameter_figures import Panel, ParameterRange

if TYPE_CHECKING:
    from calib.calibration.result_parts import FixedParameter, ProfileCurve, SobolIndices
    from calib.uncertainty.estimates import FittedParameter

#: Correlations of fitted parameters from here on are worth a sentence: at 0.9 an interval is 2.3 times as
#: wide as it would be if the other parameter were known, 1 / sqrt(1 - r^2).
STRONG = 0.9
#: Letters of names and verdicts in the parameter figure.
LABEL, VERDICT = 20, 34
#: Verdicts in the order of what the trace says, and what they mean.
IDENTIFIABILITY = {
    "identified": "the trace alone bounds it on both sides, to 10 % or better",
    "weak": "bounded on both sides, but not so well",
    "one_sided": "the trace bounds one side; the other is the literature's, or what is possible",
    "only_as_product": "known times the width of the specimen and the gain of the sensor, or times another parameter",
    "not_seen": "the trace bounds neither side: the interval is the literature's, and the value is of one food of many "
    "that draw the curve",
    "at_bound": "the fit ran into the end of what was allowed, and fails for it",
    "at_limit": "the best value is the end of what is possible, such as no friction: a result, no failure",
    "unknown": "the fit ended before it was known how far the value may be off",
}
#: What the sensitivity is of, and the part of the variance from which on a parameter is named.
QUANTITIES = {"peak": "peak", "work": "work", "initial_slope": "initial slope"}
NAMED = 0.1


def parameter_range(name: str, p: FittedParameter) -> ParameterRange:
    """A parameter over the middle of its literature range."""
    middle = _middle(p)
    over = [None if x is None else x / middle for x in (p.low95, p.high95, p.prior_low, p.prior_high)]
    note = f"{quantity(p.value, p.unit)}\n{short(in_words(p.verdict), VERDICT)}"
    return ParameterRange(short(name, LABEL), note, p.value / middle, *over)


def _middle(p: FittedParameter) -> float:
    """Geometric middle of the literature range; arithmetic if it starts at 0, the value if there is none."""
    low, high = p.prior_low, p.prior_high
    if low is None or high is None or not low + high > 0.0:
        return abs(p.value) or 1.0
    return math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)


def parameter(name: str, p: FittedParameter, meaning: str) -> Data:
    """One line of the table of fitted values.

    Args:
        name: The parameter.
        p: Its value and intervals.
        meaning: What it is, in words.

    Returns:
        The cells by name, and whether the value lies outside of the literature's range.
    """
    low, high, value, unit = p.prior_low, p.prior_high, p.value, p.unit
    return {
        "name": breakable(name),
        "meaning": meaning,
        "value": quantity(value, unit),
        "interval": interval(p.low95, p.high95, unit, like=value),
        "literature": interval(low, high, unit, like=value),
        "verdict": in_words(p.verdict),
        "outside": (low is not None and value < low) or (high is not None and value > high),
        "status": in_words(p.status),
        "source": source_in_words(p.source or ""),
    }


def fixed(name: str, p: FixedParameter, meaning: str) -> list[str]:
    """One line of the table of values that were not fitted.

    Args:
        name: The property.
        p: Its value.
        meaning: What it is, in words.

    Returns:
        The cells.
    """
    value = "none" if p.value is None else quantity(p.value, p.unit)
    return [breakable(name), meaning, value, in_words(p.status), source_in_words(p.source or "")]


def correlations(correlations: Mapping[str, float | None]) -> list[str]:
    """Pairs that one force curve cannot tell apart, the strongest first."""
    strong = [(names, r) for names, r in correlations.items() if r is not None and abs(r) >= STRONG]
    means = {True: "raising both together", False: "raising one and lowering the other"}
    return [f"{listed(names.split(','))}, r = {plain(r, 2)}: {means[r > 0.0]} hardly changes the force."
            for names, r in sorted(strong, key=lambda item: -abs(item[1]))]  # fmt: skip


def correlation_matrix(correlations: Mapping[str, float | None], names: Sequence[str]) -> tuple[list[str], np.ndarray]:
    """The correlations of the fitted parameters as a matrix.

    Args:
        correlations: By "one,other"; each pair in one order or in both.
        names: The parameters.

    Returns:
        Names of those that have a correlation with another one, and the matrix (k, k), NaN where a pair is not known.
    """
    known = {frozenset(pair.split(",")): c for pair, c in correlations.items() if c is not None}
    seen = [name for name in names if any(name in pair for pair in known)]
    rows = [[1.0 if a == b else known.get(frozenset((a, b)), np.nan) for b in seen] for a in seen]
    return seen, np.array(rows, dtype=float).reshape(len(seen), len(seen))


def pair(names: Sequence[str], matrix: np.ndarray) -> str:
    """The correlation of two parameters in words; empty for more of them, which a figure shows, and for fewer."""
    if len(names) != 2 or not np.isfinite(matrix[1, 0]):
        return ""
    return f"{listed(list(names))}, r = {quantity(float(matrix[1, 0]), '-', digits=2, signed=True)}"


def legend(fitted: Mapping[str, FittedParameter]) -> list[list[str]]:
    """The verdicts that occur, and what they mean."""
    present = {p.verdict for p in fitted.values()}
    return [[in_words(name), text] for name, text in IDENTIFIABILITY.items() if name in present]


def panels(profiles: Mapping[str, ProfileCurve], fitted: Mapping[str, FittedParameter]) -> list[Panel]:
    """Profiles in the unit that people use; those of fewer than two points are left out."""
    out = []
    for name, profile in profiles.items():
        x = np.array(profile.value, dtype=float)
        if len(x) < 2 or np.ptp(x) == 0.0:
            continue
        p = fitted.get(name)
        unit, low, high = ("-", None, None) if p is None else (p.unit, p.prior_low, p.prior_high)
        factor, text = rung(unit, float(np.median(np.abs(x))))
        rise, alone = (np.array(column, dtype=float) for column in (profile.rise, profile.trace_alone))
        value = None if p is None else p.value / factor
        prior = None if low is None or high is None else (low / factor, high / factor)
        ends = None if p is None or p.low95 is None or p.high95 is None else (p.low95 / factor, p.high95 / factor)
        title = f"{short(name, LABEL)} [{text}]" if text else short(name, LABEL)
        out.append(Panel(title, x / factor, rise, alone, value, ends, prior, unit != "-" and bool(np.all(x > 0.0))))
    return out


def influences(sensitivity: Mapping[str, Mapping[str, SobolIndices]]) -> list[str]:
    """Which parameters move each quantity of the curve, the strongest first."""
    said = []
    for quantity_, rows in sensitivity.items():
        totals = {name: row.total for name, row in rows.items() if row.total is not None}
        strong = sorted((name for name in totals if totals[name] >= NAMED), key=lambda name: -totals[name])
        if strong:
            parts = [f"{name} ({quantity(totals[name], 'fraction', digits=2)})" for name in strong]
            said.append(f"{QUANTITIES.get(quantity_, in_words(quantity_)).capitalize()}: {listed(parts)}.")
    return said


def influence_caption() -> str:
    """What the figure of the influences shows, with its citation."""
    return (
        "What moves the curve: part of the variance of each quantity while all parameters range over the literature's "
        "ranges, of one alone (first-order Sobol index), and with what it does together with others (total index) "
        "[@Sobol 2001]. Computed on the surrogate, a statistical model of the curve between the simulated ones, which "
        "is an extrapolation far from them."
    )
