"""What a food is put together of: parts of their kinds, and properties that need or exclude one another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calib.io.kinds import TEXT, check_kind
from calib.io.yaml_checks import Place
from calib.material.properties import ADHESION, LAYER_STIFFNESS, LAYERS, RELAXATION, RELAXING_BULK, Property

STRENGTHS = ("strength_ratio", "tensile_strength")
"""A food has one of them at most."""
BY_NAME = ((Mapping,), "a dict of values by name")
"""What holds properties or sizes, and in words."""
PROPERTY = ((Property,), "a Property")
"""What a property is, and in words."""


def check_parts(parts: Mapping[str, Any]) -> None:
    """Insist on the kinds of a food's parts, by name.

    Raises:
        CutcalError: One is of another kind.
    """
    check_kind("Food", "name", parts["name"], *TEXT)
    for name in ("dims", "properties", "inclusions"):
        check_kind("Food", name, parts[name], *BY_NAME)
        for of, value in parts[name].items():
            check_kind("Food", f"{name}[{of!r}]", value, *(BY_NAME if name == "inclusions" else PROPERTY))
    if parts["roundness"] is not None:
        check_kind("Food", "roundness", parts["roundness"], *PROPERTY)


def check_together(here: Place, properties: Mapping[str, Property]) -> None:
    """Refuse properties that do not go together.

    Args:
        here: Where the food is described.
        properties: Its properties, by name.

    Raises:
        MaterialError: One is missing that another one needs, or two say the same.
    """
    place = here.at("properties")
    if properties["skin_thickness"].value > 0.0 and "R_skin" not in properties:
        raise place.error("skin_thickness > 0 needs R_skin; give it, or skin_thickness 0")
    if all(name in properties for name in STRENGTHS):
        raise place.error("strength_ratio and tensile_strength are the same; give one of them")
    for size, resistance in (*LAYERS.items(), ADHESION, RELAXATION):
        have = [name for name in (size, resistance) if name in properties]
        if len(have) == 1:
            other = resistance if have[0] == size else size
            raise place.error(f"{have[0]} needs {other}; give both, or neither")
    if RELAXING_BULK in properties and "relaxing_share" not in properties:
        raise place.error(f"{RELAXING_BULK} is a part of relaxing_share; give that too")
    for size, stiffness in LAYER_STIFFNESS.items():
        if stiffness in properties and size not in properties:
            raise place.error(f"{stiffness} needs {size}; give it, and {LAYERS[size]}")
