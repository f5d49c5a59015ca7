"""Pictures, video and page of a cut: they show the food, the blade where it is, and the force of that moment."""

from __future__ import annotations

import base64
import builtins
import gzip
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from calib.errors import OutputError
from mpm.output.snapshot import SnapshotRecorder
from mpm.output.surface import Surface
from mpm.runtime import Runtime
from mpm.scene import Knife, Motion
from mpm.solver import Simulation
from reports.base.html_page import page
from reports.base.scene_render import MOMENTS, SIZE, STEPS, Film, attempt, blade, blade_at, round_up, stills, video
from tests.mpm.scenes import PRISM

BAR = 800  # row of a picture below which the scale of the colours stands


@pytest.fixture(scope="module")
def film() -> Film:
    """A cut of a second, seen six times."""
    simulation, watch = Simulation(PRISM, Runtime(threads=1)), SnapshotRecorder(6)
    record = simulation.run(snapshots=watch)
    surface = Surface(PRISM.food.shape, simulation.setup.seeds, PRISM.mirrors)
    return Film(PRISM, surface, watch.taken, record.time, record.stroke, record.resolved)


def test_moments_are_contact_largest_force_and_end(film: Film) -> None:
    """The look at the largest force is the one nearest to it in time; each look has the force of its own time."""
    found = film.moments()
    assert tuple(found) == MOMENTS and found["contact"] is film.looks[0] and found["end"] is film.looks[-1]
    peak = film.time[np.argmax(film.force)]
    assert abs(found["peak"].time - peak) == min(abs(look.time - peak) for look in film.looks)
    out = replace(
        film, stroke=np.minimum(film.stroke, 5e-3)
    )  # a blade that stops and goes on: the stroke says nothing of the time
    assert [out.force_at(look) for look in out.looks] == [film.force_at(look) for look in film.looks]


def test_the_blade_has_its_size_and_is_where_it_was(film: Film) -> None:
    """Volume of a wedge of the included angle up to the spine and a plate above it; edge lowered, slid, and higher at
    +x when tilted."""
    knife = Knife("wedge", 2e-3, math.radians(20), 0.03, 0.2)
    points, triangles = blade(knife, 0.1)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    high = 1e-3 / math.tan(math.radians(10))
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 == pytest.approx(0.1 * 2e-3 * (0.03 - high / 2))
    scene = replace(film.scene, motion=Motion(0.01, tilt=0.1))
    look = replace(film.looks[0], stroke=4e-3, slide=2e-3)
    found = blade_at(scene, look)[0]
    ends = found[[0, 5]]
    np.testing.assert_allclose(ends.mean(axis=0), [2e-3, 0.0, 0.02], atol=1e-12)
    assert ends[1, 2] - ends[0, 2] == pytest.approx(math.tan(0.1) * (ends[1, 0] - ends[0, 0]))


def test_stills_show_food_blade_and_board(film: Film, tmp_path: Path) -> None:
    """Three files of the size that is said, each with pixels of steel, of the board and of food under stress; the blade
    goes down."""
    paths = stills(film, tmp_path)
    assert [p.name for p in paths] == ["contact.png", "peak.png", "end.png"]
    rows = []
    for path in paths:
        image = imread(path)[..., :3]
        assert image.shape == (SIZE[1], SIZE[0], 3)
        spread = image.max(axis=2) - image.min(axis=2)
        steel = (spread < 0.06) & (image.mean(axis=2) > 0.2) & (image.mean(axis=2) < 0.6)
        assert 0.01 < steel.mean() < 0.4  # grey
        assert ((image[..., 0] - image[..., 2]) > 0.15).mean() > 0.1  # wood and food
        rows.append(np.flatnonzero(steel[:BAR].sum(axis=1) > 20).max())
    assert rows[2] > rows[0] + 100  # by 15 of the 33 mm that the picture is high, seen from above
    peak = imread(paths[1])[:BAR]
    assert (peak[..., 0] - peak[..., 1] > 0.4).mean() > 1e-3  # red where the stress is largest


def test_a_video_has_a_picture_for_each_look(film: Film, tmp_path: Path) -> None:
    """As many frames as looks; progress counts them; no draft is left."""
    from imageio_ffmpeg import count_frames_and_secs

    done: list[int] = []
    video(replace(film, looks=film.looks[::3]), tmp_path / "cut.mp4", done.append)
    frames, _ = count_frames_and_secs(str(tmp_path / "cut.mp4"))
    assert frames == 2 and done == [1, 2]
    assert [p.name for p in tmp_path.iterdir()] == ["cut.mp4"]


def test_a_page_needs_no_network_and_has_all_looks(film: Film, tmp_path: Path) -> None:
    """Nothing is loaded from elsewhere; each frame has the vertices of its look, to a hundredth of a millimetre, and
    its force."""
    path = tmp_path / "cut.html"
    page(film, path, "prism, thin knife")
    packed = path.read_text(encoding="utf-8")
    text = gzip.decompress(base64.b64decode(re.search(r'packed = "(.*?)"', packed)[1])).decode()  # type: ignore[index]
    assert "src=" not in packed and path.stat().st_size < 3_000_000
    assert not re.search(r"<(script|link|img)[^>]+(src|href)\s*=", text) and "prism, thin knife" in text
    frames = json.loads(re.search(r"Plotly\.addFrames\('[^']+', (\[.*?\])\);", text, re.DOTALL)[1])  # type: ignore[index]
    assert len(frames) == len(film.looks)
    food, knife, now = frames[3]["data"]

    def numbers(one: dict[str, Any]) -> np.ndarray:
        return np.frombuffer(base64.b64decode(one["bdata"]), dtype=np.dtype(one["dtype"]))

    look = film.looks[3]
    np.testing.assert_allclose(numbers(food["z"]) * 1e-5, film.surface.points(look)[:, 2], atol=0.51e-5)
    np.testing.assert_allclose(
        numbers(food["intensity"]), film.surface.values(look.mises) / 1e3, atol=2.1e-6 * film.largest
    )
    assert numbers(knife["z"]).min() == pytest.approx(1e5 * (0.024 - look.stroke), abs=1)
    assert now["y"] == [pytest.approx(film.force_at(look))]


@pytest.mark.parametrize(
    ("module", "said"), [("plotly", "a page needs plotly"), ("imageio_ffmpeg", "needs imageio-ffmpeg")]
)
def test_what_is_not_installed_is_one_line(
    film: Film, tmp_path: Path, monkeypatch: Any, module: str, said: str
) -> None:
    """Video and page name the package and how to get it."""
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.split(".")[0] == module:
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(OutputError, match=rf"{said}.*cutcal\[view\]"):
        if module == "plotly":
            page(film, tmp_path / "cut.html", "")
        else:
            video(film, tmp_path / "cut.mp4")


def test_where_nothing_can_be_drawn_or_written_it_is_one_line(film: Film, tmp_path: Path, monkeypatch: Any) -> None:
    """No OpenGL, and a folder that is a file."""
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        page(film, tmp_path / "file" / "cut.html", "")
    import pyvista

    def fail(**_: Any) -> None:
        raise RuntimeError("no OpenGL here\nsecond line")

    monkeypatch.setattr(pyvista, "Plotter", fail)
    with pytest.raises(OutputError, match=r"cannot draw here \(no OpenGL here\); cutcal doctor"):
        stills(film, tmp_path)


def test_a_ball_is_drawn_where_these_tests_run() -> None:
    """What ``cutcal doctor`` tries."""
    assert "drawn without a screen" in attempt()


def test_the_scale_of_colours_has_round_numbers(film: Film) -> None:
    """Each of its numbers has three digits at most, and its end is no more than half again the stress that it shows."""
    for value in (23.9e3, 0.61, 4.0, 9.5e5):
        rounded = round_up(value)
        assert value * (1.0 - 1e-9) <= rounded <= 1.5 * value and float(f"{rounded:.2g}") == pytest.approx(rounded)
    numbers = [k * film.largest / STEPS for k in range(STEPS + 1)]
    assert all(float(f"{x:.3g}") == pytest.approx(x, rel=1e-12) for x in numbers)
