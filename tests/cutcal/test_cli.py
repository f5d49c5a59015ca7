"""The command line as a newcomer meets it: one clear error, exit code 1, nothing written."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from calib.calibration.result import read_result
from calib.material.food import load_food, load_foods
from calib.material.references import remarks
from cutcal.commands.calibration.calibrate import verdict_text
from cutcal.main import main
from mpm.output.verdict_words import VERDICT_WORDS
from reports.calibration import parameter_page
from tests.data_dir import ROOT
from tests.reports.sample import summary, write_run

BANANA = ROOT / "force_data" / "banana_reconstructed.csv"


def cut(n: int = 200, before: int = 60, sign: float = 1.0) -> pd.DataFrame:
    """A plain cut at 100 Hz and 20 mm/s: flat, half sine, flat."""
    t = np.arange(n) / 100
    s = np.clip((np.arange(n) - before) / (n - before - 20), 0, 1)
    noise = np.random.default_rng(0).normal(0, 0.02, n)
    return pd.DataFrame({"time_s": t, "force_N": 5 + sign * 12 * np.sin(np.pi * s) + noise})


def spoil(frame: pd.DataFrame, row: int, column: str, value: object) -> pd.DataFrame:
    """The same table with one bad cell."""
    frame = frame.astype(object)
    frame.loc[row, column] = value
    return frame


def refused(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Run ``cutcal calibrate`` and return its one error line."""
    assert main(["calibrate", *argv]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = [x for x in captured.err.splitlines() if not x.startswith("note:")]
    assert len(lines) == 1 and lines[0].startswith("cutcal: ")
    assert "Traceback" not in captured.err
    return lines[0]


BAD_TRACES = {
    "text in the force column": (spoil(cut(), 17, "force_N", "oops"), ["force_N", "oops", "19"]),
    "inf in the force column": (spoil(cut(), 17, "force_N", "inf"), ["force_N", "19"]),
    "time not increasing": (cut().assign(time_s=lambda d: d.time_s * (d.index % 2)), ["time_s", "increas"]),
    "no contact": (cut().assign(force_N=5 + np.random.default_rng(1).normal(0, 0.02, 200)), ["no contact"]),
    "short baseline": (cut(before=3), ["baseline"]),
    "wrong sign": (cut(sign=-1.0), ["--sign"]),
    "no force column": (cut().rename(columns={"force_N": "torque_Nm"}), ["--force-col"]),
    "header only": (cut().iloc[:0], ["bad.csv"]),
}


@pytest.mark.parametrize("case", BAD_TRACES)
def test_bad_trace_is_one_clear_error(case, tmp_path, capsys):
    """Each bad trace is refused with the file, the place and the remedy, and no output folder is made."""
    frame, words = BAD_TRACES[case]
    path = tmp_path / "bad.csv"
    frame.to_csv(path, index=False)
    out = tmp_path / "out"
    line = refused(capsys, "--food", "banana", "--trace", str(path), "--speed", "0.02", "--out", str(out))
    for word in ["bad.csv", *words]:
        assert word in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, ["no such file", "missing.csv"]), ("", ["empty"]), ("time_s;force_N\n0;1\n", ["missing.csv"])],
)
def test_missing_and_empty_files_are_said(content, words, tmp_path, capsys):
    """A missing, an empty and a semicolon-separated file each get their own sentence."""
    path = tmp_path / "missing.csv"
    if content is not None:
        path.write_text(content)
    line = refused(capsys, "--food", "banana", "--trace", str(path), "--out", str(tmp_path / "out"))
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["--food", "bananna"], ["bananna", "did you mean 'banana'"]),
        (["--food", "banana", "--set", "nu=0.7"], ["nu", "0.7", "0.49"]),
        (["--food", "banana", "--set", "E=-1"], ["E", "-1"]),
        (["--food", "banana", "--set", "E"], ["--set E", "NAME=VALUE"]),
        (["--food", "banana", "--set", "youngs=2e5"], ["youngs", "did you mean 'E'"]),
        (["--food", "banana", "--knife", "kichen"], ["kichen", "kitchen"]),
        (["--food", "banana", "--fit", "E,yeild_stress"], ["yeild_stress", "yield_stress"]),
        (["--food", "banana", "--material", "nowhere.yaml"], ["nowhere.yaml"]),
        (["--food", "banana", "--workers", "0"], ["--workers"]),
        (["--food", "banana", "--workers", "0", "--check"], ["--workers", "at least 1"]),
        (["--food", "banana", "--budget", "5"], ["budget of 5", "9 parameters"]),
    ],
)
def test_bad_options_are_one_clear_error(argv, words, tmp_path, capsys):
    """Unknown foods, knives and properties get a did-you-mean; impossible values their limits."""
    line = refused(capsys, *argv, "--trace", str(BANANA), "--out", str(tmp_path / "out"))
    for word in words:
        assert word in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("mark", ["summary.json", "evaluations.h5", "evaluations.h5.journal"])
def test_out_with_another_run_is_never_touched(mark, tmp_path, capsys):
    """A folder that holds a run is refused and left as it was."""
    (tmp_path / mark).write_text("precious")
    line = refused(capsys, "--food", "banana", "--trace", str(BANANA), "--out", str(tmp_path))
    assert mark in line and "--resume" in line
    assert (tmp_path / mark).read_text() == "precious"


def test_out_that_is_a_file(tmp_path, capsys):
    """A file in place of the output folder is said."""
    path = tmp_path / "out"
    path.write_text("")
    assert "file" in refused(capsys, "--food", "banana", "--trace", str(BANANA), "--out", str(path))


@pytest.mark.parametrize("value", ["abc", "-1", "nan", "5"])
def test_numbers_are_checked_by_the_parser(value, capsys):
    """An impossible height is a usage error with its limits."""
    assert main(["calibrate", "--food", "banana", "--trace", "x.csv", "--height", value]) == 1
    assert "--height" in capsys.readouterr().err


def test_foods_lists_and_shows(capsys):
    """``foods`` lists every food; one food comes with ranges, sources and its flags; JSON is one document."""
    assert main(["foods"]) == 0
    head, *lines, foot = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(load_foods())
    assert max(map(len, [head, *lines, foot])) <= 80
    (potato,) = (line for line in lines if line.startswith("potato "))
    assert head.split() == ["shape", "length", "width", "height", "E", "R"]
    assert potato.split() == "potato half_cylinder 80 mm 65 mm 50 mm 2 MPa 75 J/m^2".split()
    assert main(["foods", "banana"]) == 0
    shown = capsys.readouterr().out
    assert "Table 2" in shown and "300 kPa      50 to 2000, proxy" in shown
    assert main(["foods", "cherry"]) == 0
    assert "! cherry: not modelled: the stone" in capsys.readouterr().out
    assert main(["foods", "banana", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["banana"]["properties"]["E"]["value"] == load_food("banana").value("E")


@pytest.mark.parametrize("food", ["banana", "apple", "grape"])
def test_a_food_is_shown_with_the_remarks_that_it_cites(food, capsys):
    """Each once, in short lines, and no other."""
    assert main(["foods", food]) == 0
    shown = capsys.readouterr().out
    cited = set(re.findall(r"\(remark (\d+)\)", shown))
    assert cited and re.findall(r"^  remark (\d+): ", shown, re.MULTILINE) == sorted(cited, key=int)
    plain = " ".join(shown.split())
    assert all(remarks()[number] in plain for number in cited)
    assert max(map(len, shown.partition("  remark ")[2].splitlines())) <= 100


def test_the_terminal_says_verdicts_in_words(tmp_path):
    """Those of the glossary; documents and tables keep their identifiers."""
    result = read_result(write_run(tmp_path))
    codes = {p.verdict for p in result.fitted.values()}
    assert {"one_sided", "only_as_product"} <= codes
    for text in (verdict_text(result), result.fit_report(), result._repr_html_()):
        assert "one-sided" in text and "only as a product" in text and "_sided" not in text and "as_product" not in text
    assert set(result.parameters["verdict"]) == codes


def test_one_word_for_one_verdict(tmp_path):
    """That of the terminal, of ``fit_report``, of the report with its legend, and of the documentation, for each
    verdict that a document may have."""
    result = read_result(write_run(tmp_path))
    schema = json.loads((ROOT / "calib" / "io" / "schemas" / "common.json").read_text(encoding="utf-8"))
    verdicts = schema["$defs"]["verdictWord"]["enum"]
    assert set(VERDICT_WORDS) == set(verdicts)
    docs = [(ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("glossary.md", "calibrate.md")]
    for verdict in verdicts:
        one = replace(result, fitted={"E": replace(result.fitted["E"], verdict=verdict)})
        word = parameter_page.parameter("E", one.fitted["E"], "")["verdict"]
        assert [row[0] for row in parameter_page.legend(one.fitted)] == [word]
        assert re.search(rf"^ +E .*  {word}$", verdict_text(one), re.MULTILINE), word
        assert re.search(rf"^ +E: .*  {word}$", one.fit_report(), re.MULTILINE), word
        assert f"<td>{word}</td>" in one._repr_html_()
        assert all(re.search(rf"^\| {word}( \(`{verdict}`\))? \|", text, re.MULTILINE) for text in docs), word


def test_the_terminal_has_units_that_people_use(tmp_path):
    """Fitted values and their intervals share one, with no power of ten; so do those of ``foods``."""
    lines = {
        line.split()[0]: line.split() for line in verdict_text(read_result(write_run(tmp_path))).splitlines() if line
    }
    value, unit, low, to, high, *_ = lines["E"][1:]
    p = summary()["parameters"]["E"]
    assert (unit, to) == ("kPa", "to") and float(value) == pytest.approx(p["value"] / 1e3, rel=1e-3)
    assert [float(low), float(high)] == pytest.approx([p["low95"] / 1e3, p["high95"] / 1e3], rel=5e-3)
    assert not any("e+" in word for word in lines["E"])
