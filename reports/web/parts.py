"""Parts that every page has: pairs of label and text, lists, and marks that need no colour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from reports.base.labels import capital
from reports.web.markup import Markup, element, joined

TEMPLATES = Path(__file__).resolve().parents[1] / "templates"
MARKS = {"yes": ("✓", "passed"), "no": ("✗", "failed"), "none": ("–", "not run")}
HINT = "Point at a curve, or move the slider with the arrow keys, for the values there."


def assets() -> tuple[str, str]:
    """Style and script of a page."""
    style, script = ((TEMPLATES / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    return style, script


def mark(kind: str) -> Markup:
    """A sign and a word for ``yes``, ``no`` or ``none``."""
    sign, word = MARKS[kind]
    return element("span", f"{sign} ", word, class_=kind)


def pairs(rows: Iterable[Iterable[str]], kind: str = "span") -> Markup:
    """Labels and their texts."""
    cells = [joined([element("dt", name), element("dd", element(kind, text))]) for name, text in rows]
    return element("dl", *cells)


def items(texts: Iterable[str], **attributes: str) -> Markup:
    """A list."""
    return element("ul", *(element("li", text) for text in texts), **attributes)


def limits_section(content: Mapping[str, Any]) -> Markup:
    """What a run does not show, and what it warned of.

    Args:
        content: Texts of the report, with lists of both: ``limits`` and ``warnings``.

    Returns:
        The section.
    """
    return element(
        "section",
        element("h2", "What this does not show"),
        items(content["limits"]) if content["limits"] else element("p", "Nothing was stated by the run."),
        element("h3", "Warnings"),
        items(content["warnings"]) if content["warnings"] else element("p", "None."),
        id="limits",
    )


def stamped(kind: str, name: str, source: str, passed: bool | None, parts: dict[str, str]) -> Markup:
    """The head of a page: what it is, whether it passed, and links to its parts.

    Args:
        kind: What was run.
        name: Its food, or what it is about.
        source: File that it was run on; empty where there are several.
        passed: Whether it passed; None where there is no verdict.
        parts: Names of the sections, by their places.

    Returns:
        The header.
    """
    word, look = ("✓ passed", "stamp") if passed else ("✗ not passed", "stamp failed")
    stamp = None if passed is None else element("p", word, class_=look)
    of = element("p", element("code", source)) if source else None
    what = element("div", element("p", kind, class_="kind"), element("h1", name), of)
    links = [element("a", text, href=f"#{place}") for place, text in parts.items()]
    return element("header", element("div", what, stamp, class_="top"), element("nav", *links, aria_label="Parts"))


def chart(label: str, across: str = "stroke") -> Markup:
    """The chart, what its cursor shows, and the slider that moves it; a script draws them.

    Args:
        label: What the chart shows, for readers of the screen.
        across: What its axis below is.
    """
    way = element("input", type="range", id="cursor", min="0", step="1", value="0")
    return joined([
        element("div", element("svg", role="img", aria_label=label, id="chart"), element("div", id="tip", hidden=True),
                id="box", hidden=True),
        element("p", element("label", f"{capital(across)} ", way), " ", element("output", for_="cursor", id="at"),
                hidden=True, class_="way"),
        element("p", HINT, class_="note screen", hidden=True),
    ])  # fmt: skip
