"""A second search for what one search calls identified: from another design, knowing nothing of the first.

A profile is walked from the best run, and sees no other food that explains the curve as well. On 85 made-up bananas whose cut was searched once, 18 of 25
intervals of E, yield stress and initiation depth that were called identified held the truth; others belonged to such a food, with a fourth of the stiffness or
a thirteenth of the yield stress. So a claim has to be found twice, and where the budget does not hold a second search it is none (multi-start as a
check: Raue et al. 2013, PLoS ONE 8:e74335).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

from threadpoolctl import threadpool_limits

from calib.doubt import Doubt, as_good, doubt_of
from calib.evaluation import Evaluator
from calib.fit import FitResult, calibrate, onward
from calib.joint import JointObjective
from calib.objective import Objective, Trial
from calib.options import FitOptions
from calib.profiles import RISE, with_profiles
from calib.progress import Progress
from calib.search import Search
from calib.surrogate import Surrogate
from calib.uncertainty import Interval, Uncertainty
from mpm.errors import SimulationError

OTHERWISE = 2_000_003
"""Added to the seed of the second search."""


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
        As :func:`calib.fit.calibrate` and :func:`calib.doubt.doubt_of`.
    """
    result = calibrate(objective, fine, coarse=coarse, replicate=again, options=options, progress=progress)

    def doubted(fit: FitResult, simulate: bool = True) -> Doubt | None:
        scout, judge = (coarse, fine) if simulate else (None, None)
        return doubt_of(objective, fit, scout=scout, judge=judge, seed=options.seed, sample=sample, say=say)

    if result.status != "interrupted":
        found(result)
    doubt = doubted(result, result.status != "interrupted")
    if doubt is None or result.status == "interrupted":
        return result, doubt
    claimed = [k for k, i in enumerate(doubt.uncertainty.intervals) if i.verdict == "identified"]
    rest = options.budget - options.cost(doubt.result.history)
    if not claimed:
        return doubt.result, doubt
    names = ", ".join(objective.parameters.names[k] for k in claimed)
    if rest < options.least(len(objective.parameters)):
        said = (
            f"{names}: bounded by one search, and the budget held no second one that might confirm it, so called weak; a budget of "
            f"{2 * options.budget:g} may."
        )
        say(said[:-1])
        return doubt.result, replace(doubt, uncertainty=_unconfirmed(doubt.uncertainty, None), said=(said,))
    say(f"a second search, from another design, for {names}")
    result = _searched(objective, doubt, claimed, fine, coarse, options, progress)
    if result.best is not doubt.result.best:
        gain = doubt.result.best.misfit - result.best.misfit
        better = f"A second search found a food that explains the curve better, by {gain:.3g} in chi-square: the values are its own."
        own = doubted(result) or doubt
        doubt = replace(own, uncertainty=_unconfirmed(own.uncertainty, doubt.result.best), said=(better,))
    else:
        widened = with_profiles(doubt.uncertainty, doubt.profiles, as_good(result))
        lost = [objective.parameters.names[k] for k in claimed if widened.intervals[k].verdict != "identified"]
        another = f"{', '.join(lost)}: a second search found another food that explains the curve as well; the interval reaches to it."
        doubt = replace(doubt, result=result, uncertainty=widened, said=(another,) if lost else ())
    for sentence in doubt.said:
        say(sentence[:-1])
    return doubt.result, doubt


def _unconfirmed(found: Uncertainty, other: Trial | None) -> Uncertainty:
    """The same with nothing called identified but what holds the answer of the other search, where there was one."""

    def seen(i: Interval) -> bool:
        return other is not None and i.low95 <= other.evaluation.parameters[i.parameter.name] <= i.high95

    lost = [i.verdict == "identified" and not seen(i) for i in found.intervals]
    changed = (replace(i, verdict="weak") if gone else i for i, gone in zip(found.intervals, lost, strict=True))
    return replace(found, intervals=tuple(changed))


def _searched(
    objective: Objective | JointObjective,
    doubt: Doubt,
    claimed: Sequence[int],
    fine: Evaluator,
    coarse: Evaluator,
    options: FitOptions,
    progress: Callable[[Progress], None] | None,
) -> FitResult:
    """The fit with the runs of a second search, which ends where the first has ended: within the intervals of what is claimed, as good."""
    first = doubt.result
    ends = []
    for k in claimed:
        i = doubt.uncertainty.intervals[k]
        ends.append((k, i.parameter.to_internal(i.low95), i.parameter.to_internal(i.high95)))

    def there(best: Trial) -> bool:
        return best.misfit <= first.best.misfit + RISE and all(low <= best.z[k] <= high for k, low, high in ends)

    told = onward(progress, first.history, first.best, options)
    rest = options.budget - options.cost(first.history)
    own = replace(options, budget=rest, seed=options.seed + OTHERWISE)
    search = Search(objective, fine, coarse, own, told, there)
    with threadpool_limits(1, "blas"):
        with suppress(SimulationError):  # no run of this design ends its stroke
            search.run()
        runs = (*first.history, *search.trials)
        best, surrogate = first.best, first.surrogate
        assert surrogate is not None  # or there were no intervals
        found = min((t for t in search.finished if t.cut), key=lambda t: t.misfit, default=best)
        if found.misfit >= best.misfit - surrogate.luck:
            return replace(first, history=runs)
        surrogate = Surrogate(objective, runs, found, surrogate.hyper)
        parameters = first.parameters.with_values(found.evaluation.parameters)
        jacobian = surrogate.jacobian(found.z)
    return replace(first, history=runs, best=found, parameters=parameters, surrogate=surrogate, jacobian=jacobian)
