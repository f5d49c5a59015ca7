"""The page of verification and validation: what ``credibility.json`` says, and nothing where there is none."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from pypdf import PdfReader

from calib.calibration.credibility import Context, Credibility, ModelError, to_document
from calib.calibration.report import write_report
from calib.io.folder import finite
from reports import ReportError
from reports.calibration.credibility_page import FILE, credibility
from tests.reports import sample

PEAK = ModelError(19.4, 20.0, "N", -0.6, 0.2, 0.3, 0.6, 0.7, -2.0, 0.8)
WORK = ModelError(0.50, 0.40, "J", 0.10, 0.01, 0.0, 0.01, 0.0141, 0.072, 0.128)
NOBODY = Context()
UNKNOWN = ModelError(0.50, 0.40, "J", 0.10, None, 0.0, 0.01, None, None, None)


def write(folder: Path, context: Context = NOBODY, work: ModelError = WORK, **changes: Any) -> Path:
    """A folder whose ``credibility.json`` is that of a peak and a work."""
    found = Credibility(food="banana", trace_sha256="0" * 64, peak=PEAK, work=work, context=context)
    folder.mkdir(exist_ok=True)
    (folder / FILE).write_text(json.dumps(finite(to_document(found) | changes)))
    return folder


def test_an_error_beyond_its_uncertainty_is_the_models(tmp_path: Path) -> None:
    """0.6 N of 1.4 N shows nothing, 0.10 J of 0.028 J does; each value with its unit."""
    page = credibility(write(tmp_path))
    assert page is not None
    peak, work = page["rows"]
    assert (
        peak[:3] == ["Peak force", "19.40\u00a0N", "20.00\u00a0N"] and peak[-1] == "an error of the model is not shown"
    )
    assert work[0] == "Work" and work[-1] == "an error of the model is shown"
    assert page["factor"] == "2" and len(page["not_counted"]) == 3


def test_E_is_no_error(tmp_path: Path) -> None:
    """What older files call E is named S less D: E is a modulus."""
    older = "The parameters were fitted to this very trace, so that E is small by construction"
    for text in (older, older.replace("E is", "S - D is")):
        page = credibility(write(tmp_path, not_counted=[text]))
        assert page is not None and page["not_counted"][0].endswith("so that S \u2212 D is small by construction")


def test_what_is_not_known_is_said(tmp_path: Path) -> None:
    """A repeated run that broke down leaves no interval; a context is what somebody stated."""
    page = credibility(write(tmp_path, work=UNKNOWN))
    assert page is not None and page["rows"][1][-2] == "not known" and not page["stated"]
    stated = credibility(write(tmp_path, Context(context_of_use="slice bananas")))
    assert stated is not None and stated["stated"] and stated["context"][0] == ["Context of use", "slice bananas"]
    assert stated["conditions"] == []
    cold = credibility(write(tmp_path, Context(conditions={"time_in_store": "9 days"})))
    assert cold is not None and cold["conditions"] == [["Time in store", "9 days"]]


def test_a_folder_without_the_file_has_no_page_and_a_damaged_one_is_an_error(tmp_path: Path) -> None:
    """Older runs have no such file; one that lacks a key is named."""
    assert credibility(tmp_path) is None
    write(tmp_path, peak={"unit": "N"})
    with pytest.raises(ReportError, match=r"credibility\.json: damaged"):
        credibility(tmp_path)


def test_the_report_has_the_section_where_there_is_the_file(tmp_path: Path) -> None:
    """Its heading and the words of its answer, once; without the file neither."""
    folder = sample.write_run(tmp_path)
    heading, answer = "In the words of verification and validation", "an error of the model is shown"
    assert heading not in text(write_report(folder))
    write(tmp_path)
    found = text(write_report(folder))
    assert found.count(heading) == 1 and answer in found and "as stated" not in found
    write(tmp_path, Context(conditions={"temperature": "8 C"}))
    assert "Specimen and measurement, as stated Temperature 8 C" in text(write_report(folder))


def text(report: Path) -> str:
    """All words of a PDF."""
    return " ".join(" ".join(page.extract_text() for page in PdfReader(report).pages).split())
