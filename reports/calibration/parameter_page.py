"""The page of the fitted parameters: values, intervals and what one force curve cannot tell apart."""

from __future__ import annotations

import math

import numpy as np

from reports.base.format import breakable, interval, listed, plain, quantity, rung
from reports.base.labels import meaning, short, words
from reports.base.run_folder import Data
from reports.calibration.parameter_figures import Panel, Row

#: Correlations of fitted parameters from here on are worth a sentence: at 0.9 an interval is 2.3 times as
#: wide as it would be if the other parameter were known, 1 / sqrt(1 - r^2).
STRONG = 0.9
#: Letters of names and verdicts in the parameter figure.
LABEL, VERDICT = 20, 34
#: Verdicts in the order of what the trace says, and what they mean.
VERDICTS = {
    "identified": "the trace alone bounds it on both sides, to 10 % or better",
    "weak": "bounded on both sides, but not so well",
    "one_sided": "the trace bounds one side; the other is the literature's, or what is possible",
    "only_as_product": "known times the width of the specimen and the gain of the sensor, or times another parameter",
    "not_seen": "the trace bounds neither side: the value is the literature's",
    "at_bound": "the fit ran into the end of what was allowed",
}
#: What the sensitivity is of, and the part of the variance from which on a parameter is named.
QUANTITIES = {"peak": "peak", "work": "work", "initial_slope": "initial slope"}
NAMED = 0.1


def row(name: str, p: Data) -> Row:
    """A parameter over the middle of its literature range."""
    middle = _middle(p)
    over = [None if p[k] is None else p[k] / middle for k in ("low95", "high95", "prior_low", "prior_high")]
    note = f"{quantity(p['value'], p['unit'])}\n{short(words(p['verdict']), VERDICT)}"
    return Row(short(name, LABEL), note, p["value"] / middle, *over)


def _middle(p: Data) -> float:
    """Geometric middle of the literature range; arithmetic if it starts at 0, the value if there is none."""
    low, high = p["prior_low"], p["prior_high"]
    if low is None or high is None or not low + high > 0.0:
        return abs(p["value"]) or 1.0
    return math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)


def parameter(name: str, p: Data) -> Data:
    """One line of the table of fitted values."""
    low, high, value, unit = p["prior_low"], p["prior_high"], p["value"], p["unit"]
    return {
        "name": breakable(name),
        "meaning": meaning(name),
        "value": quantity(value, unit),
        "interval": interval(p["low95"], p["high95"], unit),
        "literature": interval(low, high, unit),
        "verdict": words(p["verdict"]),
        "outside": (low is not None and value < low) or (high is not None and value > high),
        "status": words(p["status"]),
        "source": p["source"] or "",
    }


def fixed(name: str, p: Data) -> list[str]:
    """One line of the table of values that were not fitted."""
    value = "none" if p["value"] is None else quantity(p["value"], p["unit"])
    return [breakable(name), meaning(name), value, words(p["status"]), p["source"] or ""]


def correlations(correlations: Data) -> list[str]:
    """Pairs that one force curve cannot tell apart, the strongest first."""
    strong = [(names, r) for names, r in correlations.items() if r is not None and abs(r) >= STRONG]
    means = {True: "raising both together", False: "raising one and lowering the other"}
    return [f"{listed(names.split(','))}, r = {plain(r, 2)}: {means[r > 0.0]} hardly changes the force."
            for names, r in sorted(strong, key=lambda item: -abs(item[1]))]  # fmt: skip


def legend(parameters: Data) -> list[list[str]]:
    """The verdicts that occur, and what they mean."""
    present = {p["verdict"] for p in parameters.values()}
    return [[words(name), text] for name, text in VERDICTS.items() if name in present]


def panels(profiles: Data, parameters: Data) -> list[Panel]:
    """Profiles in the unit that people use; those of fewer than two points are left out."""
    out = []
    for name, profile in profiles.items():
        x = np.array(profile["value"], dtype=float)
        if len(x) < 2 or np.ptp(x) == 0.0:
            continue
        p = parameters.get(name, {})
        unit, low, high = p.get("unit", "-"), p.get("prior_low"), p.get("prior_high")
        factor, text = rung(unit, float(np.median(np.abs(x))))
        rise, alone = (np.array(profile[key], dtype=float) for key in ("rise", "trace_alone"))
        value = p["value"] / factor if p else None
        prior = None if low is None or high is None else (low / factor, high / factor)
        title = f"{short(name, LABEL)} [{text}]" if text else short(name, LABEL)
        out.append(Panel(title, x / factor, rise, alone, value, prior, unit != "-" and bool(np.all(x > 0.0))))
    return out


def influences(sensitivity: Data) -> list[str]:
    """Which parameters move each quantity of the curve, the strongest first."""
    said = []
    for quantity_, rows in sensitivity.items():
        totals = {name: row["total"] for name, row in rows.items() if row["total"] is not None}
        strong = sorted((name for name in totals if totals[name] >= NAMED), key=lambda name: -totals[name])
        if strong:
            parts = [f"{name} ({quantity(totals[name], 'fraction', digits=2)})" for name in strong]
            said.append(f"{QUANTITIES.get(quantity_, words(quantity_)).capitalize()}: {listed(parts)}.")
    return said
