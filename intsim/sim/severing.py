"""Whether a blade's motion parts the food: the motion's descent in the cutting solver, behind an arm that yields."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import CELL_PER_ZONE, LENGTH_PER_HEIGHT, Sizing, cut_scene, specimen
from intsim.task.pieces import piece_shape
from intsim.task.planner import CONTROL_RATE
from intsim.task.targets import Item
from mpm.output.record import ForceRecord
from mpm.scene import Arm, Scene
from mpm.scene.errors import SceneError
from mpm.scene.shapes import Shape
from mpm.solver import Simulation

PANDA_ARM = Arm(1 / 0.57e-3)
"""ManiSkill's Panda with its own gains: it gives way by 0.57 mm per N of vertical reaction."""
MIN_DESCENT_SPEED = 1e-3  # speed of a descent that still is one [m/s]
MIN_SLICE_RATIO = 1e-3
"""Speed along the edge over that down below which a cut is a press and keeps its mirror plane [-]."""
MIN_CELLS = 2  # in the thinner part of the food, as mpm.scene asks
FINEST_CELL = 1 / 3
"""Finest cell over the usual one [-].

The cost grows with the fourth power of the number of cells over a length, and an evaluation has hundreds of cuts.
"""
MIN_CUT_DEPTH = 1e-3  # way into the food that still is a cut [m]


@dataclass(frozen=True)
class SeveringOutcome:
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


def cut_scene_at(
    item: Item,
    along: float,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    coarse: bool = True,
    cells: int | None = None,
) -> Scene:
    """A press cut through a food, or the piece of it that is there, at a place along its axis.

    A place nearer to the end than two cells asks for finer ones. A piece lies on the board at rest: how it was deformed
    before is forgotten.

    Args:
        item: The food as it is.
        along: Where along its axis [m].
        food: Its properties.
        knife: Name of the knife.
        coarse: Cells and speed of a screening run.
        cells: Most cells over height and width; a large food has larger cells, and with them a wider process zone.

    Returns:
        The scene of the cut.

    Raises:
        SceneError: A cut that the solver cannot make.
    """
    which = item.piece_at(along)
    if which is None:
        raise SceneError(f"no piece of the {item.name} lies {1e3 * along:.1f} mm from its middle")
    shape = sized = _simulated_part(item, which, along - item.pieces[which].shift, food)
    least = min(-sized.ends[0], sized.ends[1])
    # cells and zone do not depend on the length, and a slice may be too short for the usual cells
    whole, blade = replace(sized, cut=0.0, length=max(sized.length, sized.height)), load_knife(knife)
    usual = cut_scene(food, whole, blade, coarse=coarse)
    largest = 0.0 if cells is None else min(shape.height, shape.width) / cells
    if largest > usual.numerics.dx:
        usual = cut_scene(food, whole, blade, coarse=coarse, dx=largest * (CELL_PER_ZONE if coarse else 1.0))
    cell = min(usual.numerics.dx, least / MIN_CELLS)
    if cell < FINEST_CELL * usual.numerics.dx:
        raise SceneError(
            f"a slice of {least * 1e3:.2g} mm would need cells of {cell * 1e3:.2g} mm, which take too long"
        )
    return replace(usual, food=replace(usual.food, shape=sized), numerics=replace(usual.numerics, dx=cell))


def _simulated_part(item: Item, which: int, place: float, food: FoodSpec) -> Shape:
    """The piece as it is simulated: of parallel sides only what is near the cut.

    ``place`` is where the blade is, along the axis of the uncut food [m].
    """
    if len(item.pieces) == 1 and item.shape.outline is None:
        whole = item.shape
        sizing = Sizing(whole.kind, whole.height, whole.width, None, 0.5 + place / whole.length)
        return specimen(food, None, sizing)[0]
    piece = piece_shape(item, which, place)
    if not piece.prism:
        return piece
    most = LENGTH_PER_HEIGHT * piece.height / 2
    low, high = (min(abs(end), most) for end in piece.ends)
    return replace(piece, length=low + high, cut=(low - high) / 2)


def commanded_scene(
    item: Item,
    along: float,
    command: np.ndarray,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    arm: Arm = PANDA_ARM,
    coarse: bool = True,
) -> Scene | None:
    """The cut that a commanded motion makes.

    Taken from the motion: the way down from the food's top, its mean speed, the draw along the edge, and how long the
    lowest place is held.

    Args:
        item: The food before the cut, whole.
        along: Where along its axis [m].
        command: Commanded poses x, y, z [m], yaw and tilt [rad], one for each control step, shape (n, 5).
        food: Its properties.
        knife: Name of the knife.
        arm: What holds it.
        coarse: Cells and speed of a screening run.

    Returns:
        The scene; None where the motion does not reach into the food.

    Raises:
        SceneError: A cut that the solver cannot make.
    """
    z = command[:, 2]
    shape = item.shape
    bottom = int(np.argmin(z))
    depth = shape.height - float(z[bottom])
    entry = int(np.argmax(z[: bottom + 1] < shape.height)) if depth > 0 else bottom
    if depth < MIN_CUT_DEPTH or bottom == entry:
        return None
    first = max(entry - 1, 0)
    span = (bottom - first) / CONTROL_RATE
    down = max((float(z[first]) - float(z[bottom])) / span, MIN_DESCENT_SPEED)
    yaw = float(command[bottom, 3])
    edge = np.array([np.cos(yaw), np.sin(yaw)])
    drawn = float((command[bottom, :2] - command[first, :2]) @ edge) / span
    held = int((z[bottom:] <= z[bottom] + 1e-4).sum()) - 1
    scene = cut_scene_at(item, along, food, knife=knife, coarse=coarse)
    stroke = depth if not arm.rigid else min(depth, shape.height)
    ratio = drawn / down if abs(drawn) > MIN_SLICE_RATIO * down else 0.0
    motion = replace(scene.motion, stroke=stroke, slice_ratio=ratio, speed=down, dwell=held / CONTROL_RATE)
    return replace(scene, motion=motion, arm=arm)


def simulate_severing(
    item: Item,
    along: float,
    command: np.ndarray,
    food: FoodSpec,
    *,
    knife: str = "kitchen",
    arm: Arm = PANDA_ARM,
    coarse: bool = True,
) -> tuple[SeveringOutcome, ForceRecord | None]:
    """Simulate the cut that a commanded motion makes.

    Args:
        item: The food before the cut, whole.
        along: Where along its axis [m].
        command: Commanded poses x, y, z [m], yaw and tilt [rad], one for each control step, shape (n, 5).
        food: Its properties.
        knife: Name of the knife.
        arm: What holds it.
        coarse: Cells and speed of a screening run.

    Returns:
        The finding, and the record; None without a simulation.
    """
    try:
        scene = commanded_scene(item, along, command, food, knife=knife, arm=arm, coarse=coarse)
        if scene is None:
            return SeveringOutcome(False, why="the edge does not reach into the food"), None
        record = Simulation(scene).run()
    except SceneError as e:
        return SeveringOutcome(None, why=str(e)), None
    if record.status != "done" or record.pieces is None:
        return SeveringOutcome(
            None,
            peak=record.peak,
            why=f"the simulation stopped at {record.fraction:.0%} of the motion: {record.status}",
        ), record
    whole = record.severed_area + record.pieces.uncut_area
    short = float(record.command[-1] - record.stroke[-1])
    found = SeveringOutcome(
        record.pieces.complete, record.pieces.uncut_area / whole, record.peak, short, record.pieces.words()
    )
    return found, record
