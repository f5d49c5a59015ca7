"""Whether a blade's motion parts the food: the motion's descent in the cutting solver, behind an arm that yields."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace

import numpy as np

from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import CELL_PER_ZONE, Sizing, cut_scene, specimen
from intsim.task.planner import RATE
from intsim.task.targets import Item
from mpm.output.record import ForceRecord
from mpm.scene import Arm, Scene
from mpm.scene.errors import SceneError
from mpm.solver import Simulation

ARM = Arm(1 / 0.57e-3)
"""ManiSkill's Panda with its own gains gives way by 0.57 mm per N of vertical reaction."""
SLOWEST = 1e-3  # speed of a descent that still is one [m/s]
LEAST_DRAW = 1e-3  # of the speed along the edge over that down, below which a cut is a press and keeps its mirror plane
LEAST_CELLS = 2  # in the thinner part of the food, as mpm.scene asks
FINEST = 1 / 3  # of the usual cell: finer ones cost more than 81 times as much, and an evaluation has hundreds of cuts
SHORTEST = 1e-3  # way into the food that still is a cut [m]


@dataclass(frozen=True)
class Severed:
    """What the solver found.

    Attributes:
        severed: Whether the food is in pieces; None where it was not simulated.
        uncut: Part of the section that still holds [-].
        peak: Largest force on the knife [N].
        short: Height of the edge over the one commanded [m], at the end, of an episode where the edge was lowest.
        why: Reason where it was not simulated, or the finding in words.
    """

    severed: bool | None
    uncut: float = 1.0
    peak: float = 0.0
    short: float = 0.0
    why: str = ""

    def as_dict(self) -> dict[str, object]:
        """As plain data."""
        return asdict(self)


def cut_place(
    item: Item,
    along: float,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    coarse: bool = True,
    cells: int | None = None,
) -> Scene:
    """A press cut through a food at a place along its axis.

    A place nearer to the end than two cells asks for finer ones.

    Args:
        item: The food, taken for whole.
        along: Where along its axis [m].
        food: Its properties.
        knife: Name of the knife.
        coarse: Cells and speed of a screening run.
        cells: Most cells over height and width: a large food has larger ones, and a wider process zone of the edge with them.

    Raises:
        SceneError: A cut that the solver cannot make.
    """
    shape = item.shape
    sizing = Sizing(shape.kind, shape.height, shape.width, None, 0.5 + along / shape.length)
    sized, _ = specimen(food, None, sizing)
    least = min(-sized.ends[0], sized.ends[1])
    whole, blade = replace(sized, cut=0.0), load_knife(knife)
    usual = cut_scene(food, whole, blade, coarse=coarse)
    largest = 0.0 if cells is None else min(shape.height, shape.width) / cells
    if largest > usual.numerics.dx:
        usual = cut_scene(food, whole, blade, coarse=coarse, dx=largest * (CELL_PER_ZONE if coarse else 1.0))
    cell = min(usual.numerics.dx, least / LEAST_CELLS)
    if cell < FINEST * usual.numerics.dx:
        raise SceneError(
            f"a slice of {least * 1e3:.2g} mm would need cells of {cell * 1e3:.2g} mm, which take too long"
        )
    return replace(usual, food=replace(usual.food, shape=sized), numerics=replace(usual.numerics, dx=cell))


def scene_of(
    item: Item,
    along: float,
    command: np.ndarray,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    arm: Arm = ARM,
    coarse: bool = True,
) -> Scene | None:
    """The cut that a commanded motion makes, None where it does not reach into the food.

    Taken from the motion: the way down from the food's top, its mean speed, the draw along the edge, and how long the lowest place is
    held.

    Args:
        item: The food before the cut, whole.
        along: Where along its axis [m].
        command: Commanded poses x, y, z, yaw, pitch (n, 5), one for each step of control.
        food: Its properties.
        knife: Name of the knife.
        arm: What holds it.
        coarse: Cells and speed of a screening run.

    Raises:
        SceneError: A cut that the solver cannot make.
    """
    z = command[:, 2]
    shape = item.shape
    bottom = int(np.argmin(z))
    depth = shape.height - float(z[bottom])
    entry = int(np.argmax(z[: bottom + 1] < shape.height)) if depth > 0 else bottom
    if depth < SHORTEST or bottom == entry:
        return None
    first = max(entry - 1, 0)
    span = (bottom - first) / RATE
    down = max((float(z[first]) - float(z[bottom])) / span, SLOWEST)
    yaw = float(command[bottom, 3])
    edge = np.array([np.cos(yaw), np.sin(yaw)])
    drawn = float((command[bottom, :2] - command[first, :2]) @ edge) / span
    held = int((z[bottom:] <= z[bottom] + 1e-4).sum()) - 1
    scene = cut_place(item, along, food, knife=knife, coarse=coarse)
    stroke = depth if not arm.rigid else min(depth, shape.height)
    ratio = drawn / down if abs(drawn) > LEAST_DRAW * down else 0.0
    motion = replace(scene.motion, stroke=stroke, slice_ratio=ratio, speed=down, dwell=held / RATE)
    return replace(scene, motion=motion, arm=arm)


def sever(
    item: Item,
    along: float,
    command: np.ndarray,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    arm: Arm = ARM,
    coarse: bool = True,
) -> tuple[Severed, ForceRecord | None]:
    """Simulate a cut; the arguments are those of :func:`scene_of`. Returns the finding, and the record where there is one."""
    try:
        scene = scene_of(item, along, command, food, knife=knife, arm=arm, coarse=coarse)
        if scene is None:
            return Severed(False, why="the edge does not reach into the food"), None
        record = Simulation(scene).run()
    except SceneError as e:
        return Severed(None, why=str(e)), None
    if record.status != "done" or record.pieces is None:
        return Severed(
            None,
            peak=record.peak,
            why=f"the simulation stopped at {record.fraction:.0%} of the motion: {record.status}",
        ), record
    whole = record.severed_area + record.pieces.uncut_area
    short = float(record.command[-1] - record.stroke[-1])
    found = Severed(record.pieces.complete, record.pieces.uncut_area / whole, record.peak, short, record.pieces.words())
    return found, record
