"""Pictures of a cut: the food as it deforms, coloured by its stress, with knife and board, drawn without a screen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mpm.files import replacing
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.scene import Knife, Scene
from mpm.scene.errors import OutputError

COLOURS = "YlOrRd"  # falls evenly in lightness, so it can be read in grey and by the colour-blind
SIZE, VIDEO_SIZE = (1200, 900), (960, 720)  # of a picture and of a video [pixels]
SHOWN = 0.98  # part of the food's surface whose stress is within the colours when it is largest
FRAME = 1.15  # of the food beside the blade that a picture shows, in heights or widths, whichever is larger
EYE = np.array([1.0, -0.55, 0.45])  # from where it is seen
BLADE = 1.4  # length of the blade that is drawn, in widths of the food, where it is longer
STEEL, WOOD, PAPER, INK = "#8a9199", "#d9c4a0", "white", "black"
STEPS = 3  # between the numbers at the scale of colours
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # what a step may begin with
BAR = {
    "title": " ",
    "color": INK,
    "label_font_size": 20,
    "n_labels": STEPS + 1,
    "fmt": "%.3g",
    "position_x": 0.55,
    "position_y": 0.015,
    "width": 0.4,
    "height": 0.07,
}
MOMENTS = ("contact", "peak", "end")
SAMPLES = 8  # colours found for a pixel
RATE = 15  # pictures of a video in a second


def round_up(value: float) -> float:
    """The next round number that is no smaller.

    >>> round_up(23.9), round_up(0.61), round_up(4.0)
    (25.0, 0.8, 4.0)
    """
    power = 10.0 ** math.floor(math.log10(value))
    return next(one * power for one in ROUND if one * power >= value * (1.0 - 1e-9))


@dataclass(frozen=True, eq=False)
class Film:
    """A cut to be drawn.

    Attributes:
        scene: What was simulated.
        surface: The food's surface.
        looks: What was seen of it, in the order of time.
        time: Simulated time of the record [s], shape (n,).
        stroke: Stroke of the record [m], shape (n,).
        force: Upward force on the knife [N], shape (n,).
    """

    scene: Scene
    surface: Surface
    looks: Sequence[Snapshot]
    time: np.ndarray
    stroke: np.ndarray
    force: np.ndarray

    @cached_property
    def largest(self) -> float:
        """Stress at the end of the colours [Pa]: three steps of a round number."""
        values = [float(np.quantile(self.surface.values(look.mises), SHOWN)) for look in self.looks]
        return STEPS * round_up(max([*values, 1.0]) / STEPS)

    def force_at(self, look: Snapshot) -> float:
        """Upward force on the knife at a look [N]."""
        return float(np.interp(look.time, self.time, self.force))

    def moments(self) -> dict[str, Snapshot]:
        """The looks nearest to contact, to the largest force and to the end, by these words."""
        peak = self.time[int(np.argmax(self.force))]
        times = np.array([look.time for look in self.looks])
        chosen = (self.looks[0], self.looks[int(np.argmin(np.abs(times - peak)))], self.looks[-1])
        return dict(zip(MOMENTS, chosen, strict=True))


def blade(knife: Knife, length: float) -> tuple[np.ndarray, np.ndarray]:
    """A blade whose edge lies along x through the origin.

    Args:
        knife: The blade.
        length: How much of its length [m].

    Returns:
        Corners (10, 3) [m], and triangles (t, 3).
    """
    half, high = knife.spine / 2, knife.spine / 2 / math.tan(knife.angle / 2)
    outline = np.array([[0.0, 0.0], [half, high], [half, knife.height], [-half, knife.height], [-half, high]])
    ends = [np.column_stack([np.full(5, x), outline]) for x in (-length / 2, length / 2)]
    around, after = np.arange(5), np.roll(np.arange(5), -1)
    sides = np.concatenate([np.stack([around, after + 5, after], 1), np.stack([around, around + 5, after + 5], 1)])
    fan = np.array([[0, k, k + 1] for k in range(1, 4)])
    return np.concatenate(ends), np.concatenate([sides, fan, fan[:, ::-1] + 5])[:, ::-1]


def blade_at(scene: Scene, look: Snapshot) -> tuple[np.ndarray, np.ndarray]:
    """The same where the blade is at a look: lowered, slid along its edge and tilted."""
    assert isinstance(scene.knife, Knife)  # a press has no blade
    points, triangles = blade(scene.knife, min(scene.knife.length, BLADE * scene.food.shape.width))
    c, s = math.cos(scene.motion.tilt), math.sin(scene.motion.tilt)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    place = np.array([look.slide, 0.0, scene.food.shape.height - look.stroke])
    return points @ turn.T + place, triangles


class Stage:
    """Draws the looks of a film, one after the other.

    Args:
        film: What to draw.
        size: Width and height [pixels].
    """

    def __init__(self, film: Film, size: tuple[int, int] = SIZE) -> None:
        import pyvista

        _silence()
        self.film = film
        self._food = _mesh(film.surface.rest, film.surface.triangles)
        plot: Any = pyvista.Plotter(off_screen=True, window_size=list(size))
        plot.set_background(PAPER)
        plot.enable_anti_aliasing("msaa", multi_samples=SAMPLES)
        self._plot = plot
        self._setting()

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *raised: object) -> None:
        self._plot.close()

    def _setting(self) -> None:
        """Board, food, blade and camera."""
        import pyvista

        shape, plot = self.film.scene.food.shape, self._plot
        near = FRAME * max(shape.width, shape.height)
        reach = max(shape.length, 2 * near)
        board = pyvista.Box((-0.7 * near, 0.7 * near, -0.55 * reach, 0.55 * reach, -0.12 * near, -1e-5))
        plot.add_mesh(board, color=WOOD, ambient=0.25)
        look = self.film.looks[0]
        self._food["stress"] = np.zeros(self._food.n_points)
        plot.add_mesh(
            self._food,
            scalars="stress",
            cmap=COLOURS,
            clim=(0.0, self.film.largest / 1e3),
            smooth_shading=True,
            split_sharp_edges=False,
            ambient=0.3,
            specular=0.15,
            scalar_bar_args=BAR,
        )
        self._knife = _mesh(*blade_at(self.film.scene, look))
        plot.add_mesh(self._knife, color=STEEL, ambient=0.25, specular=0.4)
        middle = np.array([0.0, 0.0, 0.45 * shape.height])
        plot.camera_position = [tuple(middle + 8 * near * EYE), tuple(middle), (0.0, 0.0, 1.0)]
        plot.enable_parallel_projection()
        plot.camera.parallel_scale = 0.9 * near

    def draw(self, look: Snapshot) -> np.ndarray:
        """One look as an image (height, width, 3), 0 to 255."""
        film, scene = self.film, self.film.scene
        self._food.points = film.surface.points(look)
        self._food["stress"] = film.surface.values(look.mises) / 1e3
        self._knife.points = blade_at(scene, look)[0]
        words = f"stroke {look.stroke * 1e3:.1f} mm, force {film.force_at(look):.1f} N"
        for text, place in ((words, (0.02, 0.94)), ("von Mises stress [kPa]", (0.02, 0.03))):
            self._plot.add_text(text, position=place, viewport=True, font_size=13, color=INK, name=str(place))
        image: np.ndarray = self._plot.screenshot(return_img=True)
        return image


def stills(film: Film, folder: Path) -> list[Path]:
    """Draw the cut at contact, at the largest force and at its end: contact.png, peak.png, end.png.

    Args:
        film: What to draw.
        folder: Where to.

    Raises:
        OutputError: It cannot be drawn here, or not be written.
    """
    from matplotlib.image import imsave

    paths = [folder / f"{name}.png" for name in MOMENTS]
    with _drawing(folder), Stage(film) as stage:
        for path, look in zip(paths, film.moments().values(), strict=True):
            imsave(path, stage.draw(look))
    return paths


def video(film: Film, path: Path, progress: Callable[[int], None] = lambda done: None) -> None:
    """Draw all looks as an MP4 file (H.264).

    Args:
        film: What to draw.
        path: The file.
        progress: Called with the number of pictures that are drawn.

    Raises:
        OutputError: The encoder is not installed, the cut cannot be drawn here, or the file not be written.
    """
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        raise OutputError("a video needs imageio-ffmpeg: pip install 'cutcal[view]', or leave the option out") from None
    own = path.with_name(f"draft-{path.name}")  # the encoder knows the format by the suffix
    with _drawing(path), replacing(path, draft=own) as draft, Stage(film, VIDEO_SIZE) as stage:
        writer = write_frames(str(draft), VIDEO_SIZE, fps=RATE, quality=7, ffmpeg_log_level="error")
        writer.send(None)
        try:
            for done, look in enumerate(film.looks, 1):
                writer.send(np.ascontiguousarray(stage.draw(look)))
                progress(done)
        finally:
            writer.close()


@contextmanager
def _drawing(path: Path) -> Iterator[None]:
    """Say in one line why a picture could not be drawn."""
    try:
        yield
    except (RuntimeError, ImportError) as e:
        why = str(e).splitlines()[0] if str(e) else type(e).__name__
        raise OutputError(
            f"{path}: cannot draw here ({why}); cutcal doctor tells what is missing. What was computed is written"
        ) from None
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror or e})") from None


def attempt() -> str:
    """Draw a ball, and say with what."""
    import pyvista

    _silence()
    plot: Any = pyvista.Plotter(off_screen=True, window_size=[64, 64])
    plot.set_background(PAPER)
    plot.add_mesh(pyvista.Sphere(), color=INK)
    dark = float((plot.screenshot(return_img=True).mean(axis=2) < 128).mean())
    window = type(plot.render_window).__name__
    plot.close()
    if not 0.1 < dark < 0.9:
        raise RuntimeError(f"a ball came out {dark:.0%} dark")
    return f"drawn without a screen by {window}"


def _silence() -> None:
    """Keep VTK from writing warnings, as that there is no screen, between the lines of a program."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)


def _mesh(points: np.ndarray, triangles: np.ndarray) -> Any:
    import pyvista

    return pyvista.PolyData.from_regular_faces(points, triangles)
