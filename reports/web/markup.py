"""HTML that is put together from parts: every text is escaped unless a function of this module has made it.

A name of a food or of a file can therefore be no element, and what the browser may load or run is said in the document
itself: its own style and script, by their hash, and pictures that are in it.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

VOID = frozenset({"br", "img", "input", "meta", "wbr"})
"""Elements that have no content and no end."""
LISTED = "all"
"""Name of the table that scrolls by itself where a screen is too narrow."""
SOFT_BREAK = "\u200b"
"""Where a long word may break in texts of the typesetter."""


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


Part = str | None
"""What an element may hold: markup as it is, other text escaped, None for nothing."""


def element(kind: str, *parts: Part, **attributes: str | bool | None) -> Markup:
    """An element with its content.

    Args:
        kind: Its name.
        parts: What it holds, one after the other.
        attributes: Its attributes: ``class_`` is class, other lines below are hyphens; True is an attribute without a
            value, None or False none at all.

    Returns:
        The element.
    """
    said = []
    for key, value in attributes.items():
        word = key.rstrip("_").replace("_", "-")
        if value is True:
            said.append(f" {word}")
        elif value is not None and value is not False:
            said.append(f' {word}="{escape(value)}"')
    start = f"<{kind}{''.join(said)}>"
    return Markup(start if kind in VOID else f"{start}{joined(parts)}</{kind}>")


def joined(parts: Iterable[Part]) -> Markup:
    """Parts one after the other."""
    return Markup("".join(_html(part) for part in parts if part is not None))


def _html(text: str) -> str:
    """A part as HTML; where a long word may break, the browser is told so."""
    return text if isinstance(text, Markup) else escape(text).replace(SOFT_BREAK, "<wbr>")


def table(head: Sequence[Part], rows: Iterable[Sequence[Part]], numbers: Iterable[int] = (), **more: str) -> Markup:
    """A table whose first cell of each row is its heading.

    Where a screen is too narrow the cells of a row flow below its heading, each after the title of its column; the long
    list of members scrolls instead.

    Args:
        head: Titles of the columns.
        rows: Cells of the rows.
        numbers: Columns that are set to the right.
        more: ``id``, and ``label``, which names the table for readers of the screen.

    Returns:
        The table.
    """
    listed = more.get("id") == LISTED
    right = {k: "number" for k in numbers}
    top = element("tr", *(element("th", cell, scope="col", class_=right.get(k)) for k, cell in enumerate(head)))
    titles = [None if listed else cell for cell in head]
    body = []
    for row in rows:
        cells = [element("th", row[0], scope="row")]
        cells += [element("td", cell, class_=right.get(k), data_head=titles[k]) for k, cell in enumerate(row[1:], 1)]
        body.append(element("tr", *cells))
    drawn = element("table", element("thead", top), element("tbody", *body), id=more.get("id"))
    return element("div", drawn, class_="wide", role="region", tabindex="0", aria_label=more.get("label"))


def data(name: str, content: Mapping[str, Any]) -> Markup:
    """Plain data that a script finds by the name; no text in it can end the element."""
    text = json.dumps(content, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for letter in "<>&":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(f'<script type="application/json" id="{escape(name)}">{text}</script>')


def picture(svg: bytes, alt: str) -> Markup:
    """An SVG document as a picture within the page."""
    source = "data:image/svg+xml;base64," + base64.b64encode(svg).decode()
    return element("img", src=source, alt=alt, class_="paper")


def document(title: str, body: Markup, style: str, script: str) -> str:
    """A whole page that loads nothing and runs one script.

    Args:
        title: Its title.
        body: What it shows.
        style: Its style sheet.
        script: Its script.

    Returns:
        The HTML document.
    """
    allowed = f"default-src 'none'; img-src data:; style-src {_hash(style)}; script-src {_hash(script)}"
    head = element(
        "head",
        element("meta", charset="utf-8"),
        Markup(f'<meta http-equiv="Content-Security-Policy" content="{allowed}">'),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        Markup(f"<style>{style}</style>"),
    )
    whole = element("body", body, Markup(f"<script>{script}</script>"))
    return f'<!doctype html>\n<html lang="en">\n{head}\n{whole}\n</html>\n'


def _hash(text: str) -> str:
    """What a policy names a style sheet or a script by."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
