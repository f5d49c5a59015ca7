"""What a convergence study runs: a cut on several grids, and one thing after the other varied apart from them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from calib.errors import CurveError
from calib.material.scene import with_other_particles
from calib.validation.method_constants import CONSTANTS
from mpm.scene import Scene
from mpm.scene.shapes import Shape

AXES = ("safety", "mach", "ppc", "offset", "repeat")
"""What can be varied beside the cell size, each apart from the others: dt over its limit, speed over the P-wave's,
particles per cell and direction, blade against the grid [cells], and what should not matter at all."""
HALF = 0.5
"""Time step and speed over those of the cut, and the blade's place in the grid [cells], where all constants of the
method are varied and no other values are asked for."""


@dataclass(frozen=True)
class RefinementPlan:
    """What is refined, and what is varied beside the cell size.

    Attributes:
        scene: The cut; its cell size is not used.
        axes: Values to try, by axis of :data:`AXES`; cell sizes [m] under ``dx``.
        repeats: Runs with other particles and the grid elsewhere, to tell noise from trend.
        constants: Whether each constant of the method is halved and doubled as well.
    """

    scene: Scene
    axes: Mapping[str, Sequence[float]]
    repeats: int = 3
    constants: bool = False


@dataclass(frozen=True)
class CutDescription:
    """What a document says of the cut.

    Attributes:
        food: Name of the food.
        knife: Name of the knife.
        shape: The specimen.
        command: Words of the command line.
        warnings: What a reader should know of the input.
    """

    food: str
    knife: str
    shape: Shape
    command: Sequence[str]
    warnings: Sequence[str]


@dataclass(frozen=True)
class PlannedRun:
    """One run.

    Attributes:
        axis: What is varied: ``dx``, one of :data:`AXES`, or the key of a constant of the method.
        value: Its value; cell sizes in [m], of ``repeat`` the number of the run.
        scene: The cut.
    """

    axis: str
    value: float
    scene: Scene

    @property
    def cost(self) -> float:
        """Particle steps of the run up to a constant."""
        n = self.scene.numerics
        whole = 4 / 2 ** sum(self.scene.mirrors)
        return n.ppc**3 / n.dx**4 / (n.safety * self.scene.motion.mach) * whole

    @property
    def words(self) -> str:
        """The run in words."""
        return f"dx {self.value * 1e3:g} mm" if self.axis == "dx" else f"{self.axis} {self.value:g}"


def planned_runs(plan: RefinementPlan) -> list[PlannedRun]:
    """Runs of a plan. The other axes and constants are varied on the coarsest grid, runs are repeated on the next finer
    one.

    Args:
        plan: What to run, with at least two cell sizes. With two grids the repeats are on the coarser one.

    Returns:
        The runs: those on the grids from coarse to fine, then those of each axis and constant, then the repeats.

    Raises:
        CurveError: Fewer than two cell sizes.
        SceneError: A value that cannot be simulated.
    """
    scene, axes = plan.scene, dict(plan.axes)
    if plan.constants:
        own = {"safety": HALF * scene.numerics.safety, "mach": HALF * scene.motion.mach, "offset": HALF}
        axes = {name: (value,) for name, value in own.items()} | axes
    cells = sorted(axes["dx"], reverse=True)
    if len(cells) < 2:
        raise CurveError(f"--dx {cells[0]:g}: give at least two cell sizes, for instance 3e-3,2e-3,1.5e-3")
    out = [PlannedRun("dx", dx, replace(scene, numerics=replace(scene.numerics, dx=dx))) for dx in cells]
    base = out[0].scene
    for value in axes.get("safety", ()):
        out.append(PlannedRun("safety", value, replace(base, numerics=replace(base.numerics, safety=value))))
    for value in axes.get("mach", ()):
        out.append(PlannedRun("mach", value, replace(base, motion=replace(base.motion, mach=value))))
    for value in axes.get("ppc", ()):
        out.append(PlannedRun("ppc", value, replace(base, numerics=replace(base.numerics, ppc=round(value)))))
    for value in axes.get("offset", ()):
        shifted = replace(base.numerics, grid_shift=(0.0, value, 0.0))
        out.append(PlannedRun("offset", value, replace(base, numerics=shifted)))
    if plan.constants:
        out += varied_constants(base)
    again = out[min(1, len(cells) - 2)].scene
    for k in range(1, plan.repeats + 1):
        out.append(PlannedRun("repeat", k, with_other_particles(again, k)))
    return out


def varied_constants(scene: Scene) -> list[PlannedRun]:
    """Runs with each constant of the method halved and doubled, where that can be and where it has a part in the cut.

    Args:
        scene: The cut.

    Returns:
        The runs; the time step is an axis of its own.
    """
    return [
        PlannedRun(c.key, factor * c.value(scene), c.varied(scene, factor))
        for c in CONSTANTS
        if c.key not in AXES and c.value(scene) != 0
        for factor in c.factors
    ]
