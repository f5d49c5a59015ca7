"""Numbers written for people: SI values become text.

Every number of a report and of a verdict passes through :func:`quantity` or one of its neighbours, so that one
quantity has one unit and one precision everywhere.
"""

from __future__ import annotations

import math

NBSP = "\u00a0"
MINUS = "\u2212"
DASH = "\u2013"

#: SI unit -> rungs (value from which it is used, factor, text), smallest first: the units that people use.
LADDERS: dict[str, tuple[tuple[float, float, str], ...]] = {
    "Pa": ((0.0, 1.0, "Pa"), (1e3, 1e3, "kPa"), (1e6, 1e6, "MPa"), (1e9, 1e9, "GPa")),
    "m": ((0.0, 1e-6, "µm"), (1e-4, 1e-3, "mm"), (1.0, 1.0, "m")),
    "N": ((0.0, 1.0, "N"), (1e4, 1e3, "kN")),
    "J": ((0.0, 1e-3, "mJ"), (1.0, 1.0, "J")),
    "J/m^2": ((0.0, 1.0, "J/m²"), (1e4, 1e3, "kJ/m²")),
    "N/m": ((0.0, 1.0, "N/m"), (1e4, 1e3, "kN/m")),
    "m/s": ((0.0, 1e-3, "mm/s"), (1.0, 1.0, "m/s")),
    "Hz": ((0.0, 1.0, "Hz"), (1e3, 1e3, "kHz")),
    "kg/m^3": ((0.0, 1.0, "kg/m³"),),
    "rad": ((0.0, math.pi / 180.0, "°"),),
    "fraction": ((0.0, 1e-2, "%"),),
    "-": ((0.0, 1.0, ""),),
    "": ((0.0, 1.0, ""),),
}
#: Decimals of a per cent that are worth printing.
PERCENT_PLACES = 2
#: A value this close to the next unit counts as reaching it: 1e-3 m is 1 mm whatever the last bit says.
ROUNDING = 1e-9
#: Outside this range a number is written with a power of ten.
PLAIN_RANGE = (1e-4, 1e6)
#: Numbers from here on have their thousands set apart.
GROUP_FROM = 1e4

#: Largest step of a value that is told beside another and the difference between them, part of the value.
COMPARED_STEP = 2e-3

#: With more decimals than this, a value and its much smaller uncertainty are written apart.
MOST_PLACES = 6

_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def plain(x: float, digits: int | None = 3) -> str:
    """A number with ``digits`` significant digits, or the shortest text that has three for None.

    >>> plain(-0.12345), plain(5.0, None), plain(1234567.0)
    ('−0.123', '5', '1.23 × 10⁶')
    """
    if x == 0.0:
        return "0"
    if not PLAIN_RANGE[0] <= abs(x) < PLAIN_RANGE[1]:
        mantissa, exponent = f"{x:.{(digits or 3) - 1}e}".split("e")
        mantissa = f"{float(mantissa):g}" if digits is None else mantissa
        return f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", MINUS)
    if digits is None:
        return f"{_three(x):.6g}".replace("-", MINUS)
    rounded = float(f"{x:.{digits - 1}e}")
    return _grouped(rounded, max(0, digits - 1 - math.floor(math.log10(abs(rounded)))))


def at_axis(x: float) -> str:
    """A number at an axis: thousands set apart, and powers of ten where it is very large or small.

    >>> at_axis(0.5), at_axis(2e4).replace(NBSP, " "), at_axis(1e7), at_axis(5e-6)
    ('0.5', '20 000', '10⁷', '5 × 10⁻⁶')
    """
    return count(x) if GROUP_FROM <= abs(x) < PLAIN_RANGE[1] else plain(x, None).removeprefix("1 × ")


def count(n: float | None) -> str:
    """A whole number, thousands set apart from ten thousand on; a dash where there is none.

    >>> count(1234567).replace(NBSP, " "), count(1234)
    ('1 234 567', '1234')
    """
    return DASH if n is None else _grouped(n, 0)


def quantity(
    value: float | None, unit: str, *, digits: int | None = 3, signed: bool = False, like: float | None = None
) -> str:
    """A value in the unit people use for it; a dash where there is none.

    Args:
        value: In the SI unit; None or not finite means there is none.
        unit: SI unit as in ``materials.yaml``; ``fraction`` is shown in per cent, with two decimals at most;
            an unknown unit is kept.
        digits: Significant digits; None for the shortest text (limits, settings).
        signed: Whether a positive value gets its sign.
        like: Value whose unit is used [SI unit]: numbers that stand side by side share one. None or zero: its own.

    Returns:
        Number and unit.

    >>> quantity(3.2e5, "Pa").replace(NBSP, " "), quantity(0.033, "m").replace(NBSP, " ")
    ('320 kPa', '33.0 mm')
    """
    if value is None or not math.isfinite(value):
        return DASH
    factor, name = rung(unit, abs(like or value))
    x = value / factor
    few = name == "%" and digits is not None and 0.0 < abs(x) < 10.0 ** (digits - PERCENT_PLACES)
    text = _grouped(x, PERCENT_PLACES) if few else plain(x, digits)
    return _with_unit(("+" if signed and text.strip("0.") and x > 0.0 else "") + text, name)


def compared(value: float | None, unit: str) -> str:
    """A value beside one that it is compared with, such as the simulated peak beside the measured one.

    >>> [compared(x, "N").replace(NBSP, " ") for x in (12.547, 12.87, 9.2834, 46.134)]
    ['12.55 N', '12.87 N', '9.28 N', '46.13 N']
    """
    first = float(f"{abs(value):e}"[0]) if value and math.isfinite(value) else 1.0
    return quantity(value, unit, digits=3 if 0.01 / first <= COMPARED_STEP else 4)


def difference(first: float | None, second: float | None, unit: str) -> tuple[str, str, str]:
    """Two values that are compared and the first less the second, in the unit and to the decimals of the second.

    The difference is that of the two numbers as they are printed, so that a reader who computes it finds the same.

    Args:
        first: One value [SI unit].
        second: The one that it is compared with [SI unit].
        unit: SI unit, as of :func:`quantity`.

    Returns:
        Both values and the difference, with its sign; a dash for what is not known.

    >>> [text.replace(NBSP, " ") for text in difference(44.4356, 46.134, "N")]
    ['44.44 N', '46.13 N', '−1.69 N']
    >>> [text.replace(NBSP, " ") for text in (*difference(0.3, 0.0, "N"), *difference(math.nan, 1.0, "N"))]
    ['0.3000 N', '0.0000 N', '+0.3000 N', '–', '1.000 N', '–']
    """
    if first is None or second is None or not (math.isfinite(first) and math.isfinite(second)):
        return (compared(first, unit), compared(second, unit), DASH)
    of = second or first
    factor, name = rung(unit, abs(of))
    number = compared(of, unit).split(NBSP + name)[0] if name else compared(of, unit)
    places = len(number.partition(".")[2])
    printed = [round(value / factor, places) for value in (first, second)]
    less = round(printed[0] - printed[1], places)
    texts = [_grouped(x, places) for x in (*printed, less)]
    texts[2] = ("+" if less > 0.0 else "") + texts[2]
    return (_with_unit(texts[0], name), _with_unit(texts[1], name), _with_unit(texts[2], name))


def interval(
    low: float | None, high: float | None, unit: str, *, digits: int | None = 3, like: float | None = None
) -> str:
    """A range with both ends to the same digits and in one unit; a bound if one end is not known, a dash if neither is.

    Args:
        low: Lower end in the SI unit, or None.
        high: Upper end in the SI unit, or None.
        unit: SI unit, as of :func:`quantity`.
        digits: Significant digits of each end; None for the shortest text (settings, published values).
        like: Value whose unit is used [SI unit], such as the one that the range is of. None or zero: the larger end.

    Returns:
        Both numbers with one unit.

    >>> interval(0.8e6, 2e6, "Pa").replace(NBSP, " "), interval(5e4, 2e6, "Pa", like=3e5).replace(NBSP, " ")
    ('0.800 to 2.00 MPa', '50.0 to 2000 kPa')
    """
    ends = [x if x is not None and math.isfinite(x) else None for x in (low, high)]
    known = [abs(x) for x in ends if x is not None]
    if not known:
        return DASH
    size = like or max(known)
    if len(known) == 1:
        side, end = ("above", ends[0]) if ends[0] is not None else ("below", ends[1])
        return f"{side} {quantity(end, unit, digits=digits, like=size)}"
    factor, name = rung(unit, abs(size))
    texts = [plain(x / factor, digits) for x in ends if x is not None]
    return _with_unit(" to ".join(texts if texts[0] != texts[1] else texts[:1]), name)


def uncertain(value: float | None, sd: float | None, unit: str, *, like: float | None = None) -> str:
    """A value with its standard uncertainty, both to the second digit of the uncertainty.

    Args:
        value: In the SI unit, or None.
        sd: Its standard uncertainty in the SI unit, or None.
        unit: SI unit, as of :func:`quantity`.
        like: Value whose unit is used [SI unit]. None or zero: the larger one of the two.

    Returns:
        Both with one unit; the value alone where there is no uncertainty.

    >>> uncertain(12.5271, 0.112, "N").replace(NBSP, " ")
    '12.53 ± 0.11 N'
    """
    if value is None or sd is None or not (math.isfinite(value) and math.isfinite(sd) and sd > 0.0):
        return quantity(value, unit, like=like)
    factor, name = rung(unit, abs(like or max(abs(value), sd)))
    x, s = value / factor, sd / factor
    places = max(0, 1 - math.floor(math.log10(s)))
    if places > MOST_PLACES:
        return f"{quantity(value, unit)}{NBSP}±{NBSP}{quantity(sd, unit, digits=2)}"
    text = f"{_grouped(x, places)}{NBSP}±{NBSP}{_grouped(s, places)}"
    return _with_unit(f"({text})" if name in ("%", "°") else text, name)


def before_and_after(value: float, sd: float | None, prior_sd: float, unit: str) -> tuple[str, str]:
    """What was known of a number that should be zero, and what is known of it now, in one unit.

    Args:
        value: What it is now, in the SI unit.
        sd: Standard uncertainty of that, or None.
        prior_sd: Standard uncertainty before, about zero.
        unit: SI unit, as of :func:`quantity`.

    Returns:
        Both, each with its uncertainty.

    >>> [text.replace(NBSP, " ") for text in before_and_after(-8.3e-5, 8.8e-5, 5.6e-4, "m")]
    ['0 ± 0.56 mm', '−0.083 ± 0.088 mm']
    """
    size = max(abs(value), sd or 0.0, prior_sd)
    before = f"0{NBSP}±{NBSP}{quantity(prior_sd, unit, digits=2, like=size)}"
    return before, uncertain(value, sd, unit, like=size)


def rung(unit: str, size: float) -> tuple[float, str]:
    """Factor and text of the unit for a value of this size [SI unit].

    >>> rung("Pa", 3.2e5)
    (1000.0, 'kPa')
    """
    ladder = LADDERS.get(unit, ((0.0, 1.0, unit.replace("^2", "²").replace("^3", "³")),))
    if size == 0.0:
        return next(((factor, name) for _, factor, name in ladder if factor == 1.0), ladder[0][1:])
    size = _three(size)
    return [(factor, name) for start, factor, name in ladder if size >= start * (1.0 - ROUNDING)][-1]


def terminal_rung(unit: str, size: float) -> tuple[float, str]:
    """Factor and text of the unit for a value of this size [SI unit], in letters that every terminal has.

    >>> terminal_rung("Pa", 3.2e5), terminal_rung("J/m^2", 327.0), terminal_rung("m", 5e-5)
    ((1000.0, 'kPa'), (1.0, 'J/m^2'), (1e-06, 'um'))
    """
    factor, name = rung(unit, size)
    for letter, plain_letters in (("²", "^2"), ("³", "^3"), ("µ", "u"), ("°", "deg")):
        name = name.replace(letter, plain_letters)
    return factor, name or "-"


def duration(seconds: float | None) -> str:
    """A wall time.

    >>> duration(3725.0).replace(NBSP, " "), duration(42.31).replace(NBSP, " ")
    ('1 h 02 min', '42.3 s')
    """
    if seconds is None or not math.isfinite(seconds):
        return DASH
    if seconds < 120.0:
        return quantity(seconds, "s")
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{minutes}{NBSP}min"
    return f"{minutes // 60}{NBSP}h{NBSP}{minutes % 60:02d}{NBSP}min"


def listed(names: list[str]) -> str:
    """Names as a list in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _three(x: float) -> float:
    """The number rounded to three significant digits."""
    return float(f"{x:.2e}")


def _grouped(x: float, places: int) -> str:
    text = f"{x:,.{places}f}" if abs(x) >= GROUP_FROM else f"{x:.{places}f}"
    text = text.replace(",", NBSP)
    return text.replace("-", MINUS if text.strip("-0.") else "")


def _with_unit(text: str, name: str) -> str:
    return text + (name if name in ("", "°") else NBSP + name)
