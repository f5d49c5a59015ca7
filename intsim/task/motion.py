"""When the motion of a cut is over: the knife is released, rests, or its time is out. Before that nothing succeeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from intsim.task.kinematic_table import axis_crossing
from intsim.task.targets import Item

RELEASE_CLEARANCE = 0.01  # height of the edge above a food that it has met at which the knife is released [m]
STALL_STEPS, STALL_DISTANCE = 30, 1e-3
"""Control steps within which an edge that has not moved so far [m] is at rest: a second and a half."""


def at_rest(way: Sequence[np.ndarray]) -> bool:
    """Whether an edge has not moved for :data:`STALL_STEPS`.

    Args:
        way: Where it has been after each step, x, y, z first [m], shape (3,) or longer each.
    """
    if len(way) <= STALL_STEPS:
        return False
    last = np.array([there[:3] for there in way[-STALL_STEPS:]])
    return bool(np.linalg.norm(last - last[-1], axis=1).max() < STALL_DISTANCE)


class MotionEnd:
    """Follows the edge, and says whether its motion is over.

    Args:
        steps: Control steps of an episode.

    Attributes:
        met: Whether the edge has been in a food.
        why: ``released``: the edge has been in a food and is above it again; ``rest``: it has been in one and has not
            moved for a second and a half; ``time``: no step is left; empty while the motion goes on. A knife that
            comes down again after a release is in motion again.
    """

    def __init__(self, steps: int) -> None:
        self._left, self._top = steps, 0.0
        self._way: list[np.ndarray] = []
        self.met, self.why = False, ""

    def step(self, pose: np.ndarray, items: Sequence[Item]) -> str:
        """Take in where the edge is after a control step.

        Args:
            pose: Middle of the edge x, y, z [m], its direction and its angle to the board [rad], shape (5,).
            items: The foods as they are.

        Returns:
            Why the motion is over; empty while it goes on.
        """
        self._left -= 1
        self._way.append(np.array(pose, float))
        for item in items:
            along = axis_crossing(item, pose)
            if along is not None and pose[2] < item.top(along):
                self.met, self._top = True, max(self._top, item.shape.height)
        self.why = self._reason(float(pose[2]))
        return self.why

    def _reason(self, height: float) -> str:
        if self.met and height > self._top + RELEASE_CLEARANCE:
            return "released"
        if self.met and at_rest(self._way):
            return "rest"
        return "time" if self._left <= 0 else ""
