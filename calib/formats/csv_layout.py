"""Where the table is in a text file: what separates its cells, which line names them, which states their units."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from calib.errors import TraceError
from calib.io.wording import quoted
from calib.table.clock_cells import is_clock
from calib.table.numerals import is_number, number_and_unit
from calib.table.units import is_unit, split_unit
from calib.table.vector_fields import numbers_of

SEPARATORS = (",", ";", "\t", "|", " ")
"""What may stand between cells; a blank stands for any number of them."""
MOST_ABOVE = 60
"""Lines above a header that are taken for words about the record."""
SAMPLE = 200
"""Lines from which separator and header are told."""
MOST_BELOW, MOST_BETWEEN, FEW = 40, 20, 5
"""Lines below the last row, lines of words between rows, and rows by which it is told what a row is like."""
_COMMENT_MARKS = ("%", "//", "!")
"""What stands before a header as before a comment, beside ``#``."""
_RULE = re.compile(r"[-=+:|_]*|(u?int|float)(8|16|32|64)?|double|real|numeric|integer|string|str|text", re.IGNORECASE)
"""A cell of a line that is drawn below names, or that has the types of columns."""
_COMMENT = re.compile(r"(comments?|remarks?|notes?|bemerkung(en)?|kommentar|)", re.IGNORECASE)
_NUMBER_OF_SPECIMEN = re.compile(r"[\s_#]\d+(?=\s*([\[(].*)?$)")
"""The number of a specimen in the name of a column, as in ``Load 2 (N)``."""
UNIT_CELL = re.compile(
    r"\s*[\[(]?\s*[A-Za-z%\u00b5\u03bc\u00b0\"][\w/^%.*\u00b7-]{0,14}\s*[\])]?\s*|\s*[\[(]?\s*[-/]?\s*[\])]?\s*"
)
"""A cell of a row of units: a short word, in brackets or not, or nothing."""

NumberedLines = list[tuple[int, str]]
NumberedRows = list[tuple[int, list[str]]]


@dataclass(frozen=True)
class Layout:
    """Where the table is in a file.

    Attributes:
        above: Cells of each line above the header.
        header: Names of the columns, empty where the file has none.
        units: Cells of the row of units, empty where there is none.
        rows: Line number and cells of each row.
        parts: Index of the row with which each part begins.
        cut_off: Line number of a last row that is not whole and was left out, or None.
        no_samples: Line numbers of lines of words between and below the rows, which were left out.
        blocks: Specimens that stand beside each other, each with the same columns; they are parts.
    """

    above: list[list[str]]
    header: list[str]
    units: list[str]
    rows: NumberedRows
    parts: tuple[int, ...]
    cut_off: int | None = None
    no_samples: tuple[int, ...] = ()
    blocks: int = 1


def layout_of(source: str, body: NumberedLines) -> Layout:
    """Find the table in the lines of a file.

    The separator is the one that leaves the most cells that are numbers. The header is the first line of words below
    which numbers of the same width follow, with a row of units between them or not. The same header again begins
    another part.

    Args:
        source: What errors call the file.
        body: Its lines with their numbers, without comments and empty lines.

    Returns:
        The layout.

    Raises:
        TraceError: It has one column, a quote is not closed, or a row has another width than the header.
    """
    separator = _separator([line for _, line in body[:SAMPLE]])
    rows = _cells(source, body, separator)
    width = _usual_width(cells for _, cells in rows[:SAMPLE])
    if separator == " ":
        top = [(line, _names_with_blanks(text, width)) for line, text in body[: MOST_ABOVE + 2]]
        rows = [*top, *rows[len(top) :]]
    rows = _without_rules(rows)
    head = _header(rows, width)
    if head is None:
        header, units, start = ([], [], 0) if _share(rows[0][1]) > 0.5 else (rows[0][1], [], 1)
        above: list[list[str]] = []
    else:
        first, units_at = head
        header, units = rows[first][1], rows[units_at][1] if units_at is not None else []
        start = (first if units_at is None else units_at) + 1
        above = [cells for _, cells in rows[:first]]
    if len(header) == width + 1 and header[0].strip() in _COMMENT_MARKS:
        header, units = header[1:], units[1:]
    if header and len(header) < 2:
        raise TraceError(
            f"{source}: not a CSV file with a force column and one beside it (header: {quoted(header[0])}); separate "
            "cells with commas, semicolons, tabs or blanks"
        )
    data = rows[start:]
    if header:
        data, words = _without_words(data, header)
    kept, parts = _parts(data, header)
    words = tuple(line for line in words if kept and line > kept[0][0]) if header else ()
    kept, header = _without_empty_end(kept, header)
    kept, header = _as_wide(kept, header)
    kept, cut_off = _whole_rows(source, kept, len(header) or width)
    count = _blocks(header)
    if count > 1 and len(parts) == 1:
        kept, parts = _stacked(kept, len(header), count)
        size = (len(header) + 1) // count
        alike = header[:size] == header[size : 2 * size]
        header, units = [n if alike else _NUMBER_OF_SPECIMEN.sub("", n) for n in header[:size]], units[:size]
        if not header[-1].strip():
            header, kept = header[:-1], [(line, cells[: len(header) - 1]) for line, cells in kept]
    return Layout(above, header, units, kept, parts, cut_off, words, count)


def is_words(cells: Sequence[str]) -> bool:
    """Whether a line could be a header: words in two cells at least, and no number."""
    return sum(bool(cell.strip()) for cell in cells) > 1 and not any(is_number(cell) for cell in cells)


def are_units(cells: Sequence[str]) -> bool:
    """Whether a line below a header is one of units: short words, most of them units or nothing."""
    filled = [cell for cell in cells if cell.strip(" []()-")]
    return bool(filled) and all(UNIT_CELL.fullmatch(cell) for cell in cells) and not any(map(is_number, cells))


def _separator(lines: Sequence[str]) -> str:
    """What separates cells: that with which the most of them are numbers, in rows of one width."""
    tail = lines[len(lines) // 2 :]
    best, most = max(SEPARATORS[:4], key=lines[0].count), 0.0
    for separator in dict.fromkeys((best, *SEPARATORS)):
        cells = [_split(line, separator) for line in tail]
        width = _usual_width(cells)
        share = sum(_share(row) for row in cells if len(row) == width) / len(cells) if width > 1 else 0.0
        if share > most + 1e-9:
            best, most = separator, share
    return best


def _usual_width(rows: Iterable[Sequence[str]]) -> int:
    """The number of cells that most rows of a table's end have."""
    widths = [len(cells) for cells in rows]
    return Counter(widths[len(widths) // 2 :]).most_common(1)[0][0]


def _split(line: str, separator: str) -> list[str]:
    """The cells of one line."""
    if separator == " ":
        return line.split()
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _without_rules(rows: NumberedRows) -> NumberedRows:
    """The rows without lines of dashes and of types above the first numbers, as below the names in a report."""
    until = next((k for k, (_, cells) in enumerate(rows[: MOST_ABOVE + 2]) if _share(cells) > 0.5), 0)
    kept = [
        (line, cells)
        for line, cells in rows[:until]
        if not any(cells) or not all(_RULE.fullmatch(cell.strip()) for cell in cells)
    ]
    return [*kept, *rows[until:]]


def _names_with_blanks(text: str, width: int) -> list[str]:
    """The cells of a line between blanks; names with blanks in them, or before their units, are one where that gives as
    many cells as the rows have."""
    cells = text.split()
    if len(cells) > width > 1:
        for mark in (r"\s{2,}", r"\s+(?![\[(])"):
            found = re.split(mark, text.strip())
            if len(found) == width:
                return found
    return cells


def _share(cells: Sequence[str]) -> float:
    """Part of the cells that hold anything which hold numbers, vectors or times; 0 where fewer than two do."""
    filled = [cell for cell in cells if cell.strip()]
    held = sum(
        is_number(cell) or is_clock(cell) or len(numbers_of(cell)) > 1 or number_and_unit(cell)[1] != ""
        for cell in filled
    )
    return held / len(filled) if len(filled) > 1 else 0.0


def _header(rows: NumberedRows, width: int) -> tuple[int, int | None] | None:
    """Indices of the header and of the row of units; None where there is no header."""

    def numbers_from(k: int) -> bool:
        below = [cells for _, cells in rows[k : k + 4]]
        held = [_share(cells) > 0.5 and abs(len(cells) - width) <= 1 for cells in below]
        return bool(held) and held[0] and sum(held) >= min(3, len(held))

    found: tuple[int, int | None] | None = None
    for k in range(min(len(rows) - 1, MOST_ABOVE + 1)):
        cells = rows[k][1]
        if abs(len(cells) - width) > 1 or not is_words(cells):
            continue
        here: tuple[int, int | None] | None = None
        if numbers_from(k + 1):
            above_it = rows[k - 1][1] if k else []
            here = k, None
            if k and is_words(above_it) and len(above_it) == len(cells) and _mostly_units(cells):
                here = k - 1, k if are_units(cells) else None
        elif k + 2 < len(rows) and numbers_from(k + 2):
            below = rows[k + 1][1]
            if len(below) == len(cells) and are_units(below) and _mostly_units(below) and not _mostly_units(cells):
                here = k, k + 1
        if here is None or (found is not None and not _has_units(rows, here)):
            continue
        if rows[here[0]][1] == rows[found[0]][1] if found is not None else False:
            break  # another specimen
        found = here
        start = k + 1 if here[1] is None else here[1] + 1
        held = [_share(row) > 0.5 for _, row in rows[start : start + FEW]]
        if len(held) < FEW or all(held):
            break  # what is shorter is a list of results
    return found


def _has_units(rows: NumberedRows, head: tuple[int, int | None]) -> bool:
    """Whether a header has a row of units below it, or units in its names."""
    return head[1] is not None or any(split_unit(cell).text for cell in rows[head[0]][1])


def _mostly_units(cells: Sequence[str]) -> bool:
    """Whether more than half of the cells are units; a dash, as of a column without unit, says nothing."""
    filled = [cell for cell in cells if cell.strip(" []()-")]
    return 2 * sum(map(is_unit, filled)) > len(filled)


def _parts(rows: NumberedRows, header: list[str]) -> tuple[NumberedRows, tuple[int, ...]]:
    """The rows of data, and where the header stands again; words above it and units below it are left out."""
    starts: list[int] = [0]
    kept: NumberedRows = []
    skip = False
    for line, cells in rows:
        if header and cells == header:
            while len(kept) > starts[-1] and _share(kept[-1][1]) <= 0.5:
                kept.pop()
            if len(kept) > starts[-1]:
                starts.append(len(kept))
            skip = True
        elif not (skip and are_units(cells)):
            kept.append((line, cells))
            skip = False
    return kept, tuple(starts)


def _without_words(rows: NumberedRows, header: list[str]) -> tuple[NumberedRows, tuple[int, ...]]:
    """The rows without lines that hold no sample: words between rows, and what is below the last row.

    The header where it stands again stays, with the lines between it and the rows before it.
    """
    usual = _usual_width(cells for _, cells in rows) if rows else 0
    where = [j for j in range(usual) if sum(is_number(c[j]) for _, c in rows[: 2 * FEW] if len(c) == usual) > FEW]
    if not where or sum(cells == header for _, cells in rows):
        return rows, ()
    end = len(rows)
    while end > max(len(rows) - MOST_BELOW, 1) and _is_below(rows[end - 1][1], usual, where):
        end -= 1
    if end == len(rows) - 1 and 1 < len(rows[end][1]) < usual:  # the last row was cut off
        end += 1
    between = [k for k, (_, cells) in enumerate(rows[:end]) if k and not any(map(is_number, cells)) and any(cells)]
    between = [k for k in between if not any(is_clock(cell) for cell in rows[k][1])]
    if len(between) > MOST_BETWEEN:
        between = []
    left = {*between, *range(end, len(rows))}
    return [row for k, row in enumerate(rows) if k not in left], tuple(rows[k][0] for k in sorted(left))


def _is_below(cells: Sequence[str], usual: int, where: Sequence[int]) -> bool:
    """Whether a line is none of the rows: of another width, empty, or begun with a word in place of a number."""
    if len(cells) != usual or not any(cell.strip() for cell in cells):
        return True
    first = next(cell for cell in cells if cell.strip())
    return bool(cells[where[0]] == first and re.match(r"[^\W\d_]{2}", first.strip()) and not is_number(first))


def _as_wide(rows: NumberedRows, header: list[str]) -> tuple[NumberedRows, list[str]]:
    """Rows and header of one width, where all rows lack the comment at their end, or the header the rows' number."""
    widths = {len(cells) for _, cells in rows}
    if not header or widths == {len(header)} or not widths:
        return rows, header
    width = min(widths)
    if 1 < width < len(header) and all(_COMMENT.fullmatch(name.strip()) for name in header[width:]):
        return [(line, [*cells, *[""] * (len(header) - len(cells))]) for line, cells in rows], header
    if len(widths) != 1:
        return rows, header
    numbers = [cells[0].strip() for _, cells in rows]
    if width == len(header) + 1 and numbers[0] in ("0", "1"):
        if all(text == str(k) for k, text in enumerate(numbers, start=int(numbers[0]))):
            return rows, ["index", *header]
    return rows, header


def _blocks(header: Sequence[str]) -> int:
    """How often the same columns stand beside each other, with an empty column between them or not."""
    names = [name.strip() for name in header]
    plain = [re.sub(r"\.\d+$", "", name) for name in names]  # as pandas tells the same names apart
    numbered = [_NUMBER_OF_SPECIMEN.sub("", name) for name in names]
    plain = [one if one in names else name for one, name in zip(plain, names, strict=True)]
    for wide in (names, [*names, ""], plain, [*plain, ""], numbered, [*numbered, ""]):
        for count in range(len(wide) // 2, 1, -1):
            size, rest = divmod(len(wide), count)
            if not rest and size > 1 and wide == wide[:size] * count and len(set(wide[:size])) == size:
                return count
    return 1


def _stacked(rows: NumberedRows, width: int, count: int) -> tuple[NumberedRows, tuple[int, ...]]:
    """Specimens beside each other, one below the other, and where each begins; a shorter one ends where it is empty."""
    size = (width + 1) // count
    out: NumberedRows = []
    starts = []
    for k in range(count):
        block = [(line, (cells + [""])[k * size : (k + 1) * size]) for line, cells in rows]
        while block and not any(cell.strip() for cell in block[-1][1]):
            block.pop()
        if block:
            starts.append(len(out))
        out += block
    return out, tuple(starts or [0])


def _without_empty_end(rows: NumberedRows, header: list[str]) -> tuple[NumberedRows, list[str]]:
    """Rows and header without columns at the end that have neither a name nor a cell."""
    width = max((len(cells) for _, cells in rows), default=0)
    while width > 1 and not any(len(cells) >= width and cells[width - 1].strip() for _, cells in rows):
        if len(header) >= width and header[width - 1].strip():
            break
        width -= 1
        rows = [(line, cells[:width]) for line, cells in rows]
    named = header[:width] if not any(cell.strip() for cell in header[width:]) else header
    return rows, named


def _whole_rows(source: str, rows: NumberedRows, width: int) -> tuple[NumberedRows, int | None]:
    """The rows, and the number of a last one that was cut off.

    Raises:
        TraceError: Another row has more or fewer cells than the header.
    """
    for k, (line, cells) in enumerate(rows):
        if len(cells) != width:
            if k == len(rows) - 1 and k and len(cells) < width:
                return rows[:-1], line
            twice = len(cells) >= 2 * width - 1 > 2
            remedy = (
                "separate cells by semicolons if decimals follow a comma, or repair the row"
                if twice
                else "repair or remove the row"
            )
            raise TraceError(f"{source}, row {line}: {len(cells)} cells, the header has {width}; {remedy}")
    return rows, None


def _cells(source: str, body: NumberedLines, separator: str) -> NumberedRows:
    """Line number and cells of each row; a quoted cell may hold several lines.

    Raises:
        TraceError: A quote that is not closed, or a cell that is too long.
    """
    if separator == " ":
        return [(line, text.split()) for line, text in body]
    reader = csv.reader([line for _, line in body], delimiter=separator, strict=True)
    rows: NumberedRows = []
    begin = 0
    try:
        for row in reader:
            rows.append((body[begin][0], row))
            begin = reader.line_num
    except csv.Error as error:
        raise TraceError(f"{source}, row {body[begin][0]}: not CSV ({error}); check the quotes in this row") from None
    return rows
