"""Trajectories of the blade for a cut: approach, contact, cut, hold, retract, in four styles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from intsim.task.targets import Item, TaskError

STYLES = ("press", "slice", "rock", "saw")
PHASES = ("approach", "contact", "cut", "hold", "retract")
CONTROL_RATE = 20.0  # control steps a second
HOME = (-0.25, 0.0, 0.25)  # where the middle of the edge begins [m]
CLEARANCE = 0.02  # height above the food at which the descent begins [m]
DESCENT_SPEED = 0.04  # of the descent [m/s]
APPROACH_TIME = 2.0  # time from home to above the food, and back up [s]
SLICE_RATIO = 1.0  # way along the edge over the way down, of a slice
ROCK_ANGLE = math.radians(8.0)  # angle of the edge to the board at which a rock begins
SAW_AMPLITUDE, SAW_FREQUENCY = 0.015, 1.5  # amplitude of a saw along the edge [m], strokes a second


@dataclass(frozen=True)
class BladeDescent:
    """How the blade comes down.

    Attributes:
        style: ``press`` straight down, ``slice`` with a draw along the edge, ``rock`` from a raised end, ``saw`` to and
            fro.
        depth: Height of the edge at the end [m]; negative to command it into the board, for an arm that yields.
        hold: Time that it is held there [s].
        speed: Of the descent [m/s].

    Raises:
        TaskError: An unknown style, or a speed that is no positive number.
    """

    style: str = "press"
    depth: float = 0.0
    hold: float = 0.0
    speed: float = DESCENT_SPEED

    def __post_init__(self) -> None:
        if self.style not in STYLES:
            raise TaskError(f"plan: style {self.style!r} is none of {', '.join(STYLES)}")
        if not (math.isfinite(self.speed) and self.speed > 0):
            raise TaskError(f"plan: a descent of {self.speed:g} m/s; give a positive speed")


PRESS = BladeDescent()
"""Straight down to the board."""


@dataclass(frozen=True, eq=False)
class BladeTrajectory:
    """Poses of the edge's middle at the rate of control.

    Attributes:
        pose: x, y, z [m], yaw of the edge and its angle to the board [rad], shape (n, 5).
        phase: Which of ``PHASES`` each belongs to, shape (n,).
    """

    pose: np.ndarray
    phase: np.ndarray


def minimum_jerk(n: int) -> np.ndarray:
    """Part of the way after each of n steps of a motion from rest to rest with the least jerk [-], shape (n,).

    Flash and Hogan 1985, J. Neurosci. 5:1688.
    """
    t = np.arange(1, n + 1) / n
    out: np.ndarray = t**3 * (10 - 15 * t + 6 * t**2)
    return out


def plan_cut(
    item: Item,
    along: float,
    descent: BladeDescent = PRESS,
    *,
    start: np.ndarray | None = None,
    yaw: float | None = None,
    place: np.ndarray | None = None,
) -> BladeTrajectory:
    """The trajectory of the blade for one cut.

    Args:
        item: The food.
        along: Where along its axis it is cut [m].
        descent: How the blade comes down.
        start: Pose x, y, z [m], yaw and tilt [rad] from which it begins, shape (5,); home without it.
        yaw: Direction of the edge [rad]; across the food without it.
        place: Where on the table the middle of the edge comes down [m], shape (2,); on the food's axis without it.

    Returns:
        Poses and phases from the start to above the place of the cut.
    """
    turn = item.yaw + math.pi / 2 if yaw is None else yaw
    turn = (turn + math.pi / 2) % math.pi - math.pi / 2  # an edge has no direction
    begin = np.array([*HOME, turn, 0.0]) if start is None else np.asarray(start, float)
    centre = item.at(along) if place is None else place
    above, cut = _descent(descent, centre, item.shape.height + CLEARANCE, turn)
    part = minimum_jerk(round(APPROACH_TIME * CONTROL_RATE))[:, None]
    reach = begin + part * (above - begin)
    end = cut[-1]
    rest = np.repeat(end[None], round(descent.hold * CONTROL_RATE), axis=0)
    back = end + part * (np.array([end[0], end[1], HOME[2], turn, 0.0]) - end)
    first = int(np.argmax(cut[:, 2] <= item.shape.height))
    phase = ["approach"] * (len(reach) + first) + ["contact"] + ["cut"] * (len(cut) - first - 1)
    phase += ["hold"] * len(rest) + ["retract"] * len(back)
    return BladeTrajectory(np.concatenate([reach, cut, rest, back]), np.array(phase))


def _descent(descent: BladeDescent, centre: np.ndarray, high: float, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Pose above the cut (5,), and the poses of the way down (n, 5) [m, rad].

    The way down begins at a height above the board [m]; the edge has a direction [rad].
    """
    edge = np.array([math.cos(turn), math.sin(turn)])
    depth, style = descent.depth, descent.style
    steps = max(2, math.ceil((high - depth) / descent.speed * CONTROL_RATE))
    down = high + (depth - high) * np.arange(1, steps + 1) / steps
    passed = (high - down) / (high - depth)
    shift, tilt = np.zeros(steps), np.zeros(steps)
    if style == "slice":
        shift = SLICE_RATIO * (high - depth) * (passed - 0.5)
    elif style == "rock":
        tilt = ROCK_ANGLE * (1 - passed)
    elif style == "saw":
        shift = SAW_AMPLITUDE * np.sin(2 * math.pi * SAW_FREQUENCY * np.arange(1, steps + 1) / CONTROL_RATE)
    cut = np.column_stack([centre + shift[:, None] * edge, down, np.full(steps, turn), tilt])
    first_shift = shift[0] if style == "slice" else 0.0
    above = np.array([*centre + first_shift * edge, high, turn, ROCK_ANGLE if style == "rock" else 0.0])
    return above, cut
