"""The stone or the cavity of a food, in a cut that is asked for it."""

from __future__ import annotations

import math
from dataclasses import replace

from calib.errors import MaterialError
from calib.material.food import FoodSpec
from calib.table.units import metres
from mpm.scene import Inclusion, Scene
from mpm.scene.errors import SceneError

AS_USUAL = ""
"""Size of an inclusion that is that of the food."""
SIZES = 3  # length, width, height
STONE_MACH = 0.003
"""Largest speed of a blade that may meet a stone over that of the P-wave [-]: all of the fruit is set in motion at once
(docs/theory.md, "Stones and cavities")."""


def sizes_of(text: str) -> tuple[float, ...]:
    """Sizes of an inclusion from text such as ``17x33x24mm``.

    Args:
        text: Length, width and height; a unit stands after the last, or after each.

    Returns:
        Length across the blade, width along it and height [m], shape (3,).

    Raises:
        ValueError: It is no such text.
    """
    parts = text.lower().replace("\u00d7", "x").split("x")
    unit = parts[-1].lstrip("0123456789.eE+- ")
    values = tuple(metres(part if part[-1:].isalpha() else part + unit) for part in map(str.strip, parts))
    if len(values) != SIZES or not all(math.isfinite(v) and v > 0 for v in values):
        raise ValueError(text)
    return values


def inclusion(food: FoodSpec, name: str, height: float, given: str = AS_USUAL) -> Inclusion:
    """The stone or the cavity of a specimen.

    Args:
        food: The food.
        name: One of ``calib.material.properties.INCLUSIONS``.
        height: Of the specimen [m]: a larger one has a larger stone.
        given: Its size, as in :func:`sizes_of`; :data:`AS_USUAL` for that of the food.

    Returns:
        It, in the middle of the food.

    Raises:
        MaterialError: The food has none, or the size cannot be read.
    """
    if given:
        try:
            return Inclusion(*sizes_of(given))
        except ValueError:
            raise MaterialError(
                f"{name} {given!r}: write length x width x height, such as 17x33x24mm; the width is along the blade"
            ) from None
    if name not in food.inclusions:
        raise MaterialError(
            f"{food.name} has no {name} in its file; leave it out, or give its size (length x width x height, such as "
            "17x33x24mm)"
        )
    scale = height / food.dims["height"].value
    return Inclusion(**{size: scale * p.value for size, p in food.inclusions[name].items()})


def with_inclusions(scene: Scene, food: FoodSpec, stone: str | None = None, cavity: str | None = None) -> Scene:
    """The scene of a food with its stone or its cavity; a blade that may meet a stone moves slowly.

    Args:
        scene: The cut.
        food: The food.
        stone: Size of the stone as in :func:`inclusion`, or None to leave it out.
        cavity: Size of the cavity, likewise.

    Returns:
        The scene.

    Raises:
        MaterialError: The food has none, or a size cannot be read.
        SceneError: They do not lie within the food, or cells do not resolve the stone.
    """
    if stone is None and cavity is None:
        return scene
    held, height = scene.food, scene.food.shape.height
    if stone is not None:
        held = replace(held, stone=inclusion(food, "stone", height, stone))
    if cavity is not None:
        held = replace(held, cavity=inclusion(food, "cavity", height, cavity))
    scene = replace(scene, food=held)
    if scene.food.stone not in scene.food.crossed:
        return scene
    return replace(scene, motion=replace(scene.motion, mach=min(scene.motion.mach, STONE_MACH)))


def check_limit(scene: Scene) -> None:
    """Insist on a force limit where the blade is to go down on a stone: a rigid blade would crush the food with it.

    Args:
        scene: The cut.

    Raises:
        SceneError: There is none.
    """
    stone, shape = scene.food.stone, scene.food.shape
    if stone is None or stone not in scene.food.crossed or scene.arm.force_limit is not None:
        return
    if scene.motion.stroke > shape.height - stone.section_top(shape):
        raise SceneError(
            "stone: the blade goes down on it; say what the arm bears (--force-limit 60), end above it (--stroke), or "
            f"cut beside it (--at, {stone.length * 5e2:.1f} mm from the middle or more)"
        )
