"""The solver: a Scene in, a ForceRecord out. Importing this package does not import Taichi."""

from __future__ import annotations

from mpm.output.record import ForceRecord
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import CutcalError, SceneError, SimulationError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.taichi_environment import prepare_taichi

prepare_taichi()

__all__ = [
    "Board",
    "CutcalError",
    "EdgeLaw",
    "Food",
    "ForceRecord",
    "Knife",
    "Material",
    "Motion",
    "Numerics",
    "Scene",
    "SceneError",
    "Shape",
    "SimulationError",
]
