"""The robot's arm behind the knife: its mass in a scaled motion, and where its way ends."""

from __future__ import annotations

import math

from mpm.material import Material
from mpm.scene import Scene
from mpm.shapes import section_area

ON_BOARD = 1e-9  # height at which the edge is on the board [m]


def arm_mass(scene: Scene, material: Material, stiffness: float) -> float:
    """Mass of the arm [kg]: as slow as the food's first axial mode, not lighter than the food beside the blade.

    The real mass is immaterial: in a quasi-static cut the arm's inertia has no part in the force.
    """
    shape = scene.food.shape
    period = 4 * shape.height / material.p_wave
    layer = material.rho * 2 * scene.numerics.dx * section_area(shape)
    return max(stiffness * (period / (2 * math.pi)) ** 2, layer)


def pressed_home(scene: Scene, rows: list[list[float]]) -> bool:
    """Whether an arm that yields presses the edge on the board, and nothing is left to cut nor to come back from.

    Args:
        scene: The scene.
        rows: Rows of the record so far, the stroke first [m].
    """
    motion, height = scene.motion, scene.food.shape.height
    down = len(rows) > 1 and all(row[0] > height - ON_BOARD for row in rows[-2:])
    return down and motion.stroke > height and motion.retract == 0
