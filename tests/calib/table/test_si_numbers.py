from __future__ import annotations

import math

import pytest

from calib.table.si_numbers import si_number


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.045", "m", 0.045),
        ("45mm", "m", 0.045),
        (" 4.5 cm ", "m", 0.045),
        ("0.3mm", "m", 3e-4),
        ("300\u00b5m", "m", 3e-4),
        ("-4e0mm", "m", -0.004),
        ("2inch", "m", 0.0508),
        ("12", "cells", 12.0),
        ("60N", "N", 60.0),
        ("2kgf", "N", 19.6133),
        ("5ms", "s", 0.005),
        ("20mm/s", "m/s", 0.02),
        ("1.2 m/min", "m/s", 0.02),
        (".3 MPa", "Pa", 3e5),
        ("0.3N/mm^2", "Pa", 3e5),
        ("0.3 N/mm\u00b2", "Pa", 3e5),
        ("1.75 N/mm", "N/m", 1750.0),
        ("0.2kJ/m2", "J/m^2", 200.0),
        ("200 N/m", "J/m^2", 200.0),
        ("1.03 g/cm3", "kg/m^3", 1030.0),
        ("1kHz", "/s", 1000.0),
        ("5deg", "degrees", 5.0),
        ("30%", "-", 0.3),
    ],
)
def test_numbers_with_their_units(text: str, unit: str, value: float) -> None:
    """Each is what it says, to the last digit: a conversion adds none."""
    assert si_number(text, unit) == value


def test_radians_are_angles() -> None:
    """An angle in degrees may be given in radians."""
    assert si_number(f"{math.pi / 6}rad", "degrees") == pytest.approx(30.0, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "words"),
    [
        ("45px", "m", "'45px' is not a length: write it in m, or with its unit (mm, cm, um, inch)"),
        ("45N", "m", "'45N' is not a length"),
        ("45,5mm", "m", "'45,5mm' is not a length"),
        ("4 5mm", "m", "'4 5mm' is not a length"),
        ("mm", "m", "'mm' is not a length"),
        ("", "m", "'' is not a length"),
        ("60kPa", "N", "'60kPa' is not a force"),
        ("0.3mpa", "Pa", "'0.3mpa' is not a stress: write it in Pa, or with its unit (kPa, MPa, GPa, N/mm^2)"),
        ("0.3N/m", "Pa", "'0.3N/m' is not a stress"),
        ("20m", "m/s", "'20m' is not a speed"),
        ("2mm", "cells", "'2mm' is not a number"),
        ("30%", "", "'30%' is not a number"),
        ("3mm", "-", "'3mm' is not a part: write it as in 0.3 or 30%"),
    ],
)
def test_units_of_something_else(text: str, unit: str, words: str) -> None:
    """A unit of another quantity, or none at all, is named with what can be written; none is guessed."""
    with pytest.raises(ValueError, match=".") as caught:
        si_number(text, unit)
    assert str(caught.value).startswith(words)
