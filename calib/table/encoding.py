"""The text of a file, whatever its encoding: UTF-8, UTF-16, or what an older program of a country wrote."""

from __future__ import annotations

import codecs
import re

from charset_normalizer import from_bytes

from calib.errors import TraceError

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_BINARY = re.compile(rb"[\x01-\x08\x0e-\x1f]")
"""Bytes that no text has."""
_WESTERN = re.compile(
    "[\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u00ff\u00b0\u00b2\u00b3\u00b5\u00b1\u00b7\u00a7\u00a0\\x00-\\x7f]*"
)
"""Letters and signs that headers in Western languages have."""
_CAPITALS = re.compile("[\u00c0-\u00de]{2}|[\u00df-\u00ff]{3}")
"""Letters beyond ASCII that follow each other, as they do where another alphabet is read as Western."""
_COUNTRIES = ("cp1252", "gb18030", "cp932", "cp949", "big5", "cp1251", "cp1250", "mac_roman")
"""Encodings of a country, the most usual first."""
_WORDS = re.compile(
    "[Pp]r\u00fcf|[Hh]\u00f6he|[Ff]or\u00e7a|D\u00e9placement|d\u00e9placement|[Ss]i\u0142a|[Pp]rzemieszczenie|\u65f6\u95f4|\u6642\u9593|\u6642\u523b|"
    "\u8bd5\u9a8c|\u8a66\u9a13|\u8377\u91cd|\u8f7d\u8377|\u8ca0\u8377|\u4f4d\u79fb|\u5909\u4f4d|\u9ad8\u3055|\u9ad8\u5ea6|\u884c\u7a0b|\u30b9\u30c8\u30ed\u30fc\u30af|\uc2dc\uac04|\ud558\uc911|\ubcc0\uc704|"
    "[\u0412\u0432]\u0440\u0435\u043c\u044f|[\u041d\u043d]\u0430\u0433\u0440\u0443\u0437\u043a\u0430|[\u0423\u0443]\u0441\u0438\u043b\u0438\u0435|[\u041f\u043f]\u0435\u0440\u0435\u043c\u0435\u0449\u0435\u043d\u0438\u0435"
)
"""Words of measurement that have letters beyond ASCII: in the wrong encoding they are others."""
MOST_FOREIGN = 0.3
"""Part of the bytes beyond ASCII from which on a file that is not UTF-8 is no table of numbers."""
WIDE = 0.4
"""Part of the even or odd bytes that are zero from which on each letter has two bytes."""


def decode(source: str, raw: bytes, kind: str) -> tuple[str, tuple[str, ...]]:
    """The text of a file.

    Args:
        source: What errors call the file.
        raw: Its content.
        kind: What it should be, such as ``CSV``, for errors.

    Returns:
        The text without a byte order mark, and what was assumed, one sentence each.

    Raises:
        TraceError: It is not text.
    """
    encoding = next((name for mark, name in _MARKS if raw.startswith(mark)), None) or _wide(raw)
    if encoding is not None:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError as error:
            raise _not_text(source, kind, f"byte {error.start} is not {encoding.upper()[:6]}") from None
        notes: tuple[str, ...] = () if encoding == "utf-8-sig" else (f"{source}: read as {encoding.upper()}",)
    else:
        text, notes = _narrow(source, raw, kind)
    return _without_zeros(source, text, kind, notes)


def _wide(raw: bytes) -> str | None:
    """UTF-16 without a mark, by the zero bytes of its ASCII letters."""
    some = raw[:4000]
    even, odd = some[::2], some[1::2]
    if len(some) < 20:
        return None
    if odd.count(0) > WIDE * len(odd) and not even.count(0):
        return "utf-16-le"
    return "utf-16-be" if even.count(0) > WIDE * len(even) and not odd.count(0) else None


def _narrow(source: str, raw: bytes, kind: str) -> tuple[str, tuple[str, ...]]:
    """UTF-8, or one of the encodings of a byte a letter; those of Western Europe first."""
    try:
        return raw.decode("utf-8"), ()
    except UnicodeDecodeError as error:
        foreign = re.sub(rb"[\x00-\x7f]+", b"", raw)
        if _BINARY.search(raw) or len(foreign) > MOST_FOREIGN * len(raw):
            raise _not_text(source, kind, f"byte {error.start} is not UTF-8") from None
    lines = b"\n".join(line for line in raw.split(b"\n") if not line.isascii())
    name = _told_by_words(lines) or _western(raw)
    if not name:
        best = from_bytes(lines).best()
        name = best.encoding if best is not None else "cp1252"
    return raw.decode(name, "replace"), (f"{source}: not UTF-8, read as {name}; check the names of its columns",)


def _western(raw: bytes) -> str:
    """The encoding of Western Europe where the text has its letters alone, else nothing."""
    try:
        text = raw.decode("cp1252")
    except UnicodeDecodeError:
        return ""
    return "cp1252" if text and _WESTERN.fullmatch(text) and not _CAPITALS.search(text) else ""


def _told_by_words(lines: bytes) -> str:
    """The encoding in which lines hold the most words of measurement, empty where they hold none in any."""
    found = dict.fromkeys(_COUNTRIES, 0)
    for name in _COUNTRIES:
        try:
            found[name] = len(_WORDS.findall(lines.decode(name)))
        except UnicodeDecodeError:
            continue
    best = max(found, key=lambda name: found[name])
    return best if found[best] else ""


def _without_zeros(source: str, text: str, kind: str, notes: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """The text without zero bytes at its end and lines of them, which a logger leaves that lost its power.

    Raises:
        TraceError: There are others.
    """
    if "\0" not in text:
        return text, notes
    kept = text.rstrip("\0")
    lines = kept.split("\n")
    if not kept.strip("\0 \r\n"):
        raise _not_text(source, kind, "it holds zero bytes")
    empty = [i for i, line in enumerate(lines) if line.strip("\0\r") == "" and "\0" in line]
    for i in empty:
        lines[i] = ""
    kept = "\n".join(lines)
    if "\0" in kept:
        row = kept[: kept.index("\0")].count("\n") + 1
        raise TraceError(
            f"{source}, row {row}: not a text {kind} file there (it holds zero bytes); remove the row, or copy the "
            "file from the logger again"
        )
    return kept, (*notes, f"{source}: zero bytes at its end or in lines of their own were left out")


def _not_text(source: str, kind: str, why: str) -> TraceError:
    return TraceError(f"{source}: not a text {kind} file ({why}); save the record as CSV, JSON or HDF5")
