"""What a fit is worth without one of its properties: all others fitted again, and simulated.

The simpler model is nested in the fitted one: its property has the least value that it may have, which is no friction,
or as good as no adhesion. The evidence for the property is the difference of both models' Bayesian information criteria
(Schwarz 1978, Ann. Statist. 6:461): what the least chi-square rises without it, less the logarithm of the number of
independent data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from calib.fit.multistart import FitResult
from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator
from calib.uncertainty.analysis import CLOSE, search_uncertainty
from calib.uncertainty.intervals import Uncertainty
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


def with_nested_runs(
    objective: Objective | JointObjective,
    fit: FitResult,
    fine: Evaluator,
    names: Sequence[str],
    say: Callable[[str], None] = lambda text: None,
) -> FitResult:
    """A fit with the runs that show what it is worth without some properties.

    Args:
        objective: What was fitted.
        fit: The fit.
        fine: Runs simulations at the resolution that counts.
        names: Properties that were fitted.
        say: Called before each round of simulations, with one sentence.

    Returns:
        The fit with these runs in its history and its surrogate; as it was where it ended too early for a surrogate.
    """
    found = search_uncertainty(objective, fit)
    if found is None or not names:
        return fit
    search = _Simpler(objective, fit, found)
    for turn in range(ROUNDS):
        asked = {name: z for name in names if (z := search.next(name)) is not None}
        if not asked:
            break
        say(f"without {' and without '.join(asked)}, round {turn + 1} of {ROUNDS} at most")
        batch = [objective.parameters.to_dict(z) for z in asked.values()]
        made = sorted(fine.evaluate(batch), key=lambda e: e.index)
        search.runs += [objective.score(e, stage="without") for e in made]
    with threadpool_limits(1, "blas"):
        surrogate = search.surrogate
        jacobian = surrogate.jacobian(fit.best.z)
    return replace(fit, history=tuple(search.runs), surrogate=surrogate, jacobian=jacobian)


def nested_models(
    objective: Objective | JointObjective, fit: FitResult, names: Sequence[str]
) -> tuple[NestedModel, ...]:
    """What a fit is worth without some properties, by the runs of :func:`with_nested_runs`.

    Args:
        objective: What was fitted.
        fit: The fit with these runs.
        names: The properties.

    Returns:
        A model for each property; one without a run that ended its stroke is left out.
    """
    found = []
    for name in names:
        sizes = [_size(objective, run, name) for run in _simulated(objective, fit.history, name) if run.ok]
        if sizes:
            least, whole = min(sizes), _size(objective, fit.best, name)
            evidence = least - whole - math.log(objective.effective_rows)
            found.append(NestedModel(name, objective.parameters[name].low, least, whole, evidence))
    return tuple(found)


def _simulated(objective: Objective | JointObjective, runs: Sequence[ScoredRun], name: str) -> list[ScoredRun]:
    """Runs at the resolution that counts in which a property has the least value that it may have."""
    at = objective.parameters.names.index(name)
    return [run for run in runs if not run.coarse and run.z[at] <= objective.parameters.lower[at] + 1e-9]


def _size(objective: Objective | JointObjective, run: ScoredRun, name: str) -> float:
    """Chi-square of a run without the property's own prior [-]."""
    at, parameters = objective.parameters.names.index(name), objective.parameters
    own = (run.z[at] - parameters.prior_mean[at]) / parameters.prior_sd[at]
    return float(run.misfit - own**2)


class _Simpler:
    """Searches the simpler models on the surrogate of a fit."""

    def __init__(self, objective: Objective | JointObjective, fit: FitResult, found: Uncertainty) -> None:
        self.objective, self.fit, self.found = objective, fit, found
        self.runs: list[ScoredRun] = list(fit.history)

    @property
    def surrogate(self) -> Surrogate:
        """That through all runs so far."""
        assert self.fit.surrogate is not None  # or there is no uncertainty of it
        return Surrogate(self.objective, self.runs, self.fit.best, self.fit.surrogate.hyper)

    def next(self, name: str) -> FloatArray | None:
        """Where this model may be best (p,), as the surrogate sees it by now; None where it is settled."""
        parameters = self.fit.parameters
        simulated = _simulated(self.objective, self.runs, name)
        sizes = [run.misfit for run in simulated if run.ok]
        if len(sizes) > 1 and min(sizes[:-1]) - sizes[-1] < SETTLED:
            return None
        at = parameters.names.index(name)
        with threadpool_limits(1, "blas"):
            surrogate = self.surrogate
            posterior = Posterior(surrogate, parameters, self.found)
            found = []
            for z in (self.fit.best.z, *(run.z for run in simulated)):
                z = z.copy()
                z[at] = parameters.lower[at]
                found.append(posterior.optimum(z, at))
            best = min(found, key=lambda z: float(np.sum(surrogate.residuals(z[None])[0] ** 2)))
        near = CLOSE * parameters.prior_sd
        return None if any(np.all(np.abs(best - run.z) <= near) for run in simulated) else best
