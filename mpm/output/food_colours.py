"""Colours of foods in pictures: of the skin, of the flesh on the face of a cut, and of what marks either."""

from __future__ import annotations

from dataclasses import dataclass

Colour = tuple[float, float, float]
"""Red, green and blue as a screen shows them, 0 to 1 [-]."""


@dataclass(frozen=True)
class FoodColours:
    """Colours of a food, chosen by eye.

    Attributes:
        skin: The skin.
        skin_marks: Spots, stripes or blush of the skin.
        flesh: The face of a cut.
        flesh_marks: Seeds, core or walls on it.
    """

    skin: Colour
    skin_marks: Colour
    flesh: Colour
    flesh_marks: Colour


FOOD_COLOURS = {
    "banana": FoodColours((0.93, 0.80, 0.22), (0.40, 0.26, 0.10), (0.98, 0.94, 0.76), (0.72, 0.60, 0.38)),
    "cucumber": FoodColours((0.13, 0.36, 0.13), (0.33, 0.55, 0.22), (0.80, 0.90, 0.62), (0.95, 0.96, 0.80)),
    "apple": FoodColours((0.75, 0.10, 0.12), (0.90, 0.70, 0.28), (0.98, 0.95, 0.80), (0.36, 0.20, 0.10)),
    "peach": FoodColours((0.97, 0.68, 0.40), (0.80, 0.22, 0.20), (0.99, 0.82, 0.50), (0.72, 0.25, 0.18)),
    "melon": FoodColours((0.72, 0.76, 0.46), (0.88, 0.86, 0.70), (0.98, 0.72, 0.42), (0.96, 0.86, 0.58)),
    "orange": FoodColours((0.97, 0.52, 0.08), (0.80, 0.36, 0.04), (0.99, 0.60, 0.12), (0.99, 0.90, 0.72)),
    "strawberry": FoodColours((0.85, 0.08, 0.12), (0.95, 0.80, 0.40), (0.96, 0.36, 0.36), (0.99, 0.86, 0.82)),
    "pear": FoodColours((0.74, 0.78, 0.28), (0.55, 0.42, 0.18), (0.98, 0.96, 0.84), (0.50, 0.34, 0.18)),
    "kiwi": FoodColours((0.46, 0.34, 0.18), (0.30, 0.21, 0.10), (0.50, 0.74, 0.22), (0.08, 0.08, 0.05)),
    "tomato": FoodColours((0.85, 0.13, 0.08), (0.93, 0.36, 0.12), (0.92, 0.33, 0.25), (0.97, 0.72, 0.42)),
    "lemon": FoodColours((0.96, 0.86, 0.16), (0.82, 0.70, 0.08), (0.98, 0.92, 0.52), (0.99, 0.98, 0.86)),
    "grape": FoodColours((0.32, 0.10, 0.32), (0.52, 0.36, 0.52), (0.74, 0.76, 0.48), (0.45, 0.30, 0.16)),
    "shine_muscat": FoodColours((0.64, 0.78, 0.28), (0.82, 0.88, 0.50), (0.88, 0.92, 0.66), (0.72, 0.80, 0.46)),
    "plum": FoodColours((0.36, 0.08, 0.26), (0.58, 0.42, 0.58), (0.92, 0.70, 0.28), (0.62, 0.32, 0.18)),
    "cherry": FoodColours((0.52, 0.02, 0.08), (0.70, 0.10, 0.14), (0.78, 0.20, 0.26), (0.80, 0.62, 0.46)),
    "potato": FoodColours((0.70, 0.56, 0.36), (0.45, 0.33, 0.20), (0.96, 0.91, 0.68), (0.90, 0.82, 0.52)),
}
"""By name in ``materials.yaml``."""
OTHER_COLOURS = FoodColours((0.80, 0.60, 0.40), (0.60, 0.42, 0.26), (0.95, 0.90, 0.80), (0.0, 0.0, 0.0))
"""Of a food that has none of its own."""


def food_colours(name: str) -> FoodColours:
    """Colours of a food.

    Args:
        name: Its name in ``materials.yaml``, or any other.

    Returns:
        Its own, or those of all others.
    """
    return FOOD_COLOURS.get(name, OTHER_COLOURS)
