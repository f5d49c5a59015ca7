"""The solver: a Scene in, a ForceRecord out. Importing this package does not import Taichi."""

from __future__ import annotations

import os

from mpm.output.record import ForceRecord
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import CutcalError, SceneError, SimulationError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

os.environ.setdefault("ENABLE_TAICHI_HEADER_PRINT", "0")  # stdout belongs to the caller
os.environ.setdefault("TI_SKIP_VERSION_CHECK", "ON")  # Taichi would tell its makers once a day that it was started

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
