"""Pinned versions: those with hashes are those without, and each has hashes."""

from __future__ import annotations

import re

from tests.data_dir import ROOT

PIN = re.compile(r"^([\w.-]+)==([^\s;\\]+)(.*(?:\n    --hash=sha256:[0-9a-f]{64}.*)*)", re.MULTILINE)
BUILDS = {"hatchling", "packaging", "pathspec", "pluggy", "trove-classifiers", "tomli", "tomlkit"}
MAC = "pyobjc"  # which vtk wants there alone, at any version


def pins(name):
    """Versions of each package in a file, and how many hashes each version has."""
    found = {}
    for package, version, rest in PIN.findall((ROOT / name).read_text()):
        found.setdefault(re.sub(r"[-_.]+", "-", package.lower()), {})[version] = rest.count("--hash=")
    return found


def extras():
    """What the extras need, without that of the robot's and the documentation's, which are not in the file."""
    text = (ROOT / "pyproject.toml").read_text().partition("[project.optional-dependencies]")[2].partition("\n[")[0]
    lines = [line for line in text.strip().splitlines() if not line.startswith(("robot", "docs"))]
    needed = re.findall(r'"([\w.-]+)[^"\[]*"', "\n".join(lines))
    return {re.sub(r"[-_.]+", "-", name.lower()) for name in needed}


def test_pins_with_hashes_are_those_without():
    """No package has another version in the file with hashes, none is without, and all that is needed is there."""
    plain, hashed = pins("constraints.txt"), pins("constraints-hashes.txt")
    assert len(hashed) > 80
    for package, versions in hashed.items():
        assert all(versions.values()), f"{package} has no hash"
        if package not in BUILDS and not package.startswith(MAC):
            assert set(versions) <= set(plain[package]), package
    project = (ROOT / "pyproject.toml").read_text().partition("dependencies = [")[2].partition("]")[0]
    needed = {re.sub(r"[-_.]+", "-", n.lower()) for n in re.findall(r'^    "([\w.-]+)', project, re.MULTILINE)}
    assert "numpy" in needed and needed <= set(hashed)
    assert extras() >= {"nbclient", "openpyxl", "pytest"} and extras() <= set(hashed)
