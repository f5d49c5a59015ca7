"""The solver: a Scene in, a ForceRecord out.

Importing this package imports neither Taichi nor SciPy; each name is loaded when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from mpm.taichi_environment import prepare_taichi

if TYPE_CHECKING:
    from mpm.output.record import ForceRecord
    from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
    from mpm.scene.errors import CutcalError, SceneError, SimulationError
    from mpm.scene.material import Material
    from mpm.scene.shapes import Shape

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

_PLACES = {
    "ForceRecord": "mpm.output.record",
    "CutcalError": "mpm.scene.errors",
    "SceneError": "mpm.scene.errors",
    "SimulationError": "mpm.scene.errors",
    "Material": "mpm.scene.material",
    "Shape": "mpm.scene.shapes",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for, and nothing before."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES.get(name, "mpm.scene")), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
