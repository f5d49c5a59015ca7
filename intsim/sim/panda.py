"""ManiSkill's Panda with a knife in its closed gripper; needs the extra ``[robot]``."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import sapien
from mani_skill import PACKAGE_ASSET_DIR
from mani_skill.agents.base_agent import Keyframe
from mani_skill.agents.registration import register_agent
from mani_skill.agents.robots import Panda

from calib.material.knife import load_knife
from intsim.render.arm import BLADE_OFFSET

URDF_SOURCE = Path(PACKAGE_ASSET_DIR) / "robots" / "panda" / "panda_v2.urdf"
STEEL_DENSITY = 7850.0  # kg/m^3
JOINT_IMPEDANCE = np.array([3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0])
"""Stiffness of a Franka arm's joints [N m/rad]: what libfranka's examples set (setJointImpedance)."""
TORQUE_LIMITS = np.array([87.0] * 4 + [12.0] * 3)
"""Most torque of its joints [N m] (Franka control interface)."""
JOINT_INERTIA = 1.0
"""Inertia that a joint's damping is chosen for [kg m^2]; what an arm's first joints see.

The damping of the arm's own controller is not published: it is critical for this inertia, 2 sqrt(stiffness x inertia).
"""
MANISKILL_STIFFNESS, MANISKILL_DAMPING = 1e3, 1e2
"""Gains of ManiSkill's own Panda [N m/rad, N m s/rad], which a stiffness that is given as one number goes with."""
EDGE_LINK = "knife_edge"
BLADE_LINK = "knife"


@functools.cache
def urdf(knife: str, *, visible: bool) -> str:
    """Path of the robot's description with a blade fixed to its hand.

    The blade lies along the hand's x axis, the edge away from the hand.

    Args:
        knife: Name of the knife.
        visible: Without it all that only a renderer needs is left out: where there is no renderer, its materials cannot
            be made.
    """
    blade = load_knife(knife)
    tree = ElementTree.parse(URDF_SOURCE)
    root = tree.getroot()
    for mesh in root.iter("mesh"):
        mesh.set("filename", str(URDF_SOURCE.parent / mesh.get("filename", "")))
    size = (blade.length, blade.spine, blade.height)
    link = ElementTree.SubElement(root, "link", name=BLADE_LINK)
    for kind in ("visual", "collision"):
        box = ElementTree.SubElement(ElementTree.SubElement(link, kind), "geometry")
        ElementTree.SubElement(box, "box", size=_numbers(*size))
    mass = STEEL_DENSITY * float(np.prod(size))
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "mass", value=_numbers(mass))
    squares = mass / 12 * np.square(size)
    moments = {"ixx": squares[1] + squares[2], "iyy": squares[0] + squares[2], "izz": squares[0] + squares[1]}
    ElementTree.SubElement(
        inertial, "inertia", {k: _numbers(v) for k, v in (moments | {"ixy": 0.0, "ixz": 0.0, "iyz": 0.0}).items()}
    )
    ElementTree.SubElement(root, "link", name=EDGE_LINK)
    for child, z in ((BLADE_LINK, BLADE_OFFSET + blade.height / 2), (EDGE_LINK, BLADE_OFFSET + blade.height)):
        joint = ElementTree.SubElement(root, "joint", name=f"{child}_joint", type="fixed")
        ElementTree.SubElement(joint, "origin", rpy="0 0 0", xyz=_numbers(0.0, 0.0, z))
        ElementTree.SubElement(joint, "parent", link="panda_hand")
        ElementTree.SubElement(joint, "child", link=child)
    if not visible:
        for parent in list(root.iter()):
            for tag in ("visual", "material"):
                for child_element in parent.findall(tag):
                    parent.remove(child_element)
    path = Path(_folder().name) / f"panda_{knife}{'' if visible else '_bare'}.urdf"
    tree.write(path, encoding="unicode")
    return str(path)


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Where this process keeps its descriptions; removed when it ends."""
    return tempfile.TemporaryDirectory(prefix="cutcal-panda-")


def _numbers(*values: float) -> str:
    return " ".join(f"{v:.9g}" for v in values)


@register_agent()
class PandaKnife(Panda):
    """A Panda whose end effector is the middle of a knife's edge."""

    uid = "panda_knife"
    ee_link_name = EDGE_LINK
    knife, visible = "kitchen", True
    arm_stiffness = JOINT_IMPEDANCE.tolist()
    arm_damping = (2 * np.sqrt(JOINT_IMPEDANCE * JOINT_INERTIA)).tolist()
    arm_force_limit = TORQUE_LIMITS.tolist()
    keyframes = {
        "rest": Keyframe(
            qpos=np.array([0.0, np.pi / 8, 0, -np.pi * 5 / 8, 0, np.pi * 3 / 4, np.pi / 4, 0.0, 0.0]),
            pose=sapien.Pose(),
        )
    }

    @property
    def urdf_path(self) -> str:
        """Path of the description; ManiSkill asks for it while the robot is loaded."""
        return urdf(self.knife, visible=self.visible)


def hand_rotation(yaw: float, pitch: float = 0.0) -> np.ndarray:
    """Orientation (3, 3) of a hand that points down, the edge in a direction and its end risen by a pitch [rad]."""
    c, s, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    x = np.array([c * cp, s * cp, sp])
    y = np.array([s, -c, 0.0])
    return np.stack([x, y, np.cross(x, y)], axis=1)


def edge_pose(p: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """The edge's pose x, y, z, yaw, pitch (5,) from its middle and its direction; an edge has no beginning."""
    yaw = float(np.arctan2(axis[1], axis[0]))
    turned = yaw > np.pi / 2 or yaw <= -np.pi / 2
    return np.array(
        [*p, (yaw + np.pi / 2) % np.pi - np.pi / 2, float(np.arcsin(np.clip(axis[2], -1, 1))) * (-1 if turned else 1)]
    )


class Kinematics:
    """Inverse kinematics of the arm by SAPIEN's own model.

    Args:
        robot: The articulation.
    """

    def __init__(self, robot: Any) -> None:
        own = robot._objs[0]
        self._model = own.create_pinocchio_model()
        self._link = next(k for k, link in enumerate(own.links) if link.name.endswith(EDGE_LINK))
        self._mask = np.array([1] * 7 + [0] * 2)
        self._root = own.pose

    def pose(self, joints: np.ndarray) -> np.ndarray:
        """Pose of the edge (5,) in the world that joints (9,) give."""
        self._model.compute_forward_kinematics(joints)
        there = self._root * self._model.get_link_pose(self._link)
        return edge_pose(np.array(there.p, float), there.to_transformation_matrix()[:3, 0].astype(float))

    def joints(self, pose: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, float]:
        """Joint angles that bring the edge to a pose.

        Args:
            pose: x, y, z, yaw, pitch of the edge in the world, shape (5,).
            near: Joints from which they are sought [rad, m], shape (9,).

        Returns:
            Joints (9,), and how far the edge is from there [m].
        """
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = hand_rotation(pose[3], pose[4]), pose[:3]
        goal = self._root.inv() * sapien.Pose(matrix)
        found, _, _ = self._model.compute_inverse_kinematics(
            self._link, goal, initial_qpos=near, active_qmask=self._mask, eps=1e-5, max_iterations=200
        )
        self._model.compute_forward_kinematics(found)
        there = self._model.get_link_pose(self._link)
        out = np.array(found, float)
        out[7:] = near[7:]
        return out, float(np.linalg.norm(there.p - goal.p))
