"""The picture of the cut: the food across the blade's middle, early, nearest to the largest force and at the end."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mpm.output.section import Section
from mpm.scene import Knife
from reports.base.figures import WIDTH, svg
from reports.base.section_figure import draw_food, draw_tools

EARLY = 0.2
"""Part of the stroke at which the first picture is taken."""
BRIGHT = 99.0
"""Percentile of the stress at which the colours end: few particles at the edge would darken all others."""
COLOURS = "cividis_r"  # as light as grey in print, and the same to readers who are colour-blind
DOTS = 220  # dots per inch of the particles, which are no vector graphics: some ten thousand of them
ABOUT = 0.8  # distance from the blade to which a glance goes, in heights of the food
MARGIN = 0.12  # room around the food, of its height
TALLEST = 52.0  # of one picture [mm]
LABELS = 14.0  # title and numbers of the axes, of a picture's height [mm]
LINE = 3.5  # one more line of a title, of a picture's height [mm]
LEAST = 18.0  # of one picture of several in a row [mm]
AXIS = 14.0  # numbers and label at the left of a picture [mm]
SCALE = 18.0  # scale of colours at the right, of a picture's width [mm]
BESIDE = (1.05, 0.0, 0.06, 0.94)  # place of a glance's scale: as tall as the picture with its pointed end, of its sizes


Glance = Callable[[Axes], None]


def moments(section: Section, stroke: np.ndarray, force: np.ndarray) -> list[tuple[int, str]]:
    """Which looks are shown, and what each is called: early, nearest to the largest force, at the end; none twice.

    Args:
        section: The looks.
        stroke: Strokes of the force curve [m], shape (n,).
        force: Simulated force [N], shape (n,).

    Returns:
        Index of each look, in the order of time, and its name.
    """
    nearest, title = _near_peak(section, stroke, force)
    peak = float(section.stroke[nearest])
    wanted = ((EARLY * float(section.stroke[-1]), ""), (peak, title), (math.inf, "at the end"))
    found: dict[int, str] = {}
    for at, name in wanted:
        k = int(np.argmin(np.abs(section.stroke - min(at, float(section.stroke[-1])))))
        found[k] = name or found.get(k, "")
    return sorted(found.items())


def _near_peak(section: Section, stroke: np.ndarray, force: np.ndarray) -> tuple[int, str]:
    """The look nearest to the largest force, and what it is called: that, or where the largest force is."""
    peak = float(stroke[int(np.argmax(force))])
    k = int(np.argmin(np.abs(section.stroke - peak)))
    at, there = (f"{1e3 * place:.1f}" for place in (section.stroke[k], peak))
    return k, "largest force" if at == there else f"near the\nlargest force at {there} mm"


def cut(section: Section, knife: Knife, height: float, stroke: np.ndarray, force: np.ndarray) -> list[bytes]:
    """Pictures of the food under the blade, coloured by its von Mises stress: one for each look, in one scale.

    Args:
        section: The food across the blade's middle.
        knife: The blade.
        height: Height of the food [m].
        stroke: Strokes of the simulated curve [m], shape (n,).
        force: Its forces [N], shape (n,).

    Returns:
        SVG documents, each with the scale of the colours, for they may stand on two pages: one for each look of a long
        food, one for all of a short one.
    """
    shown = moments(section, stroke, force)
    half = float(np.abs(section.y[[k for k, _ in shown]]).max()) + MARGIN * height
    top = height * (1 + 3 * MARGIN)
    slender = (top + MARGIN * height) / (2 * half)
    colour = _colours(section, stroke, force)

    def draw(figure: Figure, looks: Sequence[tuple[int, str]]) -> None:
        panels = list(figure.subplots(1, len(looks), squeeze=False).flat)
        for axes, (k, name) in zip(panels, looks, strict=True):
            draw_food(axes, section, k, colour)
            draw_tools(axes, knife, height - float(section.stroke[k]), top)
            at = 1e3 * float(section.stroke[k])
            axes.set_title(f"{at:.1f} mm deep" + (f", {name}" if name else ""))
            axes.set(xlim=(-1e3 * half, 1e3 * half), ylim=(-1e3 * MARGIN * height, 1e3 * top), aspect="equal")
            axes.grid(visible=False)
            axes.set(xlabel="across the blade [mm]", ylabel="height [mm]")
        figure.colorbar(colour, ax=panels, location="right", aspect=20, extend="max", label="von Mises stress [kPa]")

    def tall(count: int) -> float:
        return min((WIDTH - SCALE - AXIS * count) / count * slender, TALLEST)

    rows = [shown] if tall(len(shown)) >= LEAST else [[look] for look in shown]
    titles = [max(name.count("\n") for _, name in row) for row in rows]
    return [
        svg(partial(draw, looks=row), tall(len(row)) + LABELS + LINE * more)
        for row, more in zip(rows, titles, strict=True)
    ]


def _colours(section: Section, stroke: np.ndarray, force: np.ndarray) -> ScalarMappable:
    """The one scale of all pictures of a cut: to the stress that few particles of the moments shown exceed."""
    most = float(np.percentile(section.mises[[k for k, _ in moments(section, stroke, force)]], BRIGHT)) or 1.0
    return ScalarMappable(Normalize(0.0, most / 1e3), COLOURS)


def glance(section: Section, knife: Knife, height: float, stroke: np.ndarray, force: np.ndarray) -> Glance:
    """What draws the food about the blade, in the look nearest to the largest force, into given axes.

    Args:
        section: The food across the blade's middle.
        knife: The blade.
        height: Height of the food [m].
        stroke: Strokes of the simulated curve [m], shape (n,).
        force: Its forces [N], shape (n,).

    Returns:
        What draws it.
    """
    k, title = _near_peak(section, stroke, force)
    half = min(float(np.abs(section.y[k]).max()) + MARGIN * height, ABOUT * height)
    colour = _colours(section, stroke, force)

    def draw(axes: Axes) -> None:
        top = height * (1 + 3 * MARGIN)
        draw_food(axes, section, k, colour)
        draw_tools(axes, knife, height - float(section.stroke[k]), top)
        axes.set(xlim=(-1e3 * half, 1e3 * half), ylim=(-1e3 * MARGIN * height, 1e3 * top), aspect="equal")
        axes.set(xlabel="across the blade [mm]", ylabel="height [mm]")
        axes.set_title(f"{1e3 * float(section.stroke[k]):.1f} mm deep, {title}", loc="right")
        axes.grid(visible=False)
        scale = axes.inset_axes(BESIDE)
        axes.figure.colorbar(colour, cax=scale, extend="max", label="von Mises stress [kPa]")

    return draw
