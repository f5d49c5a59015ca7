"""A second search for what one search calls identified: from another design, knowing nothing of the first, and sent away from it.

A profile is walked from the best run, and sees no other food that explains the curve as well. On 85 made-up bananas whose cut was searched once, 18 of 25
intervals of E, yield stress and initiation depth that were called identified held the truth; others belonged to such a food, with a fourth of the stiffness or
a thirteenth of the yield stress. So a claim has to stand against a search for a food that would refute it, and where the budget does not hold one it is none
(multi-start as a check: Raue et al. 2013, PLoS ONE 8:e74335; sent away from what is known, as deflation does: Farrell et al. 2015, SIAM J. Sci. Comput.
37:A2026). A second search that was not sent away ended in the first one's valley where another one explained the curve as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from calib.fit.multistart import FitResult, calibrate
from calib.fit.options import FitOptions
from calib.fit.search import Search
from calib.fit.surrogate import Surrogate
from calib.io.progress import Progress, onward
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective, Trial
from calib.problem.parameters import ParameterSet, plain
from calib.simulation.evaluation import Evaluator
from calib.uncertainty.analysis import Doubt, as_good, at_first_sight, doubt_of
from calib.uncertainty.intervals import EXPLAINED, Interval
from calib.uncertainty.profile_likelihood import RISE
from mpm.scene.errors import SimulationError

FloatArray = npt.NDArray[np.float64]

PROVEN = ("R", "R_skin")
"""Properties that a fit may claim: of 100 made-up bananas 28 of 28 and 15 of 15 such intervals held the truth. Of E, yield stress and initiation
depth, which a cut bounds as well, 18 of 25 did on the 85 before, called identified by one search: stiff foods that yield late and soft ones that flow and rub
are cut with the same force, and two searches did not find the one beside the other."""
OTHERWISE = 2_000_003
"""Added to the seed of the second search."""
STRETCH = 3.0
"""Claimed intervals are barred this much longer about their middle: there chi-square has risen by 8.6, so that no food of the same
valley draws the search away from another one that is as good."""
BARRED = 10.0
"""Residual in the middle of what is barred [standard deviations]."""


@dataclass(frozen=True)
class Barred(ParameterSet):
    """Parameters whose prior has a row more: how deep a point lies within all claimed intervals at once.

    Attributes:
        claims: Place of each claimed parameter, middle and half width of what is barred of it, in internal coordinates.
    """

    claims: tuple[tuple[int, float, float], ...] = ()

    def prior_residual(self, z: FloatArray) -> FloatArray:
        """Distance from the prior centre in prior standard deviations, and the depth: (p + 1,) of a point (p,), (q, p + 1) of many."""
        depth = [1.0 - np.abs(z[..., place] - middle) / half for place, middle, half in self.claims]
        row = BARRED * np.maximum(np.min(depth, axis=0), 0.0)
        return np.concatenate([super().prior_residual(z), row[..., None]], axis=-1)


def infer(
    objective: Objective | JointObjective,
    fine: Evaluator,
    *,
    coarse: Evaluator,
    again: Evaluator,
    options: FitOptions,
    sample: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] = lambda text: None,
    found: Callable[[FitResult], None] = lambda result: None,
) -> tuple[FitResult, Doubt | None]:
    """Fit, find what the fit does not know, and search once more for what it calls identified.

    Args:
        objective: Target, parameters and error model.
        fine: Runs simulations at the resolution that counts.
        coarse: Runs cheaper ones.
        again: Runs those of ``fine`` with what should not matter changed.
        options: Budget and the like, of all that is searched.
        sample: Whether the posterior is sampled as well.
        progress: Called after each simulation of a search.
        say: Called with each stage, as one sentence.
        found: Told the fit when it is found and what it does not know is not: it will hardly change.

    Returns:
        The fit, and what it does not know: None where it ended too early for that.

    Raises:
        As :func:`calib.fit.multistart.calibrate` and :func:`calib.uncertainty.analysis.doubt_of`.
    """
    first = calibrate(objective, fine, coarse=coarse, replicate=again, options=options, progress=progress)
    if first.status == "interrupted":
        return first, doubt_of(objective, first, seed=options.seed, sample=sample)
    alone = at_first_sight(objective, first)
    claimed = [] if alone is None else [i for i in alone.intervals if i.verdict == "identified" and _proven(i)]
    if claimed:
        first = _repeated(objective, first, again)
    result, second = first, None
    held = options.budget - options.cost(first.history) >= options.least(len(objective.parameters))
    if claimed and held and _steady(objective, first):
        say(f"a second search, from another design, for a food with another {_names(claimed, ' or ')}")
        result = second = _searched(objective, first, claimed, fine, coarse, options, progress)
    found(result)
    doubt = doubt_of(objective, result, scout=coarse, judge=fine, seed=options.seed, sample=sample, say=say)
    if doubt is None:
        return result, None
    doubt = _unclaimed(
        doubt,
        "bounded, but of made-up cuts one of four such intervals does not hold the truth",
        lambda i: not _proven(i),
    )
    if any(i.verdict == "identified" for i in doubt.uncertainty.intervals):
        doubt = replace(doubt, result=_repeated(objective, doubt.result, again))
    if second is not None:
        doubt = _weighed(doubt, first, second, claimed)
    if not _steady(objective, doubt.result):
        doubt = _unclaimed(
            doubt, "bounded, but the same values at half the speed and with other particles do not explain the curve"
        )
    elif second is None:
        more = f"; a budget of {2 * options.budget:g} may hold one" if claimed else ""
        doubt = _unclaimed(doubt, f"bounded by one search and not by a second one that might refute it{more}")
    for sentence in doubt.said:
        say(sentence[:-1])
    return doubt.result, doubt


def _repeated(objective: Objective | JointObjective, fit: FitResult, again: Evaluator) -> FitResult:
    """The fit with a second run of its answer, if there is none yet."""
    if _second_run(fit) is not None:
        return fit
    run = next(iter(again.evaluate([fit.best.evaluation.parameters])))
    return replace(fit, replicates=(*fit.replicates, objective.trial(run, stage="replicate")))


def _second_run(fit: FitResult) -> Trial | None:
    """That of the answer, slower and with other particles."""
    return next((t for t in fit.replicates if np.array_equal(t.z, fit.best.z)), None)


def _steady(objective: Objective | JointObjective, fit: FitResult) -> bool:
    """Whether the answer explains the curve whatever should not matter: the right material would leave as large a chi-square in its second run, if
    there is one."""
    run = _second_run(fit)
    return run is None or run.misfit <= float(chi2.ppf(EXPLAINED, objective.effective_rows))


def _searched(
    objective: Objective | JointObjective,
    first: FitResult,
    claimed: Sequence[Interval],
    fine: Evaluator,
    coarse: Evaluator,
    options: FitOptions,
    progress: Callable[[Progress], None] | None,
) -> FitResult:
    """The fit with the runs of a second search, for a food with one of the claimed parameters elsewhere."""
    told = onward(progress, first.history, first.best, options)
    own = replace(options, budget=options.budget - options.cost(first.history), seed=options.seed + OTHERWISE)
    barred = replace(objective, parameters=_barred(objective.parameters, claimed))
    search = Search(barred, fine, coarse, own, told, first.best.misfit + RISE)
    with threadpool_limits(1, "blas"):
        with suppress(SimulationError):  # no run of this design ends its stroke
            search.run()
        more = [objective.trial(t.evaluation, coarse=t.coarse, stage=t.stage) for t in search.trials]
        runs = (*first.history, *more)
        assert first.surrogate is not None  # or nothing would be claimed
        found = min((t for t in more if t.cut and not t.coarse), key=lambda t: t.misfit, default=first.best)
        best = found if found.misfit < first.best.misfit - first.surrogate.luck else first.best
        surrogate = Surrogate(objective, runs, best, first.surrogate.hyper)
        parameters = first.parameters.with_values(best.evaluation.parameters)
        jacobian = surrogate.jacobian(best.z)
    return replace(first, history=runs, best=best, parameters=parameters, surrogate=surrogate, jacobian=jacobian)


def _barred(parameters: ParameterSet, claimed: Sequence[Interval]) -> Barred:
    """The parameters with what is claimed of them barred."""
    bars = []
    for i in claimed:
        low, high = i.parameter.to_internal(i.low95), i.parameter.to_internal(i.high95)
        bars.append((parameters.names.index(i.parameter.name), 0.5 * (low + high), 0.5 * STRETCH * (high - low)))
    return Barred(parameters.items, tuple(bars))


def _weighed(doubt: Doubt, first: FitResult, second: FitResult, claimed: Sequence[Interval]) -> Doubt:
    """What is not known after a second search for another food than is ``claimed`` after the first."""
    if second.best is not first.best:
        values = first.best.evaluation.parameters
        gain = first.best.misfit - second.best.misfit
        said = f"A second search found a food that explains the curve better, by {gain:.3g} in chi-square: the values are its own."
        doubt = replace(doubt, said=(*doubt.said, said))
        return _unclaimed(doubt, "the food of the first search had another", lambda i: not _holds(i, values))
    after = second.history[len(first.history) :]
    others = [t.evaluation.parameters for t in as_good(doubt.result, doubt.uncertainty) if any(t is o for o in after)]
    kept = {i.parameter.name for i in doubt.uncertainty.intervals if i.verdict == "identified"}
    lost = [i for i in claimed if i.parameter.name not in kept and not all(_holds(i, values) for values in others)]
    if not lost:
        return doubt
    said = f"{_names(lost)}: a second search found another food that explains the curve as well; the interval reaches to it."
    return replace(doubt, said=(*doubt.said, said))


def _holds(interval: Interval, values: Mapping[str, float]) -> bool:
    return interval.low95 <= values[interval.parameter.name] <= interval.high95


def _unclaimed(doubt: Doubt, why: str, lost: Callable[[Interval], bool] = lambda i: True) -> Doubt:
    """The same with those that are ``lost`` weak where they were identified, and with a sentence on why."""
    gone = [i for i in doubt.uncertainty.intervals if i.verdict == "identified" and lost(i)]
    if not gone:
        return doubt
    changed = tuple(replace(i, verdict="weak") if i in gone else i for i in doubt.uncertainty.intervals)
    said = f"{_names(gone)}: {why}, so called weak."
    return replace(doubt, uncertainty=replace(doubt.uncertainty, intervals=changed), said=(*doubt.said, said))


def _proven(interval: Interval) -> bool:
    return plain(interval.parameter.name) in PROVEN


def _names(intervals: Sequence[Interval], between: str = ", ") -> str:
    return between.join(i.parameter.name for i in intervals)
