"""A second search for what one search calls identified: from another design, knowing nothing of the first, and sent
away from it.

A profile is computed from the best run, and sees no other food that explains the curve as well. On made-up bananas one
search alone claimed intervals that belonged to such a food (docs/theory.md, "Measured choices"). So a claim has to
stand against a search for a food that would refute it, and where the budget does not hold one there is no claim. This
is multi-start as a check (Raue et al. 2013, PLoS ONE 8:e74335), and the search is sent away from what is known as
deflation does (Farrell et al. 2015, SIAM J. Sci. Comput. 37:A2026).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from calib.fit.budget import progress_of_all
from calib.fit.deflation import DeflatedParameterSet
from calib.fit.multistart import FitResult, multistart_search
from calib.fit.options import FitOptions
from calib.fit.repeated_runs import ALIKE, again, holds, standing_in_its_place
from calib.fit.search import Search
from calib.fit.surrogate import Surrogate
from calib.io.progress import Progress
from calib.material.properties import property_of
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import EXPLAINED, Objective
from calib.problem.parameters import ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator, Evaluators
from calib.uncertainty.analysis import UncertaintyAnalysis, analyse, equally_good, search_uncertainty
from calib.uncertainty.intervals import Interval
from calib.uncertainty.nested_models import with_nested_runs
from calib.uncertainty.profile_likelihood import RISE
from mpm.scene.errors import SimulationError

CLAIMABLE = ("R", "R_skin")
"""Properties that a fit may call identified. Intervals of the others hold the truth too seldom: stiff foods that yield
late and soft ones that flow and rub are cut with the same force (docs/theory.md, "Measured choices")."""
SECOND_SEED = 2_000_003
"""Added to the seed of the second search."""
STRETCH = 3.0
"""Claimed intervals are deflated this much longer about their middle: there chi-square has risen by 8.6, so that no
food of the same valley draws the search away from another one that is as good."""


@dataclass(frozen=True)
class Listener:
    """What is told of a fit while it runs.

    Attributes:
        progress: Called after each simulation of a search.
        say: Called with each stage, as one sentence.
        found: Called with the fit once it is found, before its uncertainty is: the fit will hardly change.
        remark: Called with each remark on the answer; None for what is called with the stages.
        made: Called after each simulation of a stage with how many of its are done, and how many it has.
    """

    progress: Callable[[Progress], None] | None = None
    say: Callable[[str], None] = lambda text: None
    found: Callable[[FitResult], None] = lambda result: None
    remark: Callable[[str], None] | None = None
    made: Callable[[int, int], None] = lambda done, whole: None


def fit_with_uncertainty(
    objective: Objective | JointObjective,
    evaluators: Evaluators,
    options: FitOptions,
    listener: Listener | None = None,
    without: Sequence[str] = (),
) -> tuple[FitResult, UncertaintyAnalysis | None]:
    """Fit, analyse the uncertainty of the fit, and search once more for what it calls identified.

    Args:
        objective: Target, parameters and error model.
        evaluators: What runs the simulations.
        options: Budget and the like, of all that is searched.
        listener: What is told of it; None for nothing.
        without: Parameters without which the fit is tried again, for :func:`calib.uncertainty.nested_models`. Their
            intervals know these runs.

    Returns:
        The fit, and its uncertainty: None where it ended too early for that.

    Raises:
        MaterialError: A budget too small for the number of parameters.
        SimulationError: No simulation of the design reached the end of its stroke.
        KeyboardInterrupt: Interrupted before any simulation reached the end of its stroke.
    """
    told = listener or Listener()
    fine, coarse, replicate = evaluators.fine, evaluators.coarse, evaluators.replicate
    first = multistart_search(
        objective,
        fine,
        coarse=coarse,
        replicate=replicate,
        finer=evaluators.finer,
        options=options,
        progress=told.progress,
    )
    if first.status == "interrupted":
        return first, analyse(objective, first, seed=options.seed)
    alone = search_uncertainty(objective, first)
    claimed = [] if alone is None else [i for i in alone.intervals if i.verdict == "identified" and _claimable(i)]
    if claimed:
        first = _replicated(objective, first, replicate)
    result, second = first, None
    affordable = options.budget - options.cost(first.history) >= options.least(len(objective.parameters))
    if claimed and affordable and _robust(objective, first):
        told.say(f"a second search, from another design, for a food with another {_names(claimed, ' or ')}")
        result = second = _second_search(objective, first, claimed, evaluators, options, told.progress)
    told.found(result)
    result = with_nested_runs(objective, result, fine, without, told.say)
    analysis = analyse(
        objective,
        result,
        coarse=coarse,
        fine=fine,
        seed=options.seed,
        say=told.say,
        made=told.made,
        accepts=lambda run: _may_follow(objective, result, run, replicate),
    )
    if analysis is None:
        return result, None
    analysis = _standing(objective, analysis, evaluators, options.seed)
    analysis = _reviewed(objective, analysis, _Searches(first, second, claimed), replicate, options.budget)
    for sentence in analysis.remarks:
        (told.remark or told.say)(sentence[:-1])
    return analysis.result, analysis


@dataclass(frozen=True, eq=False)
class _Searches:
    """The fit of the first search, that of both where there was a second one, and what the first alone has claimed."""

    first: FitResult
    second: FitResult | None
    claimed: Sequence[Interval]


def _reviewed(
    objective: Objective | JointObjective,
    analysis: UncertaintyAnalysis,
    searches: _Searches,
    replicate: Evaluator,
    budget: float,
) -> UncertaintyAnalysis:
    """The uncertainty with no claim that a second search, a repeated run or experience with made-up cuts refutes."""
    analysis = _without_claims(
        analysis,
        "bounded, but of made-up cuts one of four such intervals does not hold the truth",
        lambda i: not _claimable(i),
    )
    if any(i.verdict == "identified" for i in analysis.uncertainty.intervals):
        analysis = replace(analysis, result=_replicated(objective, analysis.result, replicate))
    if searches.second is not None:
        analysis = _compared(analysis, searches.first, searches.second, searches.claimed)
    if not _robust(objective, analysis.result):
        return _without_claims(
            analysis, "bounded, but the same values at half the speed and with other particles do not explain the curve"
        )
    if searches.second is None:
        more = f"; a budget of {2 * budget:g} may hold one" if searches.claimed else ""
        return _without_claims(analysis, f"bounded by one search and not by a second one that might refute it{more}")
    return analysis


def _standing(
    objective: Objective | JointObjective, analysis: UncertaintyAnalysis, evaluators: Evaluators, seed: int
) -> UncertaintyAnalysis:
    """The uncertainty about a run that stands on finer cells, where the answer does not and the curve does not tell
    them apart: the ends of the intervals may have found such a food after the answer was chosen."""
    fit = analysis.result
    found = standing_in_its_place(objective, fit.best, fit.history, evaluators.finer, evaluators.replicate)
    if found is None:
        return analysis
    assert fit.surrogate is not None  # or nothing is analysed
    best, second = found
    with threadpool_limits(1, "blas"):
        surrogate = Surrogate(objective, fit.history, best, fit.surrogate.hyper)
        jacobian = surrogate.jacobian(best.z)
    moved = replace(
        fit,
        best=best,
        parameters=fit.parameters.with_values(best.evaluation.parameters),
        replicates=(*fit.replicates, second),
        surrogate=surrogate,
        jacobian=jacobian,
    )
    again_analysed = analyse(objective, moved, seed=seed)
    assert again_analysed is not None
    remark = (
        "The best fit has another force on finer cells: the values are those of a food that has not, and that the "
        f"curve does not tell from it (chi-square {best.misfit:.3g} against {fit.best.misfit:.3g})."
    )
    return replace(again_analysed, remarks=(*analysis.remarks, remark))


def _replicated(objective: Objective | JointObjective, fit: FitResult, replicate: Evaluator) -> FitResult:
    """The fit with a second run of its answer, if there is none yet."""
    if _second_run(fit) is not None:
        return fit
    return replace(fit, replicates=(*fit.replicates, again(objective, fit.best, replicate, "replicate")))


def _may_follow(objective: Objective | JointObjective, fit: FitResult, run: ScoredRun, replicate: Evaluator) -> bool:
    """Whether a run with a smaller chi-square may be the answer in place of one whose second run has the same force.

    Not where the curve does not tell them apart and its own second run has another force, or breaks down.
    """
    if fit.best.misfit - run.misfit > ALIKE or not holds(fit.best, fit.replicates):
        return True
    return holds(run, [again(objective, run, replicate, "replicate")])


def _second_run(fit: FitResult) -> ScoredRun | None:
    """That of the answer, slower and with other particles."""
    return next((t for t in fit.replicates if np.array_equal(t.z, fit.best.z)), None)


def _robust(objective: Objective | JointObjective, fit: FitResult) -> bool:
    """Whether the answer explains the curve whatever should not matter: the right material would leave as large a
    chi-square in its second run, if there is one."""
    run = _second_run(fit)
    return run is None or run.misfit <= float(chi2.ppf(EXPLAINED, objective.effective_rows))


def _second_search(
    objective: Objective | JointObjective,
    first: FitResult,
    claimed: Sequence[Interval],
    evaluators: Evaluators,
    options: FitOptions,
    progress: Callable[[Progress], None] | None,
) -> FitResult:
    """The fit with the runs of a second search, for a food with one of the claimed parameters elsewhere."""
    told = progress_of_all(progress, first.history, first.best, options)
    own = replace(options, budget=options.budget - options.cost(first.history), seed=options.seed + SECOND_SEED)
    deflated = replace(objective, parameters=_deflated(objective.parameters, claimed))
    search = Search(deflated, evaluators.fine, evaluators.coarse, own, told, first.best.misfit + RISE)
    with threadpool_limits(1, "blas"):
        with suppress(SimulationError):  # no run of this design ends its stroke
            search.run()
        more = [objective.score(t.evaluation, coarse=t.coarse, stage=t.stage) for t in search.runs]
        runs = (*first.history, *more)
        assert first.surrogate is not None  # or nothing would be claimed
        found = min((t for t in more if t.cut and not t.coarse), key=lambda t: t.misfit, default=first.best)
        better = found.misfit < first.best.misfit - first.surrogate.noise_misfit
        best = found if better and _may_follow(objective, first, found, evaluators.replicate) else first.best
        surrogate = Surrogate(objective, runs, best, first.surrogate.hyper)
        parameters = first.parameters.with_values(best.evaluation.parameters)
        jacobian = surrogate.jacobian(best.z)
    return replace(first, history=runs, best=best, parameters=parameters, surrogate=surrogate, jacobian=jacobian)


def _deflated(parameters: ParameterSet, claimed: Sequence[Interval]) -> DeflatedParameterSet:
    """The parameters with what is claimed of them deflated."""
    claims = []
    for i in claimed:
        low, high = i.parameter.to_internal(i.low95), i.parameter.to_internal(i.high95)
        claims.append((parameters.names.index(i.parameter.name), 0.5 * (low + high), 0.5 * STRETCH * (high - low)))
    return DeflatedParameterSet(parameters.items, parameters.correlations, tuple(claims))


def _compared(
    analysis: UncertaintyAnalysis, first: FitResult, second: FitResult, claimed: Sequence[Interval]
) -> UncertaintyAnalysis:
    """The uncertainty after a second search for another food than is ``claimed`` after the first."""
    if second.best is not first.best:
        values = first.best.evaluation.parameters
        gain = first.best.misfit - second.best.misfit
        remark = (
            f"A second search found a food that explains the curve better, by {gain:.3g} in chi-square: the values are "
            "its own."
        )
        analysis = replace(analysis, remarks=(*analysis.remarks, remark))
        return _without_claims(analysis, "the food of the first search had another", lambda i: not _holds(i, values))
    after = second.history[len(first.history) :]
    good = equally_good(analysis.result, analysis.uncertainty)
    others = [t.evaluation.parameters for t in good if any(t is o for o in after)]
    kept = {i.parameter.name for i in analysis.uncertainty.intervals if i.verdict == "identified"}
    lost = [i for i in claimed if i.parameter.name not in kept and not all(_holds(i, values) for values in others)]
    if not lost:
        return analysis
    why = "a second search found another food that explains the curve as well; the interval reaches to it."
    remark = f"{_names(lost)}: {why}"
    return replace(analysis, remarks=(*analysis.remarks, remark))


def _holds(interval: Interval, values: Mapping[str, float]) -> bool:
    return interval.low95 <= values[interval.parameter.name] <= interval.high95


def _without_claims(
    analysis: UncertaintyAnalysis, why: str, lost: Callable[[Interval], bool] = lambda i: True
) -> UncertaintyAnalysis:
    """The same with those that are ``lost`` weak where they were identified, and with a sentence on why.

    The sentence does not call them weak: one that is known only as a product is called that in the end.
    """
    gone = [i for i in analysis.uncertainty.intervals if i.verdict == "identified" and lost(i)]
    if not gone:
        return analysis
    changed = tuple(replace(i, verdict="weak") if i in gone else i for i in analysis.uncertainty.intervals)
    remark = f"{_names(gone)}: {why}, so not called identified."
    uncertainty = replace(analysis.uncertainty, intervals=changed)
    return replace(analysis, uncertainty=uncertainty, remarks=(*analysis.remarks, remark))


def _claimable(interval: Interval) -> bool:
    return property_of(interval.parameter.name) in CLAIMABLE


def _names(intervals: Sequence[Interval], between: str = ", ") -> str:
    return between.join(i.parameter.name for i in intervals)
