"""Where a result comes from: versions, commit, command line, hashes."""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

from calib._version import __version__
from calib.io.type_schema import ALWAYS, Shared
from calib.io.typed_document import ANY
from calib.io.yaml_checks import PACKAGE

DATA = "data"  # folder of a package that an installed one has and a checkout has not
BUILT = "commit.txt"  # in that folder: the commit that a wheel was built from
PACKAGES = ("taichi", "numpy", "scipy", "SALib", "dynesty", "pandas", "h5py", "matplotlib", "typst")


def versions() -> dict[str, str]:
    """Versions of cutcal, Python and the packages that a result depends on."""
    out = {"cutcal": __version__, "python": platform.python_version()}
    for name in PACKAGES:
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return out


def git_commit() -> str | None:
    """Commit of the checkout that cutcal runs from, or that its wheel was built from, with ``+changes`` where it was
    edited; None where nobody knows."""
    top = PACKAGE.parent
    if not (top / ".git").exists():
        built = PACKAGE / DATA / BUILT
        return built.read_text(encoding="utf-8").strip() or None if built.is_file() else None
    try:
        commit = _git(top, "rev-parse", "HEAD")
        dirty = _git(top, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return commit + ("+changes" if dirty else "")


def _git(top: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(top), *words], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()


def code_key(*packages: str) -> str:
    """SHA-256 over the source of these packages, of the solver where none is named: a stored run is reused only by the
    code that made it.
    """
    top = PACKAGE.parent
    digest = hashlib.sha256()
    for package in packages or ("mpm",):
        for path in sorted((top / package).rglob("*.py")):
            if path.relative_to(top).parts[1] != DATA:
                digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def key_of(content: Any) -> str:
    """SHA-256 over plain data in canonical form."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


Versions = Annotated[Mapping[str, str], Shared("versions")]
Commit = Annotated[str | None, Shared("commit")]
Seed = Annotated[int, Shared("seed")]
DeviceName = Annotated[str, Shared("device")]
CommandLine = Annotated[tuple[str, ...], Shared("command")]


@dataclass(frozen=True)
class Software:
    """What was run.

    Attributes:
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    versions: Annotated[Mapping[str, str], Shared("versions")]
    git: Annotated[str | None, Shared("commit")]

    @classmethod
    def here(cls) -> Software:
        """The software that runs now."""
        return cls(versions(), git_commit())


@dataclass(frozen=True)
class Invocation:
    """How it was called.

    Attributes:
        seed: Seed of the particles, and of the search or the draws where there are any.
        device: Device of the simulations.
        command: Command line, or the call from Python, that made the document.
    """

    seed: Annotated[int, Shared("seed")] = field(metadata=ANY)
    device: Annotated[str | None, Shared("device"), ALWAYS]
    command: Annotated[tuple[str, ...], Shared("command")]
