"""Cameras and lamps: how a point of the world comes to a place in a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from intsim.task.targets import CAMERAS

PICTURE_CAMERAS = ("front", "side", "wrist", "work")
"""Cameras of the pictures: the three of the published datasets, and a close one."""
NEAR = 0.01  # distance before a camera from which on it sees [m]
FIELD = 0.9  # field of view of the cameras that stand [rad]
WRIST_FIELD, WRIST_PLACE = 1.57, np.array([0.07, 0.0, 0.0])  # that of the hand [rad], and where it is in its frame [m]
WORK_EYE, WORK_TARGET, WORK_FIELD = (0.36, -0.20, 0.26), (-0.02, 0.0, 0.02), 0.85  # the close one [m, rad]


@dataclass(frozen=True, eq=False)
class View:
    """A camera with a square picture.

    Attributes:
        eye: Where it is [m], shape (3,).
        turn: Its directions to the right, down and forward, world axes, rows, shape (3, 3).
        focal: Pixels a unit of the tangent of the angle, or a metre where it is ``flat`` [px or px/m].
        pixels: Width and height of the picture.
        flat: Whether it looks along parallel lines, as a lamp far away does.
        stands: Whether it stays where it is.
    """

    eye: np.ndarray
    turn: np.ndarray
    focal: float
    pixels: int
    flat: bool = False
    stands: bool = True

    @staticmethod
    def towards(eye: np.ndarray, target: np.ndarray, field: float, pixels: int) -> View:
        """A camera.

        Args:
            eye: Where it is [m], shape (3,).
            target: What it looks at [m], shape (3,).
            field: Its field of view, as wide as high [rad].
            pixels: Width and height of its picture.

        Returns:
            What it sees.
        """
        return View(np.asarray(eye, float), _turn(np.subtract(target, eye)), _focal(field, pixels), pixels)

    @staticmethod
    def lamp(direction: np.ndarray, reach: float, pixels: int) -> View:
        """What a lamp far away sees.

        Args:
            direction: In which it shines [-], shape (3,).
            reach: How far around the middle of the board [m].
            pixels: Width and height of its picture.

        Returns:
            What it sees.
        """
        turn = _turn(direction)
        return View(-2 * reach * turn[2], turn, pixels / (2 * reach), pixels, flat=True)

    @staticmethod
    def standing(name: str, pixels: int) -> View:
        """The camera of a name that stands beside the robot: ``front``, ``side`` or ``work``."""
        if name == "work":
            return View.towards(np.array(WORK_EYE), np.array(WORK_TARGET), WORK_FIELD, pixels)
        own = CAMERAS[name]
        return View.towards(np.array(own.eye), np.array(own.target), FIELD, pixels)

    @staticmethod
    def wrist(hand: np.ndarray, pixels: int) -> View:
        """The camera of the hand, whose pose in the world is ``hand`` (4, 4): it looks along the fingers."""
        turn = hand[:3, :3]
        return View(
            hand[:3, 3] + turn @ WRIST_PLACE,
            np.stack([-turn[:, 1], turn[:, 0], turn[:, 2]]),
            _focal(WRIST_FIELD, pixels),
            pixels,
            stands=False,
        )

    @property
    def row(self) -> np.ndarray:
        """As the kernels take it: eye, turn by rows, focal, half the picture, 1 if flat, 1 if it stands; (16,)."""
        own = (*self.eye, *self.turn.ravel(), self.focal, self.pixels / 2, float(self.flat), float(self.stands))
        return np.array(own, np.float32)


def _focal(field: float, pixels: int) -> float:
    return pixels / 2 / float(np.tan(field / 2))


def _turn(look: np.ndarray) -> np.ndarray:
    """Right, down and forward of a camera that looks in a direction and holds its head up."""
    forward = np.asarray(look, float) / np.linalg.norm(look)
    right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.999 else [1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward])
