"""Runs made once more with what should not matter changed: speed, particles, cells.

A force that hangs on the simulated speed or on the cells is not the food's. Of runs that the curve does not tell apart,
one whose repetition has the same force is the answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.fit.acquisition import apart
from calib.fit.deflation import telling
from calib.fit.surrogate import coordinate_unit
from calib.problem.joint_objective import JointObjective
from calib.problem.objective import Objective
from calib.problem.parameters import Z95
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import Evaluator

#: Runs among which an answer is chosen by a second run of each: two batches of two.
FINALISTS = 4
#: Largest change of peak or work in a second run that has the same force [-]: half of what the verdict allows for the
#: speed, because it carries the change on to rest, and a hundredth for other particles.
HELD_CHANGE = 0.035
#: Largest change of peak or work on finer cells of an answer that stands there [-]: what the verdict allows.
STANDING_CHANGE = 0.05
#: Chi-square that two runs may be apart if the curve does not tell them apart: that of an interval of 95 %.
ALIKE = Z95**2
#: Half width of an answer's own valley along what tells foods apart [standard deviations of its prior].
OWN_VALLEY = 0.5


def holds(run: ScoredRun, replicates: Sequence[ScoredRun]) -> bool:
    """Whether a run's second run has the same force.

    Args:
        run: The run.
        replicates: Second runs, among which its own may be.

    Returns:
        That; False where there is none, or it broke down.
    """
    again = next((r for r in replicates if r.ok and np.array_equal(r.z, run.z)), None)
    return again is not None and run.change(again) <= HELD_CHANGE


def stands(objective: Objective | JointObjective, run: ScoredRun, finer: Evaluator | None) -> bool:
    """Whether a run has the same force on finer cells, to what the verdict allows.

    Args:
        objective: What scores the runs.
        run: The run.
        finer: Runs it on finer cells; without it any run stands.

    Returns:
        That; False where the finer one breaks down.
    """
    return finer is None or _unchanged(run, again(objective, run, finer, "finer"))


def again(objective: Objective | JointObjective, run: ScoredRun, evaluator: Evaluator, stage: str) -> ScoredRun:
    """A run made once more.

    Args:
        objective: What scores it.
        run: The run.
        evaluator: Makes it.
        stage: Why.

    Returns:
        The second run.
    """
    return objective.score(next(iter(evaluator.evaluate([run.evaluation.parameters]))), stage=stage)


def standing_in_its_place(
    objective: Objective | JointObjective,
    answer: ScoredRun,
    runs: Sequence[ScoredRun],
    finer: Evaluator | None,
    replicate: Evaluator,
) -> tuple[ScoredRun, ScoredRun] | None:
    """A run that stands on finer cells and holds, in place of an answer that does not stand.

    The curve must not tell them apart. As among finalists the chi-square is that of two runs; here the one on finer
    cells is the second. Runs of the answer's own valley are not asked for, because they have its fault, nor is the
    answer where there are no others.

    Args:
        objective: What was fitted.
        answer: The answer.
        runs: All runs of the fit.
        finer: Runs them on finer cells; without it any answer stands.
        replicate: Runs them slower and with other particles.

    Returns:
        The run and its second run; None where the answer stands, or where none of the best four elsewhere may take its
        place.
    """
    others = _elsewhere(objective, answer, runs)
    if finer is None or not others:
        return None
    refuting = again(objective, answer, finer, "finer")
    if _unchanged(answer, refuting):
        return None
    limit = answer.misfit + (refuting.misfit if refuting.ok else answer.misfit) + 2 * ALIKE
    for run in others:
        on_finer = again(objective, run, finer, "finer")
        if not _unchanged(run, on_finer) or run.misfit + on_finer.misfit > limit:
            continue
        second = again(objective, run, replicate, "replicate")
        if holds(run, [second]):
            return run, second
    return None


def _elsewhere(
    objective: Objective | JointObjective, answer: ScoredRun, runs: Sequence[ScoredRun]
) -> Sequence[ScoredRun]:
    """Runs that the curve does not tell from the answer, out of its valley and apart from each other, the best ones
    first."""
    place, sd = telling(objective.parameters), objective.parameters.prior_sd
    unit = coordinate_unit(objective.parameters)
    limit = answer.misfit + 2 * ALIKE
    alike = [t for t in runs if t.cut and not t.coarse and t.misfit <= limit]
    far = [t for t in alike if abs(t.z - answer.z)[place] > OWN_VALLEY * sd[place]]
    return apart(far, unit, FINALISTS)


def _unchanged(run: ScoredRun, on_finer: ScoredRun) -> bool:
    return on_finer.ok and run.change(on_finer) <= STANDING_CHANGE
