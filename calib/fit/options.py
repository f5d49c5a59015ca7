"""How much a fit may spend."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from calib.errors import MaterialError
from calib.problem.scored_run import ScoredRun


@dataclass(frozen=True)
class FitOptions:
    """How much to spend on a fit.

    Attributes:
        budget: Largest number of simulations, coarse ones counted by their cost.
        batch: Simulations that run at the same time (worker processes).
        design: Space-filling runs at the start, besides the given values and the prior centre.
        coarse_cost: Cost of a coarse simulation in fine ones [-]; half the resolution costs about a quarter or less.
        tolerance: Gain in chi-square that is worth a round [-], times the reduced chi-square where that exceeds 1. 0.5
            is an eighth of what bounds a 95 % interval (3.84), and moves its ends by 6 % of its half width
            (docs/theory.md, "Measured choices").
        seed: Seed of the design and of the probes.

    Raises:
        ValueError: A number that is not positive.
    """

    budget: float = 100.0
    batch: int = 2
    design: int = 7
    coarse_cost: float = 0.25
    tolerance: float = 0.5
    seed: int = 0

    def __post_init__(self) -> None:
        if min(self.budget, self.batch, self.design, self.coarse_cost, self.tolerance) <= 0 or self.seed < 0:
            raise ValueError(f"{self} has a number that is not positive; give positive ones.")

    def cost(self, runs: Iterable[ScoredRun]) -> float:
        """What some runs have taken of the budget [fine simulations]."""
        return sum(self.coarse_cost if run.coarse else 1.0 for run in runs)

    def least(self, parameters: int) -> int:
        """Smallest budget of a search for so many parameters."""
        return 2 * parameters + self.design + 2

    def check(self, parameters: int) -> None:
        """Raise MaterialError when the budget is too small for this number of parameters."""
        least = self.least(parameters)
        if self.budget < least:
            raise MaterialError(
                f"a budget of {self.budget:g} simulations is too small for {parameters} parameters; give at least "
                f"{least}, or fit fewer."
            )
