"""The form of a specimen where nobody says it: how much of a cylinder it is, and how much of an ellipsoid.

A food whose anatomy leaves that open has a ``roundness`` with a range in ``materials.yaml``. Its form is one number
between two that are drawn everywhere (:func:`mpm.scene.profiles.barrel_radius`), so that a fit can ask for it.
"""

from __future__ import annotations

from dataclasses import replace

from calib.errors import MaterialError
from calib.material.food import FoodSpec
from calib.material.properties import Property
from mpm.scene.profiles import FAMILY

ROUNDNESS, ASPECT = "roundness", "aspect"
"""Names of the parameters."""

ASPECT_SPAN = 1.25
"""Largest width over height of a specimen, over the likely one, and the likely one over the least [-]: half fruits that
were cut at 0.4 to 0.6 of their diameter (assumed). That of a width over all sizes of a food would be too wide."""

UNUSUAL = 1.25
"""Stroke over the largest usual height of a food from which on it is said [-]."""


def unusual_stroke(food: FoodSpec, stroke: float, source: str) -> list[str]:
    """Whether a stroke is longer than the food is usually high, one sentence or none.

    Args:
        food: The food.
        stroke: Length of the stroke [m].
        source: Where it comes from: ``position``, ``speed`` or ``height``.

    Returns:
        The sentence, with what may be wrong.
    """
    most = food.dims["height"].high
    if source == "height" or stroke <= UNUSUAL * most:
        return []
    what = "its unit" if source == "position" else "the speed, and whether the knife stood before it went up (--t-end)"
    return [
        f"the stroke of {1e3 * stroke:.0f} mm is longer than {food.name.replace('_', ' ')} is usually high "
        f"({1e3 * most:.0f} mm at most): check {what}, or give --height"
    ]


def known_of(food: FoodSpec, name: str) -> Property:
    """What the literature says of a property of a food, of a size, or of its width over its height.

    Args:
        food: The food.
        name: What may be fitted.

    Returns:
        The property.
    """
    if name != ASPECT:
        return {**food.properties, **food.sizes}[name]
    width, height = food.dims["width"], food.dims["height"].value
    likely = width.value / height
    source = f"width over height, its spread assumed; width: {width.source}"
    return Property(ASPECT, likely, likely / ASPECT_SPAN, likely * ASPECT_SPAN, "-", source, "assumed")


def open_shape(food: FoodSpec) -> str:
    """The food's shape at its roundness, as ``mpm.scene.shapes.named`` reads it.

    Raises:
        MaterialError: The food does not leave its shape open.
    """
    if food.roundness is None:
        raise MaterialError(
            f"--fit {ROUNDNESS}: the shape of {food.name} is not open; leave it out, or give the shape a {ROUNDNESS} "
            "in a file of the food"
        )
    return f"{FAMILY[food.shape_kind]}:{food.roundness.value!r}"


def with_roundness(food: FoodSpec, value: float, *, status: str, source: str) -> FoodSpec:
    """The food as a barrel of another roundness; the range stays.

    Args:
        food: The food.
        value: The roundness [-].
        status: ``given`` or ``fitted``.
        source: Where it comes from.

    Returns:
        The food.

    Raises:
        MaterialError: The food does not leave its shape open, or an impossible value.
    """
    kind, _, _ = open_shape(food).partition(":")
    assert food.roundness is not None  # or its shape is not open
    return replace(food, shape_kind=kind, roundness=replace(food.roundness, value=value, status=status, source=source))
