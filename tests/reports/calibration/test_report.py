"""The PDF of a calibration: complete, stable, honest about what failed, and clear about damaged input."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from calib.calibration.report import write_report
from calib.calibration.result import from_document
from calib.calibration.withdrawal_result import WithdrawalAgreement
from calib.errors import OutputError
from calib.problem.target import ErrorModel
from calib.uncertainty.estimates import FittedNuisance
from reports import ReportError
from reports.base import format as report_format
from reports.base.format import DASH
from reports.calibration import measurement, report
from tests.data_dir import ROOT
from tests.reports import sample
from tests.reports.sample import pages, spaced

MOST_BYTES = 5_000_000
Content = Callable[..., dict[str, Any]]


@pytest.fixture
def content(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Content:
    """Function that returns what the template would be given for a run, without drawing or setting it."""
    caught: list[dict[str, Any]] = []
    monkeypatch.setattr(report, "_pictures", lambda _: {})
    monkeypatch.setattr(report, "publish", lambda _, __, content, *___, **____: caught.append(content))

    def make(kind: str = "good", **changes: Any) -> dict[str, Any]:
        write_report(sample.write_run(tmp_path, kind, **changes))
        return caught[-1]

    return make


# ---- the document


@pytest.mark.parametrize(("kind", "count"), [("good", 8), ("reconstructed", 8), ("failed", 9), ("interrupted", 6)])
def test_every_outcome_gives_a_pdf_of_the_planned_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, count: int
) -> None:
    """Sections follow one another, and no page has more than a third of its text area empty."""
    filled, look = [], report_format.page_fills

    def page_fills(*args: Any) -> list[float]:
        found = look(*args)
        filled.append(min(found))
        return found

    monkeypatch.setattr(report_format, "page_fills", page_fills)
    path = write_report(sample.write_run(tmp_path, kind))
    pdf = path.read_bytes()
    assert path == tmp_path / "report.pdf"
    assert pdf.startswith(b"%PDF") and len(pdf) < MOST_BYTES
    assert pages(pdf) == count
    assert max(filled) >= 1.0 - (22.0 + (297.0 - 24.0 - 22.0) / 3.0) / 297.0  # margins of 24 and 22 mm


def test_all_fonts_are_embedded(tmp_path: Path) -> None:
    """Every font of the document comes with its outlines."""
    pdf = write_report(sample.write_run(tmp_path)).read_bytes()
    fonts = len(re.findall(rb"/Type\s*/FontDescriptor", pdf))
    assert fonts >= 3 and len(re.findall(rb"/FontFile[23]? ", pdf)) == fonts


@pytest.mark.slow
def test_same_files_give_same_bytes_in_another_process(tmp_path: Path) -> None:
    """Neither the clock, the hash seed, the time zone, the folder nor an existing report changes a byte."""
    first = write_report(sample.write_run(tmp_path / "a")).read_bytes()
    second = sample.write_run(tmp_path / "a folder with another name")
    code = "import sys; from pathlib import Path; from calib.calibration.report import write_report; " + (
        "[write_report(Path(sys.argv[1])) for _ in range(2)]"
    )
    env = {**os.environ, "PYTHONHASHSEED": "12345", "TZ": "Asia/Tokyo", "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-c", code, str(second)], check=True, env=env, cwd=tmp_path)
    assert (second / "report.pdf").read_bytes() == first
    assert (second / "report.html").read_bytes() == (tmp_path / "a" / "report.html").read_bytes()
    assert sorted(p.name for p in second.iterdir()) == [
        "curves.csv", "evaluations.h5", "report.html", "report.pdf", "summary.json"
    ]  # fmt: skip


def test_another_number_gives_another_document(tmp_path: Path) -> None:
    """Stability does not come from ignoring the input."""
    first = write_report(sample.write_run(tmp_path)).read_bytes()
    assert write_report(sample.write_run(tmp_path, particles=118345)).read_bytes() != first


def test_long_names_and_markup_are_only_text(tmp_path: Path) -> None:
    """Names that are long, or mean something to the typesetter or to mathtext, are printed, not run."""
    s = sample.summary("failed")
    odd = "#panic() *bold $x^2$ [ \\ @ref <a> `raw` // /* "
    s["trace"] |= {"source": "robot_cell_3_" * 12 + odd + ".csv", "columns": {"force": "F" * 90, "time": odd}}
    s["verdicts"] += [{**s["verdicts"][0], "name": "long_" * 20, "note": odd * 6}]
    s["parameters"]["name_of_an_unknown_one_" + odd] = s["parameters"]["E"] | {"unit": odd, "verdict": odd}
    s["knife"]["name"] = "k" * 90
    s["command"] = ["calibrate", "--trace", "folder/" * 40 + odd] + ["--option"] * 60
    s["failures"] = [{"reason": odd, "fraction": None, "parameters": {odd: 1.0, "x" * 60: 2}}]
    s["warnings"] = [odd * 8] * 12
    s |= {"food": odd, "device": "d" * 200}
    assert pages(write_report(sample.write_run(tmp_path, "failed", **s)).read_bytes()) >= 6


def test_unknown_numbers_and_empty_lists_leave_no_hole(tmp_path: Path) -> None:
    """A report is made where everything that may be unknown is, and it has its pages."""
    s = sample.summary()
    unknown = ("baseline_sd_N", "onset_sd_s", "peak_real_sd_N", "peak_error", "shape_error", "nrmse",
               "work_error", "wall_s", "particles", "mach", "momentum_residual", "ke_over_ie", "ripple_N",
               "git", "device", "reduced_chi2", "correlation_length_m", "predictive_inside")  # fmt: skip
    mappings = ("parameters", "correlations", "fixed_parameters", "null_models", "metrics", "versions")
    mappings += ("nuisances", "profiles", "sensitivity")
    lists = ("verdicts", "failures", "misfit_history", "warnings", "limits", "command")
    empty: dict[str, Any] = {name: {} for name in mappings} | {name: [] for name in lists}
    empty |= dict.fromkeys(unknown) | {"counters": None}
    empty |= {name: dict.fromkeys(s[name]) for name in ("sprague_geers", "iso18571")}
    run = sample.write_run(tmp_path, **empty)
    assert pages(write_report(run).read_bytes()) == 5


def test_missing_parts_of_a_simulation_are_not_drawn(tmp_path: Path) -> None:
    """Columns that may be empty may be NaN or blank, and the report says so of the unfitted simulation."""
    run = sample.write_run(tmp_path)
    lines = (run / "curves.csv").read_text().splitlines()
    header = lines[0].split(",")
    blank = [header.index(name) for name in ("edge_N", "start_N")]
    rows = [["" if i in blank else x for i, x in enumerate(line.split(","))] for line in lines[1:]]
    (run / "curves.csv").write_text("\n".join([lines[0], *(",".join(row) for row in rows)]))
    assert pages(write_report(run).read_bytes()) == 8


def test_an_older_folder_still_gives_a_report(tmp_path: Path) -> None:
    """Without band, table of simulations and what later versions compute, the report has its six pages."""
    run = sample.write_run(tmp_path, "interrupted")
    data = json.loads((run / "summary.json").read_text())
    for key in ("nuisances", "profiles", "sensitivity", "reduced_chi2", "correlation_length_m", "predictive_inside"):
        del data[key]
    (run / "summary.json").write_text(json.dumps(data))
    with h5py.File(run / "evaluations.h5", "a") as store:
        del store["status"]
    assert pages(write_report(run).read_bytes()) == 6


def test_a_long_table_keeps_the_figure_on_the_first_page(tmp_path: Path) -> None:
    """Eighteen lines, some with names or notes of two lines, leave the main figure its least height, not a page of its
    own."""
    verdicts = sample.summary()["verdicts"]
    verdicts += [{**verdicts[0], "name": f"{i} a name that is longer than its own column"} for i in range(3)]
    verdicts += [{**verdicts[0], "note": "lag +0.00018 ± 0.0001 m, expected 0 ± 0.0003 m"} for _ in range(4)]
    run = sample.write_run(tmp_path, "reconstructed", verdicts=verdicts)
    assert pages(write_report(run).read_bytes()) == 8


# ---- what it says


def test_what_the_measurement_leaves_open_is_said_in_units_and_marked(content: Content) -> None:
    """Prior and posterior with their units; a gain four prior standard deviations off is marked, a good one is not."""
    rows = {r[0]: [spaced(x) for x in r[2:]] for r in content()["left_open"]}
    assert list(rows) == ["Tare", "Drift", "Lag", "Gain", "Width"]
    assert rows["Lag"] == ["0 ± 67 µm", "31 ± 44 µm", "yes"]
    assert rows["Gain"] == ["0 ± 2.0 %", "(−0.3 ± 1.9) %", "yes"]
    marks = {r[0]: r[4] for r in content("failed")["left_open"]}
    assert [name for name, mark in marks.items() if mark == "no"] == ["Gain"]
    assert content("interrupted")["left_open"] == []


def test_errors_are_counted_and_sized_in_words(content: Content) -> None:
    """33 mm over a correlation length of 2.1 mm are 16 readings; chi-square 14.2 is 3.8 times; below one nothing
    widens."""
    length, size = (spaced(text) for text in content("failed")["errors"])
    assert "over 2.1 mm of stroke" in length and "240 points" in length and "about 16 independent" in length
    assert "14.2" in size and "3.8 times" in size and "were widened" in size
    assert "no interval was widened" in content(reduced_chi2=0.7)["errors"][1]
    assert content("interrupted")["errors"] == []


def test_both_chi_squares_have_their_number_of_data(content: Content) -> None:
    """That of the seen correlation length and that of the assumed one, which is the objective's own; two curves have
    twice as many data. The figure of the search names the same number."""
    assert measurement.ASSUMED_READINGS == round(1.0 / ErrorModel().correlation)
    said = spaced(content()["errors"][1])
    assert "Reduced chi-square 1.30 of the curve's 16 readings and the peak" in said
    assert "is 18.5 for 21 independent data (curve and peak), 0.881 each" in said and "verdict table" not in said
    assert content()["misfit_data"] == "21"
    line = {**sample.summary()["verdicts"][0], "name": "curve explained by the food"}
    assert "of the verdict table has the less probable of these two" in content(verdicts=[line])["errors"][1]
    assert "independent data" not in content(misfit_history=[])["errors"][1]
    up = WithdrawalAgreement(from_m=2e-3, to_m=0.02, speed_m_s=0.02, peak_real_N=0.3, peak_sim_N=0.3, nrmse=0.03,
                             work_real_J=1e-3, work_sim_J=1e-3)  # fmt: skip
    result = replace(from_document(sample.summary(), Path()), withdrawal=up)
    assert measurement.assumed_data(result, 240) == 42
    assert "42 independent data (curve and peak, down and up)" in spaced(measurement.errors(result, 240)[1])


def test_the_level_on_the_way_up_is_another_thing() -> None:
    """The tare of the pull has its own words; other names do not."""
    tare = FittedNuisance(0.0, 0.01, 0.05, "N", False)
    down, up = (measurement.left_open("tare", tare, up=way)[1] for way in (False, True))
    assert down == "level of the force before contact" and "on the way up" in up
    gain = FittedNuisance(0.0, 0.01, 0.02, "-", False)
    assert measurement.left_open("gain", gain, up=True) == measurement.left_open("gain", gain)


def test_many_failed_simulations_are_said_on_the_first_page(content: Content) -> None:
    """21 of 70 are; 2 of 61 are not."""
    assert "21 of 70 simulations broke down" in spaced(content("failed")["sentence"])
    assert "broke down" not in content()["sentence"]


def test_one_line_that_failed_is_counted_among_all(content: Content) -> None:
    """One of nine that were run."""
    verdicts = sample.summary()["verdicts"]
    verdicts[0] |= {"passed": False, "value": -0.2}
    said = content(verdicts=verdicts, passed=False)["sentence"]
    assert said.startswith("Not passed: 1 of 9 lines of the table failed (Peak error).")


def test_nought_is_written_one_way(content: Content) -> None:
    """A null model's error of a rounding is that of one without any."""
    nulls = sample.summary()["null_models"]
    nulls["ramp"]["peak_error"], nulls["half_sine"]["peak_error"] = 0.0, -2.2e-5
    rows = content(null_models=nulls)["null_rows"]
    assert [spaced(row[4]) for row in rows[1:3]] == ["0 %", "0 %"]
    assert spaced(content(momentum_residual=1e-6)["numerics"]["momentum"]) == "< 0.01 %"


def test_units_in_sentences_of_a_run_are_typeset(content: Content) -> None:
    """A space before a per cent sign and raised exponents; a power of ten stays."""
    got = content(limits=["as wide as 83% of 10 J/m^2"], warnings=["from 930 to 1110 kg/m^3, x^20, 2^3"])
    assert spaced(got["limits"][0]) == "As wide as 83 % of 10 J/m²"
    assert got["warnings"] == ["From 930 to 1110 kg/m³, x^20, 2^3"]


def test_verdicts_that_occur_are_explained(content: Content) -> None:
    """Each verdict in the table has one explanation, in words, and no other is explained."""
    words = [w for w, _ in content()["legend"]]
    assert words == ["identified", "weak", "one-sided", "only as a product"]
    assert {p["verdict"] for p in content()["parameters"]} == set(words)


def test_what_moves_the_curve_names_the_strong_ones_first(content: Content) -> None:
    """Parameters with a tenth of the variance, strongest first; an index that is not known names none."""
    said = [spaced(text) for text in content()["influences"]]
    assert said[0] == "Peak: R (53 %), mu (24 %) and E (22 %)."
    assert said[2].startswith("Initial slope: E (67 %), R_skin (23 %)")
    unknown = {"peak": {"E": {"first": None, "total": None, "total_conf": None}}}
    assert content(sensitivity=unknown)["influences"] == []


def test_region_of_failures_is_named(content: Content) -> None:
    """Failed runs at high R and low yield stress are said to be there, with medians; two failures are no region."""
    said = spaced(content("failed")["broke_down"])
    assert (
        said.startswith("Simulations failed at high R (median 1460 J/m² against ")
        and "low yield_stress (median" in said
    )
    assert content()["broke_down"] == ""


def test_verdict_names_the_lines_that_failed_and_those_not_run(content: Content) -> None:
    """The sentence under the title lists failed lines, and never hides what was not tested."""
    assert content()["sentence"].startswith("Passed")
    assert content()["sentence"].endswith("Not run: Grid uncertainty of the peak and Held-out NRMSE.")
    said = content("failed")["sentence"]
    assert said.startswith("Not passed: 7 of 9 lines of the table failed (Peak error, NRMSE,")
    assert "reconstruction, so this says nothing about a real cut" in content("reconstructed")["sentence"]
    assert "interrupted" in content("interrupted")["sentence"]


def test_passed_with_a_failed_line_is_not_covered_up(content: Content) -> None:
    """If the run passed although a line failed, the sentence names the line."""
    verdicts = sample.summary()["verdicts"]
    verdicts[0] |= {"passed": False, "value": -0.2}
    assert "except in Peak error" in content(verdicts=verdicts)["sentence"]


@pytest.mark.parametrize(
    ("value", "limit", "unit", "passed", "relation", "shown", "against"),
    [
        (-0.08, 0.05, "fraction", False, None, "−8.00 %", "≤ 5 %"),
        (0.04, 0.05, "fraction", True, None, "4.00 %", "≤ 5 %"),
        (0.041, 0.3561234, "", True, None, "0.0410", "≤ 0.356"),
        (0.85, 0.9, "-", False, None, "0.850", "≥ 0.9"),
        (0.95, 0.9, "-", True, None, "0.950", "≥ 0.9"),
        (2, 2, "-", True, ">=", "2", "≥ 2"),
        (0, 0, "-", True, None, "0", "≤ 0"),
        (True, True, None, True, None, "yes", "yes"),
        (["E", "mu"], None, "-", False, None, "E and mu", DASH),
        ("monotone", "monotone", "", True, None, "monotone", "monotone"),
        (None, 0.05, "fraction", None, None, "not run", "5 %"),
    ],
)
def test_verdict_line(
    content: Content, value: Any, limit: Any, unit: Any, passed: Any, relation: Any, shown: str, against: str
) -> None:
    """Values of all types are readable, and the direction of the limit follows from the outcome."""
    line = {"name": "x", "value": value, "limit": limit, "unit": unit, "passed": passed, "note": None}
    got = content(verdicts=[line | ({"relation": relation} if relation else {})])["verdicts"][0]
    assert (spaced(got["value"]), spaced(got["limit"])) == (shown, against)
    assert got["mark"] == {True: "yes", False: "no", None: "none"}[passed]


def test_null_model_that_is_closer_is_named(content: Content) -> None:
    """A null model that beats the simulation is named with the measure and both values."""
    nulls = sample.summary()["null_models"]
    for model in nulls.values():
        model |= {"nrmse": 0.4, "shape_error": 0.4, "R": 0.2}
    (said,) = content(null_models=nulls)["null_sentences"]
    assert said.startswith("No null model is closer") and said.endswith("NRMSE, shape error and ISO rating.")
    nulls["ramp"]["R"] = 0.99
    (said,) = content(null_models=nulls)["null_sentences"]
    assert said.startswith("The straight ramp (1 number) is closer to the trace than the simulation in ")
    assert said.endswith(" in ISO rating (0.990 against 0.977).")


def test_parameters_outside_the_literature_and_strong_correlations_are_said(content: Content) -> None:
    """Only correlations of 0.9 and more are listed, strongest first; a value off its range is flagged."""
    got = content("failed")
    pairs = [line.split(",")[0] for line in got["correlations"]]
    assert pairs == ["E and yield_stress", "E and mu", "R and R_skin"]
    assert "raising both together" in got["correlations"][0]
    assert [p["name"] for p in got["parameters"] if p["outside"]] == ["yield_stress", "mu"]
    assert content("interrupted")["correlations"] is None


def test_failures_are_grouped_by_reason(content: Content) -> None:
    """Twenty-one failures of three kinds are three lines with number and completed stroke."""
    rows = content("failed")["failures"]
    assert [(r[0], r[1], spaced(r[2])) for r in rows] == [
        ("inverted: a particle was turned inside out", "7", "20 to 74 %"),
        ("not finite: a force, energy or position is no number", "7", "23 to 77 %"), ("stopped", "7", "26 to 80 %")
    ]  # fmt: skip
    assert spaced(rows[0][3]).startswith("E = 51.0 kPa; R = 1180 J/m²; mu = 0.580")


def test_uncertainty_of_contact_is_also_given_as_stroke(content: Content) -> None:
    """0.0061 s at 11 mm/s is 67 µm; without an uncertainty nothing is claimed."""
    assert spaced(content()["conditioning"]["onset_stroke"]) == "67 µm"
    assert content(onset_sd_s=None)["conditioning"]["onset_stroke"] is None


# ---- what is wrong with the input


@pytest.mark.parametrize("name", ["summary.json", "curves.csv", "evaluations.h5"])
def test_missing_file_is_named_with_the_remedy(tmp_path: Path, name: str) -> None:
    """The error names the file and the option that brings it back."""
    run = sample.write_run(tmp_path)
    (run / name).unlink()
    with pytest.raises(OutputError, match=rf"{name}: no such file.*--resume"):
        write_report(run)


def test_missing_folder(tmp_path: Path) -> None:
    """A wrong path is said to be one."""
    with pytest.raises(OutputError, match="no such folder"):
        write_report(tmp_path / "nothing")


@pytest.mark.parametrize(
    "place",
    ["null_models", "passed", "trace.sha256", "parameters.E.low95", "verdicts.0.limit", "knife.spine"],
)
def test_missing_key_is_named_by_its_place(tmp_path: Path, place: str) -> None:
    """Also a key deep in the summary is named from the top."""
    data: Any = sample.summary()
    *path, last = place.split(".")
    inner = data
    for key in path:
        inner = inner[int(key) if key.isdigit() else key]
    del inner[last]
    run = sample.write_run(tmp_path)
    (run / "summary.json").write_text(json.dumps(data))
    shown = re.escape(place.replace(".0.", "[0]."))
    with pytest.raises(OutputError, match=rf"summary\.json: {shown} is missing.*--resume"):
        write_report(run)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("onset_s", "0.8"), ("onset_s", None), ("onset_s", math.nan), ("simulations", True), ("passed", 1),
        ("parameters", []), ("warnings", "one"), ("status", "running"), ("created", "yesterday"),
        ("misfit_history", [1, 2.0]), ("baseline_window_s", [0.1]), ("baseline_window_s", "0 to 1"),
        ("trace", {}), ("nuisances", {"gain": 1.0}), ("profiles", {"E": {"value": [1.0, 2.0]}}),
        ("profiles", {"E": {"value": [1.0, 2.0], "rise": [0.0], "trace_alone": [0.0, 1.0]}}),
        ("sensitivity", {"peak": {"E": 1.0}}), ("reduced_chi2", "1"),
    ],
)  # fmt: skip
def test_value_of_a_wrong_kind_is_refused(tmp_path: Path, key: str, value: Any) -> None:
    """A text, a null or a flag where a number belongs is an error of the file, not of the program."""
    with pytest.raises(OutputError, match=rf"summary\.json: {key}.*--resume"):
        write_report(sample.write_run(tmp_path, **{key: value}))


def test_truncated_summary(tmp_path: Path) -> None:
    """A file cut off by a full disk is called damaged."""
    run = sample.write_run(tmp_path)
    text = (run / "summary.json").read_text()
    (run / "summary.json").write_text(text[: len(text) // 2])
    with pytest.raises(OutputError, match=r"summary\.json: damaged, not JSON"):
        write_report(run)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("three_term_N", "other"), "column three_term_N is missing"),
        (lambda text: text[:-60], "row 241 is cut off"),
        (lambda text: text.replace("0,", "zero,", 1), "not a table of numbers"),
        (lambda text: text.splitlines()[0], "row 2 is cut off or missing"),
        (lambda text: "", "column stroke_m, real_N"),
        (lambda text: text + text.splitlines()[-1], "the stroke does not rise"),
        (lambda text: re.sub(r"\n0,[^,]*", r"\n0,nan", text), "column real_N has a value that is not finite"),
    ],
)
def test_damaged_curves(tmp_path: Path, change: Callable[[str], str], message: str) -> None:
    """Each kind of damage to the table is told apart, with row or column."""
    run = sample.write_run(tmp_path)
    path = run / "curves.csv"
    path.write_text(change(path.read_text()))
    with pytest.raises(ReportError, match=rf"curves\.csv: .*{message}.*--resume"):
        write_report(run)


def test_damaged_store(tmp_path: Path) -> None:
    """A store that is no HDF5, has no record, or has records of different lengths is named."""
    run = sample.write_run(tmp_path)
    path = run / "evaluations.h5"
    with h5py.File(path, "a") as store:
        del store["conditioning/raw_N"]
        store["conditioning/raw_N"] = np.zeros(7)
    with pytest.raises(ReportError, match=r"evaluations\.h5: .*unequal length"):
        write_report(run)
    with h5py.File(path, "a") as store:
        del store["conditioning"]
    with pytest.raises(ReportError, match=r"evaluations\.h5: the record of the trace is not in it.*--resume"):
        write_report(run)
    path.write_bytes(b"not a store")
    with pytest.raises(ReportError, match=r"evaluations\.h5: damaged"):
        write_report(run)


def test_an_older_report_survives_a_failure(tmp_path: Path) -> None:
    """A report that cannot be made leaves the one before untouched and no half of a file."""
    run = sample.write_run(tmp_path)
    before = write_report(run).read_bytes()
    (run / "curves.csv").unlink()
    with pytest.raises(ReportError):
        write_report(run)
    assert (run / "report.pdf").read_bytes() == before
    assert not list(run.glob("*.draft"))


def test_report_that_cannot_be_written(tmp_path: Path) -> None:
    """A folder in the report's place is an error with the path, and no part is left behind."""
    run = sample.write_run(tmp_path)
    (run / "report.pdf").mkdir()
    with pytest.raises(ReportError, match=r"report\.pdf: cannot be written"):
        write_report(run)
    assert not list(run.glob("*.draft"))


def test_reports_is_cheap_to_import() -> None:
    """Importing the package loads neither matplotlib nor the typesetter nor Taichi."""
    code = "import sys, reports; assert not {'matplotlib', 'typst', 'taichi', 'h5py'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
