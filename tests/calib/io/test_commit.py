"""The commit is known in a checkout, and in what was installed from one."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from calib.io import provenance
from tests.data_dir import ROOT

BUILD = """
import sys
sys.path.insert(0, {root!r})
from hatchling.builders.wheel import WheelBuilder
print(*WheelBuilder({top!r}).build(directory={out!r}))
"""


def test_an_installed_package_says_what_it_was_built_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the file of the wheel; an empty one, and none, are no commit."""
    monkeypatch.setattr(provenance, "PACKAGE", tmp_path / "calib")
    assert provenance.git_commit() is None
    built = tmp_path / "calib" / "data" / "commit.txt"
    built.parent.mkdir(parents=True)
    built.write_text("c0ffee+changes\n")
    assert provenance.git_commit() == "c0ffee+changes"
    built.write_text("\n")
    assert provenance.git_commit() is None


def checkout(top: Path) -> str:
    """A small checkout with the build of this one; its commit."""
    for package in ("cutcal", "calib", "mpm", "reports", "fem_reference", "studies", "intsim"):
        (top / package).mkdir(parents=True)
        (top / package / "__init__.py").write_text("")
    (top / "calib" / "_version.py").write_text('__version__ = "0.0.1"\n')
    for name in ("pyproject.toml", "hatch_build.py", "README.md", "LICENSE"):
        (top / name).write_text((ROOT / name).read_text(encoding="utf-8"), encoding="utf-8")
    for name in ("materials.yaml", "knives.yaml", "force_data"):
        (top / name).write_text("a: 1\n")
    git = ["git", "-C", str(top), "-c", "user.name=a", "-c", "user.email=a@b.example"]
    for words in (["init", "-q"], ["add", "-A"], ["commit", "-qm", "one"]):
        subprocess.run([*git, *words], check=True)
    done = subprocess.run([*git, "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_a_wheel_has_the_commit(tmp_path: Path) -> None:
    """Of a clean checkout the commit, of an edited one that it was edited, outside of one nothing."""
    top = tmp_path / "top"
    commit = checkout(top)
    for said in (commit, f"{commit}+changes", None):
        if said is None:
            (top / ".git").rename(tmp_path / "gone")
        elif said != commit:
            (top / "README.md").write_text("edited\n")
        out = tmp_path / str(said)
        code = BUILD.format(root=str(ROOT), top=str(top), out=str(out))
        subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
        (wheel,) = out.glob("*.whl")
        with zipfile.ZipFile(wheel) as file:
            there = "calib/data/commit.txt" in file.namelist()
            assert there is (said is not None)
            if said is not None:
                assert file.read("calib/data/commit.txt").decode().strip() == said
