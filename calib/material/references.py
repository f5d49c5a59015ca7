"""The references of ``materials.yaml`` in full, by the short names that the sources of its values use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from functools import cache

from calib.io.yaml_checks import data_path

_HEAD = "# References"
_ENTRY = re.compile(r"#   (\S.*?)\s{2,}(\S.*)")
_REMARK = re.compile(r"#\s{2,3}(\d+)\. (\S.*)")
_REMARK_ONWARD = re.compile(r"#     (\S.*)")
_NAMED = re.compile(r"\(remark (\d+)\)")
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


@cache
def remarks() -> dict[str, str]:
    """The remarks of the file on its numbers, by their numbers."""
    return dict(_remarks(data_path("materials.yaml").read_text(encoding="utf-8").partition(_HEAD)[0].splitlines()))


def _remarks(lines: Iterable[str]) -> Iterator[tuple[str, str]]:
    number, text = "", ""
    for line in lines:
        begun, onward = _REMARK.fullmatch(line), _REMARK_ONWARD.fullmatch(line)
        if begun:
            if number:
                yield number, text
            number, text = begun.groups()
        elif number and onward:
            text += " " + onward[1]
        elif number:
            yield number, text
            number = ""


def cited(sources: Iterable[str | None]) -> dict[str, str]:
    """The references whose short names stand in some sources, and the remarks that these name.

    Args:
        sources: Where values come from, in words.

    Returns:
        Short name and full text, in the order of the file; remarks come last, as ``remark 5``. What a remark refers to
        is there too.
    """
    said = " ".join(source for source in sources if source)
    told = {f"remark {n}": text for n, text in remarks().items() if n in _NAMED.findall(said)}
    said = " ".join([said, *told.values()])
    return {name: text for name, text in references().items() if name in said} | told
