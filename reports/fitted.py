"""The page of the fitted parameters: values, intervals and what one force curve cannot tell apart."""

from __future__ import annotations

import math

from reports.document import breakable, interval, listed, plain, quantity
from reports.finished import Data
from reports.parameters import Row
from reports.words import meaning, short, words

#: Correlations of fitted parameters from here on are worth a sentence: at 0.9 an interval is 2.3 times as
#: wide as it would be if the other parameter were known, 1 / sqrt(1 - r^2).
STRONG = 0.9
#: Letters of names and verdicts in the parameter figure.
LABEL, VERDICT = 20, 30


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
