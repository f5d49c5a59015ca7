"""Pictures, video and page of a cut: they show the food, the blade where it is, and the force of that moment."""

from __future__ import annotations

import builtins
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from scipy.ndimage import label

from calib.errors import OutputError
from mpm.output.food_colours import FOOD_COLOURS
from mpm.output.snapshot import SnapshotRecorder
from mpm.runtime import Runtime
from mpm.scene import Knife, Motion
from mpm.solver import Simulation
from reports.base.figures import RED
from reports.base.film import APART, AXES, MOMENTS, STEPS, Film, blade, blade_at, round_up
from reports.base.html_page import page
from reports.base.scene_render import SIZE, STEEL, WOOD, Stage, attempt, stills, video
from reports.base.scene_sheet import bar_ends, bar_length, numbers, view_size
from tests.mpm.scenes import PRISM

HEAD_ROWS = SIZE[1] - view_size(SIZE)[1]  # of a sheet, above the scene


@pytest.fixture(scope="module")
def film() -> Film:
    """A cut of a second, seen six times."""
    simulation, watch = Simulation(PRISM, Runtime(threads=1)), SnapshotRecorder(6)
    record = simulation.run(snapshots=watch)
    return Film.of("cucumber", simulation, watch.taken, record)


@pytest.fixture(scope="module")
def drawn(film: Film) -> Iterator[Stage]:
    """What draws it."""
    with Stage(film) as stage:
        yield stage


def coloured(image: np.ndarray, colour: Any, near: float = 0.08) -> np.ndarray:
    """Which pixels of an image (height, width, 3) have a colour, however bright."""
    wanted, found = np.array(colour[:3], float), image.astype(float) / 255
    ratio = found / np.maximum(found.max(axis=2, keepdims=True), 1e-9)
    out: np.ndarray = (np.abs(ratio - wanted / wanted.max()) < near).all(axis=2) & (found.max(axis=2) > 0.1)
    return out


def in_sheet(stage: Stage, points: np.ndarray) -> np.ndarray:
    """Row and column of places (n, 3) [m] on a sheet, shape (n, 2)."""
    across, up = stage.view.pixels(points).T
    return np.round(np.column_stack([SIZE[1] - 1 - up, across])).astype(int)


def test_moments_are_contact_largest_force_and_end(film: Film) -> None:
    """The food is at rest when the blade touches it; the look at the largest force is the one nearest to it in time;
    each look has the force of its own time."""
    found = film.moments()
    assert tuple(found) == MOMENTS and found["contact"] is film.looks[0] and found["end"] is film.looks[-1]
    contact, (peak, stroke, force) = found["contact"], film.peak
    assert contact.stroke == 0.0 and film.force_at(contact) < 0.02 * force and contact.x is film.seeds.x
    assert len(film.looks) == 7 and film.force[film.stroke == stroke] == force == film.force.max()
    last = replace(film, force=np.linspace(0.0, 1.0, len(film.force)), down=5)  # the greatest force on the way up
    assert last.peak[1:] == (film.stroke[4], last.force[4])
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


def test_a_picture_says_the_largest_force_as_the_summary_does(film: Film) -> None:
    """No look need be where the largest force is: each says its own force and that of the whole curve."""
    film = replace(film, force=np.linspace(1.0, 8.0, len(film.force)), looks=film.looks[:-1])
    look = film.moments()["peak"]
    said = numbers(film, look)
    assert said[0] == f"stroke {1e3 * look.stroke:.1f} mm" and said[1] == f"force {film.force_at(look):.2f} N"
    assert said[2] == f"largest {film.force.max():.2f} N at {1e3 * film.stroke[film.force.argmax()]:.1f} mm"
    assert said[1].split()[1] != said[2].split()[1]


def test_stills_show_food_blade_and_board(film: Film, tmp_path: Path) -> None:
    """Three files of the size that is said, each with pixels of steel, of the board and of the food's skin; the blade
    goes down."""
    paths = stills(film, tmp_path)
    assert [p.name for p in paths] == ["contact.png", "peak.png", "end.png"]
    rows = []
    for path in paths:
        image = (255 * imread(path)[..., :3]).astype(np.uint8)
        assert image.shape == (SIZE[1], SIZE[0], 3)
        scene = image[HEAD_ROWS:]
        steel, wood = coloured(scene, to_rgb(STEEL)), coloured(scene, to_rgb(WOOD), 0.05)
        assert steel.mean() > 0.01 and wood.mean() > 0.03
        food = FOOD_COLOURS["cucumber"]
        assert (coloured(scene, food.skin, 0.12) | coloured(scene, food.flesh, 0.03)).mean() > 0.05
        rows.append(np.flatnonzero(steel.sum(axis=1) > 20).max())
    assert rows[2] > rows[0] + 40  # by 15 of the some 110 mm that the picture is high, seen from above


def test_all_of_the_scene_lies_within_the_frame(film: Film, drawn: Stage) -> None:
    """The food at every look, and drawn apart, is within the picture, and its outermost pixels show paper alone; the
    picture is filled in one of its directions."""
    shown = [film.surface.points(look) for look in film.looks] + [film.apart(film.looks[-1])]
    for points in shown:
        pixels = drawn.view.pixels(points)
        assert (pixels > 0).all() and (pixels < drawn.view.size).all()
    image = drawn.draw(film.looks[0])[HEAD_ROWS:]
    assert (image[:, [0, -1]] == 255).all() and (image[-1] == 255).all()
    inked = (image < 255).any(axis=2)
    filled = np.ptp(np.flatnonzero(inked.any(axis=0))) / SIZE[0], np.ptp(np.flatnonzero(inked.any(axis=1))) / len(image)
    assert max(filled) > 0.9


def test_nothing_is_seen_of_a_cut_that_has_not_been(film: Film, drawn: Stage) -> None:
    """Along the food's flat flank below the blade the light is even across the plane of the cut, where a groove would
    be: shared vertices of skin and face would make it darker there by a tenth."""
    image = drawn.draw(film.looks[0])
    y = np.linspace(-0.01, 0.01, 81)
    at = in_sheet(drawn, np.column_stack([np.full_like(y, 0.012), y, np.full_like(y, 0.006)]))
    seen = image[at[:, 0], at[:, 1]].astype(float)
    assert coloured(seen[None].astype(np.uint8), FOOD_COLOURS["cucumber"].skin, 0.12).all()
    assert np.ptp(seen, axis=0).max() < 8  # of 255
    flesh = coloured(image[HEAD_ROWS:], FOOD_COLOURS["cucumber"].flesh, 0.03)
    assert flesh.sum() == pytest.approx(0.024**2 * abs(AXES[2, 1]) * drawn.view.scale**2, rel=0.02)  # the near end
    assert label(flesh, np.ones((3, 3)))[1] == 1


def test_the_face_of_a_cut_has_the_colour_of_flesh(film: Film, drawn: Stage) -> None:
    """Once the whole section is cut the pieces are drawn apart, and the pixels of the face have the flesh's colour: its
    middle, and about as many as the face is large, seen askew. Before, they stay together."""
    last = film.looks[-1]
    assert not film.parted(last)
    np.testing.assert_array_equal(drawn.draw(last, apart=True), drawn.draw(last))
    through = replace(last, severed=np.ones_like(last.severed))
    whole = replace(film, looks=[*film.looks[:-1], through])
    assert whole.parted(through)
    with Stage(whole) as stage:
        image = stage.draw(through, apart=True)
        row, column = in_sheet(stage, np.array([[0.0, APART * 0.024, 0.012]]))[0]
        away = 0.024**2 * abs(AXES[2, 1]) * stage.view.scale**2
    flesh = FOOD_COLOURS["cucumber"].flesh
    np.testing.assert_allclose(image[row, column] / 255, flesh, atol=0.1)
    assert coloured(image[HEAD_ROWS:], flesh, 0.03).sum() == pytest.approx(2 * away, rel=0.15)  # and the near end


def test_no_pixel_of_the_flesh_shows_where_the_food_is_whole(film: Film, drawn: Stage) -> None:
    """Below the blade the flank is skin in every pixel about the plane of the cut, at each look: the faces of the cut
    lie within the food there, and their rims along its skin."""
    for look in film.looks:
        y, z = (
            a.ravel() for a in np.meshgrid(np.linspace(-1e-3, 1e-3, 60), np.arange(1e-3, 0.022 - look.stroke, 1e-4))
        )
        at = in_sheet(drawn, np.column_stack([np.full_like(y, 0.012), y, z]))
        seen = drawn.draw(look)[at[:, 0], at[:, 1]]
        assert coloured(seen[None], FOOD_COLOURS["cucumber"].skin, 0.12).all()


def test_the_scale_bar_is_as_long_as_it_says(film: Film, drawn: Stage) -> None:
    """The black bar on the board is to the food's edge along it in pixels as its length is to the food's; 1, 2 or 5."""
    length = bar_length(0.03)
    assert length == 0.01 and [bar_length(x) for x in (0.15, 0.075, 0.022)] == [0.05, 0.02, 0.005]
    ends = bar_ends(film)
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(length)
    image = drawn.draw(film.looks[0])
    at = in_sheet(drawn, ends)
    rows, columns = np.nonzero((image[at[:, 0].min() - 9 : at[:, 0].max() + 9] < 40).all(axis=2))
    bar = columns[(columns > at[:, 1].min() - 9) & (columns < at[:, 1].max() + 9)]
    corner = in_sheet(drawn, np.array([[0.012, -0.015, 0.0], [0.012, 0.015, 0.0]]))
    assert np.ptp(bar) == pytest.approx(length / 0.03 * np.ptp(corner[:, 1]), abs=4)


def test_the_mark_is_at_the_force_of_the_look(film: Film) -> None:
    """The red mark in the inset goes to the right as the stroke, and up as the force, here one that rises evenly."""
    rising = replace(film, force=np.linspace(1.0, 8.0, len(film.force)))
    places = []
    with Stage(rising) as stage:
        for look in rising.looks[::2]:
            head = stage.draw(look)[:HEAD_ROWS, int(0.68 * SIZE[0]) :]
            rows, columns = np.nonzero(coloured(head, to_rgb(RED), 0.02))
            places.append((columns.mean(), -rows.mean()))
    across, up = np.array(places).T
    for pixels, wanted in (
        (across, [look.stroke for look in rising.looks[::2]]),
        (up, [rising.force_at(look) for look in rising.looks[::2]]),
    ):
        slope, start = np.polyfit(wanted, pixels, 1)
        assert slope > 0.0
        np.testing.assert_allclose(slope * np.array(wanted) + start, pixels, atol=1.5)


def test_a_video_has_a_picture_for_each_look(film: Film, tmp_path: Path) -> None:
    """As many frames as looks; progress counts them; no draft is left."""
    from imageio_ffmpeg import count_frames_and_secs

    done: list[int] = []
    video(replace(film, looks=film.looks[::4]), tmp_path / "cut.mp4", done.append)
    frames, _ = count_frames_and_secs(str(tmp_path / "cut.mp4"))
    assert frames == 2 and done == [1, 2]
    assert [p.name for p in tmp_path.iterdir()] == ["cut.mp4"]


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
