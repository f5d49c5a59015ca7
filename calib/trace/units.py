"""Units of time, force and length that a measured column may have, and what one of them is in the SI unit."""

from __future__ import annotations

import re
from collections.abc import Mapping

SECONDS = {
    "s": 1.0, "sec": 1.0, "second": 1.0, "seconds": 1.0,
    "ms": 1e-3, "msec": 1e-3, "millisecond": 1e-3, "milliseconds": 1e-3,
    "us": 1e-6, "usec": 1e-6,
    "ns": 1e-9, "nsec": 1e-9, "nanosecond": 1e-9, "nanoseconds": 1e-9,
}  # fmt: skip
NEWTONS = {"N": 1.0, "n": 1.0, "newton": 1.0, "newtons": 1.0, "kN": 1e3, "KN": 1e3, "kn": 1e3, "mN": 1e-3, "mn": 1e-3}
METRES = {
    "m": 1.0, "metre": 1.0, "metres": 1.0, "meter": 1.0, "meters": 1.0,
    "cm": 1e-2,
    "mm": 1e-3, "millimetre": 1e-3, "millimetres": 1e-3, "millimeter": 1e-3, "millimeters": 1e-3,
    "um": 1e-6,
}  # fmt: skip
LENGTH_DECIMALS = 12
"""Decimals of a length that is converted [m]: 0.3 mm is 0.0003 m, and not 0.00029999999999999997."""
UNITS_OF_ROLE: Mapping[str, Mapping[str, float]] = {
    "time": SECONDS,
    "force": NEWTONS,
    "position": METRES,
    "compression": METRES,
}
"""Units that a column of each role may have: what a number in them is multiplied by."""


def metres(text: str) -> float:
    """Length of a text: a number of metres, or a number and its unit, with a blank between them or not.

    >>> metres("0.045"), metres("45mm"), metres("4.5 cm")
    (0.045, 0.045, 0.045)

    Args:
        text: Such as ``0.045`` or ``45mm``.

    Returns:
        The length [m].

    Raises:
        ValueError: It is neither.
    """
    found = re.fullmatch(r"\s*(.*?)\s*([a-zA-Z]*)\s*", text)
    if found is None or found[2] not in METRES:
        return float(text)
    return round(float(found[1]) * METRES[found[2]], LENGTH_DECIMALS)


def is_unit(text: str) -> bool:
    """Whether this is a unit of time, force or length, in brackets or not."""
    return any(text.strip(" []()") in units for units in UNITS_OF_ROLE.values())
