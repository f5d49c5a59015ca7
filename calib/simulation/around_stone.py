"""Halving a fruit around its stone: the fruit is turned under the blade, and each pass goes down to the stone.

A knife that is run round a stone touches it all round, and what it leaves is the stone. Here the fruit is turned by
even steps about the axis across the blade, and each pass is a straight cut from above that ends where the stone begins.
After n passes the flesh outside of the polygon of n sides around the stone is parted. What is left are the corners
between stone and polygon; they tear when the halves are twisted, and their area is told. A pass finds open what the
passes before have parted, but not the dents and the flow that they left. A fruit that is not round has the outline of
its caliper sizes while it is turned.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpm.output.record import LIMIT, ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Inclusion, Parted, Scene
from mpm.scene.errors import SceneError
from mpm.scene.shapes import Shape, inside

TURNED_KINDS = ("sphere", "ellipsoid", "cylinder", "capsule")  # outlines that are round about the axis of the turning
TURNS = 8  # passes of a full turn: what is left is 5.5 % of the stone's section
LEAST_TURNS = 3
MOST_LEFT = 0.05  # part of the section's flesh that may be left at the corners of a halved fruit
SAMPLES = 600  # points along the width and along the height of the section, to find what is left


@dataclass(frozen=True)
class Pass:
    """One pass of a cut around a stone.

    Attributes:
        turn: Direction from which the blade comes, in the fruit as it lay: from its top towards +x [rad].
        record: The cut.
        reached: Distance of the edge from the fruit's middle at its end [m].
    """

    turn: float
    record: ForceRecord
    reached: float

    @property
    def complete(self) -> bool:
        """Whether the blade came down to the stone."""
        return self.record.status == "done" and self.record.ended != LIMIT


@dataclass(frozen=True)
class Around:
    """A cut around a stone.

    Attributes:
        passes: What was done, in order.
        flesh: Area of the section's flesh [m^2].
        left: What of it holds still [m^2].
    """

    passes: tuple[Pass, ...]
    flesh: float
    left: float

    @property
    def peak(self) -> float:
        """Largest force of all passes [N]."""
        return max(one.record.peak for one in self.passes)

    @property
    def work(self) -> float:
        """Work of all passes [J]."""
        return sum(one.record.work for one in self.passes)

    @property
    def severed_part(self) -> float:
        """Part of the section's flesh that is parted [-]."""
        return 1.0 - self.left / self.flesh

    @property
    def severed(self) -> bool:
        """Whether the fruit is halved: every pass came down to the stone, and little is left at the corners."""
        return all(one.complete for one in self.passes) and self.left <= MOST_LEFT * self.flesh

    def words(self) -> str:
        """The finding in a sentence."""
        what = f"{len(self.passes)} passes of at most {self.peak:.1f} N, {self.severed_part:.1%} of the section's flesh"
        if self.severed:
            return f"severed around the stone: {what}; {self.left * 1e6:.0f} mm^2 at its corners tear with a twist"
        why = "" if all(one.complete for one in self.passes) else "the arm stopped before the stone; "
        return f"not severed around the stone: {why}{what}; {self.left * 1e6:.0f} mm^2 hold"


def stone_of(scene: Scene) -> Inclusion:
    """The stone that a scene is to be cut around.

    Raises:
        SceneError: There is none in the blade's plane, or the fruit cannot be turned.
    """
    stone, shape = scene.food.stone, scene.food.shape
    if stone is None or stone not in scene.food.crossed:
        raise SceneError("around: there is no stone in the blade's plane; give one (--stone), or cut straight through")
    if shape.kind not in TURNED_KINDS:
        raise SceneError(f"around: a {shape.kind} cannot be turned under the blade; one of {', '.join(TURNED_KINDS)}")
    return stone


def turned(shape: Shape, angle: float) -> Shape:
    """The outline of a fruit that was turned about the axis across the blade: that of its caliper sizes.

    Args:
        shape: The outline as it lay.
        angle: By which it was turned, +x towards the top [rad].

    Returns:
        The outline.
    """
    c, s = abs(math.cos(angle)), abs(math.sin(angle))
    width = math.hypot(shape.width * c, shape.height * s)
    return replace(shape, width=width, height=math.hypot(shape.width * s, shape.height * c))


def turned_stone(stone: Inclusion, angle: float) -> Inclusion:
    """A stone that was turned with its fruit by an angle [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    aside, above = stone.aside * c - stone.above * s, stone.aside * s + stone.above * c
    return replace(stone, aside=aside, above=above, turn=(stone.turn - angle) % math.pi)


def pass_scene(scene: Scene, turn: float, before: Sequence[Pass] = ()) -> Scene:
    """The scene of one pass.

    Args:
        scene: The cut of the fruit as it lies, with its stone.
        turn: Direction from which the blade comes, from the fruit's top towards +x [rad].
        before: Passes that were done.

    Returns:
        The scene of a straight cut that ends where the stone begins.
    """
    shape = turned(scene.food.shape, turn)
    stone = turned_stone(stone_of(scene), turn)
    parted = tuple(Parted(one.turn - turn, one.reached) for one in before)
    food = replace(scene.food, shape=shape, stone=stone, parted=parted)
    stroke = shape.height - stone.section_top(shape)
    return replace(scene, food=food, motion=replace(scene.motion, stroke=stroke))


def left_over(scene: Scene, done: Sequence[Pass]) -> float:
    """Area of the section's flesh that passes have left [m^2].

    Args:
        scene: The cut of the fruit as it lies.
        done: The passes.
    """
    food, shape = scene.food, scene.food.shape
    even = (np.arange(SAMPLES) + 0.5) / SAMPLES
    x, z = (axis.ravel() for axis in np.meshgrid((even - 0.5) * shape.width, even * shape.height))
    points = np.column_stack([x, np.zeros_like(x), z])
    points = points[inside(shape, points)]
    points = points[~food.stony(points)]
    cut = np.zeros(len(points), bool)
    for one in done:
        cut |= Parted(one.turn, one.reached).holds(shape, points)
    return food.section_area * float((~cut).mean())


def cut_around(scene: Scene, turns: int = TURNS, runtime: Runtime | None = None) -> Iterator[Around]:
    """Cut a fruit around its stone, pass by pass.

    Args:
        scene: The cut of the fruit as it lies, with its stone; its stroke is not used.
        turns: Passes of a full turn.
        runtime: Device.

    Yields:
        What is done after each pass.

    Raises:
        SceneError: A fruit without a stone in the blade's plane, or too few turns.
    """
    from mpm.solver import Simulation

    stone_of(scene)
    if turns < LEAST_TURNS:
        raise SceneError(f"around: {turns} passes make no polygon around a stone; give at least {LEAST_TURNS}")
    done: list[Pass] = []
    for k in range(turns):
        turn = 2 * math.pi * k / turns
        one = pass_scene(scene, turn, done)
        record = Simulation(one, runtime).run()
        stroke = float(record.stroke[-1]) if len(record.stroke) else 0.0
        done.append(Pass(turn, record, one.food.shape.height / 2 - stroke))
        yield Around(tuple(done), scene.food.section_area, left_over(scene, done))
        if not done[-1].complete:
            return
