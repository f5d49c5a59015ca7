"""The next test from Python: the arguments of ``cutcal design``, its result as a table and a picture."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, replace
from inspect import signature
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import calib.design_api as module
from calib.design.result import read_design, to_document
from calib.io.schema import tag
from cutcal import Calibration, Design, Food
from cutcal.commands.calibration.design import add_args
from mpm.scene.errors import CutcalError
from tests.calib.design_sample import RESULT
from tests.calib.made_food import MadeFood
from tests.reports.sample import write_run

STARTS = {"run", "food", "material"}
"""Options that say what is known: in Python the first argument."""
OTHERWISE = {"help", "json", "out", "resume"}
"""Options that are arguments of ``run``, or that Python says by the result."""


def test_every_option_is_an_argument_of_the_same_name() -> None:
    """None is missing on either side."""
    parser = argparse.ArgumentParser()
    add_args(parser)
    options = {action.dest for action in parser._actions} - OTHERWISE - STARTS
    assert options == {item.name for item in fields(Design) if item.init} - {"start"}
    assert set(signature(Design.run).parameters) == {"self", "out", "resume", "say"}


@pytest.fixture
def formulas(monkeypatch: pytest.MonkeyPatch) -> None:
    """A food of formulas in place of the solver."""

    @contextmanager
    def pool(*_: Any) -> Iterator[MadeFood]:
        yield MadeFood()

    monkeypatch.setattr(module, "workers_for", pool)
    matplotlib.use("Agg")


@pytest.mark.usefixtures("formulas")
def test_a_food_is_designed_for_and_written(tmp_path: Path) -> None:
    """Arguments reach the design, which is what the folder holds; lab work that is known is taken."""
    heard: list[str] = []
    design = Design(Food.load("potato"), asked="R", set={"E": 2e6}, blade=["edc"], minutes={"cut": 3.0})
    result = design.run(tmp_path / "next", say=heard.append)
    assert to_document(read_design(tmp_path / "next")) == to_document(result)
    assert (tmp_path / "next" / "design.svg").is_file() and heard
    assert result.known["E"].value == 2e6 and result.ranking.loc["cut", "minutes"] == 3.0
    assert list(result.ranking.index) == [test.name for test in result.tests]
    assert set(result.ranking["narrows"]) == {"R"} and result.recommended in result.ranking.index
    assert result.invocation.command == (
        "Design('potato', asked='R', set={'E': 2000000.0}, blade=['edc'], minutes={'cut': 3.0})"
        f".run({str(tmp_path / 'next')!r})",
    )
    with pytest.raises(CutcalError) as caught:
        design.run(tmp_path / "next")
    assert "--" not in str(caught.value) and "resume=True" in str(caught.value)


def test_of_all_parameters_the_one_that_is_narrowed_most_is_shown() -> None:
    """Its name stands in the table, and its ends."""
    wide, narrow = RESULT.tests[0].parameters["R"], RESULT.tests[2].parameters["R"]
    test = replace(RESULT.tests[0], asked=None, parameters={"E": narrow, "R": wide})
    row = replace(RESULT, asked="all", tests=(test,)).ranking.iloc[0]
    assert (row["narrows"], row["part"], row["high95"]) == ("R", wide.part, wide.high95)


def test_a_result_tells_of_itself() -> None:
    """A short text, a table with what is recommended, and a row for each test in the picture."""
    assert repr(RESULT) == "DesignResult('banana', asked='R', recommended='blade edc')"
    html = RESULT._repr_html_()
    assert "next: blade edc" in html and html.count("<tr") == 1 + len(RESULT.tests)
    axes = RESULT.plot()
    assert [t.get_text() for t in axes.get_yticklabels()] == ["slicing, 20 min", "blade edc, 15 min", "width, 2 min"]
    assert list(axes.lines[0].get_xdata()) == [0.5, 0.6, 0.7]
    matplotlib.pyplot.close("all")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"start": "bananna"}, "did you mean 'banana'"),
        ({"start": "nowhere.yaml"}, "nowhere.yaml: no such file"),
        ({"start": "runs/nowhere"}, "runs/nowhere: no such folder"),
        ({"start": 3}, "start = 3"),
        ({"knife": "spoon"}, "spoon"),
        ({"draws": 0}, "draws = 0; give a whole number of at least 1"),
        ({"blade": "edc"}, "blade = edc is text; give a list"),
        ({"minutes": {"blade": -1.0}}, "minutes of blade = -1"),
        ({"arch": "tpu"}, "arch = tpu is none of"),
        ({"asked": "Q"}, "Q"),
        ({"asked": None}, "asked = None"),
        ({"minutes": {"sawing": 2.0}}, "sawing"),
    ],
)
@pytest.mark.usefixtures("formulas")
def test_impossible_values_are_one_line(change: dict[str, Any], words: str, tmp_path: Path) -> None:
    """Each is refused with its value, and no option of the command line is named but in a command to be typed."""
    with pytest.raises(CutcalError) as caught:
        Design(**{"start": "banana", **change}).run(tmp_path / "out")
    said = str(caught.value)
    assert words in said and "\n" not in said
    assert "--" not in re.sub(r"cutcal (foods|knives) --template", "", said)


def test_a_folder_without_a_calibration(tmp_path: Path) -> None:
    """An empty folder is said; a calibration has its food and knife already."""
    with pytest.raises(CutcalError, match=r"summary.json: no such file.*resume=True"):
        Design(tmp_path)
    with pytest.raises(CutcalError, match="knife: the calibration has its food and knife"):
        Design(tmp_path, knife="edc")
    (tmp_path / "summary.json").write_text(json.dumps({"schema": tag("study")}))
    with pytest.raises(CutcalError, match="^start .*: is a fit of several specimens"):
        Design(tmp_path)
    gone = replace(Calibration.load(write_run(tmp_path / "run")), folder=tmp_path / "gone")
    with pytest.raises(CutcalError, match="gone: no such folder"):
        Design(gone)
