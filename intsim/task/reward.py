"""A dense reward for learning to cut: how far the cut that is asked for has got. Success pays more than all of it."""

from __future__ import annotations

import math

import numpy as np

from intsim.task.success import ANGLE_TOLERANCE, PLACE_TOLERANCE
from intsim.task.targets import CutSpec, Item, TaskError, target

REACH, TURN, CUT = 0.3, 0.2, 0.4
"""What coming to the place, turning the edge across the food, and parting the section are worth: 0.9; success is 1."""
REACH_SCALE = 0.1  # distance from the place at which three quarters of its worth are lost [m]


def dense_reward(spec: CutSpec, item: Item, pose: np.ndarray, uncut: float, made: int) -> float:
    """How far an episode has got, between 0 and 0.9 [-].

    The way to the place counts above the food, so that a knife that goes down beside it gains nothing by it. What is
    parted counts only within the published tolerances of place and angle.

    Args:
        spec: What is asked for.
        item: The food as it is.
        pose: Middle of the edge x, y, z [m], its direction and its angle to the board [rad], shape (5,).
        uncut: Part of the section of the present cut that still holds [-].
        made: Cuts that are made.

    Returns:
        The reward [-]: a cut that is made counts as one over the number of cuts.
    """
    whole = REACH + TURN + CUT
    try:
        along = target(spec, item)
    except TaskError:  # nothing is left to cut
        return whole
    if made >= spec.cuts:
        return whole
    off = np.asarray(pose[:2], float) - item.at(along)
    edge = np.array([math.cos(pose[3]), math.sin(pose[3])])
    angle = math.asin(min(1.0, abs(float(edge @ item.axis))))
    above = max(float(pose[2]) - item.shape.height, 0.0)
    reach = 1 - math.tanh(math.hypot(*off, above) / REACH_SCALE)
    placed = abs(float(off @ item.axis)) <= PLACE_TOLERANCE * item.shape.length and angle <= ANGLE_TOLERANCE
    now = REACH * reach + TURN * math.cos(angle) * reach + CUT * (1 - uncut) * placed
    return (made * whole + now) / spec.cuts
