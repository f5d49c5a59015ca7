"""A change of the edge's pose as an action of ManiSkill's ``pd_ee_delta_pose``, and back; a pose as a policy's state.

There 1 stands for 0.1 m, and for -0.1 rad: ManiSkill's controller multiplies a rotation by its lower limit. The
rotation is one vector about axes that are aligned with the robot's base.
"""

from __future__ import annotations

import numpy as np

PLACE_SCALE, TURN_SCALE = 0.1, -0.1  # change of place [m] and of direction [rad] that an action of 1 stands for

GRIPPER_CLOSED = -1.0
"""Gripper's part of an action, and of a state: closed on the handle.

ManiSkill's Panda maps -1 to 1 onto finger joints from -0.01 to 0.04 m, so that -1 presses the fingers together and 0
holds them 15 mm apart.
"""


def policy_state(pose: np.ndarray) -> np.ndarray:
    """A pose of the edge as the exports have it, and as a policy that learnt from one is given it.

    Args:
        pose: x, y, z [m], yaw and tilt [rad], shape (..., 5).

    Returns:
        x, y, z [m], roll (0), tilt and yaw [rad], 0 and the gripper [-], shape (..., 8).
    """
    pose = np.asarray(pose, float)
    zero = np.zeros(pose.shape[:-1])
    place = [pose[..., k] for k in range(3)]
    return np.stack([*place, zero, pose[..., 4], pose[..., 3], zero, zero + GRIPPER_CLOSED], axis=-1)


def to_gym_action(change: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """The action for a change of pose.

    Args:
        change: x, y, z [m], roll, tilt of the edge and yaw [rad], and the gripper, shape (..., 7).
        yaw: Direction of the edge [rad], shape (...).

    Returns:
        The action [-], same shape; the roll is that of a hand that points down, and 0 in every cut.
    """
    change, c, s = np.asarray(change, float), np.cos(yaw), np.sin(yaw)
    roll, tilt = change[..., 3], change[..., 4]
    turn = np.stack([roll * c + tilt * s, roll * s - tilt * c, change[..., 5]], axis=-1)
    return np.concatenate([change[..., :3] / PLACE_SCALE, turn / TURN_SCALE, change[..., 6:]], axis=-1)


def from_gym_action(action: np.ndarray, yaw: np.ndarray | float) -> np.ndarray:
    """The change of pose that an action asks for, the inverse of :func:`to_gym_action`.

    Args:
        action: Of ``pd_ee_delta_pose`` [-], shape (..., 7).
        yaw: Direction of the edge [rad], shape (...).

    Returns:
        x, y, z [m], roll, tilt of the edge and yaw [rad], and the gripper, same shape.
    """
    action, c, s = np.asarray(action, float), np.cos(yaw), np.sin(yaw)
    turn = TURN_SCALE * action[..., 3:6]
    roll, tilt = turn[..., 0] * c + turn[..., 1] * s, turn[..., 0] * s - turn[..., 1] * c
    turned = np.stack([roll, tilt, turn[..., 2]], axis=-1)
    return np.concatenate([PLACE_SCALE * action[..., :3], turned, action[..., 6:]], axis=-1)
