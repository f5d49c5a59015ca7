"""A multi-start search (:mod:`calib.fit.search`), and the choice of the answer among its runs.

The best run ever made is returned, not the last one. Where simulations can be repeated slower and with other
particles, it is the best of the most promising ones run twice: the best of fifty noisy runs owes part of that to its
noise (selection by replication: Bechhofer 1954, Ann. Math. Statist. 25:16), and a force that hangs on the simulated
speed is not the food's. Of two that the curve does not tell apart, it is the one whose second run has the same force. A
search that has stalled above what the right material would leave is started once more from another design, with the
budget as its stopping rule. So is one whose answer has another force in its second run or on finer cells, and sent away
from that answer.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from calib.fit.acquisition import BASIN_DISTANCE, LOCAL_WEIGHT
from calib.fit.budget import progress_of_all
from calib.fit.deflation import deflated_about
from calib.fit.options import FitOptions
from calib.fit.repeated_runs import ALIKE, FINALISTS, HELD_CHANGE, holds, stands
from calib.fit.search import Search
from calib.fit.surrogate import Surrogate
from calib.io.progress import Progress
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator
from mpm.arrays import FloatArray
from mpm.scene.errors import SimulationError

#: They may be expected to be worse than the best by the chi-square that the noise of so many runs makes.
FINALIST_MARGIN = 2.0
#: Added to the seed of a search that is started once more.
RESTART_SEED = 1_000_003


@dataclass(frozen=True)
class FitResult:
    """Outcome of a fit.

    Attributes:
        status: ``converged`` (no gain in sight), ``stalled`` (gains promised, none realised), ``budget`` (spent) or
            ``interrupted``.
        best: Best finished run on the fine evaluator.
        parameters: The fitted parameters with the best values [SI].
        jacobian: Derivative of the residual vector at the best point by internal coordinates (rows, p); None when the
            search was interrupted before there were enough runs.
        repeatability: Noise of a simulated curve as seen by the fit, part of the peak [-]; NaN without Jacobian.
        history: All runs in the order of the search.
        replicates: Second runs of the finalists.
        surrogate: The surrogate through them, about the best run; None where the Jacobian is.
    """

    status: str
    best: ScoredRun
    parameters: ParameterSet
    jacobian: FloatArray | None
    repeatability: float
    history: tuple[ScoredRun, ...]
    replicates: tuple[ScoredRun, ...] = ()
    surrogate: Surrogate | None = None

    @property
    def simulations(self) -> int:
        """Number of runs on the fine evaluator, second ones included."""
        return sum(not run.coarse for run in self.history) + len(self.replicates)

    @property
    def coarse_simulations(self) -> int:
        """Number of runs on the coarse evaluator."""
        return sum(run.coarse for run in self.history)

    @property
    def failed(self) -> int:
        """Number of runs that did not finish their stroke."""
        return sum(not run.ok for run in (*self.history, *self.replicates))


def multistart_search(
    objective: Objective | JointObjective,
    evaluator: Evaluator,
    *,
    coarse: Evaluator | None = None,
    replicate: Evaluator | None = None,
    finer: Evaluator | None = None,
    options: FitOptions | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> FitResult:
    """Fit the objective's parameters with few simulations; see :mod:`calib.fit.search` for the method.

    Args:
        objective: Target, parameters and error model.
        evaluator: Runs simulations at the resolution that counts.
        coarse: Runs cheaper simulations for the design.
        replicate: Runs the simulations of ``evaluator`` with what should not matter changed (speed, particles); with it
            the answer is the best of the most promising runs made twice.
        finer: Runs the simulations of ``evaluator`` on finer cells; with it, and with ``replicate``, a search whose
            answer does not stand there is started once more, as far as the budget goes.
        options: Budget and the like.
        progress: Called after each simulation.

    Returns:
        The best run, its Jacobian and the history; after Ctrl-C what there is so far, with status ``interrupted``.

    Raises:
        MaterialError: A budget too small for the number of parameters.
        SimulationError: No simulation of the design reached the end of its stroke.
        KeyboardInterrupt: Interrupted before any simulation reached the end of its stroke.
    """
    options = FitOptions() if options is None else options
    options.check(len(objective.parameters))
    search = Search(objective, evaluator, coarse, options, progress)
    best: ScoredRun | None = None
    replicates: list[ScoredRun] = []
    # the workers have the cores, and sums in another order would ask for other points
    with threadpool_limits(1, "blas"):
        try:
            status = search.run()
            again = status == "stalled" and search.best.misfit > chi2.median(objective.effective_rows)
            if again:
                status = _restarted(search, status)
            if replicate is not None:
                best, replicates = _best_of_finalists(search, replicate)
                held = holds(best, replicates)
                if not again and not (held and (not _restartable(search) or stands(objective, best, finer))):
                    refuted = best if held else None  # by finer cells
                    status = _restarted(search, status, away_from=best)
                    other, replicates = _best_of_finalists(search, replicate, replicates, refuted)
                    if refuted is None or other is refuted or stands(objective, other, finer):
                        best = other
        except KeyboardInterrupt:
            if not search.finished:
                raise
            status = "interrupted"
        return _result(search, status, best or search.best, replicates)


def _restartable(search: Search) -> bool:
    """Whether the budget holds another search, and this one has not already looked elsewhere for long in vain."""
    options = search.options
    return options.budget - search.spent >= options.least(len(search.objective.parameters)) and not search.idle


def _restarted(search: Search, ended: str, away_from: ScoredRun | None = None) -> str:
    """Spend the rest of the budget of a search on one from another design, with nothing of what it has learnt.

    That is where the budget holds a search, and the first has not already looked elsewhere for long in vain. The runs
    of both are then the search's.

    Args:
        search: The first search.
        ended: How it ended.
        away_from: A run whose food is not to be found again.

    Returns:
        How the better of the two ended.
    """
    goal, options = search.objective, search.options
    if not _restartable(search):
        return ended
    rest = options.budget - search.spent
    first, told = search.best, progress_of_all(search.progress, search.runs, search.best, options)
    own = replace(options, budget=rest, seed=options.seed + RESTART_SEED)
    sought = goal if away_from is None else replace(goal, parameters=deflated_about(goal.parameters, away_from.z))
    other = Search(sought, search.fine, search.coarse, own, told)
    try:
        status = other.run()
    except SimulationError:
        status = ended  # no run of the other design ended its stroke
    finally:
        scored = (goal.score(run.evaluation, coarse=run.coarse, stage=run.stage) for run in other.runs)
        search.runs += other.runs if away_from is None else scored
    return status if search.best is not first else ended


def _best_of_finalists(
    search: Search, replicate: Evaluator, known: list[ScoredRun] | None = None, refuted: ScoredRun | None = None
) -> tuple[ScoredRun, list[ScoredRun]]:
    """Repeat the most promising runs, slower and with other particles; the answer among them, and the second runs.

    A run whose repetition breaks down is not the answer; where all break down, the next ones are repeated, promising or
    not. They are as well where the answer's second run has another force, as far as the curve may not tell them apart.

    Args:
        search: With the runs.
        replicate: Runs them once more.
        known: Second runs that there are.
        refuted: A run that has another force on finer cells: the answer only where the curve tells it from the others.
    """
    surrogate = search.surrogate()
    order = sorted(search.finished, key=lambda run: surrogate.expected(run.z, LOCAL_WEIGHT))
    limit = surrogate.expected(order[0].z, LOCAL_WEIGHT) + FINALIST_MARGIN * max(surrogate.noise_misfit, 1.0)
    pairs = [(run, again) for again in known or () for run in order if np.array_equal(run.z, again.z)]
    tried, replicates = [run for run, _ in pairs], [again for _, again in pairs]
    # what did not cut the food is no finalist any more once something has
    lost = [again for again in known or () if not any(again is kept for kept in replicates)]
    for bound in (limit, limit + ALIKE, math.inf):
        answer = _answer(tried, replicates, refuted)
        if answer is not None and ((answer is not refuted and holds(answer, replicates)) or bound == math.inf):
            break
        finalists: list[ScoredRun] = []
        for run in [search.best, *order]:
            others = (*tried, *finalists)
            apart = all(np.abs((run.z - other.z) / search.unit).max() > BASIN_DISTANCE for other in others)
            if apart and len(finalists) < FINALISTS and surrogate.expected(run.z, LOCAL_WEIGHT) <= bound:
                finalists.append(run)
        for first in range(0, len(finalists), search.options.batch):
            batch = finalists[first : first + search.options.batch]
            left = [run for run in batch if _may_win(run, surrogate, tried, replicates, refuted)]
            asked = [run.evaluation.parameters for run in left]
            found = sorted(replicate.evaluate(asked), key=lambda e: e.index)
            tried += left
            replicates += (search.objective.score(e, stage="replicate") for e in found)
    return _answer(tried, replicates, refuted) or search.best, [*lost, *replicates]


def _answer(tried: list[ScoredRun], replicates: list[ScoredRun], refuted: ScoredRun | None = None) -> ScoredRun | None:
    """The run of least mean chi-square in both runs, if its second run has the same force and it is not refuted, or no
    other that the curve does not tell from it is such a one; else the best of those. None where every second run broke
    down."""
    sound = [(t.misfit + r.misfit, k) for k, (t, r) in enumerate(zip(tried, replicates, strict=True)) if r.ok]
    if not sound:
        return None
    alike = [(size, k) for size, k in sorted(sound) if size <= min(sound)[0] + 2 * ALIKE]
    held = [k for _, k in alike if tried[k] is not refuted and tried[k].change(replicates[k]) <= HELD_CHANGE]
    return tried[held[0] if held else alike[0][1]]


def _may_win(
    run: ScoredRun,
    surrogate: Surrogate,
    tried: list[ScoredRun],
    replicates: list[ScoredRun],
    refuted: ScoredRun | None = None,
) -> bool:
    """Whether a second run of a finalist may make it the answer (a race: Maron & Moore 1994, NIPS 6:59).

    Not if it would have to gain more over what is expected of it than those run twice so far have gained, on average,
    and the noise. Where the answer so far does not hold, one may win that the curve does not tell from it.
    """
    answer = _answer(tried, replicates, refuted)
    if answer is None:
        return True
    sound = [(t, again) for t, again in zip(tried, replicates, strict=True) if again.ok]
    gain = float(np.mean([surrogate.expected(t.z, LOCAL_WEIGHT) - again.misfit for t, again in sound]))
    noise = FINALIST_MARGIN * max(surrogate.noise_misfit, 1.0)
    least = surrogate.expected(run.z, LOCAL_WEIGHT) - gain - noise
    leave = 0.0 if answer is not refuted and holds(answer, replicates) else 2 * ALIKE
    return run.misfit + least < min(t.misfit + again.misfit for t, again in sound) + leave


def _result(search: Search, status: str, best: ScoredRun, replicates: list[ScoredRun]) -> FitResult:
    """What was found, with a Jacobian if there are runs enough for one."""
    jacobian, repeatability, surrogate = None, math.nan, None
    if sum(run.ok for run in search.runs) > len(search.parameters):
        surrogate = search.surrogate(best)
        jacobian, repeatability = surrogate.jacobian(best.z), surrogate.noise
    parameters = search.parameters.with_values(best.evaluation.parameters)
    return FitResult(
        status, best, parameters, jacobian, repeatability, tuple(search.runs), tuple(replicates), surrogate
    )
