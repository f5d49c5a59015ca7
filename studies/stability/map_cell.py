"""A cell of the stability map: one small cut with one or two things pushed to the end of their range or past it.

All cells of the map are cuts of a block of 20 mm with a process zone of 5 mm, so that cells of the grid of 5 mm are
allowed. Resistance and yield stress follow the stiffness, because the ratios decide whether a food is cut or crushed.
The knife moves at a Mach number, so its real speed matters only to foods that relax. A scene holds one material, so a
contrast of density is one between foods, not inside one.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from calib.io.provenance import key_of
from mpm.errors import SceneError
from mpm.material import Material
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.shapes import Shape

BLOCK_SIZE = 0.02  # edge of the block [m]
CUTTING_LENGTH = 1e-3  # R / E [m]; 0.04 to 1.3 mm for the foods of materials.yaml
YIELD_STRAIN = 0.2  # yield stress / E [-]; 0.075 to 0.2 there
BASE_KNIFE = Knife("blade", 2e-3, math.radians(15.0), 0.03, 0.2)
BASE_MATERIAL = Material(
    E=1e5,
    nu=0.4,
    rho=1000.0,
    yield_stress=YIELD_STRAIN * 1e5,
    R=CUTTING_LENGTH * 1e5,
    R_initiation=CUTTING_LENGTH * 1e5,
    mu=0.3,
)
BASE_SCENE = Scene(
    Food(Shape("block", BLOCK_SIZE, BLOCK_SIZE, BLOCK_SIZE), BASE_MATERIAL),
    BASE_KNIFE,
    Motion(BLOCK_SIZE, 0.01),
    edge=EdgeLaw(zone=5e-3),
    numerics=Numerics(dx=2.5e-3, output=1e-4, room=3.0),  # room for halves that fall over
)

SOUND_STEP = 0.8  # cells below this part of the limit must be stable where the food is a physical one
CHECKED_STEP = 0.9  # what Numerics allows
USUAL_CUTTING_LENGTH = 2e-3
USUAL_YIELD_STRAIN = 0.05
USUAL_SAG = 0.25  # weight of the food's height over its stiffness [-]
USUAL_MU = 1.0
USUAL_LOSS = 0.2
USUAL_MACH = 0.02
USUAL_DWELL = 60.0  # [s]; a longer pause is no danger but takes long
HOLDING_MU = 1.0  # friction on the board of food that is held while it is sliced
USUAL_SPINE = 0.25  # thickness of the blade over the size of the block [-]
WAVE_STEPS = 1.5  # steps in which a wave crosses a cell where the step is at its limit
HIGHEST = 3.0  # cells above the food that the grid has

Checked = TypeVar("Checked")


@dataclass(frozen=True)
class StartState:
    """How a run starts otherwise than a cut does.

    Attributes:
        lift: Height of the food above the board [m].
        squeeze: Length of the food over its true length, by which all particles are drawn together [-].
        strained: Whether the particles feel that they were drawn together.
        depth: How deep the edge is in the food [m].
        aside: Way of the blade along its edge [m].
    """

    lift: float = 0.0
    squeeze: float = 1.0
    strained: bool = False
    depth: float = 0.0
    aside: float = 0.0


@dataclass(frozen=True)
class MapCell:
    """One cell of the map.

    Attributes:
        family: What is varied.
        values: Names with units and values of what is varied.
        scene: What is simulated; None where the checks refuse it.
        refusal: What they say.
        start: How the run starts.
        forced: Whether the scene was made past the checks.
        step: Factor on the time step of the scene, also where the edge and not the wave speed limits it [-].
    """

    family: str
    values: Mapping[str, Any]
    scene: Scene | None
    refusal: str = ""
    start: StartState = field(default_factory=StartState)
    forced: bool = False
    step: float = 1.0

    @property
    def words(self) -> str:
        """The cell in words."""
        named = {k: f"{v:g}" if isinstance(v, float) else str(v) for k, v in self.values.items()}
        values = ", ".join(v if k == "what" else f"{k} {v}" for k, v in named.items())
        return f"{self.family}: {values}{' (forced)' if self.forced else ''}"

    @property
    def key(self) -> str:
        """What determines the run."""
        return key_of([self.scene.as_dict() if self.scene else self.refusal, vars(self.start), self.step])

    @property
    def physical(self) -> bool:
        """Whether a cut like this one exists and the time step is below 0.8 of the limit: it must be stable."""
        if self.scene is None or self.forced or self.start.squeeze != 1 or self.start.depth > 0:
            return False
        m, n = self.scene.food.material, self.scene.numerics
        motion, knife = self.scene.motion, self.scene.knife
        if self.start.lift > HIGHEST * n.dx or not isinstance(knife, Knife) or knife.spine > USUAL_SPINE * BLOCK_SIZE:
            return False
        if motion.dwell > USUAL_DWELL or motion.slice_ratio != 0 and self.scene.board.mu < HOLDING_MU:
            return False
        return (
            n.safety < SOUND_STEP
            and m.nu >= 0
            and m.R <= USUAL_CUTTING_LENGTH * m.E
            and m.start <= USUAL_CUTTING_LENGTH * m.E
            and m.yield_stress >= USUAL_YIELD_STRAIN * m.E
            and m.rho * n.gravity * self.scene.food.shape.height <= USUAL_SAG * m.E
            and m.mu <= USUAL_MU
            and m.loss_factor <= USUAL_LOSS
            and motion.mach <= USUAL_MACH
        )

    @property
    def cost(self) -> float:
        """Particle steps of the run, roughly."""
        if self.scene is None:
            return 0.0
        n, motion = self.scene.numerics, self.scene.motion
        images = math.prod(2 if mirror else 1 for mirror in self.scene.mirrors)
        particles = (n.ppc * BLOCK_SIZE / n.dx) ** 3 / images
        return particles * WAVE_STEPS * motion.stroke / (motion.mach * n.safety * self.step * n.dx)


def material_values(E: float = 1e5, **others: Any) -> dict[str, Any]:
    """Constants of a food of this stiffness [Pa]: resistance and yield stress in proportion, unless given."""
    R = others.get("R", CUTTING_LENGTH * E)
    return {"E": E, "yield_stress": YIELD_STRAIN * E, "R_initiation": R, "R": R, **others}


def map_cell(
    family: str,
    values: Mapping[str, Any],
    *,
    start: StartState | None = None,
    material: Mapping[str, Any] | None = None,
    **parts: Mapping[str, Any],
) -> MapCell:
    """A cell whose scene passes all checks, or what they say.

    Args:
        family: What is varied.
        values: Names and values of what is varied.
        start: How the run starts.
        material: Other constants of the food.
        parts: Other values of knife, motion, board, edge, numerics, arm.

    Returns:
        The cell; without a scene where the checks refuse it.
    """
    start = start or StartState()
    try:
        made: dict[str, Any] = {name: replace(getattr(BASE_SCENE, name), **changed) for name, changed in parts.items()}
        stuff = replace(BASE_MATERIAL, **(material or {}))
        food = replace(BASE_SCENE.food, material=stuff)
        return MapCell(family, values, replace(BASE_SCENE, food=food, **made), start=start)
    except SceneError as error:
        return MapCell(family, values, None, str(error), start)


def forced(one: MapCell, **values: float) -> MapCell:
    """The cell with ``nu`` or ``safety`` beyond the checks of material and numerics.

    This is how the map sees what the solver does past its limits; a user cannot make such a scene.
    """
    scene = one.scene
    assert scene is not None
    if "nu" in values:
        scene = _past(scene, food=_past(scene.food, material=_past(scene.food.material, nu=values["nu"])))
    if "safety" in values:
        scene = _past(scene, numerics=_past(scene.numerics, safety=1.0))
    return replace(one, scene=scene, forced=True, step=values.get("safety", one.step))


def _past(part: Checked, **values: Any) -> Checked:
    """A copy of a frozen dataclass with values that its checks would refuse."""
    out = copy.copy(part)
    for name, value in values.items():
        object.__setattr__(out, name, value)
    return out


def stepped(family: str, values: Mapping[str, Any], safety: float, **others: Any) -> Iterator[MapCell]:
    """A cell with this time step over the limit; beyond what is allowed it is refused, and a forced one comes with it.

    Args:
        family: What is varied.
        values: Names and values of what is varied.
        safety: Time step over its limit [-].
        others: Further arguments of :func:`map_cell`.

    Yields:
        One cell or two.
    """
    numerics = dict(others.pop("numerics", {}))
    yield map_cell(family, values, numerics={**numerics, "safety": safety}, **others)
    if safety > CHECKED_STEP:
        yield forced(map_cell(family, values, numerics=numerics, **others), safety=safety)
