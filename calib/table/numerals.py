"""Numbers as people and programs write them: decimals after a point or a comma, thousands set off, printed minus signs.

Whether ``60,000`` is sixty thousand or sixty is told by the other numbers of its column, else by those of the file, and
is not guessed where neither tells it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from calib.table.table import as_float
from calib.table.units import is_measured_unit

FEWEST_BARE = 5
"""Different whole numbers below a thousand from which on a column counts in ones."""
_EXPONENT = r"(?:[eE][-+]?\d+)?"
_GROUPED = {mark: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+") for mark in ",."}
"""Whole numbers whose thousands are set off by a mark, which may be decimals too where there is one mark."""
_BOTH = {
    decimal: re.compile(rf"[-+]?[1-9]\d{{0,2}}(?:{re.escape(other)}\d{{3}})+{re.escape(decimal)}\d*{_EXPONENT}")
    for decimal, other in ((",", "."), (".", ","))
}
_DECIMAL = {mark: re.compile(rf"[-+]?(?:\d+{re.escape(mark)}\d*|{re.escape(mark)}\d+){_EXPONENT}") for mark in ",."}
_SPACED = re.compile(r"(?<=\d)[ \u00a0\u2009\u202f'\u2019](?=\d{3}(?!\d))")
"""Blanks and apostrophes between thousands."""
_WITH_UNIT = re.compile(r"\s*([-+\u2212]?\d[\d.,' \u00a0]*(?:[eE][-+]?\d+)?)\s*([^\W\d_]{1,8})\s*")
_PRINT = str.maketrans({"\u2212": "-", "\u2013": "-", "\u00a0": " ", "\u202f": " ", "\u2009": " "})


@dataclass(frozen=True)
class Style:
    """How the numbers of a column are written.

    Attributes:
        decimal: What stands before decimals: a point or a comma.
        grouped: Whether the other of them sets off thousands.
    """

    decimal: str = "."
    grouped: bool = False

    def plain(self, cell: str) -> str:
        """A cell as Python writes the number; one that is no such number is left as it is."""
        text = tidy(cell)
        other = "," if self.decimal == "." else "."
        if other in text:
            if not (_GROUPED[other].fullmatch(text) or _BOTH[self.decimal].fullmatch(text)):
                return cell
            text = text.replace(other, "")
        plain = text.replace(self.decimal, ".")
        return plain if as_float(plain) is not None else cell


def tidy(cell: str) -> str:
    """A cell without blanks around it and between thousands, its minus a hyphen."""
    return _SPACED.sub("", cell.strip()).translate(_PRINT) if not cell.isascii() or " " in cell or "'" in cell else cell


def as_plain(cell: str, decimal: str = ".") -> float | None:
    """The number in a cell whose decimals follow a mark, None where there is none."""
    return as_float(Style(decimal).plain(cell))


def is_number(cell: str) -> bool:
    """Whether a cell holds a number in any style."""
    return as_float(cell) is not None or any(as_plain(cell, decimal) is not None for decimal in ",.")


def number_and_unit(cell: str) -> tuple[str, str]:
    """A number of any style and the unit of time, force or length behind it, as in ``3.004 N``; empty for others."""
    found = _WITH_UNIT.fullmatch(cell)
    if found is None or not is_measured_unit(found[2]) or not is_number(found[1]):
        return "", ""
    return found[1], found[2]


def styles_of(columns: Mapping[str, Sequence[str]], decimal: str | None = None) -> dict[str, Style]:
    """How the numbers of each column are written, where that is not as Python writes them.

    Args:
        columns: Cells of each column by name.
        decimal: The mark before decimals in the whole file, where that is known; None to tell it from the numbers.

    Returns:
        Styles by name. A column whose style nothing tells has none: its numbers cannot be read.
    """
    evidence = {name: _evidence(cells) for name, cells in columns.items()}
    certain = {mark for marks, _ in evidence.values() for mark in marks}
    if decimal is not None:
        certain = {decimal}
    found = {}
    for name, (marks, doubtful) in evidence.items():
        own = marks or (certain if doubtful else set())
        if not own and not doubtful and any(_SPACED.search(cell) for cell in columns[name]):
            own = (
                certain if len(certain) == 1 else {"."}
            )  # whole numbers whose thousands a blank or apostrophe sets off
        if decimal is not None:
            own = {decimal} if marks | doubtful else set()
        if len(own) != 1:
            continue
        mark = next(iter(own))
        other = "," if mark == "." else "."
        grouped = any(other in cell for cell in columns[name])
        printed = any(_SPACED.search(cell) or not cell.isascii() for cell in columns[name][:1000])
        if mark == "," or grouped or printed:
            found[name] = Style(mark, grouped)
    return found


def _evidence(cells: Sequence[str]) -> tuple[set[str], set[str]]:
    """Marks that are before decimals for certain, by two cells at least, and marks that are so or set off thousands."""
    certain: Counter[str] = Counter()
    doubtful: set[str] = set()
    for cell in cells:
        if "," not in cell and "." not in cell:
            continue
        text = tidy(cell)
        for mark, other in ((",", "."), (".", ",")):
            if _BOTH[mark].fullmatch(text) or (text.count(other) > 1 and _GROUPED[other].fullmatch(text)):
                certain[mark] += 1
            elif _DECIMAL[mark].fullmatch(text):
                if _GROUPED[mark].fullmatch(text):
                    doubtful.add(mark)
                else:
                    certain[mark] += 1
    marks = {mark for mark, count in certain.items() if count > 1}
    if not marks and len(doubtful) == 1 and _counts_in_ones(cells):
        (mark,) = doubtful  # 995, 1.000: whole numbers, of which those from a thousand on have a mark
        return {"," if mark == "." else "."}, doubtful
    return marks, doubtful


def _counts_in_ones(cells: Sequence[str]) -> bool:
    """Whether numbers below a thousand are whole and without a mark, several of them, where others have one.

    A program that writes three decimals writes them behind all numbers of a column.
    """
    bare = {tidy(cell) for cell in cells if "," not in cell and "." not in cell}
    return sum(bool(re.fullmatch(r"[-+]?[1-9]\d{0,2}", text)) for text in bare) >= FEWEST_BARE
