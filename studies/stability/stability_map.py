"""Where the solver is stable: each cell of the map ends stable, refused, or stopped for one of a set of reasons."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.io.folder import prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.typed_document import to_document
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import DIED, Workers
from studies.stability.map_cell import SOUND_STEP, MapCell
from studies.stability.report import write_report
from studies.stability.result import REASONS, RESULT_FILE, CellResult, MapLimits, StabilityMap

MOST_STEPS = 3e8  # particle steps that a cell may take; about three minutes
LONGEST_RUN = 300.0  # time that a run may take [s]
HUNG = 900.0  # time after which its process ends, whatever it does [s]
START_UP = 0.5  # time that each run takes apart from its particle steps [s], for the estimate of the time left
STEP_RATE = 2e6  # particle steps a second, for that estimate alone
CHECKS = ("conservation.py", "cell_run.py")  # modules that decide how a cell ends, beside the solver
KILLED = Evaluation(0, {}, "failed", DIED, 0.0, np.empty(0), np.empty(0))


def run_map(
    cells: Sequence[MapCell],
    out: Path,
    pool: Workers,
    *,
    command: Sequence[str],
    seed: int,
    resume: bool = False,
    say: Callable[[str], None],
) -> StabilityMap:
    """Run the map and write stress.json, stress.svg and report.pdf.

    Args:
        cells: The map.
        out: Output folder.
        pool: Where the runs are made.
        command: Words of the command line.
        seed: Seed of the particles, with which the cells were made.
        resume: Go on with the map in ``out``.
        say: Called with a line after each run.

    Returns:
        What stress.json holds.

    Raises:
        CutcalError: A device that is missing, or results of something else in ``out``; nothing that was computed is
            lost.
    """
    with prepare(out, "stress", resume=resume):
        with EvaluationStore(out / "evaluations.h5", Header("", "stability map"), resume=resume, say=say) as store:
            evaluations = run_cells(cells, store, pool, say)
        result = map_result(cells, evaluations, command=command, seed=seed, device=pool.arch)
        write_json(out / RESULT_FILE, to_document(result))
        from reports.studies.stability import write_figure

        write_figure(result.cells, out)
        write_report(out)
        return result


def run_cells(
    cells: Sequence[MapCell], store: EvaluationStore, pool: Workers, say: Callable[[str], None]
) -> list[Evaluation | None]:
    """Run what the store does not know.

    Args:
        cells: The cells.
        store: Where runs are kept.
        pool: Where they are made.
        say: Called with a line after each run.

    Returns:
        How each cell ended, in their order; None for one that was refused.
    """
    code = _code()
    keys = [key_of([one.key, code]) if one.scene is not None else "" for one in cells]
    found = {key: known for key in keys if key and (known := store.get(key))}
    new = list({key: k for k, key in enumerate(keys) if key and key not in found}.values())
    new.sort(key=lambda k: _order(cells[k]))
    runs = len(found) + len(new)
    if found:
        say(f"{len(found)} of {runs} runs are known already")
    costs = {k: START_UP + cells[k].cost / STEP_RATE for k in new}
    rest = Countdown(sum(costs.values()))
    if new:
        say(f"{len(new)} runs; {sum(not key for key in keys)} cells are refused without one")
        for place, ended in pool.each(bounded_run, [(cells[k], MOST_STEPS, LONGEST_RUN) for k in new]):
            k = new[place]
            done = KILLED if ended is None else ended
            store.append(keys[k], done, cells[k].family)
            found[keys[k]] = done
            state = "stable" if done.ok else f"{done.reason} at {done.fraction:.0%}"
            say(f"{cells[k].words}: {state}; {len(found)} of {runs} runs, {rest.left(costs[k])}")
    return [found[key] if key else None for key in keys]


def bounded_run(cell: MapCell, most: float, longest: float, arch: str, threads: int) -> Evaluation:
    """One run in a worker, which ends itself where even the limits of the run do not end it.

    Args:
        cell: What to run.
        most: Particle steps that are allowed.
        longest: Time that is allowed [s].
        arch: Device.
        threads: CPU threads.

    Returns:
        How it ended.
    """
    from studies.stability.cell_run import run_cell

    timer = threading.Timer(HUNG, os._exit, (1,))
    timer.daemon = True
    timer.start()
    try:
        return run_cell(cell, most, longest, arch, threads)
    finally:
        timer.cancel()


def map_result(
    cells: Sequence[MapCell],
    evaluations: Sequence[Evaluation | None],
    *,
    command: Sequence[str],
    seed: int,
    device: str,
) -> StabilityMap:
    """The finished map.

    Args:
        cells: The cells.
        evaluations: How each ended; None for one that was refused.
        command: Words of the command line.
        seed: Seed of the particles.
        device: Device of the runs.

    Returns:
        The map.
    """
    return StabilityMap(
        command=tuple(command),
        seed=seed,
        cells=tuple(cell_result(one, done) for one, done in zip(cells, evaluations, strict=True)),
        limits=MapLimits(SOUND_STEP, MOST_STEPS, LONGEST_RUN),
        device=device,
        versions=versions(),
        git=git_commit(),
    )


def cell_result(cell: MapCell, done: Evaluation | None) -> CellResult:
    """How a cell ended: ``stable``, ``refused``, ``stopped`` for a reason, or ``unexplained``."""
    about: dict[str, Any] = {
        "name": cell.words,
        "family": cell.family,
        "values": cell.values,
        "physical": cell.physical,
        "forced": cell.forced,
    }
    if done is None:
        reason = "cfl" if cell.refusal.startswith("numerics: safety") else "refused"
        status = "refused" if cell.refusal else "unexplained"
        return CellResult(**about, status=status, reason=reason, message=cell.refusal)
    if done.ok:
        status, message = "stable", ""
    else:
        status = "stopped" if done.reason in REASONS else "unexplained"
        message = REASONS.get(done.reason, "")
    if done.reason == "too_long":
        message += f": {done.scalars['particle_steps']:.3g} particle steps in all"
    numbers: dict[str, Any] = {"fraction": done.fraction, **done.scalars, "wall_s": done.seconds}
    return CellResult(**about, status=status, reason=done.reason, message=message, **numbers)


def _order(cell: MapCell) -> tuple[Any, ...]:
    """Fine grids first, and runs that share their kernels after each other."""
    assert cell.scene is not None
    n, m = cell.scene.numerics, cell.scene.food.material
    mirrors = cell.scene.mirrors
    kind = (n.precision, n.contact, mirrors, n.grid_turn, n.ppc, len(m.prony), m.damaged)
    return n.dx, kind, -cell.cost


def _code() -> str:
    """Version of solver and checks."""
    digest = hashlib.sha256(code_key().encode())
    for name in CHECKS:
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()
