"""The PDF of a study: what was predicted apart from what was fitted, rankings, and damaged input."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from calib.validation.acceptance import BAND_LIMIT
from reports import ReportError
from reports.multi_specimen import verdicts
from reports.multi_specimen.report import content, picture, read_study, write_report
from tests.reports import study_sample as sample
from tests.reports.base.test_figures import looked_at
from tests.reports.sample import pages, spaced


def test_a_study_becomes_a_pdf_that_is_stable(tmp_path: Path) -> None:
    """Verdicts, curves, model, what was fitted and the limits on seven pages; the same files give the same bytes."""
    first = write_report(sample.write_study(tmp_path / "a")).read_bytes()
    assert first.startswith(b"%PDF") and pages(first) == 7
    assert write_report(sample.write_study(tmp_path / "b")).read_bytes() == first


def test_held_out_and_in_sample_are_apart(tmp_path: Path) -> None:
    """Each cut is in one table, with its own figures; the limits are those of the prediction."""
    got = content(read_study(sample.write_study(tmp_path)))
    assert [r["name"] for r in got["held"]] == ["third"]
    assert [r["name"] for r in got["fitted"]] == ["first", "second"]
    m = sample.summary()["hold_out"]["third"]["metrics"]
    assert spaced(got["held"][0]["cells"][0]) == f"{100 * m['nrmse']:.2f} %"
    assert spaced(got["held"][0]["cells"][5]) == "100 %" and got["held"][0]["cells"][7] == "0.910"
    assert spaced(got["held_limits"]) == "NRMSE ≤ 10 %, ISO rating ≥ 0.8, in band ≥ 90 % and band width ≤ 50 %"
    assert spaced(got["fitted_limits"]).startswith("NRMSE ≤ 8 %, shape ≤ 8 %, peak ≤ 10 % and those of balances")
    assert "flesh of first and second" in got["captions"][0] and "R_skin" in got["captions"][0]


def test_sentence_names_what_was_not_predicted(tmp_path: Path) -> None:
    """A prediction that failed, a fit that failed and a study without a prediction are said to be that."""
    s = sample.summary()
    assert content(read_study(sample.write_study(tmp_path)))["sentence"].startswith(
        "The held-out cut third was predicted"
    )
    s["hold_out"]["third"]["passed"] = s["traces"]["first"]["passed"] = False
    s["traces"]["first"]["verdicts"][5]["passed"] = False
    said = content(read_study(sample.write_study(tmp_path, hold_out=s["hold_out"], traces=s["traces"])))["sentence"]
    assert (
        said == "0 of 1 held-out cuts were predicted within the limits; not third. "
        "Fitted cuts that failed in-sample: first (1 of 6 lines)."
    )
    check = {"name": "cells of two thirds", "reason": "inverted", "peak_change": None, "work_change": None}
    s["traces"]["first"]["numerical_checks"] = [check]
    got = content(read_study(sample.write_study(tmp_path, traces=s["traces"])))
    assert got["checks"][0] == ["first", "cells of two thirds", "broke down: inverted", ""]
    alone = content(read_study(sample.write_study(tmp_path, hold_out={})))
    assert "nothing here is a prediction" in alone["sentence"]
    assert pages(write_report(tmp_path).read_bytes()) >= 3


def test_each_cut_says_why_it_failed(tmp_path: Path) -> None:
    """All lines of a cut with value, limit and note; the reasons of a failure; none where a document has no lines."""
    s = sample.summary()
    s["traces"]["first"] |= {"passed": False}
    s["traces"]["first"]["verdicts"][5] |= {"value": 0.076, "passed": False}
    got = content(read_study(sample.write_study(tmp_path, traces=s["traces"])))
    lines = {name: [[spaced(str(v)) for v in row.values()] for row in rows] for name, rows in got["lines"]}
    assert list(lines) == ["third", "first", "second"] and [len(rows) for rows in lines.values()] == [5, 6, 6]
    assert lines["first"][5] == ["cells of two thirds", "7.60 %", "≤ 5 %", "no", "peak −1.2 %, work +0.60 %"]
    assert [row[0] for row in lines["third"][:4]] == [
        "curve error (NRMSE)", "ISO rating", "trace within the 95 % band", "width of the 95 % band",
    ]  # fmt: skip
    assert [row[2] for row in lines["third"][:4]] == ["≤ 10 %", "≥ 0.8", "≥ 90 %", "≤ 50 %"]
    assert [spaced(text) for text in got["fitted_notes"]] == ["first fails 1 of 6 lines: cells of two thirds 7.60 %."]
    assert "first peak +0.8 %, work −0.40 %; second" in spaced(got["checks_note"])
    assert spaced(got["chi_square"]).startswith("Reduced chi-square 1.20: what is left is 1.1 times as large")
    for t in s["traces"].values():
        del t["verdicts"]
    older = content(read_study(sample.write_study(tmp_path, traces=s["traces"])))
    assert [name for name, _ in older["lines"]] == ["third"] and older["fitted_limits"] == older["checks_note"] == ""


def test_a_cut_that_is_held_out_and_fitted_has_both_lines(tmp_path: Path) -> None:
    """Each cut in turn is predicted, and all are fitted in the end: lines and factor of either stand apart."""
    s = sample.summary()
    traces = s["traces"] | {"third": s["traces"]["first"]}
    got = content(read_study(sample.write_study(tmp_path, traces=traces)))
    assert [(name, len(rows)) for name, rows in got["lines"]] == [
        ("third, held out", 5), ("first", 6), ("second", 6), ("third, in-sample", 6),
    ]  # fmt: skip
    factors = {row[0]: row[4].split()[0] for row in got["left_open"] if row[1] == "Factor"}
    assert factors["third, held out"] == "0.910" and factors["third, in-sample"] == "1.040"
    assert len(got["model"]["cuts"]) == 3


def test_a_band_that_holds_any_curve_is_said_to_tell_little(tmp_path: Path) -> None:
    """A band wider than half of the peak is named beside the verdict; it fails the cut where the run had that limit."""
    run = sample.write_study(tmp_path)
    done = read_study(run)
    assert "tells little" not in content(done)["sentence"]
    columns = done.curves["third"]
    columns["predicted_low_N"] = columns["predicted_low_N"] - 0.4 * columns["real_N"].max()
    got = content(done)
    assert "The band of third is 53 % of the peak wide on average" in spaced(got["sentence"])
    assert spaced(got["held"][0]["cells"][6]) == "53 %"
    (line,) = [row for row in got["lines"][0][1] if row["name"] == "width of the 95 % band"]
    assert (spaced(line["value"]), line["mark"]) == ("52.9 %", "no")
    del done.summary["hold_out"]["third"]["limits"]["width"]
    older = content(done)
    assert "band width" not in older["held_limits"] and "tells little" in older["sentence"]
    assert "width of the 95 % band" not in [row["name"] for row in older["lines"][0][1]]


def test_a_wide_band_is_the_same_in_a_study_and_in_a_calibration() -> None:
    """The report may not import the limit, so that it has a number of its own."""
    assert verdicts.WIDE == BAND_LIMIT


def test_the_model_says_what_was_simulated(tmp_path: Path) -> None:
    """Sizes, knife, cells, particles, stroke and peaks of each cut, its record, sources of ranges and numbered
    references; what an older document does not have is not recorded."""
    s = sample.summary()
    w = content(read_study(sample.write_study(tmp_path)))["model"]
    third, first, _ = ([spaced(cell) for cell in row] for row in w["cuts"])
    m = s["traces"]["first"]["metrics"]
    assert first[0] == "first" and "mm" in first[1] and "wedge" in first[2] and first[3].startswith("3.00 mm, ")
    assert first[4:] == ["5120", "33.0 mm", f"{m['peak_real_N']:.2f} N", f"{m['peak_sim_N']:.2f} N"]
    assert third[4] == "4096" and third[1] == first[1]
    assert [[spaced(cell) for cell in row] for row in w["conditioning"]][0] == [
        "third", "constant, 0.410 ± 0.020 N", "1.250 ± 0.010 s", "position", "0.050 N", "0.5 mm", "15.0 Hz",
    ]  # fmt: skip
    assert len(w["references"]) == 12 and w["references"][7].startswith("Kennedy") and "[1]" in w["method"]
    assert any(text.startswith("Koh") for text in w["references"])  # of a limit
    assert "integrated out of the curve [8]" in w["objective"]
    assert {row[0] for row in w["ranges"]} == {name.split("@")[0] for name in s["parameters"]}
    reason = "practice of explicit quasi-static analysis: 5 to 10 %"
    assert ["kinetic over internal energy", reason] in w["limit_sources"]
    for key in ("shape", "knife", "dx_m", "particles", "conditioning"):
        del s["hold_out"]["third"][key]
    older = content(read_study(sample.write_study(tmp_path, hold_out=s["hold_out"])))["model"]
    assert older["cuts"][0][1:5] == ["not recorded"] * 3 + ["–"] and older["conditioning"][0][0] == "first"


def test_the_factor_has_a_prior_and_an_interval(tmp_path: Path) -> None:
    """Each cut's factor stands with what was known of it; an older document has the factor alone."""
    s = sample.summary()
    rows = {row[0]: [spaced(cell) for cell in row[2:]] for row in content(read_study(sample.write_study(tmp_path)))[
        "left_open"] if row[1] == "Factor"}  # fmt: skip
    assert rows["third"] == ["factor on the force: width and sensor", "1.00 ± 0.15", "0.910 ± 0.018",
                             "yes"]  # fmt: skip
    assert set(rows) == {"first", "second", "third"}
    s["hold_out"]["third"]["nuisances"] = None
    older = content(read_study(sample.write_study(tmp_path, hold_out=s["hold_out"])))["left_open"][0]
    assert older[3:] == ["not recorded", "0.910", "–"]


def test_shared_and_own_parameters_are_apart(tmp_path: Path) -> None:
    """Those of one cut stand with the cut; a fitted height has a meaning."""
    s = sample.summary()
    height = s["parameters"]["R_skin@first"] | {"unit": "m", "value": 0.03}
    found = content(read_study(sample.write_study(tmp_path, parameters=s["parameters"] | {"height@second": height})))
    assert not any("@" in row[0] for row in (*found["shared"], *found["own"]))
    assert [(row[0], row[6]) for row in found["own"]] == [
        ("R_skin", "first"), ("R_skin", "second"), ("height", "second"),
    ]  # fmt: skip
    assert found["own"][2][1] == "height of the specimen" and len(found["shared"]) == len(s["parameters"]) - 2


def test_a_cut_that_was_only_held_out_has_an_origin_where_it_was_recorded(tmp_path: Path) -> None:
    """Its file and hash stand with the others'; a summary that does not say them is no error."""
    got = content(read_study(sample.write_study(tmp_path)))["traces"]
    assert [r[:3] for r in got][0] == ["third", "third.csv", "measured"] and got[0][3] + got[0][4] == "c0ffee00" * 8
    hold_out = sample.summary()["hold_out"]
    del hold_out["third"]["trace"]
    older = content(read_study(sample.write_study(tmp_path, hold_out=hold_out)))["traces"]
    assert older[0] == ["third", "not recorded", "", "", ""]


def test_ranking_puts_the_closest_first_and_marks_its_own(tmp_path: Path) -> None:
    """Ratings fall along the list, a null model that is closer stands above the prediction."""
    s = sample.summary()
    s["hold_out"]["third"]["null_models"]["mean of the others"]["R"] = 0.999
    rows = dict(content(read_study(sample.write_study(tmp_path, hold_out=s["hold_out"])))["ranking"])["third"]
    ratings = [float(r[1]) for r in rows]
    assert ratings == sorted(ratings, reverse=True)
    names = [r[0] for r in rows]
    assert names.index("mean of the others") < names.index("predicted") < names.index("straight ramp (1 number)")
    assert [r[0] for r in rows if r[3] == "own"] == ["predicted"]


def test_picture_shows_what_there_is(tmp_path: Path) -> None:
    """The held-out cut and a fitted one have curve and band; without bands they are drawn without."""
    done = read_study(sample.write_study(tmp_path))
    for name in ("third", "first"):
        drawn = picture(done, name)
        for column in [c for c in done.curves[name] if "_low_" in c]:
            del done.curves[name][column]
        assert b"FillBetween" in drawn and b"FillBetween" not in picture(done, name)


def test_a_fitted_cut_is_seen_under_the_blade(tmp_path: Path) -> None:
    """A cut with a look at the food is on the first page, its picture beside its forces;
    the others are as they were.
    """
    run = sample.write_study(tmp_path)
    before = read_study(run)
    with h5py.File(run / "record-second.h5", "w") as file:
        for name, values in vars(looked_at(0.03, 0.033)).items():
            file[f"section/{name}"] = values
    done = read_study(run)
    assert b"<image" in picture(done, "second") and b"<image" not in picture(before, "second")
    assert picture(done, "first") == picture(before, "first")
    assert content(before)["shown"] == 0 and content(done)["names"][content(done)["shown"]] == "second"
    assert write_report(run).read_bytes().startswith(b"%PDF")


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda run: (run / "summary.json").unlink(), r"summary\.json: no such file"),
        (lambda run: (run / "curves-third.csv").unlink(), r"curves-third\.csv: no such file"),
        (lambda run: (run / "summary.json").write_text("{}"), r"summary\.json: food is missing"),
        (lambda run: (run / "curves-first.csv").write_text("stroke_m,real_N\n0,1\n"), r"row 2|row 3"),
    ],
)
def test_damaged_input_is_named(tmp_path: Path, damage, message: str) -> None:  # type: ignore[no-untyped-def]
    """A missing or damaged file is named, with what to do."""
    run = sample.write_study(tmp_path)
    damage(run)
    with pytest.raises(ReportError, match=message):
        write_report(run)


def test_compression_tests_are_told(tmp_path: Path) -> None:
    """Modulus, how well it is known, what was assumed and the file; nothing where the study has none."""
    press = {"name": "pressed", "E": 278e3, "spread": 0.13, "repeats": 4, "nu": 0.45,
             "files": [{"name": "press.csv", "sha256": "c0ffee00" * 8}]}  # fmt: skip
    with_one = content(read_study(sample.write_study(tmp_path / "one", presses={"pressed": press})))["model"]
    (row,) = ([spaced(cell) for cell in row] for row in with_one["presses"])
    assert row[:5] == ["pressed", "278 kPa", "13 %", "4", "0.45"] and row[6] == "press.csv, SHA-256 c0ffee00c0ffee00"
    assert row[5] == "3.0 standard deviations above it"  # ln(412 / 278) / 0.13
    assert content(read_study(sample.write_study(tmp_path / "none")))["model"]["presses"] == []
