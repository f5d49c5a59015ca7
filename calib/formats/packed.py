"""Files that are compressed, or alone in an archive, as what they hold."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from calib.errors import TraceError
from calib.io.wording import brief, listed

MOST_BYTES = 2_000_000_000
"""Bytes of a record beyond which it is not unpacked."""
_OPEN: dict[bytes, Callable[[io.BytesIO], Any]] = {b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"\xfd7zXZ\x00": lzma.open}
"""What opens a compressed file, by how it begins."""
_ENDINGS = (".gz", ".bz2", ".xz", ".zip")
_ZIP = b"PK\x03\x04"
_SEVERAL = (".xlsx", ".xlsm", ".npz")
"""Endings of archives that are one record."""


def unpacked(file: Path, raw: bytes) -> tuple[Path, bytes]:
    """What a compressed file holds.

    Args:
        file: The file.
        raw: Its content.

    Returns:
        The file without the ending of its compression and the content, or both as they are where it is not compressed.

    Raises:
        TraceError: It is damaged, or an archive of several files.
    """
    opener = next((opener for start, opener in _OPEN.items() if raw.startswith(start)), None)
    try:
        if opener is not None:
            with opener(io.BytesIO(raw)) as packed:
                return _named(file, file.name), _limited(file, packed)
        if raw.startswith(_ZIP) and file.suffix.lower() not in _SEVERAL:
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                names = [name for name in archive.namelist() if not name.endswith("/") and "__MACOSX" not in name]
                if len(names) != 1:
                    raise TraceError(
                        f"{file.name}: an archive of {len(names)} files ({listed(names)}); unpack it first"
                    )
                with archive.open(names[0]) as packed:
                    return _named(file, names[0]), _limited(file, packed)
    except (OSError, EOFError, lzma.LZMAError, zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
        raise TraceError(f"{file.name}: damaged, or not compressed as its name says ({brief(str(error))})") from None
    return file, raw


def _named(file: Path, name: str) -> Path:
    """The file with the name of what it holds."""
    ending = Path(name).suffix.lower()
    return file.with_name(Path(name).stem if ending in _ENDINGS else Path(name).name)


def _limited(file: Path, packed: Any) -> bytes:
    """The content, which is not endless.

    Raises:
        TraceError: It is too large.
    """
    raw: bytes = packed.read(MOST_BYTES + 1)
    if len(raw) > MOST_BYTES:
        raise TraceError(f"{file.name}: more than {MOST_BYTES} bytes when unpacked; cut the record to what is needed")
    if not raw.strip():
        raise TraceError(f"{file.name}: nothing in it; check that the record was saved")
    return raw
