"""What stands around the picture of a cut: its words, the stress across the blade, the forces, and a scale bar."""

from __future__ import annotations

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mpm.output.snapshot import Snapshot
from mpm.scene import Knife
from reports.base.figures import BLACK, GREY, RED, STYLE
from reports.base.film import COLOURS, Film, View, board
from reports.base.section_figure import draw_food, draw_tools

INCHES = (12.0, 9.0)  # of a sheet, whatever its pixels: letters keep their part of it
HEAD = 0.3  # of the sheet's height, above the picture
BARS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)  # lengths of a scale bar [m]
PART = 0.4  # of the food's length that a scale bar may have
ABOUT = 0.9  # distance from the blade that the section shows, in heights of the food
ABOVE = 1.25  # height that it shows, in heights of the food
LETTERS = 12.0  # size of letters [points]
APART = "pieces drawn apart\nto show the face of the cut"


def view_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of the picture on a sheet of a size [pixels]."""
    return size[0], round(size[1] * (1.0 - HEAD))


def bar_length(length: float) -> float:
    """Length of the scale bar beside a food [m].

    >>> bar_length(0.15), bar_length(0.022)
    (0.05, 0.005)

    Args:
        length: That of the food [m].
    """
    return max((bar for bar in BARS if bar <= PART * length), default=BARS[0])


def bar_ends(film: Film) -> np.ndarray:
    """Where the scale bar begins and ends, on the board before the food and along it [m], shape (2, 3)."""
    _, front, low, _, _, top = board(film)
    x, y = 0.4 * front + 0.6 * film.scene.food.shape.width / 2, low + 0.05 * film.scene.food.shape.length
    return np.array([[x, y, top], [x, y + bar_length(film.scene.food.shape.length), top]])


def numbers(film: Film, look: Snapshot) -> tuple[str, str, str]:
    """Stroke and force of a look, and the largest force of the cut: no look need be where that is."""
    _, stroke, force = film.peak
    return (
        f"stroke {look.stroke * 1e3:.1f} mm",
        f"force {film.force_at(look):.2f} N",
        f"largest {force:.2f} N at {stroke * 1e3:.1f} mm",
    )


class Sheet:
    """Lays out pictures of a film.

    Args:
        film: What is drawn.
        view: Where things are in its pictures.
        size: Width and height of a sheet [pixels].
    """

    def __init__(self, film: Film, view: View, size: tuple[int, int]) -> None:
        self._film, self._view, self._size = film, view, size

    def draw(self, picture: np.ndarray, look: Snapshot, *, apart: bool) -> np.ndarray:
        """A sheet.

        Args:
            picture: The scene at this look, of the view's size, shape (height, width, 3) [0 to 255].
            look: The look.
            apart: Whether it shows the pieces drawn apart.

        Returns:
            Shape (height, width, 3), 0 to 255.
        """
        with style.context(["default", STYLE, {"font.size": LETTERS, "axes.labelsize": LETTERS}]):
            figure = Figure(figsize=INCHES, dpi=self._size[0] / INCHES[0])
            canvas = FigureCanvasAgg(figure)
            self._words(figure, look, apart)
            self._section(figure, look)
            self._forces(figure.add_axes((0.7, 0.785, 0.275, 0.165)), look)
            figure.figimage(picture, zorder=-1)
            self._bar(figure.add_axes((0.0, 0.0, 1.0, self._view.size[1] / self._size[1])))
            canvas.draw()
            out: np.ndarray = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        return out

    def _words(self, figure: Figure, look: Snapshot, apart: bool) -> None:
        film = self._film
        name = film.food.replace("_", " ")
        figure.text(0.02, 0.945, name[:1].upper() + name[1:], fontsize=20, fontweight="bold", va="top")
        figure.text(0.02, 0.89, f"{film.scene.knife.name} knife", va="top", color=GREY)
        figure.text(0.02, 0.855, "\n".join(numbers(film, look)), va="top", linespacing=1.4)
        if apart:
            figure.text(0.02, 0.765, APART, va="top", color=GREY, fontsize=10)

    def _section(self, figure: Figure, look: Snapshot) -> None:
        """The stress about the blade, in the section across its middle."""
        film, shape = self._film, self._film.scene.food.shape
        colour = ScalarMappable(Normalize(0.0, film.largest / 1e3), COLOURS)
        axes = figure.add_axes((0.26, 0.735, 0.27, 0.215))
        k = next(k for k, own in enumerate(film.looks) if own is look)
        draw_food(axes, film.section, k, colour)
        assert isinstance(film.scene.knife, Knife)  # a press cuts nothing
        draw_tools(axes, film.scene.knife, shape.height - look.stroke, ABOVE * shape.height)
        reach = 1e3 * shape.height
        axes.set(xlim=(-ABOUT * reach, ABOUT * reach), ylim=(-0.08 * reach, ABOVE * reach), aspect="equal", anchor="C")
        axes.set_title("section across the blade", fontsize=LETTERS, fontweight="normal", loc="center")
        axes.set_axis_off()
        scale = figure.add_axes((0.55, 0.755, 0.012, 0.155))
        figure.colorbar(colour, cax=scale, extend="max")
        steps = np.linspace(0.0, film.largest / 1e3, 4)
        scale.set_yticks(steps, [f"{step:.3g}" for step in steps])
        figure.text(0.545, 0.945, "von Mises [kPa]", va="center", ha="left")

    def _forces(self, axes: Axes, look: Snapshot) -> None:
        """Force over stroke, and where this look is."""
        film = self._film
        axes.plot(film.stroke * 1e3, film.force, color=BLACK, lw=1.4)
        axes.plot([look.stroke * 1e3], [film.force_at(look)], "o", color=RED, ms=9, clip_on=False, zorder=3)
        axes.set(xlabel="stroke [mm]", ylabel="force [N]", xlim=(0.0, None))
        axes.set_ylim(min(0.0, float(film.force.min())), None)

    def _bar(self, axes: Axes) -> None:
        """A bar of round length on the board, over the picture."""
        (left, low), (right, high) = ends = self._view.pixels(bar_ends(self._film))
        width, height = self._view.size
        axes.plot(*ends.T, color=BLACK, lw=4.0, solid_capstyle="butt")
        length = bar_length(self._film.scene.food.shape.length)
        turn = float(np.rad2deg(np.arctan2(high - low, right - left)))
        place = ((left + right) / 2, (low + high) / 2 - 0.02 * height)
        axes.text(*place, f"{1e3 * length:g} mm", rotation=turn, rotation_mode="anchor", ha="center", va="top")
        axes.set(xlim=(0, width), ylim=(0, height))
        axes.set_axis_off()
