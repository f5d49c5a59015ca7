"""How fast the blade of a simulated cut runs: as slowly as it has to, for no law but relaxation follows the time."""

from __future__ import annotations

import math

from calib.material.food import FoodSpec
from calib.material.properties import BOW
from mpm.scene import Knife
from mpm.scene.shapes import Shape

MACH = 0.01
"""Largest speed of the blade over that of the P-wave [-]."""
FACE_MACH = 3e-4
"""Largest speed at which the blade's faces move the food aside over that of the P-wave [-]: what decides how far a cut
is from a slow one (docs/theory.md, "Time step and speed")."""
END_SPEED = 0.5
"""Part of its speed that a blade which is slow for its faces' sake keeps at the end of the stroke [-]."""


def quasi_static_mach(knife: Knife, shape: Shape) -> float:
    """Speed at which a blade cuts as if slowly, over the P-wave's [-]: the less, the thicker its wedge.

    A food that is cut off its middle tips under the edge, as nothing but its inertia holds it. So that one stays fast.
    """
    return MACH if shape.cut else min(MACH, FACE_MACH / math.tan(knife.angle / 2))


def screening_mach(food: FoodSpec, knife: Knife, shape: Shape) -> float:
    """Speed of a screening run over the P-wave's [-]: twice that of a default one, or the same.

    A food that may rest on its ends (:data:`calib.material.properties.BOW`) bends under the blade as slowly as its
    inertia lets it, and twice the speed leaves it no time to. A thick blade is slower already, for its faces' sake.

    Args:
        food: The food.
        knife: The blade.
        shape: The specimen.

    Returns:
        The speed.
    """
    mach = quasi_static_mach(knife, shape)
    bends = food.value(BOW) is not None and mach == MACH and not shape.cut
    return mach if bends else 2 * mach
