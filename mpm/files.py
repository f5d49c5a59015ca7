"""Files that are written whole or not at all."""

from __future__ import annotations

import os
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
        content: Its content; text is written as UTF-8.
        sync: As there.

    Raises:
        OSError: The file cannot be written.
    """
    with replacing(path, sync=sync) as draft:
        if isinstance(content, bytes):
            draft.write_bytes(content)
        else:
            draft.write_text(content, encoding="utf-8")
