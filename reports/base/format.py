"""Typesetting: text and figures become a PDF. Numbers become text in :mod:`mpm.output.number_text`.

Texts travel to the templates as JSON, never as markup: a file name cannot break a page.
"""

from __future__ import annotations

import io
import json
import re
import tempfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import typst
from PIL import Image

from mpm.files import write_atomic
from mpm.output.number_text import DASH as DASH
from mpm.output.number_text import NBSP as NBSP
from mpm.output.number_text import before_and_after as before_and_after
from mpm.output.number_text import compared as compared
from mpm.output.number_text import count as count
from mpm.output.number_text import difference as difference
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
_AIR = (1.0, *(1.0 + side * k / 50 for k in range(1, 8) for side in (-1, 1)), 1.2, 1.24, 1.28)
"""How far apart lines and blocks are, over the usual [-], in the order in which they are tried."""
_FILLED = 0.65
"""Part of the height of a sheet down to which each page of several is filled, where one of these does it [-]."""
_FOOT = 0.925
"""Part of the height of a sheet at which the foot of its page begins [-]."""
_COARSE, _INK = 12.0, 250
"""Dots per inch of the pages that are looked at for this, and the lightest grey that is ink there."""


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
        options: dict[str, Any] = {"root": folder, "font_paths": fonts}
        air = {"air": f"{_air(folder / template, options):g}"}
        return bytes(typst.compile(folder / template, format="pdf", sys_inputs=air, **options))


def _air(source: Path, options: Mapping[str, Any]) -> float:
    """The first air with which no page has more than a third of its height empty, else that whose emptiest page is
    fullest. A document of one page has the usual one: it can fill no more than it has to say."""
    filled: dict[float, float] = {}
    for air in _AIR:
        pages = page_fills(source, air, options)
        filled[air] = min(pages)
        if len(pages) == 1 or filled[air] >= _FILLED:
            return air
    return max(filled, key=lambda air: filled[air])


def page_fills(source: Path, air: float, options: Mapping[str, Any]) -> list[float]:
    """How far each page of a document is filled.

    Args:
        source: The template, beside what it reads.
        air: How far apart lines and blocks are, over the usual [-].
        options: What else the typesetter needs.

    Returns:
        Parts of the height of a sheet [-], as of :func:`filled_to`.
    """
    found = typst.compile(source, format="png", ppi=_COARSE, sys_inputs={"air": f"{air:g}"}, **options)
    return [filled_to(page) for page in (found if isinstance(found, list) else [found])]


def filled_to(page: bytes) -> float:
    """Part of the height of a sheet down to which there is ink above its foot [-].

    Args:
        page: The page as a PNG.
    """
    grey = np.asarray(Image.open(io.BytesIO(page)).convert("L"))
    rows = np.flatnonzero((grey[: int(_FOOT * len(grey))] < _INK).any(axis=1))
    return (float(rows[-1]) + 1.0) / len(grey) if len(rows) else 0.0
