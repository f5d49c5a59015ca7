"""CSV files as loggers write them: other separators, lines above the header, a row of units, decimals with a comma."""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Sequence

from calib.errors import TraceError
from calib.io.wording import brief, quoted
from calib.trace.table import MEASURED, Table, as_float, check_names, decoded
from calib.trace.units import is_unit

SEPARATORS = ",;\t"
MOST_ABOVE = 60
"""Lines above a header that are taken for words about the record; a table that changes its width later is damaged."""
DECIMAL_COMMA = re.compile(r"\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*")
"""A number whose decimals follow a comma."""
UNIT_CELL = re.compile(
    r"\s*[\[(]?\s*[A-Za-z%\u00b5\u03bc\u00b0][\w/^%.*\u00b7-]{0,7}\s*[\])]?\s*|\s*[\[(]?\s*-?\s*[\])]?\s*"
)
"""A cell of a row of units: a short word, in brackets or not, or nothing."""

NumberedLines = list[tuple[int, str]]
NumberedRows = list[tuple[int, list[str]]]


def table_of_csv(source: str, raw: bytes) -> Table:
    """Split a CSV file into header and rows; comments and blank lines are dropped, line numbers kept.

    Args:
        source: What errors call the file.
        raw: Its content.

    Returns:
        The table, all cells as text.

    Raises:
        TraceError: It is no CSV file with a header.
    """
    text = decoded(source, raw, "CSV")
    numbered = [(i, line) for i, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1) if line.strip()]
    comments = [line for _, line in numbered if line.lstrip().startswith("#")]
    body = [(i, line) for i, line in numbered if not line.lstrip().startswith("#")]
    if len(body) < 2:
        raise TraceError(f"{source}: {'a header but no data' if body else 'nothing but comments'}")
    above, separator = _above(body)
    (_, header), *rows = _cells(source, body[above:], separator)
    names = [name.strip() or f"column {i}" for i, name in enumerate(header, start=1)]
    _check_header(source, names)
    for line, row in rows:
        if len(row) != len(names):
            raise TraceError(f"{source}, row {line}: {len(row)} cells, the header has {len(names)}")
    notes = (
        [f"{source}: {above} line{'s' if above > 1 else ''} above the header {_were(above)} left out"] if above else []
    )
    units, rows = _units(names, rows)
    columns = dict(zip(names, zip(*(row for _, row in rows), strict=True), strict=True))
    if separator != ",":
        commas = [name for name, cells in columns.items() if _has_commas(cells)]
        columns |= {name: tuple(cell.replace(",", ".") for cell in columns[name]) for name in commas}
        if commas:
            notes.append(f"{source}: decimals of {', '.join(brief(name) for name in commas)} follow a comma")
    return Table(
        source=source,
        columns=columns,
        rows=[line for line, _ in rows],
        row="row",
        sha256=hashlib.sha256(raw).hexdigest(),
        label=_label(comments),
        units=units,
        notes=tuple(notes),
    )


def _were(count: int) -> str:
    return "were" if count > 1 else "was"


def _above(body: NumberedLines) -> tuple[int, str]:
    """How many lines stand above the header, and what separates cells.

    The table is the block of lines of one width at the end. It begins with its last line of words, or with the one
    before where the last has the units. What is above are words about the record. Where one of the lines above holds
    numbers alone, it is a damaged table instead, and the header is the first line.
    """
    lines = [line for _, line in body]
    own = max(SEPARATORS, key=lines[0].count)
    for separator in dict.fromkeys((own, "\t", ";", ",")):
        counts = [line.count(separator) for line in lines]
        if not counts[-1] or not _numeric(lines[-1], separator):
            continue
        block = next((k for k in range(len(counts) - 1, -1, -1) if counts[k] != counts[-1]), -1) + 1
        first = block + _header(lines[block : block + MOST_ABOVE], separator)
        if first == 0 and separator == own:
            return 0, own
        sound = not any(_numeric(line, separator) for line in lines[:first]) and _words(lines[first], separator)
        if 0 < first <= MOST_ABOVE and len(lines) - first > 2 and sound:
            return first, separator
    return 0, own


def _header(lines: Sequence[str], separator: str) -> int:
    """The last line of words, or the one above where most of its cells are units; 0 where there is none."""
    words = [_words(line, separator) for line in lines]
    last = max((k for k, yes in enumerate(words) if yes), default=0)
    cells = [cell for cell in lines[last].split(separator) if cell.strip()]
    units = 2 * sum(is_unit(cell) for cell in cells) > len(cells)
    return last - 1 if last and words[last - 1] and units else last


def _words(line: str, separator: str) -> bool:
    """Whether a line could be a header: words in two cells at least, and no number."""
    cells = line.split(separator)
    return sum(bool(cell.strip()) for cell in cells) > 1 and not any(_number(cell, separator) for cell in cells)


def _numeric(line: str, separator: str) -> bool:
    """Whether a line holds numbers alone."""
    return all(_number(cell, separator) for cell in line.split(separator))


def _number(cell: str, separator: str) -> bool:
    return as_float(cell) is not None or (separator != "," and DECIMAL_COMMA.fullmatch(cell) is not None)


def _cells(source: str, body: NumberedLines, separator: str) -> NumberedRows:
    """Line number and cells of each row; a quoted cell may hold several lines.

    Raises:
        TraceError: A quote that is not closed, or a cell that is too long.
    """
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


def _units(names: list[str], rows: NumberedRows) -> tuple[dict[str, str], NumberedRows]:
    """Units from the row below the header, where it holds nothing else and numbers follow; and the other rows."""
    if len(rows) < 2 or not any(as_float(cell) is not None or DECIMAL_COMMA.fullmatch(cell) for cell in rows[1][1]):
        return {}, rows
    cells = rows[0][1]
    if not all(UNIT_CELL.fullmatch(cell) for cell in cells) or any(as_float(cell) is not None for cell in cells):
        return {}, rows
    stated = {name: cell.strip(" []()-") for name, cell in zip(names, cells, strict=True)}
    return ({name: unit for name, unit in stated.items() if unit}, rows[1:]) if any(stated.values()) else ({}, rows)


def _has_commas(cells: Sequence[str]) -> bool:
    """Whether the numbers of a column have decimals after a comma: some have, and all others are whole."""
    some = any(DECIMAL_COMMA.fullmatch(cell) for cell in cells)
    return some and all(DECIMAL_COMMA.fullmatch(cell) or re.fullmatch(r"\s*[-+]?\d+\s*|\s*", cell) for cell in cells)


def _check_header(source: str, names: list[str]) -> None:
    """Refuse a header with one column, without names, or with a name twice."""
    if len(names) < 2:
        raise TraceError(f"{source}: not a CSV file with a force column and one beside it (header: {quoted(names[0])})")
    if all(as_float(name) is not None for name in names):
        raise TraceError(f"{source}: the first row holds numbers; add a header such as time_s,force_N")
    check_names(source, names)


def _label(comments: list[str]) -> str:
    """The label that a ``# label: ...`` comment gives, ``measured`` without one."""
    for comment in comments:
        found = re.match(r"\s*#\s*label\s*:\s*(\S+)", comment)
        if found:
            return found.group(1).lower()
    return MEASURED
