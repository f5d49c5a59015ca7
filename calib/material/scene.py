"""From a food, a knife and a conditioned trace to the scene that is simulated; every assumption is said."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.material.cut_speed import END_SPEED, MACH, quasi_static_mach, screening_mach
from calib.material.food import FoodSpec
from calib.material.form import ASPECT_SPAN, open_shape, unusual_stroke
from calib.material.properties import BOARD_FRICTION, BOARD_SUCTION, BOW
from calib.trace.conditioning import Conditioned
from mpm.scene import Board, EdgeLaw, Knife, Motion, Numerics, Scene
from mpm.scene.outline import Outline
from mpm.scene.profiles import spread
from mpm.scene.shapes import OUTLINE, Shape, span

ZONE_M = 4e-3
"""Process zone of the edge [m]; small foods get an eighth of their height."""
ZONE_PARTS = 8
"""Parts of the height or width of a small food that one process zone takes."""
CELL_PER_ZONE = 0.75
"""Default cell over the process zone [-], which then spans 1.3 cells; the coarse grid has one cell to the zone."""
CLEARANCE_ZONES = 1.0
"""Food that is likely left below the edge where a trace ends under load, in process zones."""
HEIGHT_SPAN = 1.25
"""A specimen of unknown height may be at least this many times higher than the lowest it can be."""
UNDER_LOAD = 0.5
"""A trace ends under load when its last force exceeds this part of its median after the peak."""
QUASI_RANDOM = np.array([0.7548776662, 0.5698402910])
"""Multiples of these, less whole cells, are the offsets of the grid in repeated runs: they fill the cell evenly (powers
of the root of g^3 = g + 1: Roberts 2018)."""
LENGTH_PER_HEIGHT = 4.0
"""Largest simulated length across the blade of a food with parallel sides, over its height. The blade bends its halves
apart like the arms of a double cantilever beam (Gurney and Hunt 1967), so the force on its faces grows with the length
(docs/theory.md, "Measured choices")."""
OF_BOARD = {"mu": BOARD_FRICTION, "suction": BOARD_SUCTION, "bow": BOW}
"""Properties of a food that belong to the board under it, by what ``mpm.scene.Board`` calls them."""
FITTED_SIZES = ("height", "aspect", "roundness")
"""What may be fitted of a specimen beside its material."""
MID_LENGTH = 0.5
"""Where the blade cuts when nothing else is said, in parts of the length."""
FAR_PER_HEIGHT = 0.25
"""Distance from the cut from which on there are fewer particles, over the height (docs/theory.md, "Measured
choices")."""
DAMPER_MASS = 0.4
"""Mass of the dampers of a cut over the food's [-], so that a blade that rubs does not make the halves chatter
(docs/theory.md, "Dampers")."""


SizeRange = tuple[float, float, float]
"""Lowest, likely and largest size of a specimen [m], or of a ratio of two [-]."""


@dataclass(frozen=True)
class Sizing:
    """Sizes of the specimen, each given by the user or None, and where along its length it is cut.

    Attributes:
        shape: Kind of its outline, as ``mpm.scene.shapes.named`` reads it.
        height: Height [m].
        width: Width along the blade [m].
        length: Length across the blade [m].
        at: Part of the length on the left of the blade (y < 0) [-].
        outline: Measured outline in place of a shape; the sizes are then its own.
        said: What must be known of it, one sentence each.
    """

    shape: str | None = None
    height: float | None = None
    width: float | None = None
    length: float | None = None
    at: float = MID_LENGTH
    outline: Outline | None = None
    said: tuple[str, ...] = ()

    @property
    def kept(self) -> tuple[str, ...]:
        """Which of width and length were measured, and so do not follow a fitted height."""
        return tuple(name for name in ("width", "length") if getattr(self, name) is not None)


def specimen(
    food: FoodSpec, trace: Conditioned | None, sizing: Sizing, *, open_form: bool = False, knife: Knife | None = None
) -> tuple[Shape, list[str]]:
    """Shape of the specimen, and what had to be assumed about it.

    Real traces rarely come with the specimen's size. Where the trace has a position and ends released or on the board,
    the height is the stroke; where it ends under load it lies in :func:`height_range`. Width and length that are not
    given keep the food's proportions. The force is proportional to the width, so only the product of resistance and
    width is seen by one trace, unless the food is wider than its blade is long (:func:`aspect_range`).

    Args:
        food: The food with its usual sizes.
        trace: The measured cut, None where there is none: then a height that is not given is the usual one.
        sizing: What is known of the specimen.
        open_form: Whether its form is fitted (:func:`form_is_open`).
        knife: The blade, where a width that it does not reach across is fitted.

    Returns:
        The shape, and what had to be assumed, one sentence each.

    Raises:
        SceneError: A shape or size that cannot be simulated.
    """
    said = list(sizing.said)
    default = food.to_scene_food(shape=open_shape(food) if open_form else sizing.shape).shape
    if sizing.outline is not None:
        default = replace(default, kind=OUTLINE, outline=sizing.outline)
    height, fits_height = sizing.height, False
    if height is None and trace is not None and trace.stroke_source != "height":
        said += unusual_stroke(food, trace.stroke_length_m, trace.stroke_source)
        free = height_range(food, trace, sizing)
        if free is None:
            height = trace.stroke_length_m
            why = "the edge comes to the board there" if trace.at_board else "the trace ends released"
            said.append(
                f"the specimen's height is not known: {height * 1e3:.1f} mm is the stroke, because {why}; give "
                "--height if you measured it"
            )
        else:
            (low, height, high), fits_height = free, True
            said.append(
                "the specimen's height is not known: the trace ends under load, so the edge stopped on the board or "
                f"above it, and {low * 1e3:.0f} to {high * 1e3:.0f} mm are possible; give --height if you measured it"
            )
    height = default.height if height is None else height
    if open_form:
        said.append(
            "the specimen's shape is not known: its roundness, from a cylinder (0) to an ellipsoid (1) along its "
            "length, is fitted; give --outline if you have a picture of it, or --shape"
        )
    elif sizing.shape is None and sizing.outline is None:
        said.append(
            f"the specimen's shape is not known: it is taken for the food's, {default.words}; another one has another "
            "stiffness and resistance at the same force; give --outline if you have a picture of it, or --shape"
        )
    width = sizing.width
    if width is None:
        width = default.width * height / default.height * spread(default.kind)
    whole, most = sizing.length, math.inf
    if whole is None:
        whole = default.length * height / default.height
        if default.prism:
            most = LENGTH_PER_HEIGHT * height / 2
    left, right = min(sizing.at * whole, most), min((1 - sizing.at) * whole, most)
    length = left + right
    if sizing.length is None:
        # a height that is fitted takes the length along: a number would be that of the start
        size = f"{length / height:.3g} heights" if fits_height else f"{length * 1e3:.0f} mm"
        said.append(
            f"the specimen's length across the blade is not known: {size} keep the proportions of the "
            "food; the blade bends longer halves apart with more force; give --length if you measured it"
        )
    shape = replace(default, length=length, width=width, height=height, cut=(left - right) / 2)
    if sizing.width is None:
        short = None if knife is None else aspect_range(shape, knife, sizing)
        said.append(
            "the specimen's width is not known: it keeps the proportions of the food; resistances are only identified "
            "as their product with it; give --width if you measured it"
            if short is None
            else f"the specimen's width is not known: {short[0]:.2g} to {short[2]:.2g} of its heights are possible, "
            "and the blade may not reach across it; give --width if you measured it"
        )
    return shape, said


def form_is_open(food: FoodSpec, sizing: Sizing) -> bool:
    """Whether nobody said the form of a specimen, and the food's anatomy leaves it open."""
    return food.roundness is not None and sizing.shape is None and sizing.outline is None


def blade_warnings(shape: Shape, knife: Knife) -> list[str]:
    """What a blade that is shorter than the food is wide leaves uncut, one sentence or none.

    Args:
        shape: The specimen.
        knife: The blade.

    Returns:
        The sentence, or nothing.
    """
    left, right = span(shape, 0.0)
    wide, beyond = right - left, max(right, -left) - knife.length / 2
    if beyond <= knife.length / 2 * 1e-9:
        return []
    side = "each" if right == -left else "one"
    return [
        f"the food is {wide * 1e3:.0f} mm wide where it is cut and the blade {knife.length * 1e3:.0f} mm long: "
        f"{beyond * 1e3:.1f} mm on {side} side stay uncut and hold the halves together; give --width if "
        "you measured it, or a longer knife"
    ]


def height_range(food: FoodSpec, trace: Conditioned, sizing: Sizing) -> SizeRange | None:
    """Range of the height of a specimen whose trace ends under load.

    The edge then stopped on the board or above it: the food is as high as the stroke at least. Its likely height is the
    usual one where that is possible, and leaves a process zone below the edge.

    Args:
        food: The food with its usual height and the literature's range of it.
        trace: The measured cut.
        sizing: What is known of the specimen.

    Returns:
        Lowest, likely and largest height [m]; None where the height is given, or follows from the trace.
    """
    late = trace.curve[int(trace.curve.argmax()) :]
    loaded = trace.curve[-1] > UNDER_LOAD * float(sorted(late)[len(late) // 2])
    if sizing.height is not None or trace.stroke_source == "height" or trace.at_board or not loaded:
        return None
    known = food.dims["height"]
    low = trace.stroke_length_m
    high = max(known.high, HEIGHT_SPAN * low)
    likely = known.value if low < known.value < high else (low * high) ** 0.5
    clear = low + CLEARANCE_ZONES * min(ZONE_M, low / ZONE_PARTS)
    return low, max(likely, clear), high


def aspect_range(shape: Shape, knife: Knife, sizing: Sizing) -> SizeRange | None:
    """Range of the width over the height of a specimen that its blade does not reach across.

    What lies beside the blade does not load it: the force stops growing where the chord becomes longer than the blade,
    and the width says when. Under a longer blade a width scales the curve and does not shape it.

    Args:
        shape: The specimen at its likely sizes.
        knife: The blade.
        sizing: What is known of the specimen.

    Returns:
        Lowest, likely and largest ratio [-]: the likely one over and times :data:`calib.material.form.ASPECT_SPAN`.
        None where the width is given, or the blade reaches across the likely one.
    """
    if sizing.width is not None or sizing.outline is not None or not blade_warnings(shape, knife):
        return None
    likely = shape.width / shape.height
    return likely / ASPECT_SPAN, likely, likely * ASPECT_SPAN


def of_specimen(
    scene: Scene, values: Mapping[str, float], kept: Collection[str] = ()
) -> tuple[Scene, dict[str, float]]:
    """The scene at fitted sizes, roundness and friction of the board, and the values left: those of the material.

    The cell grows with the height, so that every height has the same particles and nodes: on a fixed cell each height
    would draw other particles, and the force would jump by several per cent from one to the next. The stroke ends at
    the board, where the height is less.

    Args:
        scene: The scene with any height.
        values: Fitted values by name, ``height`` [m], ``aspect`` [-], ``roundness`` [-], ``board_friction`` [-] and
            ``board_suction`` [Pa] among them or not.
        kept: Which of ``width`` and ``length`` do not grow with the height, because they were measured.

    Returns:
        The scene, and the values without these.
    """
    rest = dict(values)
    board = {name: rest.pop(p) for name, p in OF_BOARD.items() if p in rest}
    if board:
        scene = replace(scene, board=replace(scene.board, **board))
    roundness = rest.pop("roundness", None)
    if roundness is not None:
        scene = replace(scene, food=replace(scene.food, shape=replace(scene.food.shape, roundness=roundness)))
    aspect = rest.pop("aspect", None)
    if aspect is not None:
        own = scene.food.shape
        scene = replace(scene, food=replace(scene.food, shape=replace(own, width=aspect * own.height)))
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
            motion=replace(scene.motion, stroke=min(scene.motion.stroke, height)),
            numerics=replace(scene.numerics, dx=cell, far=None if far is None else k * far),
            edge=replace(scene.edge, zone=max(scene.edge.zone, cell)),
        ),
        rest,
    )


def windowed(scene: Scene, heights: SizeRange | None = None) -> Scene:
    """The scene with half a cell more of stroke, where the food is that high.

    The simulated force is a mean over a cell of the way. With half a cell more, that mean has its whole window up to
    the end of what is compared. Without, it is carried on along a line there, and with it what the grid adds to the
    force (docs/theory.md, "Measured choices").

    Args:
        scene: The scene of what is compared.
        heights: As :func:`height_range` gives them [m]; the cell grows with the height that is fitted.

    Returns:
        The scene.
    """
    own = scene.food.shape.height
    high = own if heights is None else heights[2]
    stroke = min(scene.motion.stroke + 0.5 * scene.numerics.dx * high / own, own)
    return replace(scene, motion=replace(scene.motion, stroke=stroke))


def with_other_particles(scene: Scene, k: int) -> Scene:
    """The scene with other particles and the grid shifted along the blade and upwards.

    Across the blade the grid stays: the blade lies on a plane of nodes in every run that is compared, and what leaving
    it changes is no scatter (see ``numerics.grid_shift`` and ``cutcal converge --offset``). A scene whose grid is
    mirrored along the blade is shifted by half a cell there, and so stays mirrored, at half the cost (docs/theory.md,
    "Measured choices").

    Args:
        scene: The scene.
        k: Which of the others: 1, 2, ...

    Returns:
        The scene, with another seed and another grid shift.
    """
    x, z = (float(part) for part in np.round(k * QUASI_RANDOM % 1.0, 4))
    along, across, _ = scene.numerics.grid_shift
    moved = ((along + 0.5) % 1.0 if scene.mirrors[0] else x, across, z)
    return replace(scene, numerics=replace(scene.numerics, seed=scene.numerics.seed + k, grid_shift=moved))


def cut_scene(
    food: FoodSpec,
    shape: Shape,
    knife: Knife,
    *,
    stroke: float | Motion | None = None,
    dx: float | None = None,
    coarse: bool = False,
    seed: int = 0,
) -> Scene:
    """The scene of one cut.

    What else a motion or a discretisation has is as :class:`mpm.scene.Motion` and :class:`mpm.scene.Numerics` have it
    by default; ``dataclasses.replace`` changes it.

    Args:
        food: Material and its values.
        shape: Specimen.
        knife: Blade.
        stroke: Way of the edge [m]; the whole height by default. A motion says the real speed too, which a food whose
            force depends on it needs; its simulated speed is set here.
        dx: Cell [m]; by default three quarters of the process zone, which grows with larger ones: a screening version
            has the same edge.
        coarse: Screening version of the scene: one cell to the process zone, and up to twice the speed.
        seed: Seed of the particles.

    Returns:
        The scene.

    Raises:
        SceneError: The scene cannot be simulated as asked.
    """
    own = min(ZONE_M, min(shape.height, shape.width) / ZONE_PARTS)
    cell = dx if dx is not None else CELL_PER_ZONE * own
    zone = max(own, cell / CELL_PER_ZONE)
    mach = quasi_static_mach(knife, shape)
    thick = mach < MACH
    if coarse:
        cell, mach = cell / CELL_PER_ZONE, screening_mach(food, knife, shape)
    filled = food.to_scene_food()
    known = {name: food.value(p) for name, p in OF_BOARD.items() if shape.stands or p != BOARD_SUCTION}
    board = Board(**{name: value for name, value in known.items() if value is not None})
    deepest = shape.height - board.height(shape)
    motion = stroke if isinstance(stroke, Motion) else Motion(stroke or deepest)
    return Scene(
        food=type(filled)(shape, filled.material),
        knife=knife,
        board=board,
        motion=replace(motion, stroke=min(motion.stroke, deepest), mach=mach, end_speed=END_SPEED if thick else 1.0),
        edge=EdgeLaw(zone=zone, dent_width=own),
        numerics=Numerics(dx=cell, far=FAR_PER_HEIGHT * shape.height, seed=seed, damper_mass=DAMPER_MASS),
    )
