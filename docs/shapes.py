"""Draw the foods with a form of their own, cut in the middle: python docs/shapes.py docs/shapes.png"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyvista

from calib.material.food import load_food
from calib.material.scene import Sizing, specimen
from mpm.output.surface import half_of
from mpm.scene.shapes import Shape

FOODS = (("banana", "bent", "#e8cf6a"), ("pear", "pear", "#a9b84a"), ("strawberry", "cone", "#c8322f"))
GAP, SPACING = 0.06, 1e-3  # between the halves, over the length; between the rings of a surface [m]
SIZE = (1200, 420)  # of the picture [pixels]
EYE = np.array([1.0, 0.15, 0.75])  # from where they are seen

MIDDLE = np.array([0.0, 0.0, 0.3])  # of what is seen, over the length


def halves(shape: Shape) -> pyvista.PolyData:
    """Both sides of a food, a little apart, scaled to a length of one."""
    parts = []
    for side in (-1.0, 1.0):
        half = half_of(shape, SPACING, side)
        points = half.points / shape.length + [0.0, side * GAP / 2, 0.0]
        parts.append(pyvista.PolyData.from_regular_faces(points, half.triangles))
    return parts[0].merge(parts[1])


def main(picture: Path) -> None:
    """One food beside the other."""
    plot = pyvista.Plotter(off_screen=True, window_size=list(SIZE), shape=(1, len(FOODS)), border=False)
    for k, (name, kind, colour) in enumerate(FOODS):
        plot.subplot(0, k)
        shape, _ = specimen(load_food(name), None, Sizing(kind))
        plot.add_mesh(halves(shape), color=colour, ambient=0.25, specular=0.2)
        plot.add_text(f"{name}, --shape {kind}", position=(0.05, 0.9), viewport=True, font_size=10, color="black")
        plot.camera_position = [tuple(MIDDLE + 5 * EYE), tuple(MIDDLE), (0.0, 0.0, 1.0)]
        plot.enable_parallel_projection()
        plot.camera.parallel_scale = 0.66
    plot.set_background("white", all_renderers=True)
    plot.enable_anti_aliasing("msaa", multi_samples=8, all_renderers=True)
    plot.screenshot(str(picture))
    plot.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
