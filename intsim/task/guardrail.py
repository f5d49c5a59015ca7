"""The velocity guardrail: commands beyond what a Franka arm may do are clipped, and each clip is logged.

The published evaluation applies it to every policy alike (CulinaryCut, section 3.5): it gives no observation and plans
nothing anew. Its numbers are those of the Franka control interface, since the published ones are in a supplement that
is not public.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from intsim.task.gym_action import PLACE_SCALE
from intsim.task.kinematic_table import limit_command
from intsim.task.planner import CONTROL_RATE

MAX_JOINT_SPEEDS = np.array([2.175] * 4 + [2.61] * 3)
"""Speeds of a Franka arm's joints at most [rad/s] (Franka control interface)."""


@dataclass(frozen=True, eq=False)
class GuardrailClip:
    """A command that was clipped.

    Attributes:
        step: Control step, from 0.
        limits: Which limits were met: ``joint``, ``speed``, ``acceleration`` or ``turn``.
        asked, given: Command as it came and as it was passed on, in the units of its control mode, shape (n,) each.
    """

    step: int
    limits: tuple[str, ...]
    asked: np.ndarray
    given: np.ndarray


class Guardrail:
    """Clips the commands of one episode.

    Args:
        mode: Control mode: ``pd_joint_pos``, ``pd_ee_delta_pose``, ``pd_ee_target_delta_pose`` or ``pd_ee_pose``; the
            commands of others pass.
        joints: Joints at the beginning [rad], shape (7,).
        place: Where the hand's frame of ``pd_ee_pose`` is at the beginning: x, y, z [m] and its Euler angles [rad],
            shape (6,).

    Attributes:
        log: What was clipped, in order.
    """

    def __init__(self, mode: str, joints: np.ndarray, place: np.ndarray) -> None:
        self.mode = mode
        self.log: list[GuardrailClip] = []
        self._joints, self._place = np.array(joints, float), np.array(place, float)
        self._velocity, self._step = np.zeros(3), 0

    @property
    def joints(self) -> np.ndarray:
        """Joints that were commanded last, of ``pd_joint_pos`` [rad], shape (7,)."""
        return self._joints.copy()

    @property
    def last(self) -> tuple[str, ...]:
        """Limits that the last command met."""
        return self.log[-1].limits if self.log and self.log[-1].step == self._step - 1 else ()

    def clip(self, action: np.ndarray) -> np.ndarray:
        """A command within the limits; one that is within them is returned bit for bit.

        Args:
            action: Command of one control step, the gripper last, shape (8,) or (7,).

        Returns:
            What is passed on, same shape.
        """
        asked = np.asarray(action)
        given, limits = self._limited(np.array(asked, float))
        if limits:
            self.log.append(GuardrailClip(self._step, limits, asked.copy(), given))
        self._step += 1
        return given.astype(asked.dtype) if limits else asked

    def _limited(self, action: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        if self.mode == "pd_joint_pos":
            most = MAX_JOINT_SPEEDS / CONTROL_RATE
            turn = action[:7] - self._joints
            slow = np.clip(turn, -most, most)
            clipped = bool((slow != turn).any())
            self._joints = self._joints + slow if clipped else action[:7].copy()
            return np.array([*self._joints, *action[7:]]), ("joint",) * clipped
        if self.mode in ("pd_ee_delta_pose", "pd_ee_target_delta_pose"):
            inside = np.clip(action[:6], -1.0, 1.0)  # as the controller does
            kept = limit_command(PLACE_SCALE * inside, self._velocity)
            self._velocity = kept.delta[:3] * CONTROL_RATE
            return np.array([*kept.delta / PLACE_SCALE, *action[6:]]), kept.clipped
        if self.mode == "pd_ee_pose":
            change = action[:6] - self._place
            change[3:] = (change[3:] + np.pi) % (2 * np.pi) - np.pi
            kept = limit_command(change, self._velocity)
            self._velocity = kept.delta[:3] * CONTROL_RATE
            self._place = self._place + kept.delta if kept.clipped else action[:6].copy()
            return np.array([*self._place, *action[6:]]), kept.clipped
        return action, ()
