"""Numbers written for people, and typesetting: SI values become text, text and figures become a PDF.

Every number of a report passes through :func:`quantity` or one of its neighbours, so that one quantity has one unit
and one precision everywhere. Texts travel to the templates as JSON, never as markup: a file name cannot break a page.
"""

from __future__ import annotations

import json
import math
import os
import re
import tempfile
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import matplotlib
import typst

from reports import ReportError

NBSP = "\u00a0"
MINUS = "\u2212"
DASH = "\u2013"

#: SI unit -> (factor, text) from the smallest to the largest unit that people use for it.
LADDERS: dict[str, tuple[tuple[float, str], ...]] = {
    "Pa": ((1.0, "Pa"), (1e3, "kPa"), (1e6, "MPa"), (1e9, "GPa")),
    "m": ((1e-6, "µm"), (1e-3, "mm"), (1.0, "m")),
    "N": ((1e-3, "mN"), (1.0, "N"), (1e3, "kN")),
    "J": ((1e-3, "mJ"), (1.0, "J"), (1e3, "kJ")),
    "J/m^2": ((1.0, "J/m²"), (1e3, "kJ/m²")),
    "N/m": ((1.0, "N/m"), (1e3, "kN/m")),
    "s": ((1e-3, "ms"), (1.0, "s")),
    "m/s": ((1e-3, "mm/s"), (1.0, "m/s")),
    "Hz": ((1.0, "Hz"), (1e3, "kHz")),
    "kg/m^3": ((1.0, "kg/m³"),),
    "rad": ((math.pi / 180.0, "°"),),
    "fraction": ((1e-2, "%"),),
    "-": ((1.0, ""),),
    "": ((1.0, ""),),
}
#: A value within this part of the next unit counts as reaching it: 1e-3 m is 1 mm whatever the last bit says.
ROUNDING = 1e-9
#: Outside this range a number is written with a power of ten.
PLAIN_RANGE = (1e-4, 1e6)
#: Digits from which on thousands are set apart.
GROUP_FROM = 1e4

_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_BREAKS = re.compile(r"(?<=[/_=,;:@+&?.\\-])(?=[^\s])")
_LONG = re.compile(r"[^\s\u200b]{18}(?=[^\s\u200b]{3})")
_TEMPLATES = Path(__file__).resolve().parent / "templates"


def plain(x: float, digits: int | None = 3) -> str:
    """A number with ``digits`` significant digits, or the shortest text that is exact to six for None.

    >>> plain(-0.12345), plain(5.0, None), plain(1234567.0)
    ('−0.123', '5', '1.23 × 10⁶')
    """
    if x == 0.0:
        return "0"
    if not PLAIN_RANGE[0] <= abs(x) < PLAIN_RANGE[1]:
        mantissa, exponent = f"{x:.{(digits or 6) - 1}e}".split("e")
        if digits is None:
            mantissa = f"{float(mantissa):g}"
        return f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPT)}".replace("-", MINUS)
    if digits is None:
        return f"{x:.6g}".replace("-", MINUS)
    rounded = float(f"{x:.{digits - 1}e}")
    places = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return _grouped(rounded, places)


def count(n: float) -> str:
    """A whole number with its thousands set apart.

    >>> count(1234567).replace(NBSP, " "), count(1234)
    ('1 234 567', '1234')
    """
    return _grouped(n, 0)


def quantity(value: float | None, unit: str, *, digits: int | None = 3, signed: bool = False) -> str:
    """A value in the unit people use for it; a dash where there is none.

    Args:
        value: In the SI unit; None or not finite means there is none.
        unit: SI unit as in ``materials.yaml``; ``fraction`` is shown in per cent; an unknown one is kept.
        digits: Significant digits; None for the shortest text (limits, settings).
        signed: Whether a positive value gets its sign.

    >>> quantity(3.2e5, "Pa").replace(NBSP, " "), quantity(0.033, "m").replace(NBSP, " ")
    ('320 kPa', '33.0 mm')
    """
    if value is None or not math.isfinite(value):
        return DASH
    factor, name = _rung(unit, abs(value))
    sign = "+" if signed and value > 0.0 else ""
    return sign + _with_unit(plain(value / factor, digits), name)


def interval(low: float | None, high: float | None, unit: str) -> str:
    """A range in one unit, three digits; a dash for an end that is not known, one dash if neither is.

    >>> interval(5e4, 2e6, "Pa").replace(NBSP, " ")
    '0.0500 to 2.00 MPa'
    """
    ends = [x if x is not None and math.isfinite(x) else None for x in (low, high)]
    known = [abs(x) for x in ends if x is not None]
    if not known:
        return DASH
    factor, name = _rung(unit, max(known))
    texts = [DASH if x is None else plain(x / factor) for x in ends]
    return _with_unit(f"{texts[0]} to {texts[1]}", name)


def uncertain(value: float | None, sd: float | None, unit: str) -> str:
    """A value with its standard uncertainty, both to the second digit of the uncertainty.

    >>> uncertain(12.5271, 0.112, "N").replace(NBSP, " ")
    '12.53 ± 0.11 N'
    """
    if value is None or sd is None or not (math.isfinite(value) and math.isfinite(sd) and sd > 0.0):
        return quantity(value, unit)
    factor, name = _rung(unit, max(abs(value), sd))
    x, s = value / factor, sd / factor
    places = max(0, 1 - math.floor(math.log10(s)))
    if places > 6:
        return f"{quantity(value, unit)} ± {quantity(sd, unit, digits=2)}"
    text = f"{_grouped(x, places)} ± {_grouped(s, places)}"
    return _with_unit(f"({text})" if name in ("%", "°") else text, name)


def duration(seconds: float | None) -> str:
    """A wall time.

    >>> duration(3725.0).replace(NBSP, " "), duration(42.31).replace(NBSP, " ")
    ('1 h 02 min', '42.3 s')
    """
    if seconds is None or not math.isfinite(seconds):
        return DASH
    if seconds < 120.0:
        return quantity(seconds, "s")
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{minutes}{NBSP}min"
    return f"{minutes // 60}{NBSP}h{NBSP}{minutes % 60:02d}{NBSP}min"


def breakable(text: str) -> str:
    """Text with break opportunities inside long words (paths, hashes, options), invisible on paper."""
    return _LONG.sub(lambda m: m.group() + "\u200b", _BREAKS.sub("\u200b", text))


def listed(names: list[str]) -> str:
    """Names as a list in a sentence.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def moment(created: str) -> datetime:
    """Date and time of an ISO text; the time zone is kept as written.

    Raises:
        ValueError: No ISO date and time.
    """
    return datetime.fromisoformat(re.sub(r"[zZ]$", "+00:00", created))


def typeset(template: str, content: Mapping[str, Any], figures: Mapping[str, bytes], *, date: datetime) -> bytes:
    """Typeset a template; the same arguments give the same bytes.

    Only fonts that come with the typesetter and with matplotlib are used, so the machine's own fonts do not matter.

    Args:
        template: File name in ``reports/templates``.
        content: What the template reads as ``content.json``.
        figures: SVG documents by file name.
        date: Date of the document.

    Returns:
        The PDF.
    """
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


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that it is either the old one or the whole new one.

    Raises:
        ReportError: It cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError as e:
        raise ReportError(
            f"{path}: cannot be written ({e.strerror}); free space or permissions, then run cutcal report again"
        ) from None
    finally:
        part.unlink(missing_ok=True)


def _rung(unit: str, size: float) -> tuple[float, str]:
    """Factor and text of the unit for a value of this size [SI unit]."""
    ladder = LADDERS.get(unit, ((1.0, unit.replace("^2", "²").replace("^3", "³")),))
    if size == 0.0:
        return next((r for r in ladder if r[0] == 1.0), ladder[0])
    fits = [rung for rung in ladder if float(f"{size:.2e}") >= rung[0] * (1.0 - ROUNDING)]
    return fits[-1] if fits else ladder[0]


def _grouped(x: float, places: int) -> str:
    text = f"{x:,.{places}f}" if abs(x) >= GROUP_FROM else f"{x:.{places}f}"
    return text.replace(",", NBSP).replace("-", MINUS)


def _with_unit(text: str, name: str) -> str:
    return text + ("" if not name else name if name == "°" else NBSP + name)
