"""The keys of every JSON document, as tables that are made from its schema; for the directive ``documents``."""

from __future__ import annotations

import re
from typing import Any

from calib.io.schema import COMMON, schema, tag

LISTS = ("foods", "knives", "schemas")
"""Documents that are lists of names."""
DEPTH = 2
"""How far keys within keys are told."""


def resolved(part: dict[str, Any], whole: dict[str, Any]) -> dict[str, Any]:
    """A part of a schema, with what it points to and its own words."""
    if "$ref" not in part:
        return part
    *_, name = part["$ref"].split("/")
    own = part["$ref"].startswith("#") and name in whole["$defs"]
    home = whole["$defs"] if own else whole["$defs"][COMMON]["$defs"]  # whose parts point to each other
    return resolved(home[name], whole) | {key: value for key, value in part.items() if key != "$ref"}


def keys(part: dict[str, Any], whole: dict[str, Any], depth: int = DEPTH, before: str = "") -> dict[str, str]:
    """Meaning of each key of a document, by its path; ``[]`` are the items of a list, ``*`` any name.

    Args:
        part: Schema of the document, or of a part of it.
        whole: Schema of the document, in which it points to others.
        depth: How far down.
        before: Path of the part.
    """
    part, found = resolved(part, whole), {}
    for more in [*part.get("allOf", []), *part.get("anyOf", [])]:
        found |= keys(more, whole, depth, before)
    for name, inner in part.get("properties", {}).items():
        one = resolved(inner, whole)
        found[before + name] = one.get("description", "")
        if depth > 1:
            found |= keys(one, whole, depth - 1, f"{before}{name}.")
    for name, inner in (("[]", part.get("items")), ("*", part.get("additionalProperties"))):
        if isinstance(inner, dict):
            found |= keys(inner, whole, depth, f"{before.removesuffix('.')}{name}." if name == "[]" else f"{before}*.")
    return found


def row(path: str, text: str) -> str:
    """A row of a table: key, unit, meaning."""
    unit = re.search(r" \[([^\]]*)\]", text)
    plain = text if unit is None else text.replace(unit[0], "", 1)
    plain = plain.replace("|", "\\|").replace("*", "\\*").replace("`", "").replace("<", "&lt;")
    return f"| `{path}` | {'-' if unit is None else unit[1]} | {plain} |\n"


def section(name: str) -> str:
    """What the page says of one document."""
    whole = schema(name)
    head = f"### {tag(name)}\n\n{whole['title']}. {whole['description']}\n\n"
    if name in LISTS:
        return head
    listed = "".join(row(path, text) for path, text in keys(whole, whole).items())
    return f"{head}| key | unit | meaning |\n|---|---|---|\n{listed}\n"
