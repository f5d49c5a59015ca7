"""What the two sides of a cut do to a blade that leaves its plane: they press on its face and hold it.

The solver's blade stays in its plane, so this is no part of it but a closed form: the face of the blade is a rigid
stamp on an elastic half-space, whose stiffness is beta E / (1 - nu^2) sqrt(A) for an area A (Barkan 1962, Dynamics of
Bases and Foundations; beta 1.06 for a square). It is bounded by what the food bears, its yield stress over that area.
The food is held on the board: it does not slide.
"""

from __future__ import annotations

import math

from mpm.scene import Knife, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import span

STAMP_FACTOR = 1.06
"""beta of a square stamp [-]; 1.1 for sides of 1 to 2."""
STABLE_STIFFNESS = 1.5e4
"""Most lateral stiffness that a step of 10 ms of the robot's physics bears behind the arm [N/m].

Foods of more than about 0.5 MPa would have more. The blade then leaves its plane by the arm's load over this.
"""


def face_area(scene: Scene, height: float) -> float:
    """Area of one face of the blade in the food [m^2].

    Args:
        scene: The cut.
        height: Of the edge above the board [m].
    """
    knife, (left, right) = scene.knife, span(scene.food.shape, 0.0)
    assert isinstance(knife, Knife)  # a live cut has no press
    depth = min(max(scene.food.shape.height - height, 0.0), knife.height)
    return depth * min(right - left, knife.length)


def lateral_force(material: Material, area: float, aside: float) -> float:
    """Force of the food on a blade that has left its plane [N].

    Args:
        material: Of the food.
        area: Of a face of the blade in the food [m^2].
        aside: How far the blade is beside its plane [m].

    Returns:
        The force along the way aside; it points back.
    """
    if area <= 0:
        return 0.0
    stiffness = min(STAMP_FACTOR * material.E / (1 - material.nu**2) * math.sqrt(area), STABLE_STIFFNESS)
    most = material.yield_stress * area if material.yield_stress else math.inf
    return -math.copysign(min(stiffness * abs(aside), most), aside)
