"""The pages tried in a browser without a window or a network: what a reader points at, picks and reads off."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.calibration.report import write_report
from reports.base import brief as base
from reports.multi_specimen.report import write_report as write_study_report
from reports.press.compression import write_report as write_compression
from reports.press.stress_strain import write_figure
from tests.reports import sample, study_sample
from tests.reports.page_sample import Page, add_members
from tests.reports.press.test_press_reports import STRAIN, curves_of, result
from tests.reports.sample import spaced
from tests.reports.web.browser import NAMES, Tab, found, tab

WIDTHS = (360, 900, 1280)
BROWSER = found()

#: Where the highest point of the third member's curve is [px].
HIGHEST = """(() => {
  const chart = document.getElementById('chart'), b = chart.getBoundingClientRect();
  const points = document.querySelectorAll('#chart .every')[2].getAttribute('d').slice(1).split(/[ML]/)
    .map(one => one.split(' ').map(Number));
  const top = points.reduce((best, one) => one[1] < best[1] ? one : best);
  const scale = b.width / chart.viewBox.baseVal.width;
  return [b.left + scale * top[0], b.top + scale * top[1]];
})()"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason=f"no browser to try the pages in: none of {', '.join(NAMES)} is here"),
]


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """A tab of the browser."""
    assert BROWSER is not None
    with tab(BROWSER, tmp_path_factory.mktemp("profile")) as one:
        yield one


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a calibration, with members."""
    folder = add_members(sample.write_run(tmp_path_factory.mktemp("run")))
    return write_report(folder).with_suffix(".html")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a study of three cuts."""
    folder = study_sample.write_study(tmp_path_factory.mktemp("study"))
    return write_study_report(folder).with_suffix(".html")


@pytest.fixture(scope="module")
def compression(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a compression, whose residual is a part of a kilopascal."""
    folder = tmp_path_factory.mktemp("compression")
    curves = curves_of(("R0", 1e5 * STRAIN), ("R1", 1.2e5 * STRAIN), fitted=1.1e5 * STRAIN + 670 * np.sin(9 * STRAIN))
    write_figure(result(), curves, folder)
    (folder / "compress.json").write_text("{}")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(base, "publish", lambda *_, **__: None)
        return write_compression(result(), curves, folder).with_suffix(".html")


def tip(shown: Tab) -> dict[str, str]:
    """What the box at the cursor says, by name."""
    texts = "[...row.children].map(one => one.innerText)"
    rows = shown.ask(f"[...document.querySelectorAll('#tip div')].map(row => {texts})")
    return {name: spaced(text) for name, text in rows}


def lines(shown: Tab) -> list[str]:
    """Names of the curves that are drawn."""
    return list(shown.ask("[...document.querySelectorAll('#chart path')].map(one => one.getAttribute('class'))"))


def drawn(shown: Tab) -> dict[str, Any]:
    """The data that the script draws."""
    return dict(json.loads(shown.ask("document.getElementById('curves').textContent")))


def number(text: str) -> float:
    """A value [N] or a stroke [mm] that a reader sees."""
    return float(text.split(" ")[0].replace("−", "-"))


def says(text: str, value: float) -> bool:
    """Whether a text is a value, rounded to the digits that it has."""
    return abs(number(text) - value) <= 0.51 * 10.0 ** -len(text.split(" ")[0].partition(".")[2])


def nearest(said: dict[str, str], strokes: list[float]) -> int:
    """Which of the strokes [mm] the box at the cursor is for."""
    stroke = number(said["stroke"])
    return min(range(len(strokes)), key=lambda k: abs(strokes[k] - stroke))


@pytest.mark.parametrize("kind", ["run", "study"])
def test_a_page_asks_for_nothing_and_runs(shown: Tab, request: pytest.FixtureRequest, kind: str) -> None:
    """The file alone is read, no script throws, the page's own policy refuses nothing, and the chart is drawn."""
    path = request.getfixturevalue(kind)
    shown.open(path)
    assert [one for one in shown.asked if not one.startswith("data:")] == [path.as_uri()]
    assert shown.complaints == []
    assert {"line real_N", "line sim_N", "band", "line residual"} <= set(lines(shown))


@pytest.mark.parametrize("kind", ["run", "study"])
@pytest.mark.parametrize("width", WIDTHS)
def test_a_page_is_whole_at_each_width(shown: Tab, request: pytest.FixtureRequest, kind: str, width: int) -> None:
    """Nothing reaches over the side, and the chart is as wide as its text: on a phone, at 900 px, on a screen."""
    shown.open(request.getfixturevalue(kind), width)
    assert shown.ask("document.documentElement.scrollWidth") <= width
    chart, body = (shown.ask(f"document.querySelector('{name}').clientWidth") for name in ("#chart", "main"))
    assert chart == pytest.approx(body, abs=2.0)


@pytest.mark.parametrize("kind", ["run", "study", "compression"])
@pytest.mark.parametrize("width", WIDTHS)
def test_tables_are_read_without_scrolling(shown: Tab, request: pytest.FixtureRequest, kind: str, width: int) -> None:
    """Each cell lies within the page, and no row is higher than its texts. On a phone each cell follows the title of
    its column; on a screen a verdict stands in its column."""
    shown.open(request.getfixturevalue(kind), width)
    wide = "[...document.querySelectorAll('.wide')].filter((one) => one.offsetHeight && !one.querySelector('#all'))"
    assert shown.ask(f"{wide}.length") > 0
    cells = f"{wide}.flatMap((one) => [...one.querySelectorAll('td')])"
    ends = shown.ask(f"{cells}.filter((one) => one.offsetHeight).map((one) => one.getBoundingClientRect().right)")
    assert ends and (width > 360 or max(ends) <= width)
    high = "(row) => row.offsetHeight - Math.max(...[...row.cells].map((one) => {"
    high += "const r = document.createRange(); r.selectNodeContents(one); const b = r.getBoundingClientRect();"
    high += "return b.height ? b.bottom - row.getBoundingClientRect().top : 0; }))"
    rows = shown.ask(f"{wide}.flatMap((one) => [...one.querySelectorAll('tbody tr')].map({high}))")
    assert max(rows) < 15  # px: less than a line
    marks = shown.ask("[...document.querySelectorAll('.wide .yes, .wide .no, .wide .none')].filter((one) => "
                      "one.offsetHeight).map((one) => one.getBoundingClientRect().right)")  # fmt: skip
    assert marks and (width > 360 or max(marks) <= width)
    titles = shown.ask(f"{cells}.map((one) => getComputedStyle(one, '::before').content)")
    assert (len(set(titles)) > 2) == (width == 360)


@pytest.mark.parametrize("kind", ["run", "study", "compression"])
@pytest.mark.parametrize("width", WIDTHS)
def test_an_axis_has_two_numbers_at_least(shown: Tab, request: pytest.FixtureRequest, kind: str, width: int) -> None:
    """One number alone, the zero of a residual, says nothing of its size, however large that is."""
    shown.open(request.getfixturevalue(kind), width)
    numbers = "[...document.querySelectorAll('#chart text[text-anchor=end]')].map((one) => "
    numbers += "[Number(one.getAttribute('y')), one.textContent.replace('\u2212', '-')])"
    lower = "Number(document.querySelector('#lower rect').getAttribute('y'))"
    for text in shown.ask(numbers)[-1:]:
        assert "[" in text[1]  # the name of the axis across
    marks = [float(text) for y, text in shown.ask(numbers)[:-1] if y > shown.ask(lower)]
    assert len(marks) >= 2 and len(set(marks)) == len(marks)


def test_pointing_at_a_curve_shows_its_values(shown: Tab, run: Path) -> None:
    """The box has stroke, forces and residual of the nearest point; it goes when the pointer leaves."""
    shown.open(run)
    x, y = shown.place("#chart", 0.6, 0.3)
    shown.point(x, y)
    said, data = tip(shown), drawn(shown)
    k = nearest(said, data["x"])
    assert 0.5 < number(said["stroke"]) / data["x"][-1] < 0.65  # six tenths of the chart, its margins off
    assert all(says(said[data["names"][key]], data["y"][key][k]) for key in ("real_N", "sim_N"))
    assert says(said["residual"], data["residual"][k])
    assert shown.ask("document.querySelectorAll('#chart .dot').length") == 3
    shown.point(2, 2)
    assert shown.ask("document.getElementById('tip').hidden") is True


def test_the_slider_moves_by_keys(shown: Tab, run: Path) -> None:
    """One who has no pointer gets the same values, and a reader of the screen hears them."""
    shown.open(run)
    shown.ask("document.getElementById('cursor').focus()")
    for _ in range(3):
        shown.press("ArrowRight")
    said = tip(shown)
    assert shown.ask("document.getElementById('cursor').value") == "3"
    assert says(said["stroke"], drawn(shown)["x"][3])
    heard = spaced(shown.ask("document.getElementById('cursor').getAttribute('aria-valuetext')"))
    assert heard.startswith(said["stroke"]) and said["residual"] in heard


def test_a_switch_draws_a_curve_and_takes_it_away(shown: Tab, run: Path) -> None:
    """A part of the force is not drawn before it is asked for."""
    shown.open(run)
    before = lines(shown)
    for wanted in (True, False):
        shown.click(*shown.place("[data-curve=edge_N]"))
        assert ("line edge_N" in lines(shown)) == wanted
    assert lines(shown) == before


def test_a_member_is_picked_in_each_way(shown: Tab, run: Path) -> None:
    """By the button beside it, in the table, and by a click on its curve; its values are those of the table."""
    shown.open(run)
    page = Page(run)
    rows, values = page.tables["all"][1:], page.data["texts"]["values"]
    chosen = "[...document.querySelectorAll('#chosen tbody tr')].map(row => row.cells[1].innerText)"
    assert "line member" not in lines(shown)
    shown.click(*shown.place("#next"))
    assert "line member" in lines(shown) and shown.ask(chosen) == values[0]
    shown.ask("document.querySelector('details').open = true")
    shown.click(*shown.place("[data-member='4']"))
    assert shown.ask(chosen) == values[4] and shown.ask("document.getElementById('member').value") == "4"
    picked = "[...document.querySelectorAll('#all tr.picked button')].map(one => one.innerText)"
    assert shown.ask(picked) == [rows[4][0]]
    shown.click(*shown.place("#every"))
    assert lines(shown).count("line every") == len(rows)
    shown.place("#chart")
    x, y = shown.ask(HIGHEST)
    shown.click(x, y)
    assert shown.ask(chosen) == values[2]


def test_another_cut_is_chosen(shown: Tab, study: Path) -> None:
    """Curves, caption and values are those of the cut."""
    shown.open(study)
    cuts = drawn(shown)["cuts"]
    for k in (1, 0):
        shown.ask(f"(() => {{ const cut = document.getElementById('cut'); cut.selectedIndex = {k}; "
                  "cut.dispatchEvent(new Event('change')); })()")  # fmt: skip
        shown.point(*shown.place("#chart", 0.5, 0.3))
        said = tip(shown)
        near = nearest(said, cuts[k]["x"])
        assert says(said[cuts[k]["names"]["sim_N"]], cuts[k]["y"]["sim_N"][near])
        seen = "[...document.querySelectorAll('[data-cut]')].filter(one => one.offsetHeight)"
        assert shown.ask(f"{seen}.map(one => one.dataset.cut)") == [str(k)]


def test_without_scripts_the_figure_is_there(shown: Tab, run: Path) -> None:
    """The figure of the PDF stands in place of the chart, and what only a script can do is not offered."""
    shown.send("Emulation.setScriptExecutionDisabled", value=True)
    try:
        shown.open(run)
        seen = {
            name: shown.ask(f"[...document.querySelectorAll('{name}')].some(one => one.offsetHeight > 0)")
            for name in ("noscript img", "#verdicts", "#values", "#chart", "#choice", "#legend", ".way")
        }
    finally:
        shown.send("Emulation.setScriptExecutionDisabled", value=False)
    assert [name for name, is_seen in seen.items() if is_seen] == ["noscript img", "#verdicts", "#values"]


def test_a_name_that_is_a_script_does_not_run(shown: Tab, tmp_path: Path) -> None:
    """A food that is called so is shown as text, and no dialog opens."""
    odd = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    folder = add_members(sample.write_run(tmp_path / "odd", food=odd))
    shown.open(write_report(folder).with_suffix(".html"))
    assert shown.dialogs == [] and shown.complaints == []
    assert "<script>alert(1)</script>" in shown.ask("document.querySelector('h1').innerText").lower()


def test_stress_over_strain_is_read_off(shown: Tab, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page of a compression is whole at each width, and its curve says strain and stress at the pointer."""
    monkeypatch.setattr(base, "publish", lambda *_, **__: None)
    (tmp_path / "compress.json").write_text("{}")
    curves = curves_of(("R0", 1e5 * STRAIN), ("R1", 1.2e5 * STRAIN), fitted=1.1e5 * STRAIN)
    write_figure(result(), curves, tmp_path)
    path = write_compression(result(), curves, tmp_path).with_suffix(".html")
    for width in WIDTHS:
        shown.open(path, width)
        assert shown.complaints == [] and shown.ask("document.documentElement.scrollWidth") <= width
    shown.point(*shown.place("#chart", 0.5, 0.3))
    said = tip(shown)
    strain = number(said["strain"])
    assert said["strain"].endswith(" %") and said["measured, mean"].endswith(" kPa")
    assert says(said["measured, mean"], 1.1 * strain) and says(said["residual"], 0.0)
