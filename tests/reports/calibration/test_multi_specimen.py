"""The PDF of a study: what was predicted apart from what was fitted, rankings, and damaged input."""

from __future__ import annotations

from pathlib import Path

import h5py
import pytest

from reports import ReportError
from reports.calibration.multi_specimen import content, picture, read_study, write_report
from tests.reports import study_sample as sample
from tests.reports.base.test_figures import looked_at
from tests.reports.sample import pages, spaced


def test_a_study_becomes_a_pdf_that_is_stable(tmp_path: Path) -> None:
    """Verdicts, curves, what was fitted and the limits on four pages; the same files give the same bytes."""
    first = write_report(sample.write_study(tmp_path / "a")).read_bytes()
    assert first.startswith(b"%PDF") and pages(first) == 4
    assert write_report(sample.write_study(tmp_path / "b")).read_bytes() == first


def test_held_out_and_in_sample_are_apart(tmp_path: Path) -> None:
    """Each cut is in one table, with its own figures; the limits are those of the prediction."""
    got = content(read_study(sample.write_study(tmp_path)))
    assert [r["name"] for r in got["held"]] == ["third"]
    assert [r["name"] for r in got["fitted"]] == ["first", "second"]
    m = sample.summary()["hold_out"]["third"]["metrics"]
    assert spaced(got["held"][0]["cells"][0]) == f"{100 * m['nrmse']:.2f} %"
    assert spaced(got["held"][0]["cells"][5]) == "100 %" and got["held"][0]["cells"][6] == "0.910"
    assert spaced(got["held_limits"]) == "NRMSE ≤ 10 %, ISO rating ≥ 0.8 and in band ≥ 90 %"
    assert "flesh of first and second" in got["captions"][0] and "R_skin" in got["captions"][0]


def test_sentence_names_what_was_not_predicted(tmp_path: Path) -> None:
    """A prediction that failed, a fit that failed and a study without a prediction are said to be that."""
    s = sample.summary()
    assert content(read_study(sample.write_study(tmp_path)))["sentence"].startswith(
        "The held-out cut third was predicted"
    )
    s["hold_out"]["third"]["passed"] = s["traces"]["first"]["passed"] = False
    said = content(read_study(sample.write_study(tmp_path, hold_out=s["hold_out"], traces=s["traces"])))["sentence"]
    assert (
        said == "0 of 1 held-out cuts were predicted within the limits; not third. In-sample lines that failed: first."
    )
    check = {"name": "cells of two thirds", "reason": "inverted", "peak_change": None, "work_change": None}
    s["traces"]["first"]["numerical_checks"] = [check]
    got = content(read_study(sample.write_study(tmp_path, traces=s["traces"])))
    assert got["checks"][0] == ["first", "cells of two thirds", "broke down: inverted", ""]
    alone = content(read_study(sample.write_study(tmp_path, hold_out={})))
    assert "nothing here is a prediction" in alone["sentence"]
    assert pages(write_report(tmp_path).read_bytes()) >= 3


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
