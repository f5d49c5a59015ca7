"""Parameters that end at a bound: one of ours, or the end of what is possible."""

from __future__ import annotations

from calib.material.scene import FITTED_SIZES
from calib.uncertainty.estimates import FittedParameter

# Ends of what is physically possible: a fit that ends there found a one-sided answer (the cut shows no friction, say),
# whereas one that ends on a bound of ours asks for a value that it was not allowed.
NATURAL_LIMITS = {"mu": 0.0, "strength_ratio": 1.0}
AT_BOUND, AT_LIMIT = "at_bound", "at_limit"


def _at_natural_limit(name: str, p: FittedParameter) -> bool:
    """Whether a parameter at a bound is at the end of what is possible: its interval reaches there, and its value is
    nearer to that end than to the other."""
    limit = NATURAL_LIMITS.get(name)
    if limit is None or p.low95 is None or p.high95 is None:
        return False
    within = p.low95 * (1 - 1e-9) <= limit <= p.high95 * (1 + 1e-9)
    return within and abs(p.value - limit) < max(p.value - p.low95, p.high95 - p.value)


def bound_word(name: str, p: FittedParameter) -> str:
    """The verdict on a fitted parameter, where a bound that is the end of what is possible has a word of its own.

    Args:
        name: The parameter.
        p: What the fit says of it.

    Returns:
        :data:`AT_LIMIT` for :data:`AT_BOUND` at the end of what is possible, else the verdict as it is.
    """
    return AT_LIMIT if p.verdict == AT_BOUND and (name in FITTED_SIZES or _at_natural_limit(name, p)) else p.verdict
