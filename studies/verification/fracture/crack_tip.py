"""Where the tip of a cohesive crack is after a run."""

from __future__ import annotations

import numpy as np

from mpm.solver import Simulation
from mpm.state import host_transfer
from mpm.state.tables import TIE_OPENING

HALF = 0.5  # part of R that is taken at the tip


def tip_height(simulation: Simulation) -> float:
    """Height at which ties and edge have taken half of R, as the finite elements have it.

    Args:
        simulation: A simulation that has run; its fields are those of the end.

    Returns:
        Height above the board [m], the mean along the edge.
    """
    state, place = simulation.state, simulation.place
    ties = simulation.setup.ties()
    opening, cut = (field.to_numpy()[place, : len(ties)] for field in (state.largest_opening, state.cut_part))
    spread = np.minimum(opening / state.par.to_numpy()[place, TIE_OPENING], 1.0)
    left = ((1 - cut) * (1 - spread) ** 2).mean(axis=-1)  # of the points of a tie
    x = simulation.setup.to_scene_axes(host_transfer.particles(state, place).x)[ties[:, 0], 2]
    row = simulation.setup.seeds.x[ties[:, 0], 2] // simulation.setup.seeds.spacing
    _, group, count = np.unique(row, return_inverse=True, return_counts=True)
    taken, height = (np.bincount(group, values) / count for values in (1 - left, x))
    if not (taken > HALF).any():
        return float(height[-1])
    at = max(int(np.argmax(taken > HALF)), 1)
    return float(np.interp(HALF, taken[at - 1 : at + 1], height[at - 1 : at + 1]))
