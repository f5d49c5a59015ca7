"""Words for a parameter at a bound: one of ours, or the end of what is possible."""

from __future__ import annotations

import pytest

from calib.uncertainty.estimates import FittedParameter
from calib.validation.bounds import AT_BOUND, AT_LIMIT, bound_word


@pytest.mark.parametrize(
    ("name", "value", "interval", "word"),
    [
        ("mu", 0.02, (0.0, 0.3), AT_LIMIT),
        ("mu", 1.15, (0.2, 1.2), AT_BOUND),
        ("strength_ratio", 0.99, (0.5, 1.0), AT_LIMIT),
        ("strength_ratio", 0.09, (0.08, 0.4), AT_BOUND),
        ("R", 5000.0, (4000.0, 5000.0), AT_BOUND),
        ("height", 0.05, (0.04, 0.05), AT_LIMIT),
    ],
)
def test_the_end_of_what_is_possible_is_no_bound_of_ours(name, value, interval, word) -> None:
    """No friction, and flesh that parts as it yields, are ends of nature; all else was cut off by us."""
    low, high = interval
    fitted = FittedParameter(value, "-", low, high, None, None, AT_BOUND, "fitted", None)
    assert bound_word(name, fitted) == word
