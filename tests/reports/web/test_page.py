"""The page of a calibration: one file, whole, without anything from elsewhere, and with the numbers of the PDF."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pypdf import PdfReader

from calib.calibration.members import MOST, sensed
from calib.calibration.report import write_report
from calib.calibration.result import read_result
from calib.io.typed_document import to_document
from calib.posterior.estimates import ModeSummary, PosteriorSummary, Range, WaveSummary
from calib.trace.filters import BandLimited, filter_simulated
from calib.validation.metrics import compare
from reports import ReportError
from reports.base.format import interval, quantity
from reports.calibration import report
from reports.calibration.posterior_page import identified
from reports.web.markup import data, element, table
from tests.data_dir import ROOT
from tests.reports import sample
from tests.reports.page_sample import BEST, Page, add_members
from tests.reports.sample import spaced

MOST_BYTES = 3_000_000
KINDS = ("good", "reconstructed", "failed", "interrupted")
#: Attributes from which a browser loads something, or runs it.
LOADED = ("src", "srcset", "poster", "action", "formaction", "background", "xlink:href", "data", "ping", "style")


def page(folder: Path) -> Page:
    """The page that is written into a folder, without the work of drawing and setting the PDF."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "_pictures", lambda _: {"forces.svg": b"<svg/>"})
        patch.setattr(report, "publish", lambda *_, **__: None)
        return Page(write_report(folder).with_suffix(".html"))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that ended well, with its report."""
    folder = add_members(sample.write_run(tmp_path_factory.mktemp("run")))
    write_report(folder)
    return folder


@pytest.fixture(scope="module")
def whole(run: Path) -> Page:
    """Its page."""
    return Page(run / "report.html")


# ---- words


def test_the_page_speaks_of_what_it_has_in_the_words_of_the_glossary(whole: Page) -> None:
    """It has no pages to number, and calls the grids what glossary and PDF call them."""
    assert "first page" not in whole.text and not re.search(r"\b(coarse|fine) grid", whole.text)
    known = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    assert "### Screening grid" in known and "*grid that counts*" in known
    cells = {row[1] for row in whole.tables["all"][1:]}
    assert (
        cells
        == {"screening grid", "grid that counts"}
        == set(re.findall(r"screening grid|grid that counts", whole.text))
    )


# ---- one file


@pytest.mark.parametrize("kind", KINDS)
def test_every_outcome_gives_a_whole_page(tmp_path: Path, kind: str) -> None:
    """Each element is closed in its order, each name is there once, links lead somewhere, and the first line counts
    what is identified."""
    run = sample.write_run(tmp_path, kind)
    found = page(run)
    assert found.faults == [] and found.source.startswith("<!doctype html>")
    names = found.values("id")
    assert len(names) == len(set(names))
    assert {link[1:] for link in found.values("href") if link.startswith("#")} <= set(names)
    fitted = read_result(run).fitted
    assert found.headings[1] == identified(fitted) and re.match(r"\d of 5 parameters identified", found.headings[1])
    failed = kind in ("failed", "interrupted")
    assert ("✗ not passed" in found.text) == failed == ("stamp failed" in found.values("class"))
    assert ("Reconstructed trace" in found.text) == (kind == "reconstructed")
    assert ("stopped before it had ended" in found.text) == (kind == "interrupted")


def test_nothing_is_loaded_from_elsewhere(whole: Page) -> None:
    """No attribute, style or script names another place, and the page forbids the browser all but itself."""
    assert [value for name in LOADED for value in whole.values(name) if not value.startswith("data:image/svg")] == []
    assert {"link", "iframe", "object", "embed", "base", "form"} & {name for name, _ in whole.elements} == set()
    assert [link for link in whole.values("href") if not link.startswith("#")] == ["report.pdf"]
    (style,), (script,) = whole.styles, whole.scripts
    assert not re.search(r"url\(|@import|//", style)
    assert not re.search(r"https?:|fetch|XMLHttp|import\b|innerHTML|outerHTML|insertAdjacent|eval|Function", script)
    policy = next(known["content"] for _, known in whole.elements if known.get("http-equiv"))
    assert policy is not None and policy.startswith("default-src 'none'; img-src data:;") and "unsafe" not in policy
    for text, rule in ((style, "style-src"), (script, "script-src")):
        known = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{rule} 'sha256-{known}'" in policy


def test_the_page_is_small(run: Path, tmp_path: Path) -> None:
    """With as many members as a page takes and the figure of the PDF, it is less than the size that is promised."""
    found = page(add_members(sample.write_run(tmp_path), count=MOST + 20))
    assert (tmp_path / "report.html").stat().st_size + (run / "report.html").stat().st_size < MOST_BYTES
    assert len(found.data["curves"]["members"]) == MOST


def test_the_script_finds_what_it_asks_for(whole: Page) -> None:
    """Each name and each kind of curve that script and style use is in the page or made by the script."""
    script, style = whole.scripts[0], whole.styles[0]
    names = set(whole.values("id")) | {"curves", "texts", "cut"}  # the last is a study's
    asked = set(re.findall(r"\b(?:at|read)\(\"(\w+)\"\)", script))
    assert asked >= {"chart", "tip", "cursor", "member", "chosen", "all"} and asked <= names
    assert set(re.findall(r"#(\w+)[ .{,:]", re.sub(r":\s*#\w+", "", style))) <= names
    curves = {key for key in whole.values("data-curve") if key != "band"}
    assert curves == set(whole.data["curves"]["names"]) and all(f".{key} " in style for key in curves)


@pytest.mark.skipif(shutil.which("node") is None, reason="no node to read the script with")
def test_the_script_is_one() -> None:
    """It parses."""
    path = ROOT / "reports" / "templates" / "page.js"
    done = subprocess.run(["node", "--check", str(path)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_page_that_cannot_be_written(tmp_path: Path) -> None:
    """A folder in its place is an error with the path, and no part is left behind."""
    run = sample.write_run(tmp_path)
    (run / "report.html").mkdir()
    with pytest.raises(ReportError, match=r"report\.html: cannot be written"):
        page(run)
    assert not list(run.glob("*.draft"))


# ---- the numbers


def test_the_curves_are_those_of_the_run(run: Path, whole: Page) -> None:
    """Stroke, forces, band and residual of the page are those of curves.csv, to the last digit."""
    curves, drawn = read_result(run).curves, whole.data["curves"]
    assert np.allclose(drawn["x"], 1e3 * curves["stroke_m"], rtol=1e-8, atol=0.0)
    band = {f"band_{end}_N": values for end, values in drawn["band"].items()}
    for name, values in {**drawn["y"], **band, "residual_N": drawn["residual"]}.items():
        assert values == curves[name].tolist(), name
    assert {"real_N", "sim_N", "start_N", "edge_N"} <= set(drawn["y"])


def test_tables_have_the_texts_of_the_pdf(run: Path, whole: Page) -> None:
    """Each row of the parameters and each line of the verdict stands in the PDF in the same words."""
    pages = [one.extract_text() for one in PdfReader(run / "report.pdf").pages]
    words = re.sub(r"\s+", " ", spaced(" ".join(pages)))
    parameters, verdicts = whole.tables["values"], whole.tables["verdicts"]
    assert len(parameters) == len(BEST) + 1 and len(verdicts) > 8
    for row in parameters + verdicts:
        said = re.sub(r"\s+", " ", spaced(" ".join(filter(None, row))))
        assert said in words, said


def test_intervals_are_those_of_the_result(run: Path, whole: Page) -> None:
    """Value, interval and literature of each parameter, from the document to the cell."""
    rows = {row[0].split(" ")[0]: row for row in whole.tables["values"][1:]}
    for name, p in read_result(run).fitted.items():
        ends = (p.low95, p.high95), (p.prior_low, p.prior_high)
        ranges = [interval(*pair, p.unit, like=p.value) for pair in ends]
        assert rows[name][1:4] == [quantity(p.value, p.unit), *ranges]


def test_what_it_does_not_show_is_said(run: Path, whole: Page) -> None:
    """Each limit and warning of the document, with its capital."""
    result = read_result(run)
    assert len(result.limits) >= 4
    for text in (*result.limits, *result.warnings):
        assert text[1:] in whole.text


def test_what_is_not_known_is_left_out(tmp_path: Path) -> None:
    """A column without a number has no switch, and a gap in one is no number; without a band there is none."""
    run = sample.write_run(tmp_path, "interrupted")
    lines = [line.split(",") for line in (run / "curves.csv").read_text().splitlines()]
    start, edge = lines[0].index("start_N"), lines[0].index("edge_N")
    for k, row in enumerate(lines[1:]):
        row[start] = ""
        row[edge] = "" if k < 3 else row[edge]
    (run / "curves.csv").write_text("\n".join(",".join(row) for row in lines))
    found = page(run)
    drawn = found.data["curves"]
    assert "start_N" not in drawn["names"] and "start_N" not in found.values("data-curve")
    assert drawn["y"]["edge_N"][:4] == [None, None, None, pytest.approx(float(lines[4][edge]))]
    assert drawn["band"] is None and "band" not in found.values("data-curve")


# ---- members


def test_members_have_their_curves_and_values(run: Path, whole: Page) -> None:
    """Curve and values of each member are those it was stored with; the best values are called so and agree with the
    verdict; runs that repeat one or broke down are none."""
    drawn, texts, rows = whole.data["curves"]["members"], whole.data["texts"], whole.tables["all"][1:]
    assert len(drawn) == len(texts["values"]) == len(rows) == 12
    grids = [row[1] for row in rows]
    assert grids == ["grid that counts"] * 9 + ["screening grid"] * 3
    best = [k for k, row in enumerate(rows) if row[2] == "best values"]
    assert len(best) == 1
    result, stroke = read_result(run), sample.curves()["stroke_m"]
    filtered = filter_simulated(stroke, stroke, sample.curves()["sim_N"], result.conditioning.filter_sd_m)
    for k, row in enumerate(rows):
        own = max(int(row[0]) - 3, 0)  # the first three are the best, its repetition and the broken one
        curve = (1.0 + 0.03 * own) * filtered
        assert drawn[k]["name"] == f"member {row[0]}"
        assert drawn[k]["curve"] == pytest.approx(curve, rel=1e-5, abs=1e-5)
        said = [quantity((1.0 + 0.05 * own) * BEST[name], p.unit) for name, p in result.fitted.items()]
        assert texts["values"][k] == row[5:] == said
        agreement = compare(stroke, sample.curves()["real_N"], curve)
        assert row[3:5] == [quantity(agreement.nrmse, "fraction"), quantity(agreement.peak_sim_N, "N")]
    inside = dict(zip(BEST, texts["inside"][best[0]], strict=True))
    assert set(inside.values()) == {"yes"} and "no" in texts["inside"][-1]
    options = [known["value"] for name, known in whole.elements if name == "option"]
    assert options == ["", *map(str, range(12))] and whole.values("data-member") == options[1:]


def test_a_folder_without_curves_says_so(tmp_path: Path) -> None:
    """A store that holds no curves gives no choice, in plain words."""
    found = page(sample.write_run(tmp_path))
    assert "no member to pick" in found.text and "member" not in found.values("id")
    assert found.data["curves"]["members"] == [] and "texts" not in found.data


def test_modes_of_a_posterior_name_their_best_food(tmp_path: Path) -> None:
    """The table of modes is that of the PDF, and the food of a mode is marked among the members."""
    ranges = {name: Range(0.8 * x, x, 1.3 * x) for name, x in BEST.items()}
    other = {name: 1.1 * x for name, x in BEST.items()}
    sampled = PosteriorSummary(
        converged=True, waves=(WaveSummary(256, 142),), explained=0.87, log_evidence=-15.26, log_evidence_sd=0.2,
        likelihoods=44590, combinations={"E/R": Range(2.0, 9.0, 40.0)}, alike=("R", "mu"),
        modes=(ModeSummary(0.7, -15.6, ranges, BEST, 16.1), ModeSummary(0.3, -16.5, ranges, other, 17.0)),
    )  # fmt: skip
    found = page(add_members(sample.write_run(tmp_path, sampled=to_document(sampled))))
    known = {row[2]: row[0] for row in found.tables["all"][1:] if row[2]}
    assert known == {"best values, mode 1": "1", "mode 2": "5"}
    assert "Modes differ in E, yield_stress and R_skin." in found.text and "0.870" in found.text


# ---- names that others give


ODD = "</script><script>alert(1)</script><img src=x onerror=alert(1)>\"'><b onclick=x>&amp;<!-- ]]> \u2028"


def test_names_of_others_stay_text(tmp_path: Path) -> None:
    """A food, file, column, note, knife, option or sentence that is HTML is shown as it is and makes no element."""
    s = sample.summary("failed")
    s["trace"] |= {"source": ODD, "columns": {"force": ODD}}
    s["verdicts"] += [{**s["verdicts"][0], "name": ODD, "note": ODD}]
    s["parameters"]["odd" + ODD] = s["parameters"]["E"] | {"verdict": ODD, "status": ODD, "source": ODD}
    s["knife"]["name"] = ODD
    s["command"] = ["calibrate", ODD]
    s |= {"food": ODD, "device": ODD, "git": ODD, "warnings": [ODD], "limits": [ODD], "versions": {ODD: ODD}}
    usual = page(add_members(sample.write_run(tmp_path / "usual", "failed")))
    odd = page(add_members(sample.write_run(tmp_path / "odd", "failed", **s)))
    assert odd.faults == [] and odd.text.count("<script>alert(1)</script>") >= 12
    assert len(odd.scripts) == 1 and set(odd.data) == {"curves", "texts"}
    assert {name for name, _ in odd.elements} == {name for name, _ in usual.elements} | {"wbr"}
    assert not [name for _, known in odd.elements for name in known if name.startswith("on")]


def test_a_trace_whose_label_is_odd_stays_data() -> None:
    """Data for the script end with their own element, whatever stands in them, and are the same when read."""
    held = data("curves", {"name": ODD})
    assert held.count("<") == 2 and "&" not in held
    assert json.loads(held.partition(">")[2].removesuffix("</script>")) == {"name": ODD}


def test_markup_escapes_what_it_did_not_make() -> None:
    """Text and attributes are escaped once; elements, and nothing else, pass as they are."""
    inner = element("b", "a < b")
    assert element("p", inner, " & ", title='"x"') == '<p title="&quot;x&quot;"><b>a &lt; b</b> &amp; </p>'
    assert element("input", hidden=True, checked=False, type="range") == '<input hidden type="range">'
    assert '<td data-head="&lt;b&gt;">&lt;i&gt;</td>' in table(("a", "<b>"), [["x", "<i>"]])


def test_templates_are_part_of_the_package() -> None:
    """Style and script lie where the packages are, so that a wheel has them."""
    assert {p.name for p in (ROOT / "reports" / "templates").iterdir()} >= {"page.css", "page.js"}


def test_members_go_through_the_sensors_low_pass() -> None:
    """Where the fit had one, the curve of a member is what that sensor would have felt; else it is only smoothed."""
    stroke = np.linspace(0.0, 0.04, 240)
    curves = pd.DataFrame({"stroke_m": stroke, "after_contact_s": stroke / 0.05})
    force = np.where(stroke < 0.01, 20.0, 5.0)
    felt = {}
    for bandwidth in (15.0, None):
        conditioning = SimpleNamespace(bandwidth_Hz=bandwidth, filter_sd_m=5e-4)
        result: Any = SimpleNamespace(conditioning=conditioning, curves=curves)
        felt[bandwidth] = sensed(result, stroke)(stroke, stroke, force)
    np.testing.assert_array_equal(felt[15.0], BandLimited(15.0, stroke, stroke / 0.05)(stroke, stroke, force))
    np.testing.assert_array_equal(felt[None], filter_simulated(stroke, stroke, force))
    assert np.max(np.abs(felt[15.0] - felt[None])) > 2.0
