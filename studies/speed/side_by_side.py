"""What several processes, and several cuts in one process, gain over one cut after the other."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from calib.simulation.process_pool import Pool
from mpm.batch import simulate_together
from mpm.scene import Scene
from studies.speed.result import BatchTime, DefaultCut, ProcessScaling
from studies.speed.timing import Session

BATCHES = (1, 2, 4, 8)  # cuts side by side


def _clocked(pool: Pool, jobs: Sequence[tuple[Scene, dict[str, Any]]]) -> float:
    """Time that workers take for some cuts [s]."""
    began = time.perf_counter()
    list(pool.run(jobs))
    return time.perf_counter() - began


def process_scaling(session: Session, scene: Scene, cut: DefaultCut) -> ProcessScaling:
    """What a calibration gains from a process for each core: the same cuts in one process and in several, in turns.

    Args:
        session: What all measurements share.
        scene: The default cut.
        cut: What was measured of it.

    Returns:
        What they gain.
    """
    count = session.runtime.cpu_threads
    spent: dict[int, list[float]] = {1: [], count: []}
    afresh: list[float] = []
    jobs: list[tuple[Scene, dict[str, Any]]] = [(scene, {})]
    with ExitStack() as stack:
        pools = {n: stack.enter_context(Pool(n, session.runtime.arch)) for n in spent}
        for turn in range(session.repeats + 1):  # every process compiles in the first turn, which does not count
            for n, pool in pools.items():
                took = _clocked(pool, jobs * (2 * count))
                if turn > 0:
                    spent[n].append(took)
        for _ in range(session.repeats):  # what it compiled is kept: a further process has only to start
            pools[1].renew()
            first = _clocked(pools[1], jobs)
            afresh.append(first - _clocked(pools[1], jobs))
    done = 2 * count * cut.particles * cut.steps
    found = ProcessScaling(
        processes=count,
        speed_up=min(spent[1]) / min(spent[count]),
        cut_Mps=done / min(spent[count]) / 1e6,
        start_up_s=min(afresh),
    )
    session.say(
        f"{count} processes: {found.speed_up:.2f} times as many cuts as one, {found.cut_Mps:.2f} million particle "
        f"steps a second; a further process starts in {found.start_up_s:.2f} s"
    )
    return found


def batch_times(session: Session, scene: Scene) -> tuple[BatchTime, ...]:
    """Time of several cuts side by side (:mod:`mpm.batch`), and that of each over the time of one alone.

    Args:
        session: What all measurements share.
        scene: The default cut.

    Returns:
        The times, one for each of :data:`BATCHES`.
    """
    spent: dict[int, list[float]] = {}
    for n in BATCHES:
        spent[n] = []
        for turn in range(session.repeats + 1):  # every size compiles in its first turn, which does not count
            began = time.perf_counter()
            simulate_together([scene] * n, runtime=session.runtime)
            if turn > 0:
                spent[n].append(time.perf_counter() - began)
    least = {n: min(times) for n, times in spent.items()}
    found = tuple(BatchTime(n, wall, wall / n / least[1]) for n, wall in least.items())
    each = ", ".join(f"{one.cuts} cuts {one.per_cut:.2f} of the time of one each" for one in found[1:])
    session.say(f"side by side: {each}")
    return found
