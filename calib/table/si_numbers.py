"""Numbers of a command line, in SI or with a unit of their own: ``0.045``, ``45mm``, ``0.3 MPa``, ``20 mm/s``, ``30%``.

A length, a force or a time takes the units that a column of a table may have (:mod:`calib.table.units`). The other
quantities take those of their list. A unit of another quantity is an error, as is one that is not known.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from calib.table.units import Quantity, unit_of

DIGITS = 15
"""Significant digits of a number that is converted: 0.3 mm is 0.0003 m, and not 0.00029999999999999997."""
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)\s*")
_SPELLING = str.maketrans({"\u00b2": "2", "\u00b3": "3", "\u00b5": "u", "\u03bc": "u", "^": None, "*": None, " ": None})
_FORCES = {"N": 1.0, "kN": 1e3, "mN": 1e-3}
_LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
_TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}
_SPEEDS = {f"{d}/{t}": _LENGTHS[d] / _TIMES[t] for d in _LENGTHS for t in _TIMES}
_LINE_FORCES = {f"{f}/{d}": _FORCES[f] / _LENGTHS[d] for f in _FORCES for d in _LENGTHS}
_LINE_FORCES |= {"J/m2": 1.0, "kJ/m2": 1e3, "J/cm2": 1e4, "mJ/cm2": 10.0, "mJ/mm2": 1e3}
_STRESSES = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9, "mbar": 1e2, "bar": 1e5}
_STRESSES |= {f"{f}/{d}2": _FORCES[f] / _LENGTHS[d] ** 2 for f in _FORCES for d in _LENGTHS}


@dataclass(frozen=True)
class _Kind:
    """How numbers of one quantity may be written.

    Attributes:
        what: The quantity, in words.
        examples: Units that an error offers.
        factors: One of each unit in SI, by how it is written.
        quantity: A quantity of tables, whose units are taken in place of ``factors``.
    """

    what: str
    examples: str
    factors: Mapping[str, float] = field(default_factory=dict)
    quantity: Quantity | None = None

    def factor(self, word: str) -> float | None:
        """One of a unit in SI, None where it is no unit of this quantity."""
        if self.quantity is None:
            return self.factors.get(word.translate(_SPELLING))
        unit = unit_of(word)
        return unit.factor if unit is not None and unit.quantity is self.quantity else None


_KINDS = {
    "m": _Kind("a length", "mm, cm, um, inch", quantity=Quantity.LENGTH),
    "N": _Kind("a force", "mN, kN, kgf, lbf", quantity=Quantity.FORCE),
    "s": _Kind("a time", "ms, us, min", quantity=Quantity.TIME),
    "m/s": _Kind("a speed", "mm/s, cm/s, mm/min", _SPEEDS),
    "Pa": _Kind("a stress", "kPa, MPa, GPa, N/mm^2", _STRESSES),
    "N/m": _Kind("a force per length", "N/mm, kN/m", _LINE_FORCES),
    "J/m^2": _Kind("an energy per area", "kJ/m^2, mJ/cm^2, N/m, N/mm", _LINE_FORCES),
    "kg/m^3": _Kind("a density", "g/cm^3, kg/l", {"kg/m3": 1.0, "g/cm3": 1e3, "kg/l": 1e3, "g/ml": 1e3, "kg/dm3": 1e3}),
    "/s": _Kind("a frequency", "Hz, kHz", {"/s": 1.0, "1/s": 1.0, "Hz": 1.0, "kHz": 1e3}),
    "degrees": _Kind("an angle", "deg, rad", {"deg": 1.0, "degrees": 1.0, "\u00b0": 1.0, "rad": 180.0 / math.pi}),
    "-": _Kind("a part", "%", {"%": 0.01}),
}


def si_number(text: str, unit: str) -> float:
    """Number of a text in a unit: a plain one, or one with a unit of its own, with a blank between them or not.

    >>> si_number("45mm", "m"), si_number("0.3 MPa", "Pa"), si_number("200", "J/m^2"), si_number("30%", "-")
    (0.045, 300000.0, 200.0, 0.3)

    Args:
        text: Such as ``0.045`` or ``45mm``.
        unit: Unit of the number, and of a text without one; ``-`` for a part of a whole. One of which no other is
            known, such as ``cells``, takes plain numbers alone.

    Returns:
        The number [unit]; not finite where the text says so.

    Raises:
        ValueError: It is none; the message says what was written and what can be.
    """
    try:
        return float(text)
    except ValueError:
        kind, found = _KINDS.get(unit), _NUMBER.fullmatch(text)
    if kind is None:
        raise ValueError(f"{text!r} is not a number") from None
    factor = None if found is None else kind.factor(found[2])
    if found is None or factor is None:
        how = "as in 0.3 or 30%" if unit == "-" else f"in {unit}, or with its unit ({kind.examples})"
        raise ValueError(f"{text!r} is not {kind.what}: write it {how}") from None
    return float(f"{float(found[1]) * factor:.{DIGITS}g}")
