"""The food across the blade's middle with blade and board, drawn into given axes."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.patches import Polygon

from mpm.output.section import Section
from mpm.scene import Knife
from reports.base.figures import BLACK, LIGHT

FILLING = 1.2  # of a particle's square, so that there are no gaps where the food is stretched


def draw_food(axes: Axes, section: Section, k: int, colour: ScalarMappable) -> None:
    """Draw the food, coloured by its stress.

    Args:
        axes: Where, in millimetres.
        section: The food across the blade's middle.
        k: Which of its looks.
        colour: Colours of the von Mises stress [kPa].
    """
    y, z, half = 1e3 * section.y[k], 1e3 * section.z[k], FILLING * 1e3 * section.size.T / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    shades = colour.to_rgba(section.mises[k] / 1e3)
    for sign in (1.0, -1.0) if section.mirrored else (1.0,):
        squares = np.stack([sign * y, z], axis=1)[:, None] + half[:, None] * corners
        axes.add_collection(
            PolyCollection(squares, facecolors=shades, edgecolors=shades, linewidths=0.2, rasterized=True)
        )


def draw_tools(axes: Axes, knife: Knife, edge: float, top: float) -> None:
    """Draw the blade above its edge, and the board.

    Args:
        axes: Where, in millimetres.
        knife: The blade.
        edge: Height of its edge above the board [m].
        top: Height of what is shown [m].
    """
    spine = knife.spine / 2
    full = min(spine / math.tan(knife.angle / 2), knife.height)
    up = min(edge + knife.height, 2 * top)
    outline = [(0.0, edge), (spine, edge + full), (spine, up), (-spine, up), (-spine, edge + full)]
    axes.add_patch(
        Polygon([(1e3 * y, 1e3 * z) for y, z in outline], facecolor="white", edgecolor=BLACK, lw=0.7, zorder=3)
    )
    axes.axhspan(-1e3 * top, 0.0, color=LIGHT, lw=0, zorder=0)
    axes.axhline(0.0, color=BLACK, lw=0.7, zorder=3)
