"""From a food, a knife and a conditioned trace to the scene that is simulated; every assumption is said."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.material.food import FoodSpec
from calib.trace.conditioning import Conditioned
from mpm.scene import EdgeLaw, Knife, Motion, Numerics, Scene
from mpm.scene.shapes import Shape

ZONE_M = 4e-3  # process zone of the edge; small foods get an eighth of their height
ZONE_PARTS = 8
CELL_PER_ZONE = 0.75  # default cell, so that the zone spans 1.3 cells; the coarse grid has one cell to the zone
CLEARANCE_ZONES = 1.0  # least food left below the edge where a trace ends under load
HEIGHT_SPAN = 1.25  # a specimen of unknown height may be at least this many times higher than the lowest it can be
UNDER_LOAD = 0.5  # the trace ends under load when its last force exceeds this part of its median after the peak
# Multiples of these, less whole cells, are the places of the grid in repeated runs: they fill the cell evenly (powers of the root
# of g^3 = g + 1: Roberts 2018).
PLACES = np.array([0.7548776662, 0.5698402910])
LENGTH_PER_HEIGHT = 4.0
"""Largest simulated length across the blade of a food with parallel sides. The blade bends its halves apart like the arms of a double
cantilever beam (Gurney and Hunt 1967), so the force on its faces grows with the length: a cucumber of one height needs 0.56 of the
work of one of five, two heights need 0.77, three 0.93, four 0.99; for a banana, which flows, two are enough."""
PRISMS = ("block", "cylinder", "half_cylinder", "capsule")
MIDDLE = 0.5  # place of the blade where nothing else is said, in parts of the length
FAR = 0.25
"""Distance from the cut from which on there are fewer particles, over the height: peak and work of banana, cucumber and pear
change by 0.3 % at most, their curves by 0.4 % of the peak, and long foods take half the time."""


@dataclass(frozen=True)
class Sizing:
    """Sizes of the specimen, each given by the user or None, and where along its length it is cut.

    Attributes: shape; height, width, length [m]; at, part of the length on the left of the blade (y < 0) [-].
    """

    shape: str | None = None
    height: float | None = None
    width: float | None = None
    length: float | None = None
    at: float = MIDDLE

    @property
    def kept(self) -> tuple[str, ...]:
        """Which of width and length were measured, and so do not follow a fitted height."""
        return tuple(name for name in ("width", "length") if getattr(self, name) is not None)


def specimen(food: FoodSpec, trace: Conditioned | None, sizing: Sizing) -> tuple[Shape, list[str]]:
    """Shape of the specimen, and what had to be assumed about it.

    Real traces rarely come with the specimen's size. Where the trace has a position and ends released, the height is
    the stroke; where it ends under load it lies in :func:`height_range`. Width and length that are not given keep the food's
    proportions. The force is proportional to the width, so only the product of resistance and width is seen by one
    trace.

    Raises:
        SceneError: A shape or size that cannot be simulated.
    """
    said: list[str] = []
    default = food.to_scene_food(shape=sizing.shape).shape
    height = sizing.height
    if height is None and trace is not None and trace.stroke_source != "height":
        free = height_range(food, trace, sizing)
        if free is None:
            height = trace.stroke_length_m
            said.append(
                f"the specimen's height is not known: {height * 1e3:.1f} mm is the stroke, because the trace ends "
                "released; give --height if you measured it"
            )
        else:
            low, height, high = free
            said.append(
                f"the specimen's height is not known: the trace ends under load, so the edge stopped above the board, and "
                f"{low * 1e3:.0f} to {high * 1e3:.0f} mm are possible; give --height if you measured it"
            )
    height = default.height if height is None else height
    width = sizing.width
    if width is None:
        width = default.width * height / default.height
        said.append(
            "the specimen's width is not known: it keeps the proportions of the food; resistances are only identified as "
            "their product with it; give --width if you measured it"
        )
    whole, most = sizing.length, math.inf
    if whole is None:
        whole = default.length * height / default.height
        if default.kind in PRISMS:
            most = LENGTH_PER_HEIGHT * height / 2
    left, right = min(sizing.at * whole, most), min((1 - sizing.at) * whole, most)
    length = left + right
    if sizing.length is None:
        said.append(
            f"the specimen's length across the blade is not known: {length * 1e3:.0f} mm keep the proportions of the food; the blade "
            "bends longer halves apart with more force; give --length if you measured it"
        )
    return Shape(default.kind, length, width, height, (left - right) / 2), said


def height_range(food: FoodSpec, trace: Conditioned, sizing: Sizing) -> tuple[float, float, float] | None:
    """Lowest, likely and largest height of a specimen whose trace ends under load [m]; None where it is known.

    The edge then stopped above the board: the food is higher than the stroke by a process zone at least, and where the
    literature's range allows, within it.
    """
    late = trace.curve[int(trace.curve.argmax()) :]
    loaded = trace.curve[-1] > UNDER_LOAD * float(sorted(late)[len(late) // 2])
    if sizing.height is not None or trace.stroke_source == "height" or not loaded:
        return None
    known = food.dims["height"]
    low = trace.stroke_length_m + CLEARANCE_ZONES * min(ZONE_M, trace.stroke_length_m / ZONE_PARTS)
    high = max(known.high, HEIGHT_SPAN * low)
    return low, known.value if low < known.value < high else (low * high) ** 0.5, high


def place(scene: Scene, values: Mapping[str, float], kept: Collection[str] = ()) -> tuple[Scene, dict[str, float]]:
    """The scene at a fitted height, and the values that are left: those of the material.

    The cell grows with the height, so that every height has the same particles and nodes: on a fixed cell each height
    would draw other particles, and the force would jump by several per cent from one to the next.

    Args:
        scene: The scene with any height.
        values: Fitted values by name, ``height`` [m] among them or not.
        kept: Which of ``width`` and ``length`` do not grow with the height, because they were measured.
    """
    rest = dict(values)
    height = rest.pop("height", None)
    if height is None:
        return scene, rest
    shape = scene.food.shape
    k = height / shape.height
    sizes = {name: getattr(shape, name) * (1.0 if name in kept else k) for name in ("width", "length")}
    cut = shape.cut * sizes["length"] / shape.length
    food = replace(scene.food, shape=replace(shape, height=height, cut=cut, **sizes))
    cell, far = k * scene.numerics.dx, scene.numerics.far
    return (
        replace(
            scene,
            food=food,
            numerics=replace(scene.numerics, dx=cell, far=None if far is None else k * far),
            edge=replace(scene.edge, zone=max(scene.edge.zone, cell)),
        ),
        rest,
    )


def windowed(scene: Scene, heights: tuple[float, float, float] | None = None) -> Scene:
    """The scene with half a cell more of stroke, where the food is that high.

    The simulated force is a mean over a cell of the way, which up to the end of what is compared then has its whole window. Where
    it has not, the mean is carried on along a line, and what the grid adds with it: the last sample of an apple's cut, its peak, changed
    by -0.3 to -6.3 % in six runs at another speed, with other particles, grids and cells, and by -2.3 to +1.9 % with its window.

    Args:
        scene: The scene of what is compared.
        heights: As :func:`height_range` gives them; its cell will grow with its height.
    """
    own = scene.food.shape.height
    low, _, high = heights or (own, own, own)
    stroke = min(scene.motion.stroke + 0.5 * scene.numerics.dx * high / own, low)
    return replace(scene, motion=replace(scene.motion, stroke=stroke))


def elsewhere(scene: Scene, k: int) -> Scene:
    """The scene with other particles and the grid shifted along the blade and upwards, for k = 1, 2, ...

    Across the blade the grid stays: the blade lies on a plane of nodes in every run that is compared, and what leaving it
    changes is no scatter (see ``numerics.grid_shift`` and ``cutcal converge --offset``). A scene whose grid is mirrored along the
    blade is shifted by half a cell there and stays so: for a banana a quarter and three quarters give the same work to 0.05 %, at
    twice the cost.
    """
    x, z = (float(part) for part in np.round(k * PLACES % 1.0, 4))
    along, across, _ = scene.numerics.grid_shift
    moved = ((along + 0.5) % 1.0 if scene.mirrors[0] else x, across, z)
    return replace(scene, numerics=replace(scene.numerics, seed=scene.numerics.seed + k, grid_shift=moved))


def cut_scene(
    food: FoodSpec,
    shape: Shape,
    knife: Knife,
    *,
    stroke: float | None = None,
    dx: float | None = None,
    mach: float = 0.01,
    coarse: bool = False,
    contact: str = "cohesive",
    grid_shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = 0,
) -> Scene:
    """The scene of one cut.

    Args:
        food: Material and its values.
        shape: Specimen.
        knife: Blade.
        stroke: Way of the edge [m]; the whole height by default.
        dx: Cell [m]; by default three quarters of the process zone, which grows with larger ones: a screening version has the
            same edge.
        mach: Blade speed over the P-wave speed.
        coarse: Screening version of the scene: one cell to the process zone, twice the speed.
        contact: ``cohesive`` or ``nodal``.
        grid_shift: Grid against scene [cells].
        seed: Seed of the particles.

    Raises:
        SceneError: The scene cannot be simulated as asked.
    """
    zone = min(ZONE_M, min(shape.height, shape.width) / ZONE_PARTS)
    cell = dx if dx is not None else CELL_PER_ZONE * zone
    zone = max(zone, cell / CELL_PER_ZONE)
    if coarse:
        cell, mach = cell / CELL_PER_ZONE, 2 * mach
    filled = food.to_scene_food()
    return Scene(
        food=type(filled)(shape, filled.material),
        knife=knife,
        motion=Motion(min(stroke or shape.height, shape.height), mach),
        edge=EdgeLaw(zone=zone),
        numerics=Numerics(dx=cell, far=FAR * shape.height, contact=contact, grid_shift=grid_shift, seed=seed),
    )
