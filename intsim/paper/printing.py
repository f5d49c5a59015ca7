"""A figure of the paper beside ours, as text for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from intsim.outcomes import SuccessRate
from intsim.paper.tables import PaperComparison, PaperTable

WIDTH = 100  # of a line of sentences
INDENT, GAP = 2, 3  # before a table, and between its columns
MISSING, NOT_PRINTED = "-", "not printed as numbers"
DASH = " A dash: no such episode of ours, or no such row in the paper."


def percent(rate: float) -> str:
    """A rate in percent."""
    return f"{100 * rate:.0f} %"


def rate_words(found: SuccessRate | None) -> str:
    """A rate of ours with its interval; a dash where there is no episode."""
    if found is None:
        return MISSING
    return f"{found.successes} of {found.trials} ({100 * found.low95:.0f} to {100 * found.high95:.0f} %)"


def printed_words(printed: Mapping[str, float] | None) -> str:
    """What the paper prints of a row; a dash where it has no such row."""
    if printed is None:
        return NOT_PRINTED
    return ", ".join(f"{model} {percent(rate)}" for model, rate in printed.items()) or MISSING


def text(found: PaperComparison) -> str:
    """All tables of a figure, and the sentences below them.

    Args:
        found: The figure.

    Returns:
        Lines for a terminal.
    """
    name = found.figure.replace("fig", "Fig. ").replace("table", "Table ")
    lines = [f"{name} of the paper: {found.title}"]
    for table in found.tables:
        lines += ["", *_wrapped(f"{table.policy}; {table.world}; {_foods(table.foods)}", 0), *_grid(table), ""]
        lines += _sentences("What differs from the paper:", table.differs)
    dash = any(cell == MISSING for table in found.tables for line in _cells(table) for cell in line)
    lines += ["", *_wrapped("Brackets hold 95 % intervals (Wilson 1927)." + DASH * dash, INDENT)]
    if found.words:
        lines += _wrapped(f"The paper in words: {found.words}.", INDENT)
    return "\n".join([*lines, *_wrapped(f"Printed numbers: CulinaryCut, {found.source}.", INDENT)])


def _foods(foods: Sequence[str]) -> str:
    return f"{len(foods)} foods" if len(foods) > 3 else ", ".join(foods)


def _cells(table: PaperTable) -> list[list[str]]:
    """Rows and columns, the paper's last, under their heads."""
    columns = list(dict.fromkeys(name for row in table.rows for name in row.ours))
    head = ["", *(f"ours: {name}" for name in columns), "paper"]
    return [
        head,
        *(
            [row.label, *(rate_words(row.ours.get(name)) for name in columns), printed_words(row.paper)]
            for row in table.rows
        ),
    ]


def _grid(table: PaperTable) -> list[str]:
    """The same, each column as wide as it has to be."""
    cells = _cells(table)
    widths = [max(map(len, column)) + GAP for column in zip(*cells, strict=True)]
    return [
        (" " * INDENT + "".join(f"{cell:{width}s}" for cell, width in zip(line, widths, strict=True))).rstrip()
        for line in cells
    ]


def _sentences(head: str, said: Sequence[str]) -> list[str]:
    return [f"{' ' * INDENT}{head}", *(line for one in said for line in _wrapped(one, INDENT, "- "))]


def _wrapped(said: str, indent: int, mark: str = "") -> list[str]:
    first = " " * indent + mark
    return textwrap.wrap(said, WIDTH, initial_indent=first, subsequent_indent=" " * len(first))
