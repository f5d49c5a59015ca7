"""What is simulated: food, knife, board, motion and numerics as frozen, validated data in SI units.

Each name is loaded when it is first used: who needs the errors alone needs no SciPy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpm.scene.inclusions import Food, Inclusion, Parted
    from mpm.scene.motion import STEEPEST, Arm, Motion
    from mpm.scene.scene import BAND_CELLS, CONTACTS, PRECISIONS, EdgeLaw, Numerics, Scene
    from mpm.scene.tools import Board, Knife, Press

__all__ = [
    "BAND_CELLS",
    "CONTACTS",
    "PRECISIONS",
    "STEEPEST",
    "Arm",
    "Board",
    "EdgeLaw",
    "Food",
    "Inclusion",
    "Knife",
    "Motion",
    "Numerics",
    "Parted",
    "Press",
    "Scene",
]

_PLACES = {name: "mpm.scene.inclusions" for name in ("Food", "Inclusion", "Parted")}
_PLACES |= {name: "mpm.scene.tools" for name in ("Board", "Knife", "Press")}
_PLACES |= {name: "mpm.scene.motion" for name in ("STEEPEST", "Arm", "Motion")}


def __getattr__(name: str) -> Any:
    """Import what is asked for, and nothing before."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES.get(name, "mpm.scene.scene")), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
