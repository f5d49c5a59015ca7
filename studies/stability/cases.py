"""Cells of the stability map: one small cut with one or two things pushed to the end of their range or past it.

All cells are cuts of a block of 20 mm with a process zone of 5 mm, so that cells of 5 mm are allowed. Resistance and yield
stress follow the stiffness, because the ratios decide whether a food is cut or crushed. The knife moves at a Mach number,
so its real speed matters only to foods that relax. A scene holds one material, so a contrast of density is one between
foods, not inside one.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from calib.io.provenance import key_of
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

SIZE = 0.02  # edge of the block [m]
CUTTING_LENGTH = 1e-3  # R / E [m]; 0.04 to 1.3 mm for the foods of materials.yaml
YIELD_STRAIN = 0.2  # yield stress / E [-]; 0.075 to 0.2 there
BLADE = Knife("blade", 2e-3, math.radians(15.0), 0.03, 0.2)
FOOD = Material(
    E=1e5,
    nu=0.4,
    rho=1000.0,
    yield_stress=YIELD_STRAIN * 1e5,
    R=CUTTING_LENGTH * 1e5,
    R_initiation=CUTTING_LENGTH * 1e5,
    mu=0.3,
)
BASE = Scene(
    Food(Shape("block", SIZE, SIZE, SIZE), FOOD),
    BLADE,
    Motion(SIZE, 0.01),
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

Part = TypeVar("Part")


@dataclass(frozen=True)
class Start:
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
class Cell:
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
    start: Start = field(default_factory=Start)
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
        if self.start.lift > HIGHEST * n.dx or not isinstance(knife, Knife) or knife.spine > USUAL_SPINE * SIZE:
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
        particles = (n.ppc * SIZE / n.dx) ** 3 / images
        return particles * WAVE_STEPS * motion.stroke / (motion.mach * n.safety * self.step * n.dx)


def food(E: float = 1e5, **others: Any) -> dict[str, Any]:
    """Constants of a food of this stiffness [Pa]: resistance and yield stress in proportion, unless given."""
    R = others.get("R", CUTTING_LENGTH * E)
    return {"E": E, "yield_stress": YIELD_STRAIN * E, "R_initiation": R, "R": R, **others}


def cell(
    family: str,
    values: Mapping[str, Any],
    *,
    start: Start | None = None,
    material: Mapping[str, Any] | None = None,
    **parts: Mapping[str, Any],
) -> Cell:
    """A cell whose scene passes all checks, or what they say.

    Args:
        family: What is varied.
        values: Names and values of what is varied.
        start: How the run starts.
        material: Other constants of the food.
        parts: Other values of knife, motion, board, edge, numerics, arm.
    """
    start = start or Start()
    try:
        made: dict[str, Any] = {name: replace(getattr(BASE, name), **changed) for name, changed in parts.items()}
        stuff = replace(FOOD, **(material or {}))
        return Cell(family, values, replace(BASE, food=replace(BASE.food, material=stuff), **made), start=start)
    except SceneError as error:
        return Cell(family, values, None, str(error), start)


def forced(one: Cell, **values: float) -> Cell:
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


def _past(part: Part, **values: Any) -> Part:
    """A copy of a frozen dataclass with values that its checks would refuse."""
    out = copy.copy(part)
    for name, value in values.items():
        object.__setattr__(out, name, value)
    return out


def stepped(family: str, values: Mapping[str, Any], safety: float, **others: Any) -> Iterator[Cell]:
    """A cell with this time step over the limit; beyond what is allowed also the run that is refused."""
    numerics = dict(others.pop("numerics", {}))
    yield cell(family, values, numerics={**numerics, "safety": safety}, **others)
    if safety > CHECKED_STEP:
        yield forced(cell(family, values, numerics=numerics, **others), safety=safety)


STIFFNESSES = (1e3, 1e4, 1e5, 1e6, 1e7, 1e8)
RATIOS = (0.0, 0.2, 0.4, 0.45, 0.49, 0.495)
STEPS = (0.1, 0.4, 0.7, 0.79, 0.9, 1.0, 1.1, 1.2)


def _stiffness_and_ratio(seed: int) -> Iterator[Cell]:
    for E in STIFFNESSES:
        for nu in RATIOS:
            values = {"E_Pa": E, "nu": nu}
            yield cell("E and nu", values, material=food(E, nu=nu), numerics={"seed": seed})
            if nu > 0.49:
                base = cell("E and nu", values, material=food(E, nu=0.49), numerics={"seed": seed})
                yield forced(base, nu=nu)


def _stiffness_and_resistance(seed: int) -> Iterator[Cell]:
    for E in STIFFNESSES:
        for length in (0.0, 1e-6, 1e-4, 1e-3, 2e-3, 1e-2, 1.0):
            material = food(E, R=length * E)
            yield cell("E and R", {"E_Pa": E, "R_over_E_m": length}, material=material, numerics={"seed": seed})


def _step_and_cell(seed: int) -> Iterator[Cell]:
    for dx in (1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3, 5e-3):
        for safety in STEPS if dx > 1e-3 else (0.7, 1.2):
            values = {"dx_m": dx, "dt_over_limit": safety}
            yield from stepped("dt and dx", values, safety, numerics={"dx": dx, "seed": seed})


def _step_and_ratio(seed: int) -> Iterator[Cell]:
    for nu in (0.0, 0.3, 0.45, 0.49):
        for safety in (*STEPS, 1.5, 2.0, 3.0):
            values = {"nu": nu, "dt_over_limit": safety}
            yield from stepped("dt and nu", values, safety, material={"nu": nu}, numerics={"seed": seed})


def _real_speed(seed: int) -> Iterator[Cell]:
    numerics = {"seed": seed}
    for relaxation in (1e-2, 1.0, 100.0):
        for speed in (1e-3, 1e-2, 0.1, 1.0):
            yield cell(
                "speed",
                {"speed_m_s": speed, "relaxation_s": relaxation},
                material={"prony": ((0.5, relaxation),)},
                motion={"speed": speed},
                numerics=numerics,
            )
    yield cell("speed", {"speed_m_s": "not given"}, material={"prony": ((0.5, 1.0),)}, numerics=numerics)
    pause = {"speed": 1.0, "dwell": 9e4}
    yield cell("speed", {"dwell_s": 9e4}, material={"prony": ((0.5, 1.0),)}, motion=pause, numerics=numerics)
    for mach in (1e-3, 2e-3, 5e-3, 0.02, 0.05, 0.09):
        yield cell("mach", {"mach": mach}, motion={"mach": mach}, numerics=numerics)


def _foods(seed: int) -> Iterator[Cell]:
    numerics = {"seed": seed}
    for rho in (100.0, 300.0, 2000.0):
        yield cell("density", {"rho_kg_m3": rho}, material={"rho": rho}, numerics=numerics)
        yield cell("density", {"rho_kg_m3": rho, "E_Pa": 1e3}, material=food(1e3, rho=rho), numerics=numerics)
    for strain in (1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, math.inf):
        yield cell("yield", {"yield_over_E": strain}, material={"yield_stress": strain * FOOD.E}, numerics=numerics)
    for mu in (0.0, 1.0, 5.0):
        yield cell("friction", {"mu": mu}, material={"mu": mu}, numerics=numerics)
    for loss in (0.02, 0.2, 2.0):
        yield cell("loss", {"loss_factor": loss}, material={"loss_factor": loss}, numerics=numerics)
    for pull in (1e2, 1e4):
        sticky = {"adhesion": pull, "adhesion_energy": 1.0}
        yield cell("adhesion", {"adhesion_Pa": pull}, material=sticky, numerics=numerics)
    for strength in (0.05, 0.2):
        broken = {"tensile_strength": strength * FOOD.E, "fracture_energy": FOOD.R}
        yield cell("damage", {"strength_over_E": strength}, material=broken, numerics=numerics)
    skin = {"skin_thickness": 1e-3, "R_skin": 2 * FOOD.R}
    yield cell("skin", {"R_skin_over_R": 2.0}, material=skin, numerics=numerics)


def _ways(seed: int) -> Iterator[Cell]:
    def way(name: str, **parts: Any) -> Cell:
        numerics = {"seed": seed, **parts.pop("numerics", {})}
        return cell("way", {"what": name}, numerics=numerics, **parts)

    yield way("single precision", numerics={"precision": "f32"})
    yield way("nodal contact", numerics={"contact": "nodal"})
    yield way("whole block", numerics={"mirror": False})
    yield way("turned", numerics={"grid_turn": 0.4})
    yield way("no gravity", numerics={"gravity": 0.0})
    yield way("27 particles a cell", numerics={"ppc": 3})
    yield way("sliced", motion={"slice_ratio": 3.0}, board={"mu": 5.0})
    yield way("sliced, pulled off the board", motion={"slice_ratio": 3.0}, board={"mu": 0.0})
    yield way("tilted", motion={"tilt": 0.2, "stroke": 0.015})
    yield way("retracted", motion={"stroke": 0.01, "retract": 0.02})
    yield way("soft arm", arm={"stiffness": 300.0})
    yield way("arm too weak", arm={"stiffness": 300.0, "force_limit": 0.5})
    yield way("thick blade", knife={"spine": 0.05, "angle": math.radians(80.0), "height": 0.05})


def _starts(seed: int) -> Iterator[Cell]:
    whole = {"seed": seed, "mirror": False}
    floating = {**whole, "gravity": 0.0}

    def begin(name: str, start: Start, numerics: Mapping[str, Any], **parts: Any) -> Cell:
        return cell("start", {"what": name}, start=start, numerics=numerics, **parts)

    yield begin("blade beside the food", Start(aside=0.5), whole)
    yield begin("blade shorter than a cell", Start(), whole, knife={"length": 1.1e-3})
    yield begin("blade half off the food", Start(aside=0.1), whole)
    yield begin("stroke of 0.11 mm", Start(), whole, motion={"stroke": 1.1e-4})
    yield begin("food in the air, no gravity", Start(lift=2e-3), floating)
    yield begin("food in the air, nothing near", Start(lift=2e-3, aside=0.5), floating)
    yield begin("food falls 2 mm", Start(lift=2e-3), whole)
    yield begin("food outside the grid", Start(lift=0.1), whole)
    yield begin("edge 1 mm deep", Start(depth=1e-3), whole, motion={"stroke": 0.01})
    yield begin("edge 10 mm deep", Start(depth=0.01), whole, motion={"stroke": 0.009})
    thick = {"spine": 0.015, "angle": math.radians(80.0), "height": 0.05}
    yield begin("thick blade 10 mm deep", Start(depth=0.01), whole, motion={"stroke": 0.009}, knife=thick)
    for times in (10.0, 100.0):
        side = times ** (-1 / 3)
        yield begin(f"{times:g} times overlap, unstrained", Start(squeeze=side), whole)
        yield begin(f"{times:g} times overlap, strained", Start(squeeze=side, strained=True), whole)


def _nonsense(seed: int) -> Iterator[Cell]:
    for name, value in (("E", 0.0), ("E", math.nan), ("nu", 0.5), ("rho", -1.0), ("yield_stress", 0.0), ("R", -1.0)):
        yield cell("nonsense", {name: value}, material={name: value}, numerics={"seed": seed})
    for name, value in (("safety", 0.0), ("safety", math.inf), ("dx", 0.0), ("dx", 6e-3), ("ppc", 0), ("ppc", 1)):
        yield cell("nonsense", {name: value}, numerics={"seed": seed, name: value})
    for name, value in (("stroke", 0.03), ("mach", 1.0), ("speed", 0.0)):
        yield cell("nonsense", {name: value}, motion={name: value}, numerics={"seed": seed})


FAMILIES: tuple[Callable[[int], Iterator[Cell]], ...] = (
    _stiffness_and_ratio,
    _stiffness_and_resistance,
    _step_and_cell,
    _step_and_ratio,
    _real_speed,
    _foods,
    _ways,
    _starts,
    _nonsense,
)


def cells(seed: int = 0) -> list[Cell]:
    """The whole map; ``seed`` places the particles."""
    return [one for family in FAMILIES for one in family(seed)]


def quick_cells(seed: int = 0) -> list[Cell]:
    """A dozen cells of coarse grids: each of them is stable, stopped or refused within a second or two."""
    coarse = {"dx": 5e-3, "seed": seed}
    far = cell("dt and dx", {"dx_m": 5e-3, "dt_over_limit": 3.0}, numerics=coarse)
    out = [cell("E and nu", {"E_Pa": E, "nu": 0.4}, material=food(E), numerics=coarse) for E in (1e3, 1e5, 1e8)]
    out += [cell("E and R", {"E_Pa": 1e3, "R_over_E_m": 1.0}, material=food(1e3, R=1e3), numerics=coarse)]
    out += stepped("dt and dx", {"dx_m": 5e-3, "dt_over_limit": 1.2}, 1.2, numerics=coarse)
    out += [forced(far, safety=3.0)]
    out += [cell("nonsense", {"nu": 0.5}, material={"nu": 0.5}, numerics=coarse)]
    for name, start in (("blade beside the food", Start(aside=0.5)), ("food outside the grid", Start(lift=0.1))):
        out.append(cell("start", {"what": name}, start=start, numerics={**coarse, "mirror": False}))
    return out
