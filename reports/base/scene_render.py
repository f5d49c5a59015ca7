"""Pictures of a cut, drawn without a screen: the food in its colours as it deforms, with knife and board."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpm.discretisation.particles import Seeds
from mpm.files import replacing
from mpm.output.food_colours import food_colours
from mpm.output.record import ForceRecord
from mpm.output.section import Section, section_of
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.scene import Knife, Scene
from mpm.scene.errors import OutputError

if TYPE_CHECKING:
    from mpm.solver import Simulation

COLOURS = "YlOrRd"  # falls evenly in lightness, so it can be read in grey and by the colour-blind
SIZE, VIDEO_SIZE = (1200, 900), (960, 720)  # of a picture and of a video [pixels]
SHOWN = 0.98  # part of the food's surface whose stress is within the colours when it is largest
FRAME = 1.15  # of the board beside the blade, in heights or widths of the food, whichever is larger
EYE = np.array([1.0, -0.8, 0.55])  # from where it is seen
BLADE = 1.4  # length of the blade that is drawn, in widths of the food, where it is longer
APART = 1.05  # by which the pieces are drawn apart, in widths of the food: the blade hides nothing of the face then
ROOM = 1.06  # of the picture around what it shows, as a factor
STEEL, WOOD, PAPER, INK = "#8a9199", "#d9c4a0", "white", "black"
GLOSS = {"ambient": 0.3, "diffuse": 0.85, "specular": 0.35, "specular_power": 18.0}  # light on a skin
EVEN = {"ambient": 0.85, "diffuse": 0.2}  # light on the face of a cut: its colour is seen from all sides
STEPS = 3  # between the numbers at the scale of colours
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # what a step may begin with
MOMENTS = ("contact", "peak", "end")
SHARP = 40.0  # angle at rest between two triangles from which on their common side is an edge [degrees]
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
        food: Name of the food, which its colours go by.
        scene: What was simulated.
        surface: The food's surface.
        seeds: Its particles at rest.
        looks: What was seen of it, in the order of time.
        time: Simulated time of the record [s], shape (n,).
        stroke: Stroke of the record [m], shape (n,).
        force: Upward force on the knife [N], shape (n,).
    """

    food: str
    scene: Scene
    surface: Surface
    seeds: Seeds
    looks: Sequence[Snapshot]
    time: np.ndarray
    stroke: np.ndarray
    force: np.ndarray

    @staticmethod
    def of(food: str, simulation: Simulation, looks: Sequence[Snapshot], record: ForceRecord) -> Film:
        """That of a run that has ended.

        Args:
            food: Name of the food.
            simulation: What has run.
            looks: What was kept of it, one look at least.
            record: Its forces.

        Returns:
            What is drawn of it.
        """
        scene, seeds = simulation.scene, simulation.setup.seeds
        surface = Surface(scene.food.shape, seeds, scene.mirrors)
        return Film(food, scene, surface, seeds, looks, record.time, record.stroke, record.resolved)

    @cached_property
    def section(self) -> Section:
        """The food across the blade's middle at each of the looks."""
        return section_of(self.looks, self.seeds, self.scene.mirrors)

    @cached_property
    def largest(self) -> float:
        """Stress at the end of the colours [Pa]: three steps of a round number."""
        values = [float(np.quantile(self.surface.values(look.mises), SHOWN)) for look in self.looks]
        return STEPS * round_up(max([*values, 1.0]) / STEPS)

    def force_at(self, look: Snapshot) -> float:
        """Upward force on the knife at a look [N]."""
        return float(np.interp(look.time, self.time, self.force))

    def parted(self, look: Snapshot) -> bool:
        """Whether the cut has passed all of the food's section."""
        return bool(np.all(self.surface.cut(look)[self.surface.face]))

    def apart(self, look: Snapshot) -> np.ndarray:
        """Vertices (m, 3) [m] of the surface with the piece behind the blade drawn back, so that its cut face is
        seen."""
        points = self.surface.points(look)
        points[self.surface.second :, 1] += APART * self.scene.food.shape.width
        return points

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


@dataclass(frozen=True)
class View:
    """A picture without perspective: which place of the scene is where in it.

    Attributes:
        middle: What its middle shows, along the picture's width and height and towards the eye [m], shape (3,).
        scale: Pixels in a metre.
        size: Its width and height [pixels].
    """

    middle: np.ndarray
    scale: float
    size: tuple[int, int]

    @staticmethod
    def around(points: np.ndarray, size: tuple[int, int]) -> View:
        """The one that shows all of some places (n, 3) [m], as large as it can."""
        seen = points @ AXES.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        scale = float(np.min(np.array(size) / (high - low)[:2])) / ROOM
        return View((low + high) / 2, scale, size)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Where places (n, 3) [m] are, from the picture's lower left corner [pixels], shape (n, 2)."""
        out: np.ndarray = (points @ AXES.T - self.middle)[:, :2] * self.scale + np.array(self.size) / 2
        return out


def _axes() -> np.ndarray:
    """Directions of a picture's width and height and towards the eye, shape (3, 3)."""
    back = EYE / np.linalg.norm(EYE)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back])


AXES = _axes()


class Stage:
    """Draws the looks of a film, one after the other.

    Args:
        film: What to draw.
        size: Width and height [pixels].
    """

    def __init__(self, film: Film, size: tuple[int, int] = SIZE) -> None:
        import pyvista

        from reports.base.scene_sheet import Sheet, view_size

        _silence()
        self.film = film
        own = view_size(size)
        plot: Any = pyvista.Plotter(off_screen=True, window_size=list(own))
        plot.set_background(PAPER)
        plot.enable_anti_aliasing("msaa", multi_samples=SAMPLES)
        self._plot = plot
        self._setting()
        self.view = self._camera(own)
        self._sheet = Sheet(film, self.view, size)

    def __enter__(self) -> Stage:
        return self

    def __exit__(self, *raised: object) -> None:
        self._plot.close()

    def _setting(self) -> None:
        """Board, food and blade."""
        import pyvista

        film, plot = self.film, self._plot
        plot.add_mesh(pyvista.Box(board(film)), color=WOOD, ambient=0.25)
        colours, surface = food_colours(film.food), film.surface
        # skin and faces have vertices of their own: their light would run into each other along the rim, like a groove
        self._parts = [_Part(surface, triangles) for triangles in surface.parts]
        for part, colour, light in zip(self._parts, (colours.skin, colours.flesh), (GLOSS, EVEN), strict=True):
            plot.add_mesh(part.mesh, color=colour, smooth_shading=True, split_sharp_edges=False, **light)
        self._knife = _mesh(*blade_at(film.scene, film.looks[0]))
        plot.add_mesh(self._knife, color=STEEL, ambient=0.35, specular=0.4)

    def _camera(self, size: tuple[int, int]) -> View:
        """Look at all that there is at any time."""
        film = self.film
        shown = [corners(board(film)), film.apart(film.looks[-1]), *(film.surface.points(look) for look in film.looks)]
        shown += [blade_at(film.scene, look)[0] for look in film.looks]
        view = View.around(np.concatenate(shown), size)
        middle, camera = view.middle @ AXES, self._plot.camera
        far = 10 * float(np.ptp(np.concatenate(shown), axis=0).max())
        self._plot.camera_position = [tuple(middle + far * AXES[2]), tuple(middle), (0.0, 0.0, 1.0)]
        self._plot.enable_parallel_projection()
        camera.parallel_scale = size[1] / 2 / view.scale
        camera.clipping_range = (0.1 * far, 2 * far)
        return view

    def draw(self, look: Snapshot, *, apart: bool = False) -> np.ndarray:
        """One look as an image.

        Args:
            look: The look, one of the film.
            apart: Whether pieces that are parted are drawn apart.

        Returns:
            Shape (height, width, 3), 0 to 255.
        """
        film, scene = self.film, self.film.scene
        apart = apart and film.parted(look)
        points = film.apart(look) if apart else film.surface.points(look)
        for part in self._parts:
            part.move(points)
        self._knife.points = blade_at(scene, look)[0]
        self._plot.render()
        return self._sheet.draw(self._plot.screenshot(return_img=True), look, apart=apart)


class _Part:
    """A part of the food's surface with a colour of its own."""

    def __init__(self, surface: Surface, triangles: np.ndarray) -> None:
        used, own = np.unique(triangles, return_inverse=True)
        whole = _mesh(surface.rest[used], own.reshape(triangles.shape))
        whole["vertex"] = used
        self.mesh = whole.compute_normals(
            cell_normals=False, split_vertices=True, feature_angle=SHARP, consistent_normals=False
        )
        self._used = np.array(self.mesh["vertex"])

    def move(self, points: np.ndarray) -> None:
        """Put the vertices to where those of the whole surface (m, 3) are [m]."""
        self.mesh.points = points[self._used]
        self.mesh.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)


def board(film: Film) -> tuple[float, float, float, float, float, float]:
    """Ends of the board along x, y and z [m]: as large as the food, with room to draw the pieces apart."""
    shape = film.scene.food.shape
    near, room = FRAME * max(shape.width, shape.height), 0.15 * shape.width
    low, high = shape.ends
    return -0.7 * near, 0.85 * near, low - room, high + room + APART * shape.width, -0.12 * near, -1e-5


def corners(ends: tuple[float, float, float, float, float, float]) -> np.ndarray:
    """Corners (8, 3) of a box with given ends along x, y and z [m]."""
    x, y, z = np.array(ends).reshape(3, 2)
    return np.stack(np.meshgrid(x, y, z), axis=-1).reshape(-1, 3)


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
            imsave(path, stage.draw(look, apart=look is film.looks[-1]))
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
