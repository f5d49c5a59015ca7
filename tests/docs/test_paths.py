"""The paths of six people: each script can be read by a shell and stands on its page, and those that need nothing more
than the tests have end well."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from pypdf import PdfReader, PdfWriter

from calib.calibration.result import read_result
from reports.calibration.report import write_report
from tests.data_dir import ROOT
from tests.reports.sample import write_run

PATHS = ROOT / "docs" / "paths"
NAMES = ("readme.sh", "own_csv.sh", "own_food.sh", "notebook.sh", "reviewer.py", "robot.sh")
pytestmark = pytest.mark.skipif(os.name != "posix", reason="shell scripts")


def test_each_is_on_the_page() -> None:
    """No script that the page does not show, and none there that is gone."""
    page = (ROOT / "docs" / "paths.md").read_text(encoding="utf-8")
    assert sorted(path.name for path in PATHS.iterdir() if path.is_file()) == sorted(NAMES)
    assert tuple(re.findall(r"{literalinclude} paths/(.*)", page)) == NAMES


@pytest.mark.parametrize("name", [name for name in NAMES if name.endswith(".sh")])
def test_a_shell_can_read_it(name: str) -> None:
    """Its syntax is right, it stops at the first error, and can be started."""
    assert subprocess.run(["bash", "-n", str(PATHS / name)], check=False).returncode == 0
    assert "\nset -euo pipefail\n" in (PATHS / name).read_text(encoding="utf-8") and os.access(PATHS / name, os.X_OK)


def test_the_commands_of_the_readme_are_found() -> None:
    """What the first script types are the two commands of the README."""
    (program,) = re.findall(r"commands=\$\((awk .*)\)", (PATHS / "readme.sh").read_text(encoding="utf-8"))
    found = subprocess.run(["bash", "-c", program], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    install, calibrate = found.splitlines()
    assert install.startswith("python3 -m venv .venv && .venv/bin/pip install")
    assert calibrate.startswith(".venv/bin/calibrate --food banana") and calibrate.endswith("--out runs/banana")


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """A PATH on which cutcal and calibrate are those of this checkout."""
    bin_ = tmp_path / "bin"
    bin_.mkdir()
    for program, function in (("cutcal", "main"), ("calibrate", "calibrate")):
        code = f"import sys; from cutcal.main import {function}; sys.exit({function}())"
        (bin_ / program).write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{code}" "$@"\n')
        (bin_ / program).chmod(0o755)
    return os.environ | {"PATH": f"{bin_}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}


@pytest.mark.long
@pytest.mark.parametrize("name", ["own_csv.sh", "own_food.sh"])
def test_a_path_ends_well(
    name: str, environment: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It runs as a user would run it; it checks itself what the commands say and write."""
    done = subprocess.run(
        [str(PATHS / name), str(tmp_path / "work")], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr
    if name == "own_csv.sh":  # its report, as a reviewer reads it
        assert reviewer().main(tmp_path / "work" / "fit") == 0, capsys.readouterr().out


def reviewer() -> ModuleType:
    """The script of the reviewer."""
    spec = importlib.util.spec_from_file_location("reviewer", PATHS / "reviewer.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_a_reviewer_sees_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A number that is another in the summary; a line, and an answer, that a report without its first pages has not."""
    run = write_run(tmp_path / "run")
    write_report(read_result(run))
    module = reviewer()
    module.main(run)
    said = capsys.readouterr().out
    assert "the numbers of the first page are those of summary.json" in said and "MISSING  which method" not in said
    summary = json.loads((run / "summary.json").read_text())
    line = next(line for line in summary["verdicts"] if line["value"])
    line["value"] *= 1.2
    (run / "summary.json").write_text(json.dumps(summary))
    assert module.main(run) == 1 and f"{line['name']}: " in capsys.readouterr().out
    pages = PdfWriter()
    for page in PdfReader(run / "report.pdf").pages[2:]:
        pages.add_page(page)
    pages.write(run / "report.pdf")
    assert module.main(run) == 1
    said = capsys.readouterr().out
    assert f"{line['name']}: not on the page" in said and "MISSING  which method" in said
