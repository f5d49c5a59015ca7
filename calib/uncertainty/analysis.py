"""The uncertainty of a finished fit in one place: intervals, profiles, nuisances and predictive bands."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

import numpy as np
from threadpoolctl import threadpool_limits

from calib.fit.multistart import FitResult
from calib.fit.surrogate import Surrogate
from calib.problem.joint_objective import JointObjective
from calib.problem.nuisance import NuisanceEstimate
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator
from calib.uncertainty.intervals import Uncertainty, linearised_likelihood, uncertainty
from calib.uncertainty.predictive import Band, predictive_bands
from calib.uncertainty.profile_likelihood import RISE, Profile, profile_likelihoods, with_profile_intervals
from mpm.arrays import FloatArray

END_ROUNDS = 3
"""Rounds in which ends of intervals are simulated on fine cells: first those of identified and weak parameters, then
those of identified ones alone. Each run may move an end, because the surrogate did not know how far the other
parameters make up for it (docs/theory.md, "Measured choices")."""
CLOSE = 0.05
"""Points this near to a run, in prior standard deviations of every parameter, are not simulated."""


@dataclass(frozen=True, eq=False)
class UncertaintyAnalysis:
    """What a fit leaves uncertain.

    Attributes:
        result: The fit with the runs made here, among which the best one may be, and the surrogate through them all.
        uncertainty: Intervals, correlations and verdicts.
        profiles: Profile likelihood of each parameter.
        nuisances: What the best curves say of the measurement, trace by trace.
        bands: Posterior predictive band of each trace.
        sampled: 95 % intervals [unit] from a sample of the posterior by name, where one was asked for.
        remarks: What a second search has shown (:mod:`calib.uncertainty.global_search`), in sentences; empty where it
            has confirmed the first or none was needed.
    """

    result: FitResult
    uncertainty: Uncertainty
    profiles: tuple[Profile, ...]
    nuisances: tuple[NuisanceEstimate, ...]
    bands: tuple[Band, ...]
    sampled: dict[str, tuple[float, float]] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def analyse(
    objective: Objective | JointObjective,
    result: FitResult,
    *,
    coarse: Evaluator | None = None,
    fine: Evaluator | None = None,
    seed: int = 0,
    say: Callable[[str], None] = lambda text: None,
    made: Callable[[int, int], None] = lambda done, whole: None,
    accepts: Callable[[ScoredRun], bool] = lambda run: True,
) -> UncertaintyAnalysis | None:
    """Intervals, profiles, nuisances and predictive bands of a fit.

    Args:
        objective: What was fitted.
        result: How.
        coarse: Runs cheap simulations at the ends that the profiles claim, after which the profiles are computed again;
            without it they rest on the runs of the search alone.
        fine: Runs simulations at the resolution that counts, at both ends of each parameter that would be called
            identified or weak. The profiles are computed again with them, and ends of identified parameters that have
            moved are simulated again.
        seed: Seed of the predictive draws.
        say: Called before each round of simulations, with one sentence.
        made: Called after each simulation of a round with how many of its are done, and how many it has.
        accepts: Whether a run that is better than the answer may be the answer.

    Returns:
        The analysis; None where the fit ended before there were runs enough for one.
    """
    if result.jacobian is None or result.surrogate is None:
        return None
    with threadpool_limits(1, "blas"):
        runs, surrogate, found, profiles = _with_simulated_ends(objective, result, coarse, fine, say, made)
        better = _better(result, runs, surrogate.noise_misfit)
        if better is not None and accepts(better):
            result = replace(
                result, best=better, parameters=result.parameters.with_values(better.evaluation.parameters)
            )
            surrogate = Surrogate(objective, runs, better, surrogate.hyper)
            found, profiles = _profiled(objective, result, surrogate, surrogate.jacobian(better.z))
        result = replace(result, history=tuple(runs), surrogate=surrogate, jacobian=surrogate.jacobian(result.best.z))
        bands = predictive_bands(surrogate, result.best.z, found, seed)
    intervals = with_profile_intervals(found, profiles, [t.z for t in equally_good(result, found)])
    return UncertaintyAnalysis(result, intervals, profiles, nuisances_of(objective, result, found), bands)


def search_uncertainty(objective: Objective | JointObjective, result: FitResult) -> Uncertainty | None:
    """Intervals from the runs of a search alone; None where it ended before there were runs enough for them."""
    if result.jacobian is None or result.surrogate is None:
        return None
    with threadpool_limits(1, "blas"):
        found, profiles = _profiled(objective, result, result.surrogate, result.jacobian)
    return with_profile_intervals(found, profiles, [t.z for t in equally_good(result, found)])


def equally_good(result: FitResult, found: Uncertainty) -> list[ScoredRun]:
    """The runs on fine cells whose chi-square, as the intervals see it, is within :data:`RISE` of the best one's."""
    runs = [result.best, *(t for t in result.history if t.cut and not t.coarse)]
    size = np.sum(found.rows(np.array([t.residual for t in runs])) ** 2, axis=1)
    return [t for t, own in zip(runs, size, strict=True) if own <= size[0] + RISE]


def _with_simulated_ends(
    objective: Objective | JointObjective,
    result: FitResult,
    coarse: Evaluator | None,
    fine: Evaluator | None,
    say: Callable[[str], None],
    made: Callable[[int, int], None],
) -> tuple[list[ScoredRun], Surrogate, Uncertainty, tuple[Profile, ...]]:
    """All runs with those at the ends of the profiles, and surrogate, normal approximation and profiles through them.

    The ends of the profiles are simulated and the profiles computed again: first with the other parameters at their
    best values, then at their optimum where the trace is claimed to end them, then on fine cells where it would end
    both sides.
    """
    assert result.surrogate is not None and result.jacobian is not None  # or nothing is analysed
    surrogate, runs = result.surrogate, list(result.history)
    found, profiles = _profiled(objective, result, surrogate, result.jacobian)
    rounds: list[tuple[Evaluator | None, tuple[str, ...] | None, bool]] = [
        (coarse, None, True),
        (coarse, None, False),
        (fine, ("identified", "weak"), False),
        *[(fine, ("identified",), False)] * (END_ROUNDS - 1),
    ]
    turn = 0
    for evaluator, verdicts, alone in rounds:
        if evaluator is None:
            continue
        cheap = verdicts is None
        known = runs if cheap else [t for t in runs if not t.coarse]
        asked = _new(objective, _end_points(found, profiles, verdicts, alone=alone), known)
        if asked:
            turn += 1
            say(f"intervals, round {turn}: simulating {len(asked)} of their ends{' on coarse cells' if cheap else ''}")
            runs += _run(objective, evaluator, asked, cheap, made)
            surrogate = Surrogate(objective, runs, result.best, surrogate.hyper)
            found, profiles = _profiled(objective, result, surrogate, surrogate.jacobian(result.best.z))
    return runs, surrogate, found, profiles


def _better(result: FitResult, runs: list[ScoredRun], luck: float) -> ScoredRun | None:
    """A run at the end of an interval that is better than the answer of the search by more than ``luck``, the noise of
    one run's chi-square [-]; None where there is none."""
    fine = (t for t in runs[len(result.history) :] if t.cut and not t.coarse)
    best = min(fine, key=lambda t: t.misfit, default=None)
    return best if best is not None and best.misfit < result.best.misfit - luck else None


def _profiled(
    objective: Objective | JointObjective, result: FitResult, surrogate: Surrogate, jacobian: FloatArray
) -> tuple[Uncertainty, tuple[Profile, ...]]:
    """The normal approximation about the best run, and the profiles."""
    found = uncertainty(result.parameters, linearised_likelihood(objective, result.best, jacobian))
    return found, profile_likelihoods(surrogate, result.parameters, found)


def _end_points(
    found: Uncertainty, profiles: tuple[Profile, ...], verdicts: Collection[str] | None, alone: bool
) -> list[FloatArray]:
    """Points (p,) at the ends of the profiles of parameters with one of these verdicts, of all with None."""
    intervals = with_profile_intervals(found, profiles).intervals
    chosen = [p for i, p in zip(intervals, profiles, strict=True) if verdicts is None or i.verdict in verdicts]
    return [z for p in chosen for z in p.end_points(alone)]


def _new(objective: Objective | JointObjective, points: list[FloatArray], runs: list[ScoredRun]) -> list[FloatArray]:
    """Points that are not close to each other or to a run."""
    sd = objective.parameters.prior_sd
    chosen: list[FloatArray] = []
    for z in points:
        known = [*(t.z for t in runs), *chosen]
        if all(np.any(np.abs(z - other) > CLOSE * sd) for other in known):
            chosen.append(z)
    return chosen


def _run(
    objective: Objective | JointObjective,
    evaluator: Evaluator,
    points: list[FloatArray],
    coarse: bool,
    made: Callable[[int, int], None],
) -> list[ScoredRun]:
    """Trials at some points, in their order."""
    found = []
    for run in evaluator.evaluate([objective.parameters.to_dict(z) for z in points]):
        found.append(run)
        made(len(found), len(points))
    found.sort(key=lambda e: e.index)
    return [objective.score(e, coarse=coarse, stage="profile") for e in found]


def nuisances_of(
    objective: Objective | JointObjective, result: FitResult, found: Uncertainty
) -> tuple[NuisanceEstimate, ...]:
    """What the best curves say of the measurement, trace by trace.

    Args:
        objective: What was fitted.
        result: How.
        found: The normal approximation about the best values.

    Returns:
        Nuisances that a search integrates out given the best curves, the others with the parameters free beside them.
    """
    out: list[NuisanceEstimate] = []
    beside = iter(found.unsearched)
    for case, trial in zip(objective.terms, result.best.each, strict=True):
        for e, n in zip(case.objective.nuisance_estimates(trial.curve), case.objective.nuisances, strict=True):
            if not n.searched:
                mean, sd = next(beside)
                e = replace(e, value=mean * n.sd, sd=sd * n.sd)
            out.append(e)
    return tuple(out)
