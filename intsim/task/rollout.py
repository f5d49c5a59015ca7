"""What moves the knife, and what an episode leaves: a policy is asked step by step, a rollout is what came of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from intsim.task.targets import Item


class Policy(Protocol):
    """What an evaluation needs of a policy."""

    def reset(self, seed: int) -> None:
        """A new episode begins."""

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next action.

        It is a change of pose x, y, z [m], roll, pitch, yaw [rad] and the gripper, shape (7,), or joint targets [rad]
        and the gripper, shape (8,), which need the robot; None when the policy has done what it was told.
        """


@dataclass(eq=False)
class Rollout:
    """What an episode left.

    Attributes:
        command: Commanded poses x, y, z, yaw, pitch [m, rad], one for each step.
        pose: Poses that the edge had: not below the board.
        clipped: Limits met in each step.
        cuts: Foods as they were, and where along the axis the edge came down, for each cut in order.
    """

    command: list[np.ndarray] = field(default_factory=list)
    pose: list[np.ndarray] = field(default_factory=list)
    clipped: list[tuple[str, ...]] = field(default_factory=list)
    cuts: list[tuple[Item, float]] = field(default_factory=list)
