"""Variables of the environment that Taichi needs before it is imported."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

CACHE = "XDG_CACHE_HOME"
"""Variable of the folder in which programs keep what they can make again; ``~/.cache`` where it is not set."""


def prepare_taichi() -> None:
    """Keep Taichi quiet, and give it a folder for compiled kernels.

    Without a home, or with one that cannot be written, Taichi ends the process (SIGSEGV or SIGABRT). It then gets a
    folder among the temporary files, which the next process of the same user finds again.
    """
    os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")  # stdout belongs to the caller
    os.environ.setdefault("TI_ENABLE_PYBUF", "0")  # it takes a notebook's stream for its own affair, and says so
    os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")  # it would tell its makers once a day that it was started
    if os.name == "posix" and not _usable(_cache()):
        os.environ[CACHE] = str(_temporary())


def _cache() -> Path | None:
    """The folder for what can be made again, there or not."""
    if os.environ.get(CACHE):
        return Path(os.environ[CACHE])
    return Path(os.environ["HOME"]) / ".cache" if os.environ.get("HOME") else None


def _usable(folder: Path | None) -> bool:
    """Whether a folder can be written, or made."""
    if folder is None:
        return False
    with suppress(OSError):
        taichi = folder / "taichi"
        taichi.mkdir(parents=True, exist_ok=True)
        return os.access(taichi, os.W_OK | os.X_OK)
    return False


def _temporary() -> Path:
    """A folder of this user alone among the temporary files."""
    folder = Path(tempfile.gettempdir()) / f"cutcal-cache-{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if found.st_uid == os.getuid() and not folder.is_symlink() and not found.st_mode & 0o022 and _usable(folder):
            return folder
    return Path(tempfile.mkdtemp(prefix="cutcal-cache-"))
