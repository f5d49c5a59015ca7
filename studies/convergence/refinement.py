"""One cut on several grids, and apart from that with other time steps, speeds, particles: how much is numerical."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from calib.io.folder import prepare
from calib.io.progress import Countdown
from calib.io.provenance import code_key, key_of
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header, content_key
from calib.simulation.workers import Workers
from studies.convergence.analysis import analyse
from studies.convergence.plan import CutDescription, PlannedRun, RefinementPlan, planned_runs
from studies.convergence.report import write_figure, write_report
from studies.convergence.result import ConvergenceResult, write_result


def refine(
    plan: RefinementPlan,
    cut: CutDescription,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    say: Callable[[str], None],
) -> ConvergenceResult:
    """Run a plan and write converge.json, curves.csv, converge.svg and report.pdf.

    Args:
        plan: What to run.
        cut: What converge.json says of food, knife and command.
        out: Output folder.
        pool: Where the runs are made.
        resume: Go on with the runs in ``out``.
        say: Called with a line after each run.

    Returns:
        What converge.json holds.

    Raises:
        CutcalError: Impossible values, or results of something else in ``out``; nothing that was computed is lost.
    """
    runs = planned_runs(plan)
    with prepare(out, "converge", resume=resume):
        with EvaluationStore(
            out / "evaluations.h5", Header("", key_of(plan.scene.as_dict())), resume=resume, say=say
        ) as store:
            evaluations = _evaluated(runs, store, pool, say)
        result, curves = analyse(runs, evaluations, cut, pool.arch)
        for text in result.warnings[len(cut.warnings) :]:
            say(f"note: {text}")
        write_result(result, curves, out)
        write_figure(out)
        write_report(out)
        return result


def _evaluated(
    runs: Sequence[PlannedRun], store: EvaluationStore, pool: Workers, say: Callable[[str], None]
) -> list[Evaluation]:
    """All runs in their order; what the store knows is not run again, and the longest runs start first."""
    keys = [content_key(run.scene.as_dict(), {}, code_key()) for run in runs]
    found = {k: known for k, key in enumerate(keys) if (known := store.get(key))}
    new = sorted((k for k in range(len(runs)) if k not in found), key=lambda k: -runs[k].cost)
    if found:
        say(f"{len(found)} of {len(runs)} runs are known already")
    total = sum(runs[k].cost for k in new)
    rest = Countdown(total)
    if new:
        say(f"{len(new)} runs; the finest grid costs {max(runs[k].cost for k in new) / total:.0%} of them")
        for done in pool.run([(runs[k].scene, {}) for k in new]):
            k = new[done.index]
            store.append(keys[k], done, runs[k].words)
            found[k] = done
            peak, work = (done.scalars.get(name, math.nan) for name in ("peak_N", "work_J"))
            state = f"peak {peak:.2f} N, work {work:.4f} J" if done.ok else f"broke down ({done.reason})"
            say(f"{runs[k].words}: {state}; {len(found)} of {len(runs)} runs, {rest.left(runs[k].cost)}")
    return [found[k] for k in range(len(runs))]
