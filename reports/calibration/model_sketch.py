"""The sketch of the simulated cut: food, blade, board, grid and planes of symmetry, with letters for the conditions."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from mpm.scene import Knife
from mpm.scene.shapes import Shape, surface
from reports.base.figures import BLACK, BLUE, GREY, LIGHT, RED, svg

POINTS = 121  # of an outline
BURIED = 0.45  # of the food's height, to which the blade is drawn
HEIGHT = 46.0  # of the sketch [mm]
ABOVE = 0.55  # room above the food, of its height
ROOM = 0.9  # least way to either side of the blade that is drawn, of the food's height: the letters take it
PATCH = 5  # cells of the grid that are drawn at most, in each direction
BESIDE, TALL = 0.45, 0.8  # of the food's half length and of its height, which they do not leave
FLESH = "#f3e3b3"


def sketch(shape: Shape, knife: Knife, dx: float, symmetric: tuple[bool, bool]) -> bytes:
    """The cut across and along the blade.

    Args:
        shape: The specimen.
        knife: The blade.
        dx: Cell of the grid [m].
        symmetric: Whether the middle of the blade (x = 0) and its plane (y = 0) are planes of symmetry.

    Returns:
        An SVG document.
    """

    def draw(figure: Figure) -> None:
        left, right = figure.subplots(1, 2, width_ratios=_ratio(shape), sharey=True)
        _across(left, shape, knife, dx)
        _along(right, shape, knife)
        if symmetric[1]:
            _symmetry(left, shape)
        if symmetric[0]:
            _symmetry(right, shape)
        for axes in (left, right):
            axes.axhspan(-1e3 * shape.height, 0.0, facecolor=LIGHT, edgecolor=GREY, hatch="////", lw=0.0, zorder=0)
            axes.axhline(0.0, color=BLACK, lw=1.0)
            axes.set(ylim=(-0.16e3 * shape.height, (1.0 + ABOVE) * 1e3 * shape.height), aspect="equal")
            axes.grid(visible=False)
        left.set_ylabel("height [mm]")

    return svg(draw, HEIGHT)


def _ratio(shape: Shape) -> tuple[float, float]:
    return max(shape.length, 2 * ROOM * shape.height), max(shape.width, 0.8 * shape.height)


def _across(axes: Axes, shape: Shape, knife: Knife, dx: float) -> None:
    """The food across the blade, with a patch of the grid."""
    y = np.linspace(*shape.ends, POINTS)
    _food(axes, y, *surface(shape, np.zeros_like(y), y))
    edge, spine = (1.0 - BURIED) * shape.height, knife.spine / 2
    full = min(spine / math.tan(knife.angle / 2), knife.height)
    top = min(edge + knife.height, (1.0 + 0.8 * ABOVE) * shape.height)
    wide = spine if edge + full <= top else (top - edge) * math.tan(knife.angle / 2)
    corners = [(0.0, edge), (wide, min(edge + full, top)), (wide, top), (-wide, top), (-wide, min(edge + full, top))]
    axes.add_patch(Polygon([(1e3 * a, 1e3 * b) for a, b in corners], facecolor="white", edgecolor=BLACK, lw=0.9))
    cell, corner = 1e3 * dx, (0.55e3 * y[0], 0.12e3 * shape.height)
    cells = max(1, min(PATCH, int(BESIDE * 1e3 * -y[0] / cell), int(TALL * 1e3 * shape.height / cell)))
    for k in range(cells + 1):
        axes.plot([corner[0], corner[0] + cells * cell], [corner[1] + k * cell] * 2, color=BLUE, lw=0.5)
        axes.plot([corner[0] + k * cell] * 2, [corner[1], corner[1] + cells * cell], color=BLUE, lw=0.5)
    h = 1e3 * shape.height
    _mark(axes, "A", (wide * 1e3, 1e3 * top), (0.30 * h, 1.30 * h))
    _mark(axes, "B", (wide * 5e2, (0.75 * top + 0.25 * edge) * 1e3), (0.62 * h, 1.12 * h))
    _mark(axes, "C", (0.0, 1e3 * edge), (0.42 * h, 0.42 * h))
    _mark(axes, "D", (0.0, 0.5e3 * edge), (0.30 * h, 0.14 * h))
    board = max(0.7e3 * y[-1], 0.62 * h)
    _mark(axes, "E", (board, 0.0), (board + 0.02 * h, 0.22 * h))
    axes.annotate("G", (corner[0] + cells * cell, corner[1] + cells * cell), color=BLUE, fontweight="bold",
                  xytext=(2, 1), textcoords="offset points")  # fmt: skip
    axes.annotate("", (-0.2 * h, 1.08 * h), (-0.2 * h, (1.0 + 0.8 * ABOVE) * h),
                  arrowprops={"arrowstyle": "-|>", "color": RED})  # fmt: skip
    reach = max(1.04e3 * y[-1], ROOM * h)
    axes.set_xlim(-reach, reach)
    axes.set_title("across the blade, y [mm]")


def _along(axes: Axes, shape: Shape, knife: Knife) -> None:
    """The food along the blade at the cut, with the edge."""
    x = np.linspace(-shape.width / 2, shape.width / 2, POINTS)
    _food(axes, x, *surface(shape, x, np.zeros_like(x)))
    edge, half, top = (1.0 - BURIED) * shape.height, knife.length / 2, (1.0 + 0.8 * ABOVE) * shape.height
    axes.add_patch(Rectangle((-1e3 * half, 1e3 * edge), 2e3 * half, 1e3 * (top - edge), facecolor="white",
                             edgecolor="none", alpha=0.65))  # fmt: skip
    axes.plot([-1e3 * half, 1e3 * half], [1e3 * edge] * 2, color=RED, lw=1.6)
    reach = 0.75 * max(shape.width, 0.8 * shape.height)
    axes.set_xlim(-1e3 * reach, 1e3 * reach)
    axes.set_title("along it, x [mm]")


def _food(axes: Axes, at: np.ndarray, bottom: np.ndarray, top: np.ndarray) -> None:
    known = np.isfinite(bottom) & np.isfinite(top)
    axes.fill_between(1e3 * at[known], 1e3 * bottom[known], 1e3 * top[known], facecolor=FLESH, edgecolor=BLACK, lw=0.8)


def _symmetry(axes: Axes, shape: Shape) -> None:
    axes.axvline(0.0, color=GREY, lw=0.9, dashes=(6.0, 1.5, 1.2, 1.5))
    axes.annotate("F", (0.0, -0.13e3 * shape.height), xytext=(3, 0), textcoords="offset points", fontweight="bold",
                  bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6})  # fmt: skip


def _mark(axes: Axes, letter: str, at: tuple[float, float], text: tuple[float, float]) -> None:
    """A letter with a line to what it stands for."""
    axes.annotate(letter, at, text, fontweight="bold", va="center",
                  arrowprops={"arrowstyle": "-", "lw": 0.6, "color": BLACK})  # fmt: skip
