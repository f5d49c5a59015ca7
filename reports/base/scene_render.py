"""Pictures of a cut, drawn without a screen: the food in its colours as it deforms, with knife and board."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from mpm.files import replacing
from mpm.output.food_colours import food_colours
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.scene.errors import OutputError
from reports.base.film import (
    AXES,
    MOMENTS,
    Film,
    View,
    blade_at,
    board,
    corners,
)
from reports.base.scene_sheet import Sheet, view_size

SIZE, VIDEO_SIZE = (1200, 900), (960, 720)  # of a picture and of a video [pixels]
STEEL, WOOD, PAPER, INK = "#8a9199", "#d9c4a0", "white", "black"
GLOSS = {"ambient": 0.3, "diffuse": 0.85, "specular": 0.35, "specular_power": 18.0}  # light on a skin
EVEN = {"ambient": 0.85, "diffuse": 0.2}  # light on the face of a cut: its colour is seen from all sides
SHARP = 40.0  # angle at rest between two triangles from which on their common side is an edge [degrees]
SAMPLES = 8  # colours found for a pixel
RATE = 15  # pictures of a video in a second


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
        skin, flesh = self._parts
        skin.move(points)
        flesh.move(points, film.surface.bare(look))
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
        self._triangles = np.array(self.mesh.regular_faces)

    def move(self, points: np.ndarray, seen: np.ndarray | None = None) -> None:
        """Put the vertices to where those of the whole surface (m, 3) are [m], and draw the triangles that are seen."""
        self.mesh.points = points[self._used]
        if seen is not None:
            self.mesh.regular_faces = self._triangles[seen]
        if self.mesh.n_cells:
            self.mesh.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False, inplace=True)


def stills(film: Film, folder: Path) -> list[Path]:
    """Draw the cut at contact, nearest to the largest force and at its end: contact.png, peak.png, end.png.

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
