"""What the fields of a cut begin with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

# Columns of the tables of particles and of slices that a run begins with.
POSITION, BOARD_GAP, TOOL_GAP, VOLUME_RATIO, SURFACE_VOLUME, ADHERING = 0, 3, 4, 5, 6, 8
N_PARTICLE = 9
TOP_HIGH, TOP_LOW, WIDTH, FLOOR_HIGH, FLOOR_LOW, SOFTENING, TOP_TOUGHNESS, TOP_POWER, FLOOR_POWER = range(9)
STARTED = 9
N_SLICE = 10
# Columns of the table of ties: left and right particle, toughness, part of the section over a square of the spacing,
# part of the tie that was cut before.
LEFT, RIGHT, TOUGHNESS, SHARE, CUT_BEFORE = range(5)
N_TIE = 5
# Columns of the table of the skin's points: position, two vectors in the skin, area, half, tie beside them, length that
# crosses the cut plane there.
SKIN_POSITION, SKIN_SIDES, SKIN_AREA, SKIN_HALF, SKIN_TIE, SKIN_LENGTH = 0, 3, 9, 10, 11, 12
N_SKIN = 13


@dataclass(frozen=True, eq=False)
class Contents:
    """What the fields of one cut begin with.

    Attributes:
        nodes: Grid nodes along x, y, z.
        plane: Index of the node plane along y that is nearest to y = 0: the mirror plane across y where there is one.
        between: Whether the mirror plane across x lies half-way between the first nodes and their images and not on the
            first nodes.
        particles: Table, shape (n, N_PARTICLE): position in the grid's axes, distances at which board and tool are met
            [m], volume over that of a particle beside the cut [-], reference volumes before the board and before the
            tool [m^3], 0 for a surface that can stick, -2 in a stone and -1 for others.
        slices: Table, shape (m, N_SLICE): outline of the food in each slice [m], the way over which the edge's
            resistance falls [m], the toughness below its upper surface [J/m^2], the powers with which upper and
            lower surface are passed [-], and the force at which a cut has started there before [N/m], 0 where none has.
        parameters: Shape (N_PARAMETERS,), rows as in :mod:`mpm.state.tables`.
        pose: Of the tool, shape (N_POSE,), rows as in :mod:`mpm.state.tables`.
        relaxation: Share of each Prony branch [-], and time step over its time [-], shape (2, branches).
        ties: Table of the ties across the cut plane, shape (k, N_TIE): left and right particle, -1 for a mirror image,
            toughness [J/m^2], part of the section over a square of the spacing [-], and part that was cut before [-];
            none without a cohesive crack.
        tie_rows: Of the rows of each tie from below, toughness [J/m^2], then part of the section over that of a whole
            row [-], shape (k, 2 rows).
        skin: Table of the skin's points, shape (m, N_SKIN): position [m] and two unit vectors in the skin [-] in the
            grid's axes, area [m^2], half of the food, 0 left, 1 right, tie that bears its tension across the cut plane,
            -1 for none, and length over which it does [m]; empty where the skin bears nothing.
        half: Half of the food that each particle belongs to, 0 left, 1 right, shape (n,); empty without ties.
        stone: Table of the stone, shape (N_STONE,), rows as in :mod:`mpm.state.tables`; empty without one.
    """

    nodes: Sequence[int]
    plane: int
    between: bool
    particles: np.ndarray
    slices: np.ndarray
    parameters: np.ndarray
    pose: np.ndarray
    relaxation: np.ndarray
    ties: np.ndarray
    tie_rows: np.ndarray
    skin: np.ndarray
    half: np.ndarray
    stone: np.ndarray
