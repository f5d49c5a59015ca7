"""A simulation with its misfit: what a search learns from, and what it ends with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.simulation.evaluation import Evaluation
from mpm.arrays import FloatArray
from mpm.scene.errors import SimulationError


@dataclass(frozen=True, eq=False)
class ScoredRun:
    """A simulation as an objective sees it.

    Attributes:
        z: Internal coordinates of its parameters (p,).
        evaluation: The simulation.
        curve: Its smoothed force on the stroke grid of the trace [N] (n,); of a joint objective all traces' in turn.
        residual: Its residual vector [-] (rows of the data and p of the priors).
        coarse: Whether it was run at the coarse resolution.
        stage: Why it was run: design, scaled, difference, descent, round, scouting, screened, replicate or
            profile.
        parts: The run as each trace of a joint objective sees it; empty for a single trace.
    """

    z: FloatArray
    evaluation: Evaluation
    curve: FloatArray
    residual: FloatArray
    coarse: bool = False
    stage: str = "design"
    parts: tuple[ScoredRun, ...] = ()

    def as_fine(self) -> ScoredRun:
        """The same run, as if its resolution were the one that counts."""
        return replace(self, coarse=False, parts=tuple(part.as_fine() for part in self.parts))

    @property
    def each(self) -> tuple[ScoredRun, ...]:
        """The run of each trace."""
        return self.parts or (self,)

    @property
    def misfit(self) -> float:
        """Chi-square with priors [-]."""
        return float(self.residual @ self.residual)

    def change(self, again: ScoredRun) -> float:
        """Largest change of peak or work [-] in another run with the same parameters, of all traces.

        Args:
            again: The other run.
        """
        curves = [(one.curve, other.curve) for one, other in zip(self.each, again.each, strict=True)]
        changes = [(np.max(new) / np.max(old) - 1, np.sum(new) / np.sum(old) - 1) for old, new in curves]
        return float(np.max(np.abs(changes)))

    @property
    def ok(self) -> bool:
        """Whether the simulation reached the end of its stroke."""
        return self.evaluation.ok

    @property
    def cut(self) -> bool:
        """Whether it cut the food all the way, that of each trace."""
        return all(part.evaluation.completed == 1.0 for part in self.each)


def none_ended(runs: Sequence[ScoredRun]) -> SimulationError:
    """The error that no run reached the end of its stroke."""
    furthest = max((run.evaluation for run in runs), key=lambda e: e.fraction)
    return SimulationError(
        f"none of {len(runs)} simulations led to one that ends its stroke; the furthest got to "
        f"{furthest.fraction:.0%} ({furthest.reason}) at {furthest.parameters}; check the scene, or "
        "narrow the prior ranges.",
        reason=furthest.reason,
        fraction=furthest.fraction,
    )
