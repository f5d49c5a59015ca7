"""The references of ``materials.yaml`` in full, by the short names that the sources of its values use."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache

from calib.io.yaml_checks import data_path

_HEAD = "# References"
_ENTRY = re.compile(r"#   (\S.*?)\s{2,}(\S.*)")
_NAME = slice(4, 27)
"""Columns of a short name that its text follows after one space."""
_ONWARD = re.compile(r"#\s{10,}(\S.*)")


@cache
def references() -> dict[str, str]:
    """All references, by short name, in the order of the file."""
    found: dict[str, str] = {}
    last = ""
    lines = data_path("materials.yaml").read_text(encoding="utf-8").partition(_HEAD)[2].splitlines()[1:]
    for line in lines:
        entry, onward = _ENTRY.fullmatch(line), _ONWARD.fullmatch(line)
        if onward and last:
            found[last] += " " + onward[1]
        elif not line.startswith("#"):
            break
        else:
            last, text = entry.groups() if entry else (line[_NAME].strip(), line[_NAME.stop :].strip())
            found[last] = text
    return found


def cited(sources: Iterable[str | None]) -> dict[str, str]:
    """The references whose short names stand in some sources.

    Args:
        sources: Where values come from, in words.

    Returns:
        Short name and full text, in the order of the file.
    """
    said = " ".join(source for source in sources if source)
    return {name: text for name, text in references().items() if name in said}
