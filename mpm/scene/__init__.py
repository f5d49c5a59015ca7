"""What is simulated: food, knife, board, motion and numerics as frozen, validated data in SI units."""

from mpm.scene.inclusions import Food, Inclusion, Parted
from mpm.scene.motion import STEEPEST, Arm, Motion
from mpm.scene.scene import (
    BAND_CELLS,
    CONTACTS,
    PRECISIONS,
    EdgeLaw,
    Numerics,
    Scene,
)
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
