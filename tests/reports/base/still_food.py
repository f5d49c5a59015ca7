"""A food with a blade over it, as a film of it, without a run."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from mpm.discretisation.particles import seed
from mpm.output.snapshot import Snapshot
from mpm.output.surface import Surface
from mpm.scene import Scene
from reports.base.film import Film

Moved = Callable[[int, np.ndarray], np.ndarray]
"""Number of a look and places of the particles at rest (n, 3) [m]; returns their places then."""


def still_food(
    name: str,
    strokes: Sequence[float],
    moved: Moved | None = None,
    stressed: Moved | None = None,
    *,
    dx: float | None = None,
) -> Film:
    """A default food under the ``edc`` knife, severed above the edge, with a force that rises with the stroke.

    Args:
        name: Name of the food.
        strokes: Those of the looks [m].
        moved: Where the particles are at each look; None for at rest.
        dx: Cell size [m]; None for the default.
        stressed: Their stress [Pa], shape (n,), by the same arguments; None for none.

    Returns:
        The film.
    """
    food = FoodSpec.load(name)
    scene: Scene = cut_scene(food, food.to_scene_food().shape, load_knife("edc"), dx=dx)
    seeds = seed(scene)
    top, looks = scene.food.shape.height, []
    for k, stroke in enumerate(strokes):
        x = seeds.x if moved is None else moved(k, seeds.x)
        stress = np.zeros(len(x)) if stressed is None else stressed(k, seeds.x)
        looks.append(Snapshot(float(k), stroke, 0.0, x, stress, seeds.x[:, 2] > top - stroke))
    way = np.array(strokes, float)
    surface = Surface(scene.food.shape, seeds, scene.mirrors)
    return Film(name, scene, surface, seeds, looks, np.arange(len(way), dtype=float), way, 1e3 * way)
