"""What the build adds to a wheel: the commit of the checkout that it is built from."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLACE = "calib/data/commit.txt"
"""Where ``calib.io.provenance`` looks for it."""


class CommitHook(BuildHookInterface[Any]):
    """Writes the commit into the wheel; an editable installation asks its checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Called before a build."""
        self.folder = Path(tempfile.mkdtemp())
        commit = None if version == "editable" else commit_of(Path(self.root))
        if commit is not None:
            (self.folder / "commit.txt").write_text(commit + "\n", encoding="utf-8")
            build_data["force_include"][str(self.folder / "commit.txt")] = PLACE

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Called after it."""
        shutil.rmtree(self.folder, ignore_errors=True)


def commit_of(top: Path) -> str | None:
    """Commit of a checkout, with ``+changes`` where it was edited; None where it is none, or git is not there.

    ``calib.io.provenance`` asks alike, and cannot be imported: a build has none of what it needs.
    """
    if not (top / ".git").exists():
        return None
    try:
        commit = _git(top, "rev-parse", "HEAD")
        edited = _git(top, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.SubprocessError):
        return None
    return commit + ("+changes" if edited else "")


def _git(top: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(top), *words], capture_output=True, text=True, timeout=10, check=True)
    return done.stdout.strip()
