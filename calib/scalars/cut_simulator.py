"""Cuts of published specimens, simulated on a coarse grid whose numbers are corrected by the default one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.errors import PublishedError
from calib.material.properties import rule_of
from calib.scalars.published_data import CUT_ENERGY, PEAK_FORCE, PublishedCut, PublishedData
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import CachedEvaluator
from mpm.arrays import FloatArray

Values = Mapping[str, float]

FINE, COARSE = "fine", "coarse"


def log_numbers(run: Evaluation, cut: PublishedCut) -> dict[str, float]:
    """The numbers that a run has for what is published of a cut: logarithms by quantity [-]."""
    return {PEAK_FORCE: math.log(run.scalars["peak_N"]), CUT_ENERGY: math.log(run.scalars["work_J"] / cut.area)}


@dataclass
class CutSimulator:
    """Where cuts are simulated.

    Attributes:
        published: The cuts.
        evaluators: By fidelity and name of the cut.
        say: Called with a line after each batch.
        runs: Simulations that were asked for, known ones included.
        broken: Those of them that broke down.
        correction: Logarithm of default over coarse grid, by cut and quantity [-].
    """

    published: PublishedData
    evaluators: Mapping[str, Mapping[str, CachedEvaluator]]
    say: Callable[[str], None]
    runs: int = 0
    broken: int = 0
    correction: dict[tuple[str, str], float] = field(default_factory=dict)

    def simulate(
        self, cut: PublishedCut, batch: Sequence[Values], fidelity: str = COARSE
    ) -> list[dict[str, float] | None]:
        """Numbers of a cut, corrected where the grid is the coarse one.

        Args:
            cut: The cut.
            batch: Values [SI] by property, of each candidate.
            fidelity: ``fine`` or ``coarse``.

        Returns:
            Logarithms by quantity [-] of each candidate; None for one that broke down.
        """
        found: list[dict[str, float] | None] = [None] * len(batch)
        for run in self.evaluators[fidelity][cut.name].evaluate(batch):
            self.runs += 1
            self.broken += not run.ok
            if run.ok:
                shift = self.correction if fidelity == COARSE else {}
                found[run.index] = {q: x + shift.get((cut.name, q), 0.0) for q, x in log_numbers(run, cut).items()}
        return found

    def given_numbers(self, batch: Sequence[Values]) -> list[FloatArray | None]:
        """Logarithms of the given numbers (n,) for each candidate, on the coarse grid; None for a breakdown."""
        found = {cut.name: self.simulate(cut, batch) for cut in self.published.cuts if cut.given}
        out: list[FloatArray | None] = []
        for k in range(len(batch)):
            rows = [found[cut.name][k] for cut, _ in self.published.given]
            names = [number.quantity for _, number in self.published.given]
            whole = [row[name] for row, name in zip(rows, names, strict=True) if row is not None]
            out.append(np.array(whole) if len(whole) == len(rows) else None)
        self.say(f"{self.runs} simulations, {self.broken} broke down")
        return out

    def correct(self, values: Values) -> float:
        """Measure the corrections at these values; returns the largest change of one [-].

        Raises:
            PublishedError: A run there breaks down.
        """
        change = 0.0
        for cut in self.published.cuts:
            fine, coarse = self.simulate(cut, [values], FINE)[0], self.simulate(cut, [values])[0]
            if fine is None or coarse is None:
                raise PublishedError(
                    f"{cut.name}: its cut breaks down at {_shown(values)}; the food is squashed before it is cut: "
                    "give a stiffer E or yield_stress, or a lower R_initiation, under 'properties'"
                )
            for quantity, x in fine.items():
                step = x - coarse[quantity]
                change = max(change, abs(step))
                self.correction[cut.name, quantity] = self.correction.get((cut.name, quantity), 0.0) + step
        return change


def _shown(values: Values) -> str:
    return ", ".join(f"{name} = {x:.4g} {rule_of(name).unit}" for name, x in values.items())
