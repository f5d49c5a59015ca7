"""Write the table of docs/verification.md from what ``cutcal verify`` has found.

``python docs/verification_table.py runs/verify/verify.json [MORE.json ...]``: groups of a later file take the place of
those of an earlier one.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

PAGE = Path(__file__).with_name("verification.md")
HEAD = "|---|---|---|---|---|---|\n"
END = "\n## What the rows can tell"
SMALL = 5e-5  # part below which an error is no percentage


def as_part(value: float, sign: str = "") -> str:
    """A part as a percentage, or as a number where it is tiny."""
    return f"{value:{sign}.2g}" if abs(value) < SMALL else f"{100 * value:{sign}.2g} %"


def line(row: dict[str, Any]) -> str:
    """One row of the table: **bold** where it fails."""
    relative = row["expected"] != 0 and row["tolerance"] >= 1e-3
    error = as_part(row["error"], "+") if relative else f"{row['error']:+.2g}"
    allowed = as_part(row["tolerance"]) if relative else f"{row['tolerance']:g}"
    if not row["passed"]:
        error = f"**{error}**"
    numbers = f"{row['expected']:.5g} | {row['got']:.5g}"
    return f"| {row['case']} | {row['quantity']} | {numbers} | {error} | {allowed} |\n"


def main(paths: list[str]) -> None:
    """Rewrite the table.

    Args:
        paths: Files that ``cutcal verify`` wrote.
    """
    groups: dict[str, list[dict[str, Any]]] = {}
    for path in paths:
        found: dict[str, list[dict[str, Any]]] = {}
        for row in json.loads(Path(path).read_text(encoding="utf-8"))["rows"]:
            found.setdefault(row["group"], []).append(row)
        groups |= found
    text = PAGE.read_text(encoding="utf-8")
    begin, end = text.index(HEAD) + len(HEAD), text.index(END)
    known = [part.split("**")[1] for part in text[begin:end].splitlines() if part.startswith("| **")]
    order = [*(name for name in known if name in groups), *(name for name in groups if name not in known)]
    table = "".join(f"| **{name}** | | | | | |\n" + "".join(line(row) for row in groups[name]) for name in order)
    PAGE.write_text(text[:begin] + table + text[end:], encoding="utf-8")
    rows = [row for group in groups.values() for row in group]
    sys.stdout.write(f"{len(rows)} rows, {sum(not row['passed'] for row in rows)} failed\n")


if __name__ == "__main__":
    main(sys.argv[1:])
