"""Names of files and codes in words: what a reader sees in place of a key of ``summary.json``."""

from __future__ import annotations

import re
from typing import Any

from mpm.output.verdict_words import VERDICT_WORDS
from reports.base.format import NBSP, breakable, count, listed, quantity

#: Names of the files in words; what is not here loses its underscores.
WORDS = {
    "ramp": "straight ramp (1 number)",
    "half_sine": "half sine (1 number)",
    "three_term": "three-term curve (7 numbers)",
    "paper_table2": "paper, Table 2",
    **VERDICT_WORDS,
}
#: Parts below which no number of per cent with two decimals is left.
LEAST_PART = 5e-5
_REMARK = re.compile(r"\(remark (\d+)\)")
_PER_CENT = re.compile(r"(?<=\d)%")
_RAISED = re.compile(r"(?<=[A-Za-z])\^([23])(?!\d)")
_EXPONENTS = str.maketrans("23", "²³")
#: Properties of the material whose names are single words, which no capital changes.
SYMBOLS = ("rho", "E", "nu", "R", "mu")


def shown(x: Any, unit: str, digits: int | None) -> str:
    """A value or limit of any type as text.

    Args:
        x: A number, a flag, a text, a list of these, or None.
        unit: SI unit of a number, ``-`` where there is none.
        digits: Significant digits of a number; None for the shortest text.

    Returns:
        The text; a dash for None.
    """
    if isinstance(x, bool):
        return "yes" if x else "no"
    if isinstance(x, int) and unit == "-":
        return count(x)
    if isinstance(x, float) and unit == "fraction" and 0.0 < abs(x) < LEAST_PART:
        return f"<{NBSP}{quantity(2 * LEAST_PART, unit, digits=None)}"
    if x is None or isinstance(x, (int, float)):
        return quantity(x, unit, digits=digits)
    return breakable(listed([str(i) for i in x]) if isinstance(x, list) else str(x))


def related(value: Any, limit: Any, passed: bool | None) -> str:
    """The sign between a value and its limit, as it follows from whether the value passes.

    Args:
        value: A number; anything else has no sign.
        limit: Its limit.
        passed: Whether it passes; None where nobody judged it.

    Returns:
        The sign with a blank; empty where nothing follows.
    """
    numbers = all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in (value, limit))
    if passed is None or not numbers:
        return ""
    if abs(value) == limit:
        return "≤ " if passed else ""
    return "≤ " if (abs(value) < limit) == passed else "≥ "


def capital(text: str) -> str:
    """A sentence with a capital, unless it begins with a name: of a property, a file or a column."""
    first = text.split(" ", 1)[0]
    plain = first.replace("-", "").isalpha()
    return text[:1].upper() + text[1:] if plain and first not in SYMBOLS else text


def as_sentence(text: str) -> str:
    """A sentence with its capital and its full stop."""
    return capital(text) + ("" if text.endswith((".", "!", "?")) else ".")


def in_words(name: str) -> str:
    """A key of the files in words."""
    return WORDS.get(name, name.replace("_", " "))


def in_type(text: str) -> str:
    """A sentence of a run as a page prints it: a space before a per cent sign, and raised exponents of units."""
    spaced = _PER_CENT.sub(f"{NBSP}%", text)
    return _RAISED.sub(lambda m: m[1].translate(_EXPONENTS), spaced)


def source_in_words(text: str, remarks: str = "") -> str:
    """Where a value comes from, as a page prints it.

    A remark is one of the material's file: the page has it among its references, or says after its number where it is.
    """
    return in_type(_REMARK.sub(rf"(remark \1{remarks})", text))


def short(text: str, letters: int) -> str:
    """Text of this many letters at most."""
    return text if len(text) <= letters else text[: letters - 1] + "…"
