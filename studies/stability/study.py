"""Where the solver is stable: every cell of the map ends stable, refused, or stopped for one of a closed set of reasons."""

from __future__ import annotations

import hashlib
import os
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.io.folder import prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.schema import tag
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import DIED, Workers
from studies.stability.cases import SOUND_STEP, Cell

REASONS = {
    "not_finite": "a force, energy or position is no number",
    "inverted": "a particle was turned inside out",
    "left_grid": "food left the grid",
    "energy_growth": "more energy than was put in",
    "momentum": "momentum does not balance",
    "cfl": "the time step is refused",
    "refused": "the scene is refused",
    "too_long": "it needs more steps or time than a cell has",
    DIED: "its process was killed",
}
"""Why a cell is not stable; whatever else happens is unexplained."""
MOST = 3e8  # particle steps that a cell may take; about three minutes
LONGEST = 300.0  # seconds that a run may take
HUNG = 900.0  # seconds after which its process ends, whatever it does
GUESS = 0.5  # seconds that each run takes apart from its particle steps, for the estimate of the time left
RATE = 2e6  # particle steps a second, for that estimate alone


def run(
    cells: Sequence[Cell],
    out: Path,
    pool: Workers,
    *,
    about: dict[str, Any],
    resume: bool = False,
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Run the map and write stress.json, stress.svg and report.pdf.

    Args:
        cells: The map.
        out: Output folder.
        pool: Where the runs are made.
        about: What stress.json says of the command.
        resume: Go on with the map in ``out``.
        say: Called with a line after each run.

    Returns:
        The content of stress.json.

    Raises:
        CutcalError: A device that is missing, or results of something else in ``out``; nothing that was computed is lost.
    """
    prepare(out, resume=resume)
    with EvaluationStore(out / "evaluations.h5", Header("", "stability map"), resume=resume) as store:
        results = evaluate(cells, store, pool, say)
    document = {"schema": tag("stress"), **about, **conclude(cells, results)}
    document |= {"device": pool.arch, "versions": versions(), "git": git_commit()}
    write_json(out / "stress.json", document)
    from reports.stability import write_figure, write_report

    write_figure(out)
    write_report(out)
    return document


def evaluate(
    cells: Sequence[Cell], store: EvaluationStore, pool: Workers, say: Callable[[str], None]
) -> list[Evaluation | None]:
    """Results of all cells in their order, None for a refused one; what the store knows is not run again."""
    code = _code()
    keys = [key_of([one.key, code]) if one.scene is not None else "" for one in cells]
    found = {key: known for key in keys if key and (known := store.get(key))}
    new = list({key: k for k, key in enumerate(keys) if key and key not in found}.values())
    new.sort(key=lambda k: _order(cells[k]))
    runs = len(found) + len(new)
    if found:
        say(f"{len(found)} of {runs} runs are known already")
    costs = {k: GUESS + cells[k].cost / RATE for k in new}
    rest = Countdown(sum(costs.values()))
    if new:
        say(f"{len(new)} runs; {sum(not key for key in keys)} cells are refused without one")
        for place, result in pool.each(attempt, [(cells[k], MOST, LONGEST) for k in new]):
            k = new[place]
            done = evaluation(result)
            store.append(keys[k], done, cells[k].family)
            found[keys[k]] = done
            state = "stable" if done.ok else f"{done.reason} at {done.fraction:.0%}"
            say(f"{cells[k].words}: {state}; {len(found)} of {runs} runs, {rest.left(costs[k])}")
    return [found[key] if key else None for key in keys]


def attempt(cell: Cell, most: float, longest: float, arch: str, threads: int) -> dict[str, Any]:
    """One run in a worker, which ends itself where even the limits of the run do not end it."""
    from studies.stability.case_run import attempt as work

    timer = threading.Timer(HUNG, os._exit, (1,))
    timer.daemon = True
    timer.start()
    try:
        return work(cell, most, longest, arch, threads)
    finally:
        timer.cancel()


def evaluation(result: dict[str, Any] | None) -> Evaluation:
    """What a worker sent back; None from a worker that was killed."""
    if result is None:
        result = {"status": "failed", "reason": DIED, "fraction": 0.0}
    return Evaluation(index=0, parameters={}, stroke=np.empty(0), force=np.empty(0), **result)


def conclude(cells: Sequence[Cell], results: Sequence[Evaluation | None]) -> dict[str, Any]:
    """The document: every cell with its status and reason, how many of each, and the verdict."""
    rows = [row(one, result) for one, result in zip(cells, results, strict=True)]
    bound = [r for r in rows if r["physical"]]
    unexplained = [r["name"] for r in rows if r["status"] == "unexplained"]
    unstable = [r["name"] for r in bound if r["status"] != "stable"]
    return {
        "cells": rows,
        "unexplained": len(unexplained),
        "unexplained_cells": unexplained,
        "physical": {"cells": len(bound), "stable": len(bound) - len(unstable), "not_stable": unstable},
        "counts": dict(Counter(r["reason"] or "stable" for r in rows)),
        "reasons": REASONS,
        "limits": {"dt_over_limit": SOUND_STEP, "particle_steps": MOST, "time_s": LONGEST},
        "passed": not unexplained and not unstable,
    }


def row(one: Cell, result: Evaluation | None) -> dict[str, Any]:
    """One cell of the document: ``stable``, ``refused``, ``stopped`` for a reason, or ``unexplained``."""
    out = {"name": one.words, "family": one.family, **one.values, "physical": one.physical, "forced": one.forced}
    if result is None:
        reason = "cfl" if one.refusal.startswith("numerics: safety") else "refused"
        return {**out, "status": "refused" if one.refusal else "unexplained", "reason": reason, "message": one.refusal}
    if result.ok:
        status, message = "stable", ""
    else:
        status = "stopped" if result.reason in REASONS else "unexplained"
        message = REASONS.get(result.reason, "")
    if result.reason == "too_long":
        message += f": {result.scalars['particle_steps']:.3g} particle steps in all"
    numbers = {"fraction": result.fraction, **result.scalars, "wall_s": result.seconds}
    return {**out, "status": status, "reason": result.reason, "message": message, **numbers}


def _order(one: Cell) -> tuple[Any, ...]:
    """Fine cells first, and runs that share their kernels after each other."""
    assert one.scene is not None
    n, m = one.scene.numerics, one.scene.food.material
    kind = (n.precision, n.contact, one.scene.mirrors, n.grid_turn, n.ppc, len(m.prony), m.tensile_strength is not None)
    return n.dx, kind, -one.cost


def _code() -> str:
    """Version of solver and audit."""
    digest = hashlib.sha256(code_key().encode())
    for name in ("audit.py", "case_run.py"):
        digest.update(Path(__file__).with_name(name).read_bytes())
    return digest.hexdigest()
