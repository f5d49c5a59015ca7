"""The pages of reports that are a verdict, figures and tables: their texts are the PDF's, their curves the run's."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from calib.relaxation.relaxation_result import HoldCurve
from calib.texture.texture_result import BiteCurves
from reports.base import brief as base
from reports.base.brief import Brief, ReportPart, ReportTable
from reports.press import relaxation, texture
from reports.press.compression import STRESS, _chart
from reports.web.brief import Chart, Panel, publish_brief
from tests.data_dir import ROOT
from tests.reports.page_sample import Page
from tests.reports.press.test_press_reports import STRAIN, curves_of

ORIGIN = SimpleNamespace(device="cpu", command=("press", "tpa"), versions={"cutcal": "0.2.0"}, git=None)
TABLE = ReportTable(
    ("What", "Value", "Verdict"), ("1fr", "auto", "auto"), [["a < b", "−4.00 %", "no"], ["c", "3", ""]], marked=2
)


def brief(**changes: Any) -> Brief:
    """A report of two parts, one with a figure."""
    parts = [ReportPart("Verdict", "Why & how.", table=TABLE), ReportPart(STRESS, picture=b"<svg/>", alt="stress")]
    whole = {"kind": "Compression", "name": "Young's modulus", "passed": False, "sentence": "It is 3 kPa.",
             "facts": [("Law", "elastic")], "parts": parts, "limits": ["Nothing of yield."]}  # fmt: skip
    return Brief(**(whole | changes))


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Writes a report without the work of typesetting, and reads its page."""
    monkeypatch.setattr(base, "publish", lambda *_, **__: None)
    document = tmp_path / "compress.json"
    document.write_text("{}")

    def write(report: Brief, curves: Chart | None = None) -> Page:
        return Page(publish_brief(document, report, ORIGIN, curves).with_suffix(".html"))

    return write


def test_a_page_has_the_texts_of_its_report(written: Any) -> None:
    """Verdict, sentence, facts, each part with its table and marks, limits, command; nothing is loaded or run."""
    page = written(brief())
    assert page.faults == [] and page.scripts == []
    assert page.headings == ["Young's modulus", "Verdict", "Stress", "What this does not show", "Provenance"]
    assert list(page.tables.values()) == [
        [["What", "Value", "Verdict"], ["a < b", "−4.00 %", "✗ failed"], ["c", "3", ""]]
    ]
    for text in ("✗ not passed", "It is 3 kPa.", "elastic", "Why & how.", "Nothing of yield.", "cutcal press tpa"):
        assert text in page.text
    assert [value for value in page.values("src") if not value.startswith("data:image/svg")] == []
    names = page.values("id")
    assert len(names) == len(set(names)) and {x[1:] for x in page.values("href") if x[0] == "#"} <= set(names)


def test_a_report_without_a_verdict_has_no_stamp(written: Any) -> None:
    """A texture profile alone neither passes nor fails."""
    assert "passed" not in written(brief(passed=None)).text.replace("✗ failed", "")


def test_stress_over_strain_can_be_read_off(written: Any) -> None:
    """Mean, fit, range and residual in per cent and kPa; the figure of the PDF is for readers without scripts."""
    curves = curves_of(("R0", 1e5 * STRAIN), ("R1", 3e5 * STRAIN), fitted=2.1e5 * STRAIN)
    page = written(brief(), _chart(curves))
    (drawn,) = page.data["curves"]["cuts"]
    assert drawn["x"] == pytest.approx(100 * STRAIN) and drawn["axes"] == {
        "across": ["strain", "%"],
        "up": ["stress", "kPa"],
    }
    assert drawn["y"]["measured"] == pytest.approx(200 * STRAIN) and drawn["y"]["fitted"] == pytest.approx(210 * STRAIN)
    assert drawn["band"]["high"] == pytest.approx(300 * STRAIN) and drawn["residual"] == pytest.approx(10 * STRAIN)
    assert page.faults == [] and page.values("data-curve") == ["measured", "fitted", "band"]
    assert "range of 2 repeats" in page.text and "cut" not in page.values("id")
    assert [name for name, _ in page.elements].count("noscript") == 1


def test_specimens_of_a_hold_are_picked(written: Any) -> None:
    """Each has its own curve over the logarithm of time; the moment of the stop, which has none, is left out."""
    time = np.array([0.0, 0.01, 1.0, 100.0])
    holds = [
        HoldCurve(name, time, np.full(4, force), np.full(4, force - 1.0)) for name, force in (("a", 9.0), ("b", 7.0))
    ]
    page = written(brief(parts=[ReportPart(relaxation.HOLDS, picture=b"<svg/>")]), relaxation._chart(holds))
    one, other = page.data["curves"]["cuts"]
    assert one["x"] == [0.01, 1.0, 100.0] and one["log"] is True
    assert (one["y"]["measured"], other["y"]["measured"]) == ([9.0] * 3, [7.0] * 3) and one["residual"] == [-1.0] * 3
    assert options(page) == ["a", "b"] and "Specimen" in page.text


def test_bites_have_a_residual_only_of_a_law(written: Any) -> None:
    """A group alone has mean and range; one that a law predicts has what is left too."""
    time, loads = np.array([-1.0, 0.0, 1.0]), np.array([[0.0, 4.0, 1.0], [0.0, 6.0, 3.0]])
    groups = [BiteCurves("slow", time, loads), BiteCurves("fast", time, loads[:1], np.array([0.0, 5.0, 1.0]))]
    page = written(brief(parts=[ReportPart(texture.BITES, picture=b"<svg/>")]), texture._chart(groups))
    slow, fast = page.data["curves"]["cuts"]
    assert slow["residual"] == [None] * 3 and slow["band"] == {"low": [0.0, 4.0, 1.0], "high": [0.0, 6.0, 3.0]}
    assert fast["residual"] == [0.0, 1.0, 0.0] and fast["band"] is None and slow["main"] == ["measured"]


@pytest.mark.skipif(shutil.which("node") is None, reason="no node to run the script with")
def test_the_script_draws_what_a_panel_has(written: Any, tmp_path: Path) -> None:
    """Without a residual there is none in chart or tip; over logarithms the cursor still finds its point."""
    time = np.geomspace(0.01, 100.0, 41)
    panels = [
        Panel("a", time, {"measured": ("measured", 5.0 - np.log10(time))}),
        Panel("b", time, {"measured": ("measured", 0.0 * time + 2.0)}, residual=0.0 * time + 0.5),
    ]
    written(brief(), Chart(STRESS, ("time", "s"), ("load", "N"), panels, residual="x", logarithmic=True))
    done = subprocess.run(
        ["node", str(ROOT / "tests/reports/web/run_page.js"), str(tmp_path / "report.html")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    one, other = json.loads(done.stdout)
    assert one["lines"] == ["line measured"] and set(one["tip"]) == {"time", "measured"}
    assert other["lines"] == ["line measured", "line residual"] and set(other["tip"]) == {
        "time",
        "measured",
        "residual",
    }
    assert 0.5 < float(one["tip"]["time"].split("\u00a0")[0]) < 2.0  # the middle of four decades


def options(page: Page) -> list[str]:
    """Words of the choice, in their order."""
    start = page.source.partition('id="cut">')[2].partition("</select>")[0]
    return start.replace("<option>", "").split("</option>")[:-1]
