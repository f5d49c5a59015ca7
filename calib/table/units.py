"""Units of force, length and time: which one a text names, what one of it is in SI, and which units are none of these.

A unit stands in a column's name, in a row below the header, in an attribute or in a line about the record. All of these
end here, so that a unit means the same wherever it was written.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum

STANDARD_GRAVITY = 9.80665
"""What the weight of a mass on a load cell is divided by to give the mass [m/s^2] (CGPM 1901)."""
POUND = 0.45359237
"""A pound [kg] (international yard and pound agreement of 1959)."""


class Quantity(str, Enum):
    """What a unit measures."""

    TIME = "time"
    FORCE = "force"
    LENGTH = "length"
    OTHER = "other"


@dataclass(frozen=True)
class Unit:
    """A unit.

    Attributes:
        symbol: How it was written.
        quantity: What it measures.
        factor: One of it in SI [s, N or m]; NaN for a unit of another quantity.
        common: Whether it is an SI unit with its usual prefixes, of which nothing need be said.
    """

    symbol: str
    quantity: Quantity
    factor: float
    common: bool = True

    def fits(self, role: str) -> bool:
        """Whether a column of a role (``time``, ``force``, ``position``, ``compression``) can have it."""
        return self.quantity is QUANTITY_OF_ROLE[role]


QUANTITY_OF_ROLE = {
    "time": Quantity.TIME,
    "force": Quantity.FORCE,
    "position": Quantity.LENGTH,
    "compression": Quantity.LENGTH,
}
"""What a column of each role measures."""
SI_OF_ROLE = {"time": "s", "force": "N", "position": "m", "compression": "m"}
"""Unit in which a column of each role is kept."""
EXAMPLES = {
    "time": "s, ms, us, ns, min",
    "force": "N, mN, kN, cN, kgf, gf, lbf, ozf",
    "position": "m, mm, cm, um, inch, mil",
    "compression": "m, mm, cm, um, inch, mil",
}
"""Units that an error offers for each role."""

_SI = {
    Quantity.TIME: {
        1.0: "s sec secs second seconds seg sek sekunde sekunden seconde secondes segundo segundos "
        "secondi secondo \u79d2 \u0441 \u0441\u0435\u043a",
        1e-3: "ms msec msecs millisecond milliseconds millis",
        1e-6: "us usec usecs microsecond microseconds micros",
        1e-9: "ns nsec nsecs nanosecond nanoseconds nanos nanosec",
    },
    Quantity.FORCE: {
        1.0: "N n newton newtons \u041d \u725b",
        1e6: "MN meganewton",
        1e3: "kN KN kn kilonewton kilonewtons \u043a\u041d",
        1e1: "daN decanewton",
        1e-1: "dN decinewton",
        1e-2: "cN centinewton centinewtons",
        1e-3: "mN mn millinewton millinewtons",
        1e-6: "uN micronewton micronewtons",
    },
    Quantity.LENGTH: {
        1.0: "m metre metres meter meters",
        1e-1: "dm decimetre decimeter",
        1e-2: "cm centimetre centimetres centimeter centimeters",
        1e-3: "mm millimetre millimetres millimeter millimeters \u043c\u043c \u6beb\u7c73",
        1e-6: "um micrometre micrometres micrometer micrometers micron microns",
        1e-9: "nm nanometre nanometer nanometres nanometers",
    },
}
_OTHER_SYSTEMS = {
    Quantity.TIME: {60.0: "min mins minute minutes minuten minuti minutos", 3600.0: "h hr hrs hour hours"},
    Quantity.FORCE: {
        STANDARD_GRAVITY: "kgf kg kp kilogram kilograms kilopond kilogram-force kg-force",
        1e-3 * STANDARD_GRAVITY: "gf g gram grams gramme grammes gram-force g-force g-f gmf pond",
        1e-6 * STANDARD_GRAVITY: "mgf mg milligram milligrams",
        1e3 * STANDARD_GRAVITY: "tf tonf tonne-force",
        POUND * STANDARD_GRAVITY: "lbf lb lbs lbsf pound pounds pound-force lb-force",
        1e3 * POUND * STANDARD_GRAVITY: "klbf kip kips",
        POUND / 16.0 * STANDARD_GRAVITY: "ozf oz ounce ounces ounce-force",
        1e-5: "dyn dyne dynes",
    },
    Quantity.LENGTH: {
        0.0254: "in inch inches",
        2.54e-5: "mil mils thou",
        0.3048: "ft foot feet",
        1e-10: "angstrom",
    },
}
_NOT_OURS = (
    "Pa hPa kPa MPa GPa mbar bar psi ksi msi atm torr Nm Nmm Ncm kNm mNm uNm lbfin lbfft ozin inlb ftlb V mV uV "
    "volt volts A mA ampere W kW watt J mJ kJ joule Nmps Hz kHz MHz rpm rad mrad deg degree degrees grad arcsec C degC "
    "F degF K kelvin celsius percent pct ppm count counts cts lsb digit digits steps step ticks tick bit bits adc "
    "kgm kgs L ml l mol dB ohm kohm sample samples frame frames cycle cycles pixel pixels px strain microstrain ue "
    "mps mmps mmpm mmps2 day days d week"
)
"""Units of other quantities that stand in the headers of loggers and machines."""
_BRACKETS_ONLY = frozenset(
    "A W J C F K L d l h ft tf bar bit bits day days d week step steps sample samples frame frames cycle cycles strain "
    "digit digits tick ticks count counts pond hour".split()
)
"""Units that are names of their own after a blank or _: ``force_A`` may be that of sensor A, ``wrench_ft`` that of the
force-torque sensor."""
_MICRO = str.maketrans({"\u00b5": "u", "\u03bc": "u", "\u00c2": None, "\u2032": "'", "\u2033": '"'})


def _table() -> dict[str, Unit]:
    """All known units by how they are written."""
    units: dict[str, Unit] = {'"': Unit('"', Quantity.LENGTH, 0.0254, common=False)}
    for system, common in ((_SI, True), (_OTHER_SYSTEMS, False)):
        for quantity, names in system.items():
            for factor, words in names.items():
                units |= {word: Unit(word, quantity, factor, common) for word in words.split()}
    return {word: Unit(word, Quantity.OTHER, float("nan"), False) for word in _NOT_OURS.split()} | units


UNITS = _table()
"""Known units by how they are written."""
_ANY_CASE = {word.lower(): unit for word, unit in UNITS.items() if len(word) > 1 or unit.quantity is not Quantity.OTHER}
_ANY_CASE |= {word.lower(): unit for word, unit in UNITS.items() if unit.common}
_AMBIGUOUS_CASE = {"mn": "mN", "mpa": "MPa"}
_PARTS = re.compile(r"\s*(?:\*\*|[/*^\u00b7.-])\s*")
_POWER = re.compile(r"(.+?)(?:[\u00b2\u00b3]|-?[1-4])")


def unit_of(text: str) -> Unit | None:
    """The unit that a text names, in brackets or not; None where it names none.

    The case of letters counts where it tells units apart (``mN``, ``MN``), and does not where it cannot (``KGF``).
    """
    word = text.strip(" \t[](){}<>").translate(_MICRO).strip()
    if not word or len(word) > 20:
        return None
    known = UNITS.get(word) or UNITS.get(word.rstrip("."))
    if known is None:
        word = word.rstrip(".") or word
        known = _ANY_CASE.get(_AMBIGUOUS_CASE.get(word.lower(), word.lower()).lower())
    if known is None and _is_compound(word):
        known = Unit(word, Quantity.OTHER, float("nan"), False)
    return None if known is None else Unit(word, known.quantity, known.factor, known.common)


def _is_compound(word: str) -> bool:
    """Whether a text is several units in one, a power of one, an angle or a part of a hundred: N/mm, N*m, kg/m3, %."""
    if word in ("%", "\u00b0", "\u00b0C", "\u00b0F", "1/s", "-/-", "mm/mm", "m/m"):
        return True
    parts = [part.strip("()") for part in _PARTS.split(word)]
    return word not in UNITS and all(_is_part(part) for part in parts) and not parts[0].isdecimal()


def _is_part(word: str) -> bool:
    """Whether this is a unit, perhaps to a power, or a power."""
    found = _POWER.fullmatch(word)
    return bool(re.fullmatch(r"\d", word)) or word in UNITS or (found is not None and found.group(1) in UNITS)


def is_unit(text: str) -> bool:
    """Whether this is a unit of any kind, in brackets or not."""
    return unit_of(text) is not None


def is_measured_unit(text: str) -> bool:
    """Whether this is a unit of time, force or length."""
    unit = unit_of(text)
    return unit is not None and unit.quantity is not Quantity.OTHER


@dataclass(frozen=True)
class NamedUnit:
    """What the name of a column says of its unit.

    Attributes:
        stem: The name without it.
        text: The unit as it is written, empty where there is none.
        bracketed: Whether it is set off by brackets, so that it can be nothing but a unit.
    """

    stem: str
    text: str
    bracketed: bool = False


_BRACKETED = re.compile(r"(.*?\S)[\s_]*[\[({<]\s*([^\[\](){}<>]{1,20}?)\s*[\])}>]\s*")
_SET_OFF = re.compile(r"(.*?\S)\s*(?:,|/|\b(?:in|en)\b)\s*([^\s,]{1,15})")
_BEHIND_POINTS = re.compile(r"(.*?[^\s.])\.\.+([^\s.]{1,15})\.*|([^.]*[^\s.])\.([^\s.]{1,15})")
"""Names as R writes those with brackets or blanks in them: ``Force..N.`` and ``Force.N``."""
_LAST_WORD = re.compile(r"(.*[^\s_])[\s_]+([^\s_]{1,15})")
_JOINED = re.compile(
    r"(.*(?i:force|load|time|elapsed|depth|displacement|position|stroke|extension|distance|travel|height))"
    r"(N|Newtons?|kN|KN|mN|Sec|Seconds?|S|ms|Ms|MS|mm|Mm|MM|cm|Cm|CM|M)"
)
_CAPITAL = {"KN": "kN", "Sec": "s", "S": "s", "Ms": "ms", "MS": "ms", "Mm": "mm", "MM": "mm", "Cm": "cm", "CM": "cm"}
_CAPITAL |= {"M": "m"}
"""Units as they are joined to a quantity, such as ``ForceN`` and ``timeSec``, and those that got a capital there."""
_NO_UNIT = re.compile(
    r"[xyzXYZ]|\d+|raw|filtered|filt|corrected|primary|tared|max|mean|avg|average|abs|left|right|up|down|measured|actual|smoothed",
    re.IGNORECASE,
)
"""Words in brackets that are no units."""


def split_unit(name: str) -> NamedUnit:
    """Stem and unit of a column's name such as ``force_N``, ``Force [N]``, ``Kraft / N``, ``Load in kN`` or ``ForceN``.

    What stands in brackets is a unit, known or not. A last word is one only where it is known as such.
    """
    found = _BRACKETED.fullmatch(name)
    if found:
        stem, text = found.groups()
        if _NO_UNIT.fullmatch(text) and not is_unit(text):
            return NamedUnit(name, "")
        return NamedUnit(stem, text, bracketed=True)
    for pattern in (_SET_OFF, _LAST_WORD):
        found = pattern.fullmatch(name)
        if found and not found.group(1).endswith("/") and _is_last_word(found.group(2)):
            return NamedUnit(found.group(1), found.group(2))
    found = _BEHIND_POINTS.fullmatch(name)
    if found and _is_last_word(found[2] or found[4]):
        return NamedUnit(found[1] or found[3], found[2] or found[4])
    joined = _JOINED.fullmatch(name)
    return NamedUnit(joined[1], _CAPITAL.get(joined[2], joined[2])) if joined else NamedUnit(name, "")


def _is_last_word(word: str) -> bool:
    """Whether the last word of a name is a unit, not a name of its own."""
    if word in _BRACKETS_ONLY or _POWER.fullmatch(word) and word.isalnum():
        return False
    return is_unit(word)
