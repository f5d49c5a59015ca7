"""Reports that are a verdict, some figures and tables: of convergence, verification, stability and speed.

What they hold is said here as data; the look is that of all reports.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Protocol

from reports.base.format import breakable, publish

AGAIN = "run the same command again"


@dataclass(frozen=True)
class ReportTable:
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
class ReportPart:
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
    table: ReportTable | None = None
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
    parts: Sequence[ReportPart]
    limits: Sequence[str]
    warnings: Sequence[str] = field(default_factory=tuple)


class Origin(Protocol):
    """What a finished run says of where it comes from: device, command line, versions and commit."""

    @property
    def device(self) -> str:
        """Device of the simulations."""

    @property
    def command(self) -> Sequence[str]:
        """Words of the command line, the first is the command."""

    @property
    def versions(self) -> Mapping[str, str]:
        """Versions of cutcal, Python and packages."""

    @property
    def git(self) -> str | None:
        """Commit of the checkout, None where cutcal was installed."""


def brief_content(document: Path, brief: Brief, origin: Origin) -> dict[str, Any]:
    """What a report prints, as text.

    Args:
        document: The JSON file of the run; the report has its date.
        brief: What the report holds.
        origin: Where the run comes from.

    Returns:
        The brief by the names of its attributes, its pictures as file names, and where the run comes from.
    """
    parts = [{**asdict(part), "picture": f"part{k}.svg" if part.picture else ""} for k, part in enumerate(brief.parts)]
    return {
        **asdict(brief),
        "parts": parts,
        "provenance": provenance_lines(origin),
        "cutcal": origin.versions.get("cutcal", ""),
        "created": _date(document).strftime("%Y-%m-%d %H:%M"),
    }


def typeset_brief(document: Path, brief: Brief, origin: Origin) -> Path:
    """Write ``report.pdf`` beside a document; the same document gives the same bytes, apart from its date.

    Args:
        document: The JSON file of the run; the report has its date.
        brief: What the report holds.
        origin: Where the run comes from.

    Returns:
        Path of the report.

    Raises:
        ReportError: The report cannot be written.
    """
    pictures = {f"part{k}.svg": part.picture for k, part in enumerate(brief.parts) if part.picture}
    target = document.with_name("report.pdf")
    publish(target, "brief.typ", brief_content(document, brief, origin), pictures, date=_date(document))
    return target


def _date(document: Path) -> datetime:
    """When a document was written."""
    return datetime.fromtimestamp(int(document.stat().st_mtime), tz=timezone.utc)


def provenance_lines(origin: Origin) -> dict[str, Any]:
    """Commit, device, command and versions as a report shows them."""
    words = ["cutcal", *origin.command] if origin.command else []
    return {
        "commit": origin.git or "",
        "device": breakable(origin.device),
        "command": [breakable(shlex.quote(word)) for word in words],
        "versions": ", ".join(f"{name}\u00a0{origin.versions[name]}" for name in sorted(origin.versions)),
    }
