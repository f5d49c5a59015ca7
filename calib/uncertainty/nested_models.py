"""What a fit is worth without one of its properties: all others fitted again, and simulated.

The simpler model is nested in the fitted one: its property has the least value that it may have, which is no friction,
or as good as no adhesion. The evidence for the property is the difference of both models' Bayesian information criteria
(Schwarz 1978, Ann. Statist. 6:461): what the least chi-square rises without it, less the logarithm of the number of
independent data.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator
from calib.uncertainty.analysis import CLOSE, UncertaintyAnalysis
from calib.uncertainty.posterior import Posterior
from mpm.arrays import FloatArray

ROUNDS = 5
"""Most simulations of each simpler model: the surrogate learns from each where its best values are."""
SETTLED = 2.0
"""A simpler model is settled when its last simulation has brought its chi-square down by less than this [-]."""


@dataclass(frozen=True)
class NestedModel:
    """The fit without one property.

    Attributes:
        name: The property.
        value: What it is held at, the least that it may have [unit].
        chi_square: Least chi-square found, without the property's own prior [-].
        whole: That of the fit with it [-].
        evidence: For the property: Bayesian information criterion without it less that with it [-].
    """

    name: str
    value: float
    chi_square: float
    whole: float
    evidence: float


def nested_models(
    objective: Objective | JointObjective, analysis: UncertaintyAnalysis, fine: Evaluator, names: Sequence[str]
) -> tuple[UncertaintyAnalysis, tuple[NestedModel, ...]]:
    """Fit again without each of some properties, and simulate what is found.

    Args:
        objective: What was fitted.
        analysis: Its uncertainty.
        fine: Runs simulations at the resolution that counts.
        names: Properties that were fitted.

    Returns:
        The analysis with the runs made here among those of its fit, and a model for each property; one whose
        simulations all break down is left out.
    """
    search = _Simpler(objective, analysis)
    for _ in range(ROUNDS):
        asked = {name: z for name in names if (z := search.next(name)) is not None}
        if not asked:
            break
        batch = [objective.parameters.to_dict(z) for z in asked.values()]
        search.runs += [
            objective.score(e, stage="without") for e in sorted(fine.evaluate(batch), key=lambda e: e.index)
        ]
    found = [search.model(name) for name in names]
    fit = replace(analysis.result, history=tuple(search.runs))
    return replace(analysis, result=fit), tuple(model for model in found if model is not None)


class _Simpler:
    """Searches the simpler models on the surrogate of a fit."""

    def __init__(self, objective: Objective | JointObjective, analysis: UncertaintyAnalysis) -> None:
        self.objective, self.parameters, self.analysis = objective, analysis.result.parameters, analysis
        self.runs: list[ScoredRun] = list(analysis.result.history)

    def next(self, name: str) -> FloatArray | None:
        """Where this model may be best (p,), as the surrogate sees it by now; None where it is settled."""
        fit, sizes = self.analysis.result, [run.misfit for run in self._simulated(name) if run.ok]
        if len(sizes) > 1 and min(sizes[:-1]) - sizes[-1] < SETTLED:
            return None
        assert fit.surrogate is not None  # or nothing is analysed
        with threadpool_limits(1, "blas"):
            surrogate = Surrogate(self.objective, self.runs, fit.best, fit.surrogate.hyper)
            posterior = Posterior(surrogate, self.parameters, self.analysis.uncertainty)
            at = self.parameters.names.index(name)
            known = [run.z for run in self._simulated(name)]
            found = []
            for z in (fit.best.z, *known):
                z = z.copy()
                z[at] = self.parameters.lower[at]
                found.append(posterior.optimum(z, at))
            best = min(found, key=lambda z: float(np.sum(surrogate.residuals(z[None])[0] ** 2)))
        near = CLOSE * self.parameters.prior_sd
        return None if any(np.all(np.abs(best - z) <= near) for z in known) else best

    def model(self, name: str) -> NestedModel | None:
        """The simpler model as simulated; None where no run of it ended its stroke."""
        sizes = [self._size(run, name) for run in self._simulated(name) if run.ok]
        if not sizes:
            return None
        best = self.analysis.result.best
        whole = self._size(best, name)
        evidence = min(sizes) - whole - math.log(self.objective.effective_rows)
        return NestedModel(name, self._least(name), min(sizes), whole, evidence)

    def _least(self, name: str) -> float:
        return self.parameters[name].low

    def _simulated(self, name: str) -> list[ScoredRun]:
        """Runs of this model at the resolution that counts."""
        at = self.parameters.names.index(name)
        return [run for run in self.runs if not run.coarse and run.z[at] <= self.parameters.lower[at] + 1e-9]

    def _size(self, run: ScoredRun, name: str) -> float:
        """Chi-square of a run without the property's own prior [-]."""
        at = self.parameters.names.index(name)
        own = (run.z[at] - self.parameters.prior_mean[at]) / self.parameters.prior_sd[at]
        return float(run.misfit - own**2)
