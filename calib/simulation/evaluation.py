"""One simulation as it came back, and whatever makes them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from mpm.arrays import FloatArray
from mpm.output.number_text import quantity
from mpm.scene import Scene

FULLY_PARTED, NOT_PARTED = 0.8, 0.5
"""Energy of the edge over R times the new area from which on a run is a cut, and up to which it is none at all [-]
(docs/theory.md, "Measured choices")."""


def pressed_away(parted: float) -> str:
    """What is said of a run whose edge took too little of R times the new area for a cut.

    Args:
        parted: That part [-].

    Returns:
        One sentence.
    """
    return (
        f"the food was pressed away rather than cut: the edge took {parted:.0%} of R times the new area, so the force "
        "is that of flow and hangs on the width of the process zone; a food that is cut has a larger yield stress or a "
        "smaller R"
    )


def doubts_of_the_crack(scene: Scene) -> list[str]:
    """What is said where the grid does not resolve the food's crack: a sentence each.

    Args:
        scene: The cut.

    Returns:
        Nothing where it does; that its tensile strength was lowered, or that it flows at the crack's tip
        (docs/theory.md, "Constants of the method").
    """
    scene = scene.at_its_speed
    material = scene.food.material
    used, cell = quantity(scene.tie_strength, "Pa"), f"{scene.numerics.dx * 1e3:.3g} mm"
    out = []
    if scene.weakened:
        out.append(
            f"the tensile strength of {quantity(material.cohesion, 'Pa')} is more than cells of {cell} resolve; "
            f"{used} was used, R is the same; a smaller cell (--dx) resolves more"
        )
    if scene.flows_at_its_crack:
        out.append(
            f"the food parts at {used} and yields at {quantity(material.yield_stress, 'Pa')}, so it flows "
            f"at the tip of its crack, which cells of {cell} hardly resolve: finer ones need up to a quarter more; "
            "give it a tensile_strength below its yield_stress, or look at smaller cells (--dx)"
        )
    held = material.sticking_strength(scene.numerics.dx / scene.numerics.ppc)
    if scene.tied and held < material.adhesion:
        out.append(
            f"the adhesion of {quantity(material.adhesion, 'Pa')} is more than cells of {cell} resolve; "
            f"{quantity(held, 'Pa')} was used, the work of adhesion is the same; a smaller cell (--dx) resolves more"
        )
    return out


@dataclass(frozen=True, eq=False)
class Evaluation:
    """One simulation as it came back.

    Attributes:
        index: Place in the batch that asked for it.
        parameters: Values [SI] by name.
        status: ``ok`` or the kind of failure (``failed``, ``crashed``, ``timeout``...).
        reason: Typed reason of a failure, empty when ok.
        fraction: Part of the stroke that was completed [-], 0 to 1.
        stroke: Knife path from first contact [m] (k,), rising; may be empty after a failure. Where the blade is
            withdrawn the way up is added to the way down, which ends at the scalar ``turn_m``.
        force: Force of the food on the knife, upwards positive [N] (k,).
        scalars: Named results: momentum_residual, ke_over_ie, wall_s, ...
        seconds: Wall time of the run [s].
        parts: The runs of a joint evaluation, one per trace; empty for a single one.

    Raises:
        ValueError: A fraction outside [0, 1], or stroke and force that are not vectors of one length.
    """

    index: int
    parameters: dict[str, float]
    status: str
    reason: str
    fraction: float
    stroke: FloatArray
    force: FloatArray
    scalars: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    parts: tuple[Evaluation, ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 <= self.fraction <= 1.0:
            raise ValueError(
                f"evaluation {self.index} completed the fraction {self.fraction} of its stroke; it must be in [0, 1]."
            )
        if self.stroke.ndim != 1 or self.stroke.shape != self.force.shape:
            raise ValueError(
                f"evaluation {self.index} has {self.stroke.shape} strokes and {self.force.shape} forces; "
                "they must be two vectors of equal length."
            )

    @property
    def completed(self) -> float:
        """Part of the stroke that was completed as a cut [-], 0 to 1.

        Less than one also where the food was pressed away rather than parted: from :data:`FULLY_PARTED` to
        :data:`NOT_PARTED` it falls to nothing.
        """
        if not self.ok:
            return self.fraction
        if self.parted < FULLY_PARTED:
            return max((self.parted - NOT_PARTED) / (FULLY_PARTED - NOT_PARTED), 0.0)
        return 1.0

    @property
    def parted(self) -> float:
        """Energy of new surface over R times its area [-]; NaN where there is nothing to judge."""
        return self.scalars.get("parted", math.nan)

    @property
    def unbooked(self) -> float:
        """Part of the work that no law has taken [-]; NaN where there is nothing to judge."""
        lost, work = self.scalars.get("unbooked_J", math.nan), self.scalars.get("work_J", 0.0)
        return lost / work if work > 0 else math.nan

    @property
    def ok(self) -> bool:
        """Whether the run reached the end of its stroke."""
        return self.status == "ok"

    @property
    def down(self) -> Evaluation:
        """The way down of a run whose blade is withdrawn; any other run as it is."""
        below = self.stroke <= self.scalars.get("turn_m", math.inf)
        return self if below.all() else replace(self, stroke=self.stroke[below], force=self.force[below])

    def until(self, stroke: float) -> tuple[float, float]:
        """Largest force [N] and work [J] up to a stroke [m]: a simulation may be longer than its trace."""
        steps = np.diff(self.stroke, prepend=0.0)
        last, work = (np.interp(stroke, self.stroke, values) for values in (self.force, np.cumsum(self.force * steps)))
        return max(float(self.force[self.stroke <= stroke].max(initial=0.0)), float(last)), float(work)


class Evaluator(Protocol):
    """Whatever runs simulations: a pool of processes, a cache before it, or a fake."""

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each set of ``batch``; yield in order of completion, ``index`` = place in the batch."""


@dataclass(frozen=True)
class Evaluators:
    """What runs the simulations of a fit.

    Attributes:
        fine: Simulations at the resolution that counts.
        coarse: Cheaper ones, on coarse cells.
        replicate: Those of ``fine`` with what should not matter changed: speed, particles and the place of the grid.
        finer: Those of ``fine`` on finer cells; None where no answer is asked to stand on them.
    """

    fine: Evaluator
    coarse: Evaluator
    replicate: Evaluator
    finer: Evaluator | None = None
