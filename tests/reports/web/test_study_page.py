"""The page of a study: each cut with its own curves, held-out ones as predicted, and the numbers of the PDF."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from reports.multi_specimen import report as multi_specimen
from reports.multi_specimen.report import content, read_study, write_report
from reports.web.study import FITTED, PREDICTED, drawable
from tests.reports import study_sample as sample
from tests.reports.page_sample import Page
from tests.reports.sample import spaced

MOST_BYTES = 3_000_000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with its report."""
    folder = sample.write_study(tmp_path_factory.mktemp("study"))
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def page(folder: Path) -> Page:
    """Its page."""
    return Page(folder / "report.html")


def test_it_is_one_whole_file(folder: Path, page: Page) -> None:
    """Elements are closed, each name is there once, links lead somewhere, nothing is loaded, and it is small."""
    assert page.faults == [] and (folder / "report.html").stat().st_size < MOST_BYTES
    names = page.values("id")
    assert len(names) == len(set(names))
    links = page.values("href")
    assert {link[1:] for link in links if link.startswith("#")} <= set(names)
    assert [link for link in links if not link.startswith("#")] == ["report.pdf"]
    assert [value for value in page.values("src") if not value.startswith("data:image/svg")] == []
    assert set(re.findall(r"\bat\(\"(box|chart|tip|cursor|cut|legend)\"\)", page.scripts[0])) <= set(names)


def test_each_cut_has_its_own_curves(page: Page) -> None:
    """The script gets trace, curve, band and residual of each; of a held-out cut those of the prediction."""
    cuts = dict(zip(("third", "first", "second"), page.data["curves"]["cuts"], strict=True))
    for name, cut in cuts.items():
        columns, held = sample.curves(name), name == sample.HELD
        key, ends = ("predicted_N", "predicted_low_N") if held else ("sim_N", "band_low_N")
        assert cut["names"]["sim_N"] == (PREDICTED if held else FITTED)
        np.testing.assert_allclose(cut["y"]["sim_N"], columns[key], rtol=1e-6)
        np.testing.assert_allclose(cut["band"]["low"], columns[ends], rtol=1e-6)
        np.testing.assert_allclose(cut["residual"], columns[key] - columns["real_N"], atol=1e-6)
    assert page.values("data-cut") == ["0", "1", "2"]
    assert [row[0] for row in page.tables["held"][1:]] == ["third"]
    assert [row[0] for row in page.tables["fitted"][1:]] == ["first", "second"]


def test_its_numbers_are_those_of_the_pdf(folder: Path, page: Page) -> None:
    """Cells of the verdict and of the parameters are the texts that the typesetter gets."""
    printed = content(read_study(folder))
    for key in ("held", "fitted"):
        cells = [[spaced(text) for text in row[1:9]] for row in page.tables[key][1:]]
        assert cells == [[spaced(text) for text in row["cells"]] for row in printed[key]]
    for key in ("shared", "own"):
        values = [spaced(row[1]) for row in page.tables[key][1:]]
        assert values == [spaced(p[2]) for p in printed[key]] and values
    cuts = [[spaced(text) for text in row] for row in page.tables["cuts"][1:]]
    assert cuts == [[spaced(text) for text in row] for row in printed["model"]["cuts"]]
    for _, rows in printed["lines"]:
        assert all(spaced(row["limit"]) in spaced(page.text) for row in rows)
    assert "✓ passed" in page.text and printed["limits"][0] in page.text


def test_a_cut_that_was_fitted_and_held_out_has_both_curves() -> None:
    """The prediction counts; the fit stands beside it. Where nothing was simulated only the trace is drawn."""
    third = sample.curves("third")
    both = drawable(third | {"sim_N": third["real_N"] * 1.1}, held=True)
    assert both["names"] == {"real_N": "trace", "sim_N": PREDICTED, "fitted_N": FITTED}
    alone = drawable({"stroke_m": third["stroke_m"], "real_N": third["real_N"]}, held=True)
    assert set(alone["names"]) == {"real_N"} and alone["band"] is None and set(alone["residual"]) == {None}


def test_names_are_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A food or a file whose name is markup is shown, not obeyed; a study that failed says so."""
    monkeypatch.setattr(multi_specimen, "publish", lambda *_, **__: None)
    study = sample.write_study(tmp_path, food="<b>gel</b>", study="<img src=x>.yaml", passed=False)
    found = Page(write_report(study).with_suffix(".html"))
    assert "<b>" not in found.source and "<img src=x" not in found.source
    assert "<b>gel</b>" in found.text.lower() and "✗ not passed" in found.text and found.faults == []


@pytest.mark.skipif(shutil.which("node") is None, reason="no node to run the script with")
def test_the_script_shows_each_cut(folder: Path) -> None:
    """Run with the least of a document: the first cut at once and each other when it is chosen, with its own curves,
    caption and values at the middle of the chart."""
    program = Path(__file__).with_name("run_page.js")
    done = subprocess.run(["node", program, folder / "report.html"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for k, (name, seen) in enumerate(zip(("third", "first", "second"), json.loads(done.stdout), strict=True)):
        columns, own = sample.curves(name), PREDICTED if name == sample.HELD else FITTED
        assert seen["captions"] == [str(k)] and seen["switches"] == ["real_N", "sim_N", "band"]
        assert {"band", "line real_N", "line sim_N", "line residual"} <= set(seen["lines"])
        stroke = float(spaced(seen["tip"]["stroke"]).split()[0]) / 1e3
        for label, key in (("trace", "real_N"), (own, "predicted_N" if name == sample.HELD else "sim_N")):
            shown = float(spaced(seen["tip"][label]).split()[0])
            assert shown == pytest.approx(np.interp(stroke, columns["stroke_m"], columns[key]), abs=0.1)
