"""The kinematic table, without a robot simulator: the edge goes where it is sent, within what a Franka arm may do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from intsim.task.planner import CONTROL_RATE, HOME
from intsim.task.rollout import Rollout
from intsim.task.targets import Item

MAX_SPEED, MAX_ANGULAR_SPEED, MAX_ACCELERATION = 1.7, 2.5, 13.0
"""Limits of a Franka arm's hand: speed [m/s], angular speed [rad/s], acceleration [m/s^2].

Source: Franka control interface, limits of Cartesian motion.
"""
CUT_HEIGHT = 5e-3  # height of the edge above the board at which a food counts as cut through, in plain geometry [m]
EDGE_LENGTH = 0.18  # length of the edge [m]


@dataclass(frozen=True)
class LimitedCommand:
    """A command within the limits. Attributes: delta, pose change (6,) [m, rad]; clipped, which limits were met."""

    delta: np.ndarray
    clipped: tuple[str, ...]


def limit_command(delta: np.ndarray, before: np.ndarray, rate: float = CONTROL_RATE) -> LimitedCommand:
    """Scale a pose change down to the arm's limits; within them it is returned bit for bit, its direction always kept.

    Args:
        delta: Change of x, y, z [m] and rotations [rad] in this step, shape (6,).
        before: Velocity in the step before [m/s], shape (3,).
        rate: Steps a second.

    Returns:
        The change within the limits, and which were met.
    """
    out, clipped = np.array(delta, float), []
    speed = np.linalg.norm(out[:3]) * rate
    if speed > MAX_SPEED:
        out[:3] *= MAX_SPEED / speed
        clipped.append("speed")
    change = out[:3] * rate - before
    push = np.linalg.norm(change) * rate
    if push > MAX_ACCELERATION:
        out[:3] = (before + change * MAX_ACCELERATION / push) / rate
        clipped.append("acceleration")
    turn = np.linalg.norm(out[3:]) * rate
    if turn > MAX_ANGULAR_SPEED:
        out[3:] *= MAX_ANGULAR_SPEED / turn
        clipped.append("turn")
    return LimitedCommand(out, tuple(clipped))


class KinematicTable:
    """Foods, an edge, and steps of control.

    Args:
        items: The foods.

    Attributes:
        items: The foods as they are now.
        rollout: What has happened.
    """

    def __init__(self, items: Sequence[Item]) -> None:
        self.items = list(items)
        self.rollout = Rollout()
        self._pose = np.array([*HOME, 0.0, 0.0])
        self._velocity = np.zeros(3)
        self._down = False

    def observe(self) -> dict[str, Any]:
        """What a policy is given: the edge's pose (5,), and the foods, which only an oracle may look at."""
        return {"pose": self._pose.copy(), "items": tuple(self.items)}

    def step(self, action: np.ndarray) -> None:
        """Move by x, y, z [m] and roll, pitch, yaw [rad] of an action (7,), as ``pd_ee_delta_pose`` in metres does.

        The gripper, its last number, moves nothing: the knife is fixed to the hand.
        """
        kept = limit_command(np.asarray(action, float)[:6], self._velocity)
        self._velocity = kept.delta[:3] * CONTROL_RATE
        x, y, z, _, pitch, yaw = kept.delta
        self._pose = self._pose + [x, y, z, yaw, pitch]
        there = self._pose.copy()
        there[2] = max(there[2], 0.0)
        self.arrive(self._pose.copy(), there, kept.clipped)

    def arrive(self, command: np.ndarray, there: np.ndarray, clipped: tuple[str, ...] = ()) -> None:
        """Take down where the edge has come to.

        Args:
            command: Pose x, y, z [m], yaw and tilt [rad] where it was sent, shape (5,).
            there: Pose [m, rad] where it is, shape (5,).
            clipped: Limits that were met.
        """
        self.rollout.command.append(command)
        self.rollout.pose.append(there)
        self.rollout.clipped.append(clipped)
        deep = bool(there[2] < CUT_HEIGHT)
        if deep and not self._down:
            self._cut(there)
        self._down = deep

    def _cut(self, pose: np.ndarray) -> None:
        for k, item in enumerate(self.items):
            along = axis_crossing(item, pose)
            if along is not None:
                self.rollout.cuts.append((item, along))
                self.items[k] = item.cut_at(along)


def axis_crossing(item: Item, pose: np.ndarray) -> float | None:
    """Where along the axis of a food an edge crosses it [m]; None where the edge passes beside it or lies along it.

    Args:
        item: The food.
        pose: Pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
    """
    edge = np.array([np.cos(pose[3]), np.sin(pose[3])])
    offset = pose[:2] - [item.x, item.y]
    if abs(edge @ item.across) < 0.1:
        return None
    reach = -(offset @ item.across) / (edge @ item.across)  # way along the edge to the food's axis
    along = float((offset + reach * edge) @ item.axis)
    inside = item.piece_at(along) is not None and abs(reach) < EDGE_LENGTH / 2
    return along if inside else None
