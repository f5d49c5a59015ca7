"""Completion in the shells themselves: what is offered after what was typed."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from calib.io.schema import names
from calib.material.food import load_foods
from cutcal.commands.catalogue.completion import SHELLS, script
from tests.cutcal.test_cli import ROOT

ASK = """
COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 )); COMPREPLY=()
handler=$(complete -p "$1" | sed 's/.*-F \\([^ ]*\\).*/\\1/')
"$handler" "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\\n' "${COMPREPLY[@]}"
"""


def program(shell: str) -> str:
    """Path of a shell; the test is skipped where this machine has none, and on Windows, where one sees another file
    system."""
    found = None if sys.platform == "win32" else shutil.which(shell)
    if found is None:
        pytest.skip(f"there is no {shell} on this machine")
    return found


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """What bash offers for the last of these words."""
    path = tmp_path_factory.mktemp("shell") / "ask.sh"
    path.write_text(script("bash") + ASK)

    def ask(*words: str, folder: Path = ROOT) -> list[str]:
        done = subprocess.run(
            [program("bash"), str(path), *words], cwd=folder, capture_output=True, text=True, check=True
        )
        assert done.stderr == ""
        return done.stdout.split()

    return ask


@pytest.mark.parametrize("shell", SHELLS)
def test_script_is_one_of_its_shell(shell, tmp_path):
    """Each shell reads its script without a complaint."""
    path = tmp_path / "script"
    path.write_text(script(shell))
    done = subprocess.run([program(shell), "-n", str(path)], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_bash_offers_what_can_follow(asked):
    """Commands, options, foods, knives, devices and documents."""
    assert asked("cutcal", "sim") == ["simulate"]
    assert set(asked("cutcal", "simulate", "--food", "")) == set(load_foods())
    assert asked("calibrate", "--food", "ban") == ["banana"]
    assert asked("cutcal", "foods", "ch") == ["cherry"]
    assert asked("cutcal", "prior", "apple", "che") == ["cherry"]
    assert asked("calibrate", "--kn") == ["--knife"]
    assert "kitchen" in asked("calibrate", "--knife", "k")
    assert asked("cutcal", "simulate", "--arch", "v") == ["vulkan"]
    assert set(asked("cutcal", "schema", "")) == set(names())


def test_bash_offers_files_and_folders(asked, tmp_path):
    """Files for traces and materials, a knife of one's own beside the names, and folders alone for results."""
    (tmp_path / "runs").mkdir()
    for name in ("run.csv", "air.csv", "kiwi.yaml", "knob.yaml"):
        (tmp_path / name).write_text("")
    assert asked("calibrate", "--trace", "ru", folder=tmp_path) == ["run.csv", "runs"]
    assert asked("cutcal", "predict", "--air", "a", folder=tmp_path) == ["air.csv"]
    assert asked("calibrate", "--material", "ki", folder=tmp_path) == ["kiwi.yaml"]
    assert sorted(asked("calibrate", "--knife", "k", folder=tmp_path)) == ["kitchen", "kiwi.yaml", "knob.yaml"]
    assert asked("calibrate", "--out", "r", folder=tmp_path) == ["runs"]
    assert asked("cutcal", "report", "r", folder=tmp_path) == ["runs"]
