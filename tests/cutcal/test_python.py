"""The interface in Python: what docs/python.md says runs as it stands there, and errors are those of the command
line."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calib.material.food import FoodSpec, load_food
from calib.problem.request import Request
from calib.problem.setup import conditioned
from cutcal import Calibration, Food, Trace
from mpm.scene.errors import CutcalError
from tests.calib.cheap import LOG, noted
from tests.data_dir import ROOT

BANANA = ROOT / "force_data" / "banana_reconstructed.csv"
# A formula in place of the solver, in real processes, a coarse grid and two parameters for the cuts that follow, and a
# file to see that the script is run once. That the solver answers to the same call test_calibrate.py proves.
SMALL = """
import pathlib
from dataclasses import dataclass
import calib.api as module
import calib.simulation.process_pool as processes
from tests.calib.cheap import CheapPool

processes.Pool = CheapPool
print("began", file=pathlib.Path("began").open("a"))

@dataclass(frozen=True, eq=False)
class Small(module.Calibration):
    fit: object = ("E", "R")
    dx: object = 4.1e-3
    budget: object = 14

module.Calibration = Small
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the blocks of docs/python.md were run as one plain script, on a coarse grid."""
    folder = tmp_path_factory.mktemp("python")
    (folder / "force_data").mkdir()
    shutil.copy(BANANA, folder / "force_data")
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (folder / "script.py").write_text(SMALL + "\n".join(blocks), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(ROOT), LOG: str(folder / "runs.log")}
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    (folder / "said").write_text(done.stdout)
    return folder


@pytest.mark.slow
def test_the_documented_script_runs(folder: Path) -> None:
    """All blocks, without a guard for worker processes: they do not run the script again."""
    assert (folder / "began").read_text() == "began\n"
    assert noted(folder / "runs.log", "end").total() > 14  # in those processes
    said = (folder / "said").read_text()
    assert "report.pdf" in said and "verdict" in said and "J/m^2" in said


@pytest.mark.slow
def test_results_load_back(folder: Path) -> None:
    """A finished folder gives summary, tables, food and report, and says how it was made."""
    result = Calibration.load(folder / "runs" / "python")
    summary = json.loads((folder / "runs" / "python" / "summary.json").read_text())
    assert result.summary == summary and result.passed is summary["passed"]
    assert list(result.parameters.index) == ["E", "R"]
    assert result.parameters.loc["R", "value"] == summary["parameters"]["R"]["value"]
    assert result.curves["real_N"].max() == pytest.approx(summary["peak_real_N"], rel=0.01)
    assert isinstance(result.material, Food) and result.material.value("R") == pytest.approx(
        result.parameters["value"]["R"]
    )
    assert result.report.read_bytes().startswith(b"%PDF")
    assert summary["trace"]["source"] == "banana_reconstructed.csv"
    call = "Calibration('banana', trace=Trace('banana_reconstructed.csv'), height=0.033).run('runs/python')"
    assert summary["command"] == [call]
    assert len(repr(result)) < 200


def test_a_folder_without_a_calibration(tmp_path: Path) -> None:
    """Missing, damaged, and of another command: each is said with the file."""
    with pytest.raises(CutcalError, match="summary.json: cannot be read .*finished calibration"):
        Calibration.load(tmp_path)
    for content, words in (
        ("{", "damaged"),
        ('{"peak_N": 3}', "not of a calibration .food"),
        ("[]", "not of a calibration"),
    ):
        (tmp_path / "summary.json").write_text(content)
        with pytest.raises(CutcalError, match=f"summary.json: {words}"):
            Calibration.load(tmp_path)


def test_the_request_is_that_of_the_command_line() -> None:
    """The same values, whatever the form of food and trace; columns are chosen where the trace is read."""
    frame = pd.read_csv(BANANA, comment="#")
    forms: list[Any] = [BANANA, str(BANANA), Trace.read(BANANA), frame]
    for trace in forms:
        request = Calibration(load_food("banana"), trace, air=trace, height=0.03, fit=["E", "R"], workers=1).request()
        assert isinstance(request, Request)
        assert (request.food.name, request.sizing.height, request.fit) == ("banana", 0.03, ("E", "R"))
        (cut, air), curve = request.records(), conditioned(Calibration("banana", trace).request())[0]
        assert air is not None and air.sha256 == cut.sha256 and len(cut.sha256) == 64
        np.testing.assert_array_equal(cut.force, forms[2].force)
        assert curve.trace.source == ("DataFrame" if trace is frame else "banana_reconstructed.csv")


def test_an_outline_is_that_of_the_command_line(tmp_path: Path) -> None:
    """A file's sizes and hash reach the request, and the call that is kept names it."""
    (tmp_path / "egg.csv").write_text("y_mm,radius_mm\n0,0\n30,20\n60,0\n")
    made = Calibration("banana", BANANA, outline=tmp_path / "egg.csv", outline_as="half")
    request = made.request()
    assert (request.sizing.length, request.sizing.height) == pytest.approx((0.06, 0.02))
    assert request.sizing.outline is not None and request.sizing.outline.source == "egg.csv"
    assert "egg.csv" in request.command[0] and "outline_as='half'" in request.command[0]
    with pytest.raises(CutcalError, match="^height beside outline"):
        Calibration("banana", BANANA, outline=tmp_path / "egg.csv", outline_as="half", height=0.02)


def test_arrays_have_a_hash_and_a_name_of_their_own() -> None:
    """A trace made of arrays is told from a file: by its name, and by a hash that follows every number."""
    trace = Trace.read(BANANA)
    made = Trace(trace.time, trace.force, source="lab 3")
    cut, _ = Calibration("banana", made).request().records()
    assert cut.source == "lab 3 (arrays)" and len(cut.sha256) == 64 and cut.sha256 != trace.sha256
    other = Calibration("banana", Trace(trace.time, 1.001 * trace.force)).request().records()[0]
    assert other.sha256 != cut.sha256
    request = Calibration("banana", made, air=made, fit=["E"], dx=3e-3).request("out")
    assert request.air_source == "lab 3 (arrays)" and request.stem == "lab 3 (arrays)"
    (call,) = request.command
    assert call == "Calibration('banana', trace=Trace('lab 3'), air=Trace('lab 3'), fit=['E'], dx=0.003).run('out')"


def test_reading_options_are_those_of_the_command_line() -> None:
    """Columns, sign, rate, baseline and the number of the cut, for a file and a DataFrame."""
    frame = pd.read_csv(BANANA, comment="#").rename(columns={"force_N": "Fz"})
    frame["Fz"] *= -1.0
    given = {"columns": {"force_col": "Fz=N", "sign": "-"}, "baseline": "linear", "cut": 1}
    request = Calibration("banana", frame, **given).request("out")
    np.testing.assert_allclose(request.records()[0].force, Trace.read(BANANA).force)
    assert (request.baseline, request.cut) == ("linear", 1)
    assert "columns={'force_col': 'Fz=N', 'sign': '-'}, baseline='linear', cut=1" in request.command[0]
    with pytest.raises(CutcalError, match="columns say how a file is read, but the trace is a Trace"):
        Calibration("banana", Trace.read(BANANA), columns={"sign": "-"})


def test_groups_of_a_file_are_named_whole() -> None:
    """The summary names file and group of an air run, and the default folder the group."""
    request = Request(food=load_food("banana"), trace=Path("cuts.h5:/cut 3"), air=Path("cuts.h5:/air"))
    assert request.air_source == "cuts.h5:/air"
    assert request.stem == "cut 3"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"food": "bananna"}, "did you mean 'banana'"),
        ({"food": "nowhere.yaml"}, "nowhere.yaml: no such file"),
        ({"trace": "nowhere.csv"}, "nowhere.csv: no such file"),
        ({"trace": 3}, "3 is no record: give the path"),
        ({"trace": None}, "None is no record: give the path"),
        ({"food": 3}, "food = 3; give a name, a YAML file or a Food"),
        ({"set": ["E=2"]}, "set = ['E=2']; give a dict such as {'E': 2e5}"),
        ({"set": {3: 1.0}}, "a name of a property = 3; give text"),
        ({"start_from": ["x"]}, "start_from = ['x']; give the path of a folder"),
        ({"sample": "yes"}, "sample = 'yes'; give True or False"),
        ({"rate": "fast"}, "rate = 'fast'; give the rows a second"),
        ({"fit": 5}, "fit = 5; give a list of names"),
        ({"fit": [1]}, "a name of a property = 1; give text"),
        ({"height": -1.0}, "height = -1.0 m must be a number between 0.001 and 1 m"),
        ({"height": "33 kg"}, "height: '33 kg' is not a length: write it in m, or with its unit"),
        ({"height": "3300 mm"}, "height = 3.3 m must be a number between 0.001 and 1 m"),
        ({"height": [0.03]}, "height = [0.03] must be a number between 0.001 and 1 m"),
        ({"speed": float("nan")}, "speed = nan m/s must be"),
        ({"budget": 0}, "budget = 0 must"),
        ({"budget": -3}, "budget = -3 must be a number between 0 and 1e+06"),
        ({"budget": "100"}, "budget = '100' must be a number between 0 and 1e+06"),
        ({"workers": 0}, "workers = 0; give a whole number of at least 1"),
        ({"seed": 1.5}, "seed = 1.5; give a whole number"),
        ({"shape": "banana"}, "shape = banana is none of block"),
        ({"arch": "tpu"}, "arch = tpu is none of"),
        ({"fit": "E,R"}, "fit = E,R is text; give a list"),
        ({"fit": (name for name in ("E", "R"))}, "give a list of names, such as ['E', 'R']"),
        ({"baseline": "flat"}, "baseline = flat is none of constant, linear, zero"),
        ({"cut": 0}, "cut = 0; give a number from 1, or 'whole'"),
        ({"columns": {"force": "Fz"}}, "columns has force, which is none of time_col, force_col"),
    ],
)
def test_impossible_values_are_one_line(change: dict[str, Any], words: str) -> None:
    """Each is refused before anything is computed, with value and limits."""
    with pytest.raises(CutcalError) as caught:
        Calibration(**{"food": "banana", "trace": BANANA, **change})
    said = str(caught.value)
    assert words in said and "\n" not in said and "  " not in said and said == said.strip()


def test_numbers_may_be_text_with_a_unit() -> None:
    """As on the command line: sizes, speeds, parts and frequencies; the call that is kept has what was written."""
    given = {"width": "45mm", "dx": "3mm", "speed": "20 mm/s", "gain_sd": "5%", "bandwidth": "0.1kHz"}
    request = Calibration("banana", BANANA, **given).request("out")
    assert (request.sizing.width, request.dx, request.speed) == (0.045, 0.003, 0.02)
    assert (request.gain_sd, request.bandwidth) == (0.05, 100.0)
    assert "width='45mm'" in request.command[0]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"timecol": "t"}, "argument 'timecol' is not known, did you mean 'time_col'?"),
        ({"rate": "fast"}, "rate 'fast' is not positive"),
    ],
)
def test_a_trace_that_is_read_knows_its_arguments(how: dict[str, Any], words: str) -> None:
    """From a file and from a DataFrame."""
    for given in (BANANA, pd.read_csv(BANANA, comment="#")):
        with pytest.raises(CutcalError) as caught:
            Trace.read(given, **how)
        assert words in str(caught.value) and "__init__" not in str(caught.value)


def test_foods_by_name_and_by_file(tmp_path: Path) -> None:
    """``Food.load`` takes both, and is the class that the loaders give."""
    assert Food is FoodSpec and Food.load("banana") == load_food("banana")
    path = tmp_path / "mine.yaml"
    path.write_text(json.dumps({"mine": load_food("banana").as_dict()}))
    assert Food.load(path).name == Food.load(str(path)).name == "mine"


@pytest.mark.parametrize("name", ["cutcal", "calib"])
def test_names_are_loaded_when_they_are_used(name: str) -> None:
    """``import cutcal`` loads no pandas, no Taichi and no plotting; Trace needs no pandas either; other names are
    errors."""
    code = (
        f"import sys, {name}\n"
        "heavy = {'taichi', 'matplotlib', 'pandas', 'numpy', 'yaml', 'scipy', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
        f"from {name} import Trace\n"
        "heavy = {'taichi', 'matplotlib', 'pandas', 'h5py'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    package = importlib.import_module(name)
    assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match="no attribute 'Knife'"):
        package.Knife  # noqa: B018
