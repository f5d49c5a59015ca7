"""Results, records and foods in a notebook: pictures, tables and text; and the same arguments as options."""

from __future__ import annotations

import argparse
import importlib.util
import io
import re
from dataclasses import fields
from inspect import signature
from pathlib import Path
from typing import Any

import h5py
import matplotlib
import numpy as np
import pytest

from calib.calibration.fit_report import relation, strongest
from calib.calibration.result import CalibrationResult
from calib.errors import OutputError
from calib.io.progress import Progress, ProgressBar
from calib.io.wording import as_arguments, in_arguments
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_file import Header, StoredEvaluation, hdf5_of
from calib.validation.acceptance import Verdict
from cutcal import Calibration, Food, Study, Trace
from cutcal.commands.calibration.calibrate import add_args
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT
from tests.reports.sample import write_run

BANANA = ROOT / "force_data" / "banana_reconstructed.csv"
OTHERWISE = {"help", "json", "check", "all", "config", "material"}
"""Options that Python says in another way: the result's summary, a Study, and a food from a file."""


@pytest.fixture
def result(tmp_path: Path) -> CalibrationResult:
    """The sample calibration, with a store of two runs."""
    matplotlib.use("Agg")
    folder = write_run(tmp_path / "run")
    runs = [
        StoredEvaluation(
            str(i),
            "fine",
            Evaluation(i, {"E": 1e5 * (i + 1)}, "ok", "", 1.0, np.array([0.0, 1.0]), np.array([0.0, 2.0]), {}, 0.5),
        )
        for i in range(2)
    ]
    (folder / "evaluations.h5").write_bytes(hdf5_of(Header("sha", "scene"), runs))
    return Calibration.load(folder)


@pytest.mark.parametrize("columns", [40, 72])
def test_a_narrow_terminal_shows_every_column(
    result: CalibrationResult, monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    """Each name of a column and each value stands in the text; a part of the table is a table of the same kind."""
    monkeypatch.setenv("COLUMNS", str(columns))
    table = result.parameters
    text = repr(table)
    words = text.split()
    assert len(table.columns) > 8 and set(table.columns) <= set(words) and set(table.index) <= set(words)
    assert "..." not in text and len(text.splitlines()[0]) <= columns
    assert repr(table[["value", "unit"]]).splitlines()[0].split() == ["value", "unit"]


def test_curves_simulations_and_foods_show_every_column(
    result: CalibrationResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a narrow terminal all names stand in the text; of many rows, the first and the last."""
    monkeypatch.setenv("COLUMNS", "40")
    food = Food.load("banana").frame()
    for table in (result.curves, result.evaluations, food):
        text = repr(table)
        assert set(table.columns) <= set(text.split()) and "\\\n" in text  # which ends a part of a wide table
    assert len(result.curves) > 60 and len(repr(result.curves).splitlines()) < 100
    assert f"[{len(result.curves)} rows x {len(result.curves.columns)} columns]" in repr(result.curves)
    source = Food.load("banana").properties["E"].source
    assert food.loc["E", "source"] == source and source in repr(food)


def test_every_option_is_an_argument_of_the_same_name() -> None:
    """None is missing on either side."""
    parser = argparse.ArgumentParser()
    add_args(parser)
    options = {action.dest for action in parser._actions} - OTHERWISE
    arguments = {item.name for item in fields(Calibration) if item.init} - {"columns"}
    run = set(signature(Calibration.run).parameters) - {"self", "progress", "say"}
    assert options == arguments | run


def test_arguments_reach_the_request() -> None:
    """The new ones; reading options turn the force round as ``columns`` does."""
    given: dict[str, Any] = {"gain_sd": 0.05, "lag_sd": 0.01, "discrepancy": 0.04, "u_num": "study", "set": {"E": 2e5}}
    given |= {"start_from": "earlier"}
    request = Calibration("banana", BANANA, sign="-", **given).request()
    assert (request.gain_sd, request.lag_sd, request.errors.discrepancy) == (0.05, 0.01, 0.04)
    assert request.u_num == Path("study") and request.food.value("E") == 2e5
    assert request.start_from == Path("earlier")
    plain, turned = Calibration("banana", BANANA).request().records()[0], request.records()[0]
    np.testing.assert_array_equal(turned.force, -plain.force)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rate": -1.0}, "argument rate"),
        ({"force_col": "nowhere"}, "force_col"),
        ({"sign": "-", "columns": {"sign": "+"}}, "sign is an argument and in columns"),
        ({"gain_sd": 2.0}, "gain_sd = 2.0"),
        ({"set": {"Q": 1.0}}, "Q"),
    ],
)
def test_errors_speak_of_arguments(change: dict[str, Any], words: str) -> None:
    """No option of the command line is named."""
    with pytest.raises(CutcalError) as caught:
        Calibration("banana", BANANA, **change)
    assert words in str(caught.value) and "--" not in str(caught.value)


def test_options_become_arguments() -> None:
    """Options in a sentence, and nothing else: no dash between words, no line of a table."""
    assert as_arguments("add --resume (option --t-end)") == "add resume=True (argument t_end)"
    assert as_arguments("a -- b, force--col, option 3") == "a -- b, force--col, option 3"


def test_a_command_to_be_typed_keeps_its_options() -> None:
    """What a message says to type in a shell can be typed; what it says of a run is an argument."""
    for typed in ("cutcal foods --template", "cutcal report DIR --context", "cutcal converge --material --offset 0.5"):
        assert as_arguments(f"try --knife, or {typed} begins one") == f"try knife, or {typed} begins one"
    assert as_arguments("run the same calibrate command again with --resume").endswith("again with resume=True")
    with pytest.raises(CutcalError, match="file that cutcal foods --template begins"):
        Calibration("tofu", BANANA)


def test_stages_and_folders_speak_of_arguments(tmp_path: Path) -> None:
    """What is said, and an error that only a run can find: a folder that is there already."""
    heard: list[str] = []
    listener = in_arguments(heard.append)
    assert listener is not None and in_arguments(None) is None
    listener("give --board-z")
    assert heard == ["give board_z"]
    (tmp_path / "there").write_text("a file")
    with pytest.raises(CutcalError) as caught:
        Calibration("banana", BANANA).run(tmp_path / "there")
    assert "there" in str(caught.value) and "--" not in str(caught.value)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ({"progress": 5}, "progress = 5; give True for a bar, or a function"),
        ({"say": "print"}, "say = 'print'; give a function"),
        ({"resume": "yes"}, "resume = 'yes'; give True or False"),
    ],
)
def test_listeners_are_tried_before_anything_is_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: dict[str, Any], words: str
) -> None:
    """One that cannot be called, of a calibration and of a study, leaves no folder behind."""
    for module in ("calibration", "multi_specimen"):
        monkeypatch.setattr(f"calib.{module}.run.run", lambda *_, **__: pytest.fail("the run began"))
    study = tmp_path / "study.yaml"
    study.write_text(f"food: banana\ntraces:\n  a: {{trace: {BANANA}}}\n  b: {{trace: {BANANA}}}\n")
    for one in (Calibration("banana", BANANA), Study.read(study)):
        with pytest.raises(CutcalError, match=re.escape(f"{type(one).__name__}.run: {words}")):
            one.run(tmp_path / "out", **how)
    assert not (tmp_path / "out").exists()


def test_a_notebook_rewrites_its_line() -> None:
    """A stream of ipykernel is no terminal, and gets the bar all the same; a file gets a line now and then."""
    stream = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    plain = io.StringIO()
    for out in (stream, plain):
        with ProgressBar(out, interval_s=1e9) as bar:
            for done in (1, 2):
                bar(Progress(done, float(done), 4.0, 0, 1.0, 9.0, "search"))
    assert stream.getvalue().count("\r[") == 2 and plain.getvalue().count("\n") == 1


def test_a_result_tells_of_itself(result: CalibrationResult) -> None:
    """Text and table have each fitted parameter and verdict; runs are rows; nothing was sampled."""
    text, table = result.fit_report(), result._repr_html_()
    for name, p in result.fitted.items():
        assert f"{name}:" in text and f"<td>{name}</td>" in table and f"{p.value:.4g}" in text
    assert all(v.name in text for v in result.verdicts)
    known = sum(p.verdict == "identified" for p in result.fitted.values())
    assert f"[[Verdicts]] {known} of {len(result.fitted)} parameters identified\n" in text
    assert max(map(len, text.splitlines())) <= 120
    runs = result.evaluations
    assert list(runs["E"]) == [1e5, 2e5] and list(runs["status"]) == ["ok", "ok"] and list(runs["seconds"]) == [0.5] * 2
    assert len(result.modes) == (0 if result.sampled is None else len(result.sampled.modes))


def test_a_store_that_is_gone_or_damaged(result: CalibrationResult) -> None:
    """Each is one line with the file."""
    path = result.folder / "evaluations.h5"
    with h5py.File(path, "a") as file:
        del file["status"]
    with pytest.raises(OutputError, match="evaluations.h5: cannot be read"):
        result.evaluations  # noqa: B018
    path.unlink()
    with pytest.raises(OutputError, match="evaluations.h5: no such file"):
        result.evaluations  # noqa: B018


def test_correlations_once_and_in_order() -> None:
    """The strongest first, no pair twice, weak and unknown ones left out."""
    given = {"E,R": 0.5, "R,E": 0.5, "E,mu": -0.9, "R,mu": 0.01, "mu,nu": None}
    assert strongest(given) == [("E,mu", -0.9), ("E,R", 0.5)]


def test_pictures(result: CalibrationResult) -> None:
    """Curves that are drawn are those of the folder; given axes are used."""
    upper, lower = result.plot()
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), result.curves["real_N"])
    np.testing.assert_array_equal(lower.lines[1].get_ydata(), result.curves["residual_N"])
    trace = Trace.read(BANANA)
    axes = trace.plot(upper)
    assert axes is upper and len(axes.lines) == 3
    matplotlib.pyplot.close("all")


def test_picture_of_a_food() -> None:
    """Each property has a row with its value and unit; a range that begins at 0, as that of friction, has an arrow."""
    food = Food.load("banana")
    axes = food.plot()
    labels = [label.get_text().replace("\xa0", " ") for label in axes.get_yticklabels()]
    assert len(labels) == len(food.properties) and {"E = 300 kPa", "mu = 0.3", "skin_thickness = 3 mm"} <= set(labels)
    row = labels.index("mu = 0.3")
    drawn = [line for line in axes.lines if line.get_ydata()[0] == row]
    np.testing.assert_allclose(drawn[0].get_xdata(), [axes.get_xlim()[0], 2.0])
    assert [line.get_marker() for line in drawn].count("<") == 1
    assert sum(line.get_marker() == "<" for line in axes.lines) == sum(p.low == 0.0 for p in food.properties.values())
    matplotlib.pyplot.close("all")


def test_foods_as_tables_and_files(tmp_path: Path) -> None:
    """Names, rows and a file that reads back; texts of values are short."""
    assert {"banana", "potato"} <= set(Food.list())
    food = Food.load("banana").with_values({"E": 2e5})
    assert food.frame().loc["E", "value"] == 2e5
    food.save(tmp_path / "mine.yaml")
    assert Food.load(tmp_path / "mine.yaml") == food
    texts = (repr(food), repr(Trace.read(BANANA)), repr(Calibration("banana", BANANA)))
    assert all(len(text) < 120 + len(str(BANANA)) and "\n" not in text for text in texts)


@pytest.mark.parametrize("name", ["cutcal", "calib", "mpm", "reports", "fem_reference", "studies", "intsim"])
def test_packages_say_that_they_are_typed(name: str) -> None:
    """The mark of PEP 561 lies beside the package's first module."""
    found = importlib.util.find_spec(name)
    assert found is not None and found.origin is not None and (Path(found.origin).parent / "py.typed").is_file()


def test_a_limit_is_the_largest_or_the_smallest_value() -> None:
    """It follows from value and outcome; a value at its limit that passes is no larger."""
    lines = {(0.3, 0.01, True): ">=", (0.02, 0.05, True): "<=", (0, 0, True): "<=", (0.2, 0.05, False): "<="}
    assert {key: relation(Verdict("line", key[0], key[1], "-", key[2])) for key in lines} == lines
    assert relation(Verdict("line", None, 0.05, "-", None)) == "limit"
