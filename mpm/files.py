"""Files that are written whole or not at all, and read where they are files and have an end."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def replacing(path: Path, *, draft: Path | None = None, sync: bool = False) -> Iterator[Path]:
    """A draft beside a file, which takes the place of that file when the block has ended without an error.

    Whoever reads the file finds the old one or the whole new one, also after a kill. A block that raises leaves the old
    file and no draft; a kill may leave a draft, which the next one overwrites.

    Args:
        path: The file, there or not.
        draft: The draft, in the same folder; by default the file's name and ``.draft``. What writes a format that it
            tells by the suffix needs another one.
        sync: Whether the draft is forced to disk before it takes its place, so that it also survives a power cut.

    Yields:
        The draft, to be written and closed in the block.

    Raises:
        OSError: The draft cannot be put in place.
    """
    draft = path.with_name(f"{path.name}.draft") if draft is None else draft
    try:
        yield draft
        if sync:
            with draft.open("rb+") as stream:
                os.fsync(stream.fileno())
        os.replace(draft, path)
    finally:
        with suppress(OSError):
            draft.unlink()


def write_atomic(path: Path, content: str | bytes, *, sync: bool = False) -> None:
    """Write a file whole or not at all, as :func:`replacing` does.

    Args:
        path: The file; an existing one is replaced.
        content: Its content; text is written as UTF-8, what UTF-8 has not (a path's bytes) as an escape.
        sync: As there.

    Raises:
        OSError: The file cannot be written.
    """
    with replacing(path, sync=sync) as draft:
        if isinstance(content, bytes):
            draft.write_bytes(content)
        else:
            draft.write_text(content, encoding="utf-8", errors="backslashreplace")


def read_regular(path: Path, most: int = 0) -> bytes:
    """All bytes of a file that has an end: no pipe, which may wait for ever, and no device, which may never end.

    Args:
        path: The file. What stdin is redirected from is one, too.
        most: Bytes that it may have; 0 for any number.

    Returns:
        Its content.

    Raises:
        OSError: There is none, it cannot be read, is something else, or is too large; ``strerror`` says what and, where
            there is something to do, what to do.
    """
    with open(path, "rb", opener=_not_waiting) as stream:
        found = os.fstat(stream.fileno())
        if not stat.S_ISREG(found.st_mode):
            what = "a folder" if stat.S_ISDIR(found.st_mode) else "a pipe or a device, not a file"
            raise OSError(errno.EINVAL, f"it is {what}; save what it holds to a file", str(path))
        if most and found.st_size > most:
            raise OSError(
                errno.EFBIG, f"it has {found.st_size / 1e6:.0f} MB; at most {most / 1e6:g} MB are read", str(path)
            )
        return stream.read()


def _not_waiting(path: str, flags: int) -> int:
    """Open a file, and not wait for somebody who writes into it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
