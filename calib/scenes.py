"""From a food, a knife and a conditioned trace to the scene that is simulated; every assumption is said."""

from __future__ import annotations

from dataclasses import dataclass

from calib.conditioning import Conditioned
from calib.materials import FoodSpec
from mpm.scene import EdgeLaw, Knife, Motion, Numerics, Scene
from mpm.shapes import Shape

ZONE_M = 4e-3  # process zone of the edge; small foods get an eighth of their height
ZONE_PARTS = 8
CELL_PER_ZONE = 0.75  # default cell, so that the zone spans 1.3 cells; the coarse grid has one cell to the zone
CLEARANCE_ZONES = 2.0  # food left below the edge where a trace ends under load
UNDER_LOAD = 0.5  # the trace ends under load when its last force exceeds this part of its median after the peak
LENGTH_PER_HEIGHT = 1.0  # simulated length across the blade; the rest of a long food carries no load


@dataclass(frozen=True)
class Sizing:
    """Sizes of the specimen, each given by the user or None. Attributes: shape, height, width, length [m]."""

    shape: str | None = None
    height: float | None = None
    width: float | None = None
    length: float | None = None


def specimen(food: FoodSpec, trace: Conditioned | None, sizing: Sizing) -> tuple[Shape, list[str]]:
    """Shape of the specimen, and what had to be assumed about it.

    Real traces rarely come with the specimen's size. The height follows from the stroke where the trace has a
    position; a width that is not given keeps the food's proportions. The force is proportional to the width, so only
    the product of resistance and width is seen by one trace.

    Raises:
        SceneError: A shape or size that cannot be simulated.
    """
    said: list[str] = []
    default = food.to_scene_food(shape=sizing.shape).shape
    height = sizing.height
    if height is None and trace is not None and trace.stroke_source != "height":
        late = trace.curve[int(trace.curve.argmax()) :]
        loaded = trace.curve[-1] > UNDER_LOAD * float(sorted(late)[len(late) // 2])
        zone = min(ZONE_M, trace.stroke_length_m / ZONE_PARTS)
        height = trace.stroke_length_m + (CLEARANCE_ZONES * zone if loaded else 0.0)
        why = "it ends under load, so the edge did not reach the board" if loaded else "it ends released"
        said.append(
            f"the specimen's height is not known: {height * 1e3:.1f} mm is taken from the stroke of "
            f"{trace.stroke_length_m * 1e3:.1f} mm, because {why}; give --height if you measured it"
        )
    height = default.height if height is None else height
    width = sizing.width
    if width is None:
        width = default.width * height / default.height
        said.append(
            f"the specimen's width is not known: {width * 1e3:.1f} mm keeps the proportions of the food; resistances are "
            "only identified as their product with it; give --width if you measured it"
        )
    length = sizing.length
    if length is None:
        length = min(default.length * height / default.height, LENGTH_PER_HEIGHT * height)
    return Shape(default.kind, length, width, height), said


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
        dx: Cell [m]; by default three quarters of the process zone.
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
    zone = max(zone, cell)
    if coarse:
        cell, mach = cell / CELL_PER_ZONE, 2 * mach
        zone = max(zone, cell)
    filled = food.to_scene_food()
    return Scene(
        food=type(filled)(shape, filled.material),
        knife=knife,
        motion=Motion(min(stroke or shape.height, shape.height), mach),
        edge=EdgeLaw(zone=zone),
        numerics=Numerics(dx=cell, contact=contact, grid_shift=grid_shift, seed=seed),
    )
