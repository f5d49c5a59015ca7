"""The table that a stone begins with."""

from __future__ import annotations

import numpy as np

from mpm.scene import Food
from mpm.state import tables as row

REACH = 0.71
"""By how much the nodes that move with a stone exceed it [cells]: where nodes up to a plane are held, the velocity is
that of a wall 0.71 cells behind them in the mean (docs/theory.md, "Stones and cavities")."""


def stone_table(food: Food, dx: float) -> np.ndarray:
    """The table of the stone of a food at rest.

    Args:
        food: The food.
        dx: Cell [m].

    Returns:
        Shape (N_STONE,), rows as in :mod:`mpm.state.tables`; empty where there is no stone.
    """
    if food.stone is None:
        return np.zeros(0)
    out = np.zeros(row.N_STONE)
    out[row.STONE_MIDDLE : row.STONE_TURN] = food.stone.middle(food.shape)
    out[row.STONE_TURN : row.STONE_AXES] = food.stone.rotation.ravel()
    out[row.STONE_AXES : row.STONE_VELOCITY] = food.stone.half_axes
    out[row.STONE_REACH] = REACH * dx
    out[row.STONE_HALF] = half_of_stone(food)
    out[row.STONE_MET] = -1.0
    return out


def half_of_stone(food: Food) -> int:
    """Half of the food that its stone belongs to, 0 left, 1 right, that of its middle; -1 for both where that lies in
    the blade's plane, or where there is none."""
    if food.stone is None:
        return -1
    off = food.stone.middle(food.shape)[1]
    return -1 if off == 0 else int(off > 0)
