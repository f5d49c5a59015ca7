"""A fit: the search for the material (:mod:`calib.fit.search`), and the choice of the answer among its runs.

The best run ever made is returned, not the last one; where simulations can be repeated slower and with other particles, the
best of the most promising ones run twice, because the luckiest of fifty noisy runs is not the best (selection by replication:
Bechhofer 1954, Ann. Math. Statist. 25:16), and a force that hangs on the simulated speed is not the food's. A search that has stalled
above what the right material would leave is begun afresh: multi-start, with the budget as its stopping rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2
from threadpoolctl import threadpool_limits

from calib.fit.options import FitOptions
from calib.fit.search import CAUTION_NEAR, ELSEWHERE, Search
from calib.fit.surrogate import Surrogate
from calib.io.progress import Progress, onward
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective, Trial
from calib.problem.parameters import ParameterSet
from calib.simulation.evaluation import Evaluator
from mpm.scene.errors import SimulationError

FloatArray = npt.NDArray[np.float64]

#: Runs among which the answer is chosen by a second run of each, slower and with other particles: two batches of two.  They
#: may be expected to be worse than the best by what the noise of two runs makes.
FINALISTS, NOISES = 4, 2.0
#: Added to the seed of a search that is begun afresh.
AFRESH = 1_000_003


@dataclass(frozen=True)
class FitResult:
    """Outcome of a fit.

    Attributes:
        status: ``converged`` (no gain in sight), ``stalled`` (gains promised, none realised), ``budget``
            (spent) or ``interrupted``.
        best: Best finished run on the fine evaluator.
        parameters: The fitted parameters with the best values [SI].
        jacobian: Derivative of the residual vector at the best point by internal coordinates (n + 2 + p, p);
            None when the search was interrupted before there were enough runs.
        repeatability: Noise of a simulated curve as seen by the fit, part of the peak [-]; NaN without
            Jacobian.
        history: All runs in the order of the search.
        replicates: Second runs of the finalists.
        surrogate: The process through them, about the best run; None where the Jacobian is.
    """

    status: str
    best: Trial
    parameters: ParameterSet
    jacobian: FloatArray | None
    repeatability: float
    history: tuple[Trial, ...]
    replicates: tuple[Trial, ...] = ()
    surrogate: Surrogate | None = None

    @property
    def simulations(self) -> int:
        """Number of runs on the fine evaluator, second ones included."""
        return sum(not t.coarse for t in self.history) + len(self.replicates)

    @property
    def coarse_simulations(self) -> int:
        """Number of runs on the coarse evaluator."""
        return sum(t.coarse for t in self.history)

    @property
    def failed(self) -> int:
        """Number of runs that did not finish their stroke."""
        return sum(not t.ok for t in (*self.history, *self.replicates))


def calibrate(
    objective: Objective | JointObjective,
    evaluator: Evaluator,
    *,
    coarse: Evaluator | None = None,
    replicate: Evaluator | None = None,
    options: FitOptions | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> FitResult:
    """Fit the objective's parameters with few simulations; see :mod:`calib.fit.search` for the method.

    Args:
        objective: Target, parameters and error model.
        evaluator: Runs simulations at the resolution that counts.
        coarse: Runs cheaper simulations for the design.
        replicate: Runs the simulations of ``evaluator`` with what should not matter changed (speed, particles); with it the
            answer is not the luckiest run but the best of the most promising ones run twice.
        options: Budget and the like.
        progress: Called after each simulation.

    Returns:
        The best run, its Jacobian and the history; after Ctrl-C what there is so far, with status
        ``interrupted``.

    Raises:
        MaterialError: A budget too small for the number of parameters.
        SimulationError: No simulation of the design reached the end of its stroke.
        KeyboardInterrupt: Interrupted before any simulation reached the end of its stroke.
    """
    options = FitOptions() if options is None else options
    options.check(len(objective.parameters))
    search = Search(objective, evaluator, coarse, options, progress)
    best: Trial | None = None
    replicates: list[Trial] = []
    # the workers have the cores, and sums in another order would ask for other points
    with threadpool_limits(1, "blas"):
        try:
            status = search.run()
            if status == "stalled":
                status = _afresh(search, evaluator, coarse)
            if replicate is not None:
                best, replicates = _choose(search, replicate)
        except KeyboardInterrupt:
            if not search.finished:
                raise
            status = "interrupted"
        return _result(search, status, best or search.best, replicates)


def _afresh(search: Search, evaluator: Evaluator, coarse: Evaluator | None) -> str:
    """Search once more from another design, with nothing of what a stalled search has learnt, for what is left of its budget; the runs
    of both are then the search's.

    That is where the right material would more likely than not have left a smaller chi-square, the budget holds a search, and the first
    has not already looked elsewhere for long in vain. Of 21 made-up cuts two had stalled at two to four times the chi-square that
    other seeds found.

    Returns:
        How the better of the two ended.
    """
    goal, options = search.objective, search.options
    least = options.least(len(goal.parameters))
    rest = options.budget - search.spent
    if rest < least or search.idle or search.best.misfit <= chi2.median(goal.effective_rows):
        return "stalled"
    first, told = search.best, onward(search.progress, search.trials, search.best, options)
    other = Search(goal, evaluator, coarse, replace(options, budget=rest, seed=options.seed + AFRESH), told)
    try:
        status = other.run()
    except SimulationError:
        status = "stalled"  # no run of the other design ended its stroke
    finally:
        search.trials += other.trials
    return status if search.best is not first else "stalled"


def _choose(search: Search, replicate: Evaluator) -> tuple[Trial, list[Trial]]:
    """Run the most promising runs once more, slower and with other particles; the one of least mean chi-square, and those runs.

    A run whose repetition breaks down is not the answer; where all break down, the next ones are repeated, promising or not.
    """
    process = search.process()
    order = sorted(search.finished, key=lambda t: process.expected(t.z, CAUTION_NEAR))
    limit = process.expected(order[0].z, CAUTION_NEAR) + NOISES * max(process.luck, 1.0)
    tried: list[Trial] = []
    replicates: list[Trial] = []
    for bound in (limit, math.inf):
        finalists: list[Trial] = []
        for trial in [search.best, *order]:
            apart = all(np.abs((trial.z - t.z) / search.unit).max() > ELSEWHERE for t in (*tried, *finalists))
            if apart and len(finalists) < FINALISTS and process.expected(trial.z, CAUTION_NEAR) <= bound:
                finalists.append(trial)
        if not finalists:
            continue
        for first in range(0, len(finalists), search.options.batch):
            batch = finalists[first : first + search.options.batch]
            left = [t for t in batch if _may_win(t, process, tried, replicates)]
            runs = sorted(replicate.evaluate([t.evaluation.parameters for t in left]), key=lambda e: e.index)
            tried += left
            replicates += (search.objective.trial(e, stage="replicate") for e in runs)
        sound = [(t.misfit + r.misfit, k) for k, (t, r) in enumerate(zip(tried, replicates, strict=True)) if r.ok]
        if sound:
            return tried[min(sound)[1]], replicates
    return search.best, replicates


def _may_win(trial: Trial, process: Surrogate, tried: list[Trial], replicates: list[Trial]) -> bool:
    """Whether a second run of a finalist may make it the answer: not if it would have to gain more over what is expected of it than
    those run twice so far have gained, on average, and the noise (a race: Maron & Moore 1994, NIPS 6:59)."""
    sound = [(t, again) for t, again in zip(tried, replicates, strict=True) if again.ok]
    if not sound:
        return True
    gain = float(np.mean([process.expected(t.z, CAUTION_NEAR) - again.misfit for t, again in sound]))
    least = process.expected(trial.z, CAUTION_NEAR) - gain - NOISES * max(process.luck, 1.0)
    return trial.misfit + least < min(t.misfit + again.misfit for t, again in sound)


def _result(search: Search, status: str, best: Trial, replicates: list[Trial]) -> FitResult:
    """What was found, with a Jacobian if there are runs enough for one."""
    jacobian, repeatability, process = None, math.nan, None
    if sum(t.ok for t in search.trials) > len(search.parameters):
        process = search.process(best)
        jacobian, repeatability = process.jacobian(best.z), process.noise
    parameters = search.parameters.with_values(best.evaluation.parameters)
    return FitResult(
        status, best, parameters, jacobian, repeatability, tuple(search.trials), tuple(replicates), process
    )
