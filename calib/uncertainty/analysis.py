"""All that a finished fit does not know, found in one place: intervals, profiles, nuisances, predictive bands."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from calib.fit.multistart import FitResult
from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointObjective
from calib.problem.nuisance import NuisanceEstimate
from calib.problem.objective import Objective, Trial
from calib.simulation.evaluation import Evaluator
from calib.uncertainty.intervals import Uncertainty, evidence, uncertainty
from calib.uncertainty.posterior import Posterior, sampled
from calib.uncertainty.predictive import Band, bands
from calib.uncertainty.profile_likelihood import RISE, Profile, profiles, with_profiles
from mpm.arrays import FloatArray

JUDGED = 3
"""Times that the ends of intervals are simulated as they count, after the first those of what is called identified alone: each run may
move them, as the other parameters make up for more or less than the surrogate knew."""
CLOSE = 0.05
"""Points this near to a run, in prior standard deviations of every parameter, are not run."""


@dataclass(frozen=True, eq=False)
class Doubt:
    """What a fit does not know.

    Attributes:
        result: The fit with the runs made here, among which the best one may be, and the process through them all.
        uncertainty: Intervals, correlations and verdicts.
        profiles: Profile likelihood of each parameter.
        nuisances: What the best curves say of the measurement, trace by trace.
        bands: Posterior predictive band of each trace.
        sampled: 95 % intervals [unit] from a sample of the posterior by name, where one was asked for.
        said: What a second search has shown (:mod:`calib.uncertainty.global_search`), in sentences; empty where it has confirmed the first or none was needed.
    """

    result: FitResult
    uncertainty: Uncertainty
    profiles: tuple[Profile, ...]
    nuisances: tuple[NuisanceEstimate, ...]
    bands: tuple[Band, ...]
    sampled: dict[str, tuple[float, float]] = field(default_factory=dict)
    said: tuple[str, ...] = ()


def doubt_of(
    objective: Objective | JointObjective,
    result: FitResult,
    *,
    scout: Evaluator | None = None,
    judge: Evaluator | None = None,
    seed: int = 0,
    sample: bool = False,
    say: Callable[[str], None] = lambda text: None,
) -> Doubt | None:
    """What a fit does not know; None where it ended before there were runs enough to tell.

    Args:
        objective: What was fitted.
        result: How.
        scout: Runs cheap simulations at the ends that the profiles claim, which are then walked again; without it they rest on
            the runs of the search alone.
        judge: Runs simulations as they count at both ends of each parameter that would be called identified or weak; the profiles
            are walked again with them, and ends of identified ones that have moved are simulated again.
        seed: Seed of the predictive draws.
        sample: Whether the posterior is sampled as well.
        say: Called before each round of simulations, with one sentence.

    Raises:
        CurveError: A sample is asked for and emcee is not installed.
    """
    if result.jacobian is None or result.surrogate is None:
        return None
    with threadpool_limits(1, "blas"):
        surrogate, runs = result.surrogate, list(result.history)
        found, walked = _walk(objective, result, surrogate, result.jacobian)
        # profiles are walked, their ends simulated, and so on: with the others at their best values, then at their optimum where
        # the trace is claimed to end them, then as they count where it would end both sides; of made-up fits whose profile is
        # known the root of the rise was off by up to 1.5 after one round and 0.9 after these
        for evaluator, verdicts, alone in (
            (scout, None, True),
            (scout, None, False),
            (judge, ("identified", "weak"), False),
            *[(judge, ("identified",), False)] * (JUDGED - 1),
        ):
            if evaluator is None:
                continue
            coarse = verdicts is None
            known = runs if coarse else [t for t in runs if not t.coarse]
            ends = _ends(found, walked, verdicts, alone=alone)
            asked = _new(objective, ends, known)
            if asked:
                say(f"intervals: {len(asked)} of their ends{' on coarse cells' if coarse else ''}")
                runs += _run(objective, evaluator, asked, coarse)
                surrogate = Surrogate(objective, runs, result.best, surrogate.hyper)
                found, walked = _walk(objective, result, surrogate, surrogate.jacobian(result.best.z))
        better = _better(result, runs, surrogate.luck)
        if better is not None:
            result = replace(
                result, best=better, parameters=result.parameters.with_values(better.evaluation.parameters)
            )
            surrogate = Surrogate(objective, runs, better, surrogate.hyper)
            found, walked = _walk(objective, result, surrogate, surrogate.jacobian(better.z))
        result = replace(result, history=tuple(runs), surrogate=surrogate, jacobian=surrogate.jacobian(result.best.z))
        drawn = bands(surrogate, result.best.z, found, seed)
        posterior = Posterior(surrogate, result.parameters, found)
        own = sampled(posterior, result.best.z, seed) if sample else {}
    intervals = with_profiles(found, walked, [t.z for t in as_good(result, found)])
    return Doubt(result, intervals, walked, _nuisances(objective, result, found), drawn, own)


def at_first_sight(objective: Objective | JointObjective, result: FitResult) -> Uncertainty | None:
    """What the runs of a search alone say of the parameters; None where it ended before there were runs enough to tell."""
    if result.jacobian is None or result.surrogate is None:
        return None
    with threadpool_limits(1, "blas"):
        found, walked = _walk(objective, result, result.surrogate, result.jacobian)
    return with_profiles(found, walked, [t.z for t in as_good(result, found)])


def as_good(result: FitResult, found: Uncertainty) -> list[Trial]:
    """The runs that count and whose chi-square, as the intervals see it, is within the rise at their ends of the best one's."""
    runs = [result.best, *(t for t in result.history if t.cut and not t.coarse)]
    size = np.sum(found.rows(np.array([t.residual for t in runs])) ** 2, axis=1)
    return [t for t, own in zip(runs, size, strict=True) if own <= size[0] + RISE]


def _better(result: FitResult, runs: list[Trial], luck: float) -> Trial | None:
    """A run at the end of an interval that is better than the answer of the search by more than the noise of a run, ``luck``."""
    judged = (t for t in runs[len(result.history) :] if t.cut and not t.coarse)
    best = min(judged, key=lambda t: t.misfit, default=None)
    return best if best is not None and best.misfit < result.best.misfit - luck else None


def _walk(
    objective: Objective | JointObjective, result: FitResult, surrogate: Surrogate, jacobian: FloatArray
) -> tuple[Uncertainty, tuple[Profile, ...]]:
    """The normal approximation about the best run, and the profiles."""
    found = uncertainty(result.parameters, evidence(objective, result.best, jacobian))
    return found, profiles(surrogate, result.parameters, found)


def _ends(
    found: Uncertainty, walked: tuple[Profile, ...], verdicts: Collection[str] | None, alone: bool
) -> list[FloatArray]:
    """Points (p,) at the ends of the profiles of parameters with one of these verdicts, of all with None."""
    intervals = with_profiles(found, walked).intervals
    chosen = [p for i, p in zip(intervals, walked, strict=True) if verdicts is None or i.verdict in verdicts]
    return [z for p in chosen for z in p.frontier(alone)]


def _new(objective: Objective | JointObjective, points: list[FloatArray], runs: list[Trial]) -> list[FloatArray]:
    """Points that are not close to each other or to a run."""
    sd = objective.parameters.prior_sd
    chosen: list[FloatArray] = []
    for z in points:
        known = [*(t.z for t in runs), *chosen]
        if all(np.any(np.abs(z - other) > CLOSE * sd) for other in known):
            chosen.append(z)
    return chosen


def _run(
    objective: Objective | JointObjective, evaluator: Evaluator, points: list[FloatArray], coarse: bool
) -> list[Trial]:
    """Trials at some points, in their order."""
    batch = [objective.parameters.to_dict(z) for z in points]
    found = sorted(evaluator.evaluate(batch), key=lambda e: e.index)
    return [objective.trial(e, coarse=coarse, stage="profile") for e in found]


def _nuisances(
    objective: Objective | JointObjective, result: FitResult, found: Uncertainty
) -> tuple[NuisanceEstimate, ...]:
    """Searched ones given the best curves, the others with the parameters free beside them."""
    out: list[NuisanceEstimate] = []
    beside = iter(found.unsearched)
    for case, trial in zip(objective.cases, result.best.each, strict=True):
        for e, n in zip(case.objective.nuisance_estimates(trial.curve), case.objective.nuisances, strict=True):
            if not n.searched:
                mean, sd = next(beside)
                e = replace(e, value=mean * n.sd, sd=sd * n.sd)
            out.append(e)
    return tuple(out)
