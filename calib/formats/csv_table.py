"""CSV files as loggers and machines write them: any separator, words above the header, units below it or stated in a
line, decimals after a comma, thousands set off, no header at all."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence

from calib.errors import TraceError
from calib.formats.csv_layout import FEW, Layout, are_units, is_words, layout_of
from calib.io.wording import brief
from calib.table.encoding import decode
from calib.table.numerals import as_plain, is_number, number_and_unit, styles_of
from calib.table.table import MEASURED, Table, check_names
from calib.table.units import is_unit, split_unit
from calib.table.vector_fields import units, written_vectors

_STATED = re.compile(
    r"\W*(?:units?\s+(?:of\s+)?(?P<of>[\w ]+?)|(?P<what>[\w ]+?)\s+units?)\s*"
    r"[:=;,\t]+\s*\"?(?P<unit>[^\s,;\"]{1,15})\"?\W*",
    re.IGNORECASE,
)
"""A line such as ``Force Units: lbf``."""
_SYNONYMS = (
    ("force", "load", "resistance", "fx", "fy", "fz"),
    ("position", "displacement", "extension", "distance", "stroke", "travel", "height", "length", "depth", "crosshead"),
    ("time",),
)
"""Words of a line about units, and of the columns that it is about."""
_WRENCH = ("frame_id", *(f"wrench.{kind}.{axis}" for kind in ("force", "torque") for axis in "xyz"))
_POSE = ("frame_id", *(f"pose.position.{axis}" for axis in "xyz"), *(f"pose.orientation.{axis}" for axis in "xyzw"))
_STAMPED = {len(tail) + 2: ("header.stamp.sec", "header.stamp.nanosec", *tail) for tail in (_WRENCH, _POSE)}
"""What ``ros2 topic echo --csv`` writes of a stamped wrench and a stamped pose, without a header, by its width."""


def table_of_csv(source: str, raw: bytes, decimal: str | None = None) -> Table:
    """Split a CSV file into header and rows; comments and blank lines are dropped, line numbers kept.

    Args:
        source: What errors call the file.
        raw: Its content.
        decimal: The mark before decimals, a point or a comma; None to tell it from the numbers.

    Returns:
        The table, all cells as text.

    Raises:
        TraceError: It is no CSV file.
    """
    text, notes = decode(source, raw, "CSV")
    numbered = [(i, line) for i, line in enumerate(re.split(r"\r\n|\n|\r", text), start=1) if line.strip()]
    comments = [line for _, line in numbered if line.lstrip().startswith("#")]
    body = [(i, line) for i, line in numbered if not line.lstrip().startswith("#")]
    if body and re.fullmatch(r"sep=.", body[0][1].strip(), re.IGNORECASE):  # a line for Excel
        body = body[1:]
    if len(body) < 2:
        raise TraceError(f"{source}: {'a header but no data' if body else 'nothing but comments'}")
    layout = layout_of(source, body)
    first = layout.rows[0][0] if layout.rows else len(numbered)
    heads = [line for i, line in numbered if i < first and line.lstrip().startswith("#")]
    names, hint, said = _names(source, layout, heads)
    if not layout.rows:
        check_names(source, names)
        raise TraceError(f"{source}: a header but no data")
    columns, left_out, more = _columns(source, names, layout)
    columns, in_cells = _without_units(columns)
    columns, styled = _in_python(source, columns, decimal or _stated_decimal(layout))
    lines = [" ".join(cells) if len(cells) == 1 else ";".join(cells) for cells in layout.above] + comments
    return Table(
        source=source,
        columns=columns,
        rows=[line for line, _ in layout.rows],
        row="row",
        sha256=hashlib.sha256(raw).hexdigest(),
        label=_label(comments),
        units=units(names, columns) | _units(names, layout, lines) | _units_in_comments(names, heads) | in_cells,
        left_out=left_out,
        notes=(*notes, *said, *_left_out(source, layout), *more, *styled),
        parts=layout.parts,
        hint=hint,
    )


def _left_out(source: str, layout: Layout) -> list[str]:
    """What of the file is no part of the table, one sentence each."""
    above, notes = len(layout.above), []
    if above:
        were = "lines above the header were" if above > 1 else "line above the header was"
        notes.append(f"{source}: {above} {were} left out")
    if layout.cut_off is not None:
        notes.append(f"{source}: the last row, {layout.cut_off}, is cut off and was left out")
    if layout.no_samples:
        count, first = len(layout.no_samples), layout.no_samples[0]
        many = f"{count} lines that are no samples, the first is row {first}, were" if count > 1 else f"row {first} was"
        notes.append(f"{source}: {many} left out" if count > 1 else f"{source}: {many} left out, it is no sample")
    if layout.blocks > 1:
        notes.append(
            f"{source}: the same columns stand beside each other {layout.blocks} times; each is a record of its own"
        )
    return notes


def _names(source: str, layout: Layout, comments: Sequence[str]) -> tuple[list[str], str, list[str]]:
    """Names of the columns, what to do where they are only numbers, and what was assumed.

    They are those of the header, of a comment as wide as the table, of a ROS message, or the columns' numbers.
    """
    if layout.header:
        names = [re.sub(r"^[#%]\s+", "", name.strip()) for name in layout.header]
        return [name or f"column {i}" for i, name in enumerate(names, start=1)], "", []
    first = layout.rows[0][1] if layout.rows else []
    told = [cells for comment in comments for cells in _cells_of(comment) if len(cells) == len(first) > 1]
    told = [cells for cells in told if is_words(cells) and not are_only_units(cells)]
    if told:
        return max(reversed(told), key=_told_by), "", []
    stamped = _STAMPED.get(len(first))
    if stamped and not is_number(first[2]) and all(is_number(cell) for k, cell in enumerate(first) if k != 2):
        what = "stamped wrench" if "wrench.force.x" in stamped else "stamped pose"
        return list(stamped), "", [f"{source}: no header, read as ros2 topic echo --csv writes a {what}"]
    names = [f"column {i}" for i in range(1, len(first) + 1)]
    shown = ", ".join(f"{name}: {brief(cell.strip(), 12)}" for name, cell in zip(names[:6], first, strict=False))
    hint = (
        f"the first row holds numbers; add a header such as time_s,force_N, or name columns by number and unit "
        f"({shown}), as in --time-col 'column 1=s'"
    )
    return names, hint, []


def _cells_of(comment: str) -> list[list[str]]:
    """The cells of a comment, by each of what may separate them."""
    text = re.sub(
        r"^\W*(columns?|fields?|header|names?|units?)\s*:", "", comment.strip().lstrip("#").strip(), flags=re.I
    )
    return [[cell.strip() for cell in re.split(mark, text.strip())] for mark in (",", ";", r"\t", r"\s{2,}", r"\s+")]


def _told_by(cells: Sequence[str]) -> int:
    """How many cells of a comment look like names of columns: with a unit, or a word for what is measured."""
    known = {word for group in _SYNONYMS for word in group}
    words = [set(re.split(r"[\W_]+", cell.lower())) for cell in cells]
    return sum(bool(split_unit(cell).text) + 2 * bool(own & known) for cell, own in zip(cells, words, strict=True))


def _units_in_comments(names: Sequence[str], comments: Sequence[str]) -> dict[str, str]:
    """Units of a comment that holds nothing else, one for each column."""
    for comment in comments:
        for cells in _cells_of(comment):
            if len(cells) == len(names) and are_only_units(cells):
                return {name: cell.strip(" []()") for name, cell in zip(names, cells, strict=True)}
    return {}


def _columns(
    source: str, names: Sequence[str], layout: Layout
) -> tuple[dict[str, tuple[str, ...]], dict[str, str], list[str]]:
    """The cells of each column by name, those that were left out and why, and what was done, one sentence each.

    A column that stands twice with the same cells is one. An empty one is none, unless LabVIEW's header says by how
    much its time goes on.
    """
    found: dict[str, tuple[str, ...]] = {}
    left_out, notes = {}, []
    kept = []
    for name, cells in zip(names, zip(*(row for _, row in layout.rows), strict=True), strict=True):
        if name in found and found[name] == cells and len(cells) > FEW:
            notes.append(f"{source}: column {brief(name)} stands there twice with the same numbers; one was left out")
            continue
        kept.append(name)
        found.setdefault(name, cells)
    check_names(source, kept)
    for name in [name for name, cells in found.items() if not any(cell.strip() for cell in cells)]:
        step = _increment(layout) if name == "X_Value" else None
        if step is None:
            del found[name]
            left_out[name] = "all its cells are empty"
        else:
            found[name] = tuple(repr(step * k) for k in range(len(layout.rows)))
            notes.append(f"{source}: {name} is empty; times go on by the Delta_X of {step:g} s in the header")
    for name, split in written_vectors(found).items():
        del found[name]
        check_names(source, [*found, *split])
        found |= split
        notes.append(f"{source}: the cells of {brief(name)} hold vectors, read as {', '.join(split)}")
    return found, left_out, notes


def _without_units(columns: dict[str, tuple[str, ...]]) -> tuple[dict[str, tuple[str, ...]], dict[str, str]]:
    """The cells without the unit that stands behind each number of a column, and those units by name."""
    done, units = dict(columns), {}
    for name, cells in columns.items():
        filled = [cell for cell in cells if cell.strip()]
        if not filled or not number_and_unit(filled[0])[1]:
            continue
        split = {cell: number_and_unit(cell) for cell in filled}
        written = {unit for _, unit in split.values()}
        if len(written) == 1 and "" not in written:
            units[name] = written.pop()
            done[name] = tuple(split[cell][0] if cell.strip() else cell for cell in cells)
    return done, units


def _increment(layout: Layout) -> float | None:
    """The step of the time that LabVIEW's header states for all channels [s]."""
    for cells in layout.above:
        if cells[0].strip() == "Delta_X":
            steps = {as_plain(cell, mark) for cell in cells[1:] if cell.strip() for mark in (".", ",")} - {None}
            step = steps.pop() if len(steps) == 1 else None
            return step if step is not None and step > 0.0 else None
    return None


def are_only_units(cells: Sequence[str]) -> bool:
    """Whether all cells of a line are units."""
    return all(is_unit(cell) for cell in cells)


def _units(names: Sequence[str], layout: Layout, lines: Sequence[str]) -> dict[str, str]:
    """Units by name of the column: of the row below the header, of a row above it, of lines about the record."""
    found: dict[str, str] = {}
    for line in lines:
        match = _STATED.fullmatch(line)
        if match and is_unit(match.group("unit")):
            found |= {name: match.group("unit") for name in _meant(names, match.group("of") or match.group("what"))}
    for cells in layout.above:
        if re.fullmatch(r"\W*(y_)?units?(_label)?\W*", cells[0], re.IGNORECASE) and are_units(cells[1:] or [""]):
            found |= {n: c.strip(" []()") for n, c in zip(names[1:], cells[1:], strict=False) if is_unit(c)}
    below = {name: cell.strip(" []()-") for name, cell in zip(names, layout.units, strict=False)}
    return found | {name: unit for name, unit in below.items() if unit}


def _meant(names: Sequence[str], words: str) -> list[str]:
    """Columns that a line about units means, by a word that both have, or words of one meaning."""
    asked = set(words.lower().split())
    for group in _SYNONYMS:
        if asked & set(group):
            asked |= set(group)
    return [name for name in names if asked & set(re.split(r"[\W_]+", name.lower()))]


def _in_python(
    source: str, columns: dict[str, tuple[str, ...]], decimal: str | None
) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """The cells with numbers as Python writes them, and what was assumed, one sentence each."""
    styles = styles_of(columns, decimal)
    done = columns | {name: tuple(map(style.plain, columns[name])) for name, style in styles.items()}
    notes = []
    commas = [name for name, style in styles.items() if style.decimal == ","]
    if commas:
        notes.append(f"{source}: decimals of {', '.join(brief(name) for name in commas)} follow a comma")
    for decimal, mark in ((".", "commas"), (",", "points")):
        grouped = [name for name, style in styles.items() if style.grouped and style.decimal == decimal]
        if grouped:
            notes.append(f"{source}: {mark} in {', '.join(brief(name) for name in grouped)} set off thousands")
    return done, notes


def _stated_decimal(layout: Layout) -> str | None:
    """The mark before decimals that a line above the header states, as LabVIEW writes it."""
    for cells in layout.above:
        if re.fullmatch(r"decimal[_ ]?separator", cells[0].strip(), re.IGNORECASE) and len(cells) > 1:
            return cells[1].strip() if cells[1].strip() in (".", ",") else None
    return None


def _label(comments: Sequence[str]) -> str:
    """The label that a ``# label: ...`` comment gives, ``measured`` without one."""
    for comment in comments:
        found = re.match(r"\s*#\s*label\s*:\s*(\S+)", comment)
        if found:
            return found.group(1).lower()
    return MEASURED
