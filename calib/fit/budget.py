"""What is left of a budget of simulations: its time, and the progress of several searches that share it."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import replace

from calib.fit.options import FitOptions
from calib.io.progress import Progress
from calib.problem.scored_run import ScoredRun

COARSE_TIME = 0.18
"""Time of a coarse run over that of a default one [-] (docs/theory.md, "Measured choices"). The budget counts it as
more (``FitOptions.coarse_cost``)."""


def longest_time_left(runs: Sequence[ScoredRun], rest: float, options: FitOptions) -> float:
    """Time that the rest of a budget takes at most: were it all spent on default runs.

    Before there is a default run, that is told from what coarse ones take (:data:`COARSE_TIME`), by their lower
    quartile: some of the first compile.

    Args:
        runs: The runs so far, one at least.
        rest: What is left of the budget, in default simulations [-].
        options: How many simulations run at a time.

    Returns:
        The time [s]; NaN before there is a run that did not compile its kernels, which the first of each worker do.
    """
    default = [t.evaluation.seconds for t in runs if not t.coarse]
    each = default or [t.evaluation.seconds / COARSE_TIME for t in runs]
    if not default and len(each) <= options.batch:
        return math.nan
    usual = statistics.median(default) if default else sorted(each)[len(each) // 4]
    return rest * usual / options.batch


def progress_of_all(
    report: Callable[[Progress], None] | None, runs: Sequence[ScoredRun], best: ScoredRun, options: FitOptions
) -> Callable[[Progress], None] | None:
    """The progress of one more search, told as that of all of them.

    Args:
        report: Who is told.
        runs: The runs so far.
        best: The best of them.
        options: What all may spend.

    Returns:
        Who is to be told of that search, None where nobody is told.
    """
    if report is None:
        return None
    done, spent, failed = len(runs), options.cost(runs), sum(not t.ok for t in runs)

    def told(p: Progress) -> None:
        rest = (options.budget - spent - p.spent) / max(p.budget - p.spent, options.coarse_cost)
        total = replace(p, done=done + p.done, spent=spent + p.spent, failed=failed + p.failed)
        report(replace(total, budget=options.budget, misfit=min(p.misfit, best.misfit), eta_s=max(rest, 0.0) * p.eta_s))

    return told
