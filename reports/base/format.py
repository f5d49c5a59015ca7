"""Typesetting: text and figures become a PDF. Numbers become text in :mod:`mpm.output.number_text`.

Texts travel to the templates as JSON, never as markup: a file name cannot break a page.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib
import typst

from mpm.files import write_atomic
from mpm.output.number_text import DASH as DASH
from mpm.output.number_text import NBSP as NBSP
from mpm.output.number_text import before_and_after as before_and_after
from mpm.output.number_text import compared as compared
from mpm.output.number_text import count as count
from mpm.output.number_text import duration as duration
from mpm.output.number_text import interval as interval
from mpm.output.number_text import listed as listed
from mpm.output.number_text import plain as plain
from mpm.output.number_text import quantity as quantity
from mpm.output.number_text import rung as rung
from mpm.output.number_text import uncertain as uncertain
from reports import ReportError

_LONG_WORD = re.compile(r"\S{29,}")
_BREAKS = re.compile(r"(?<=[/_=,;:@+&?.\\-])(?=.)")
_SOLID = re.compile(r"[^\u200b]{18}(?=[^\u200b]{3})")
_TEMPLATES = Path(__file__).resolve().parents[1] / "templates"


def breakable(text: str) -> str:
    """Text in which words of 29 letters or more (paths, options) may break, by zero-width spaces."""
    return _LONG_WORD.sub(lambda m: _SOLID.sub("\\g<0>\u200b", _BREAKS.sub("\u200b", m.group())), text)


def publish(
    target: Path, template: str, content: Mapping[str, Any], figures: Mapping[str, bytes], *, date: datetime
) -> None:
    """Typeset a template and write the PDF; ``target`` is either the old file or the whole new one.

    The same arguments give the same bytes.

    Args:
        target: File to write.
        template: File name in ``reports/templates``.
        content: What the template reads as ``content.json``; this adds ``date``.
        figures: SVG documents by file name.
        date: Date of the document.

    Raises:
        ReportError: The file cannot be written.
    """
    pdf = _typeset(template, content, figures, date)
    try:
        write_atomic(target, pdf)
    except OSError as e:
        raise ReportError(
            f"{target}: cannot be written ({e.strerror}); free the disk or the permission, then make the "
            "report again with cutcal report"
        ) from None


def _typeset(template: str, content: Mapping[str, Any], figures: Mapping[str, bytes], date: datetime) -> bytes:
    """The PDF, set in fonts of the typesetter and of matplotlib: those of the machine do not matter."""
    with tempfile.TemporaryDirectory(prefix="cutcal-") as name:
        folder = Path(name)
        for source in sorted(_TEMPLATES.glob("*.typ")):
            (folder / source.name).write_bytes(source.read_bytes())
        for figure, svg in figures.items():
            (folder / figure).write_bytes(svg)
        stamp = {k: getattr(date, k) for k in ("year", "month", "day", "hour", "minute", "second")}
        (folder / "content.json").write_text(json.dumps({**content, "date": stamp}), encoding="utf-8")
        fonts = typst.Fonts(
            include_system_fonts=False,
            include_embedded_fonts=True,
            font_paths=[Path(matplotlib.get_data_path()) / "fonts" / "ttf"],
        )
        return bytes(typst.compile(folder / template, root=folder, font_paths=fonts, format="pdf"))
