"""Reports that are a verdict, some figures and tables: of convergence, verification, stability and speed.

What they hold is said here as data; the look is that of all reports.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from reports import ReportError
from reports.base.format import breakable, publish
from reports.base.run_folder import Data, read_json

AGAIN = "run the same command again"


@dataclass(frozen=True)
class Table:
    """A table of text.

    Attributes:
        head: Titles of the columns.
        widths: Widths of the columns: ``auto``, a length as ``20mm``, or a part of the rest as ``1fr``.
        rows: The text of each row.
        marked: Column whose entries are ``yes``, ``no`` or ``none``, shown by a sign and a word; -1: there is none.
        left: Columns, from the first, that are set to the left; the others are numbers.
    """

    head: Sequence[str]
    widths: Sequence[str]
    rows: Sequence[Sequence[str]]
    marked: int = -1
    left: int = 1


@dataclass(frozen=True)
class Part:
    """A part of a report: heading, text, figure and table, of which each but the heading may be missing.

    Attributes:
        title: Heading.
        text: Paragraph under it.
        picture: An SVG document.
        alt: What it shows, in words.
        table: The table.
        apart: Whether it begins a page.
    """

    title: str
    text: str = ""
    picture: bytes = b""
    alt: str = ""
    table: Table | None = None
    apart: bool = False


@dataclass(frozen=True)
class Brief:
    """A report.

    Attributes:
        kind: What it is a report of, a few words.
        name: Its heading.
        passed: Its verdict; None where there is none to give.
        sentence: The verdict in words.
        facts: Label and text of what was done.
        parts: Its parts.
        limits: What it does not show, one sentence each.
        warnings: What its reader should know of the input.
    """

    kind: str
    name: str
    passed: bool | None
    sentence: str
    facts: Sequence[tuple[str, str]]
    parts: Sequence[Part]
    limits: Sequence[str]
    warnings: Sequence[str] = field(default_factory=tuple)


def write_brief(path: Path, make: Callable[[Data], Brief]) -> Path:
    """Write ``report.pdf`` beside a document; the same document gives the same bytes, apart from its date.

    Args:
        path: The document, JSON.
        make: Says what the report holds.

    Returns:
        Path of the report.

    Raises:
        ReportError: The document is missing, damaged or incomplete, or the report cannot be written.
    """
    document = read_json(path)
    try:
        brief = make(document)
        origin = provenance(document)
    except (KeyError, TypeError, IndexError, AttributeError) as e:
        what = (
            f"{e.args[0]!r} is missing"
            if isinstance(e, KeyError) and e.args
            else "something is missing or of another kind"
        )
        raise ReportError(f"{path}: {what}; the file is incomplete or of another version of cutcal: {AGAIN}") from None
    date = datetime.fromtimestamp(int(path.stat().st_mtime), tz=timezone.utc)
    pictures = {f"part{k}.svg": part.picture for k, part in enumerate(brief.parts) if part.picture}
    parts = [{**asdict(part), "picture": f"part{k}.svg" if part.picture else ""} for k, part in enumerate(brief.parts)]
    content = {
        **asdict(brief),
        "parts": parts,
        "provenance": origin,
        "cutcal": str(document["versions"].get("cutcal", "")),
        "created": date.strftime("%Y-%m-%d %H:%M"),
    }
    target = path.with_name("report.pdf")
    publish(target, "brief.typ", content, pictures, date=date)
    return target


def provenance(document: Mapping[str, Any]) -> Data:
    """Commit, device, command and versions of a document."""
    versions, command = document["versions"], document.get("command", [])
    return {
        "commit": document.get("git") or "",
        "device": breakable(str(document.get("device") or "not recorded")),
        "command": [breakable(shlex.quote(word)) for word in ["cutcal", *command]] if command else [],
        "versions": ", ".join(f"{name}\u00a0{versions[name]}" for name in sorted(versions)),
    }
