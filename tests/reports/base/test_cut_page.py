"""The page of a cut: one file with all looks, whole at each width, in a scene with a scale bar and round strokes."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from mpm.output.snapshot import SnapshotRecorder
from mpm.runtime import Runtime
from mpm.solver import Simulation
from reports.base.film import Film
from reports.base.html_page import own_colours, page, stress_colours, ticks
from reports.base.scene_sheet import bar_length, numbers
from tests.mpm.scenes import PRISM
from tests.reports.base.still_food import still_food
from tests.reports.web.browser import Tab, found, tab

WIDTHS = ((360, 740), (900, 700), (1280, 800))
BROWSER = found()
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no browser to try the page in")


@pytest.fixture(scope="module")
def film() -> Film:
    """A cut of a second, seen six times and at contact."""
    simulation, watch = Simulation(PRISM, Runtime(threads=1)), SnapshotRecorder(6)
    record = simulation.run(snapshots=watch)
    return Film.of("cucumber", simulation, watch.taken, record)


def unpacked(path: Path) -> str:
    """The page within the page."""
    packed = re.search(r'packed = "(.*?)"', path.read_text(encoding="utf-8"))
    assert packed is not None
    return gzip.decompress(base64.b64decode(packed[1])).decode()


def drawn(text: str) -> Any:
    """The data that the script draws."""
    cut = re.search(r'<script type="application/json" id="cut">(.*?)</script>', text, re.DOTALL)
    assert cut is not None
    return json.loads(cut[1])


def values(one: dict[str, Any]) -> np.ndarray:
    """Numbers of a trace."""
    return np.frombuffer(base64.b64decode(one["bdata"]), dtype=np.dtype(one["dtype"]))


def test_a_page_needs_no_network_and_has_all_looks(film: Film, tmp_path: Path) -> None:
    """Nothing is loaded from elsewhere; each frame has the vertices of its look, to a twentieth of a millimetre, and
    its force."""
    path = tmp_path / "cut.html"
    page(film, path, "prism, <thin> knife")
    text = unpacked(path)
    assert "src=" not in path.read_text(encoding="utf-8") and path.stat().st_size < 3_000_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)\s*=", text) and "prism, &lt;thin&gt; knife" in text
    cut = drawn(text)
    frames = cut["scene"]["frames"]
    assert len(frames) == len(film.looks) == len(cut["looks"])
    skin, flesh, knife = frames[3]["data"]
    assert "colorscale" not in skin  # which the buttons set for all looks
    assert cut["own"] == json.loads(json.dumps(own_colours(film.food)))
    look = film.looks[3]
    for shown, triangles in zip((skin, flesh), film.surface.parts, strict=True):
        used = np.unique(triangles)
        np.testing.assert_allclose(values(shown["z"]) * 5e-5, film.surface.points(look)[used, 2], atol=2.6e-5)
        stress = film.surface.values(look.mises)[used] / 1e3
        np.testing.assert_allclose(values(shown["intensity"]), stress, atol=5.1e-6 * film.largest)
    assert values(knife["z"]).min() == pytest.approx(2e4 * (0.024 - look.stroke), abs=1)
    now = cut["looks"][3]
    assert now["force"] == pytest.approx(film.force_at(look)) and now["said"] == list(numbers(film, look))


def test_a_page_begins_at_contact_and_draws_the_flesh_that_is_bare(film: Film, tmp_path: Path) -> None:
    """The first look is at no stroke; of a triangle of the flesh that is not seen two corners are in one place."""
    page(film, tmp_path / "cut.html", "")
    cut = drawn(unpacked(tmp_path / "cut.html"))
    assert cut["looks"][0]["stroke"] == 0.0 and all(cut["looks"][0]["whole"]) and not any(cut["looks"][-1]["whole"][:9])
    i = values(cut["scene"]["data"][1]["i"])
    for frame, look in zip(cut["scene"]["frames"], film.looks, strict=True):
        np.testing.assert_array_equal(values(frame["data"][1]["j"]) != i, film.surface.bare(look))


def test_marks_of_the_slider_are_round_strokes_where_they_are_passed() -> None:
    """Few of them, each with the place between two looks that has its stroke; a blade that goes up again passes them
    twice."""
    for strokes in ([0.0, 1.4, 2.8, 6.0, 9.1, 12.3, 20.1], [0.0, 0.7, 1.3], [0.0, 12.0, 37.4, 20.0, 0.0]):
        marks = ticks(strokes)
        assert 3 <= len(marks) <= 7
        for part, text in marks:
            assert np.interp(part * (len(strokes) - 1), range(len(strokes)), strokes) == pytest.approx(
                float(text), abs=0.01 * strokes[-2]
            )
        steps = np.unique(np.abs(np.diff([float(text) for _, text in marks])))
        assert f"{steps[-1]:.0e}"[0] in "125"
    assert [text for _, text in marks] == ["0", "20", "20", "0"]


def test_a_page_shows_the_food_in_its_colours() -> None:
    """Whatever the stress: green skin and light flesh of a cucumber; a food without colours has those of all others.
    The stress is light where it is small, as in the pictures."""
    skin, flesh = own_colours("cucumber")
    assert (
        skin == [[0, "rgb(33, 92, 33)"], [1, "rgb(33, 92, 33)"]] and flesh[0][1] == flesh[1][1] == "rgb(204, 230, 158)"
    )
    assert own_colours("tofu") == own_colours("nobody's") != own_colours("cucumber")
    light = [sum(map(int, re.findall(r"\d+", colour))) for _, colour in stress_colours()]
    assert light == sorted(light, reverse=True)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Film, int, int], Tab]]:
    """Opens the page of a film at a width and a height [px]."""
    assert BROWSER is not None
    folder = tmp_path_factory.mktemp("page")
    with tab(BROWSER, folder / "profile") as one:

        def show(film: Film, width: int, height: int) -> Tab:
            page(film, folder / "cut.html", f"{film.food}, edc knife")
            one.open(folder / "cut.html", width, height)
            end = monotonic() + 60.0
            while not one.ask("document.body && document.body.dataset.ready"):
                assert monotonic() < end, one.complaints
                sleep(0.2)
            return one

        yield show


def picture(shown: Tab) -> np.ndarray:
    """The scene as it is seen, shape (height, width, 3) [0 to 1]."""
    box = shown.ask("(() => { const b = document.getElementById('scene').getBoundingClientRect(); "
                    "return [b.left, b.top, b.width, b.height]; })()")  # fmt: skip
    clip = dict(zip(("x", "y", "width", "height"), box, strict=True)) | {"scale": 1}
    taken = shown.send("Page.captureScreenshot", format="png", clip=clip)
    out: np.ndarray = imread(BytesIO(base64.b64decode(taken["data"])))[..., :3]
    return out


def squeezed() -> Film:
    """A default cucumber, of which each of twelve looks after contact is squeezed in another way."""

    def moved(k: int, x: np.ndarray) -> np.ndarray:
        wave = np.sin(90.0 * x[:, 1])
        out: np.ndarray = x * [1.0, 1.0, 1.0 - 0.01 * k] + 1e-4 * k * np.outer(wave, [1, 0, 1])
        return out

    def stressed(k: int, x: np.ndarray) -> np.ndarray:
        out: np.ndarray = 1e3 * k * (1.0 + np.cos(80.0 * x[:, 1] + k))
        return out

    return still_food("cucumber", [0.0035 * k for k in range(13)], moved, stressed)


@pytest.mark.slow
@needs_browser
def test_the_page_of_a_cucumber_is_small_and_whole(shown: Callable[[Film, int, int], Tab]) -> None:
    """Less than 3 MB; no error and no address asked for. At each width nothing reaches over the side, nothing overlaps,
    and the scene fills its picture in one direction without touching the picture's edge, in both kinds of colours."""
    film = squeezed()
    for width, height in WIDTHS:
        one = shown(film, width, height)
        assert one.ask("document.documentElement.scrollWidth") <= width
        boxes = "['h1', '#tools', '#scene', '#slider', '#forces'].map((q) => document.querySelector(q)"
        boxes = one.ask(f"{boxes}.getBoundingClientRect()).map((b) => [b.left, b.top, b.right, b.bottom])")
        for k, (left, top, right, bottom) in enumerate(boxes):
            assert left >= 0 and right <= width and right - left > 30 and bottom - top > 15
            assert all(right <= x or left >= z or bottom <= y or top >= w for x, y, z, w in boxes[k + 1 :])
        if width >= 900:
            assert boxes[3][3] <= height  # scene, forces and slider without scrolling
        for button in ("food", "stress"):
            one.ask(f"document.getElementById('{button}').click()")
            sleep(2.0)
            inked = (picture(one) < 0.97).any(axis=2)
            assert not inked[:, [0, 1, -2, -1]].any() and not inked[[-2, -1]].any()
            if button == "food":
                rows, columns = (np.ptp(np.flatnonzero(inked.any(axis=k))) / inked.shape[1 - k] for k in (1, 0))
                assert max(rows, columns) > 0.9 and min(rows, columns) > 0.4
        assert all(url.startswith(("file:", "data:", "blob:")) for url in one.asked)
        assert not [text for text in one.complaints if not re.search("WebGL|GPU|Canvas2D", text)]


@pytest.mark.slow
@needs_browser
def test_a_look_is_chosen_and_the_scale_bar_says_its_length(shown: Callable[[Film, int, int], Tab]) -> None:
    """The slider moves the blade, the mark and the words; a bar of round length lies on the board."""
    film = squeezed()
    one = shown(film, 900, 700)
    first = picture(one)
    length = bar_length(film.scene.food.shape.length)
    assert one.ask("document.querySelector('#scene .annotation-text').textContent") == f"{1e3 * length:g} mm"
    bar = values(drawn(unpacked(Path(one.asked[0].removeprefix("file://"))))["scene"]["data"][4]["y"])
    assert np.ptp(bar.astype(float)) == pytest.approx(2e4 * length, abs=1)
    one.ask("(() => { const way = document.getElementById('way'); way.value = '9'; "
            "way.dispatchEvent(new Event('input')); })()")  # fmt: skip
    sleep(1.0)
    assert one.ask("document.getElementById('now').innerText.split('\\n')") == list(numbers(film, film.looks[9]))
    assert np.abs(picture(one) - first).max() > 0.2
    texts = one.ask("[...document.querySelectorAll('#ticks span')].map((one) => one.textContent)")
    assert texts == ["0", "10", "20", "30", "40"]


@pytest.mark.slow
@needs_browser
@pytest.mark.parametrize("depth", [0.0, 0.021])
def test_an_uncut_food_shows_no_seam(shown: Callable[[Film, int, int], Tab], depth: float) -> None:
    """Without the flesh the picture of a cucumber is another one at its ends, and where it is cut: in the middle third
    of the skin nowhere where it is whole, at half its height above the edge alone."""
    film = still_food("cucumber", [depth, depth])
    one = shown(film, 900, 700)
    with_flesh = picture(one)
    one.ask("Plotly.restyle('scene', { visible: false }, [1])")
    sleep(1.0)
    without = picture(one)
    skin = (with_flesh[..., 1] > 1.5 * with_flesh[..., 0]) & (with_flesh[..., 1] > 1.5 * with_flesh[..., 2])
    rows, columns = (np.flatnonzero(skin.sum(axis=k) > 9) for k in (1, 0))
    changed = (np.abs(without - with_flesh) > 0.01).any(axis=2)
    assert changed[:, : columns[0] + 40].sum() > 1000  # the near end
    middle = slice(columns[0] + len(columns) // 3, columns[0] + 2 * len(columns) // 3)
    below = rows[0] + (2 * len(rows) // 3 if depth else 0)
    assert not changed[below:, middle].any()
    assert changed[:below, middle].any() == (depth > 0.0)


@pytest.mark.slow
@needs_browser
def test_the_halves_of_a_whole_food_are_lit_as_one(shown: Callable[[Film, int, int], Tab]) -> None:
    """They share the vertices of the rims where the food is whole, and so the light there; where it is cut they have
    each their own."""
    film = still_food("apple", [0.0, 0.012, 0.0375], dx=6e-3)
    one = shown(film, 900, 700)
    rims = np.searchsorted(np.unique(film.surface.parts[0]), film.surface.rims)
    for k, look in enumerate(film.looks):
        one.ask(f"(() => {{ const way = document.getElementById('way'); way.value = '{k}'; "
                "way.dispatchEvent(new Event('input')); })()")  # fmt: skip
        sleep(1.0)
        used = one.ask("[...'ijk'].flatMap((key) => [...document.getElementById('scene')._fullData[0][key]])")
        own = np.isin(rims[:, 1], used)
        np.testing.assert_array_equal(own, film.surface.cut(look)[film.surface.rims[:, 1]])
        assert np.isin(rims[:, 0], used).all()
