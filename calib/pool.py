"""Worker processes that run candidates of a scene, one Taichi runtime each, kernels compiled once per scene."""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing import connection, get_context, parent_process
from typing import Any, TypeVar

import numpy as np

from calib.objective import Evaluation
from calib.scenes import place
from mpm.errors import SimulationError
from mpm.material import Material
from mpm.record import ForceRecord
from mpm.scene import Scene

Result = TypeVar("Result")

DIED = "worker_died"  # reason of a run whose process was killed, for instance for lack of memory


def _begin() -> None:
    """Start of a worker: Ctrl-C is handled by the main process, which then ends the workers; they end with it anyway."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _follow(parent: int) -> None:
    """End this process as soon as the main one has ended, were it killed: nobody waits for results any more."""
    connection.wait([parent])
    os._exit(1)


def _run(scene: Scene, values: dict[str, Any], arch: str, threads: int) -> dict[str, Any]:
    """One simulation in a worker; everything that is sent back is plain data."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    simulation = Simulation(scene, Runtime(arch, threads))
    material: Material = replace(scene.food.material, **values)
    record = simulation.run(material)
    scalars = {
        "peak_N": record.peak,
        "work_J": record.work,
        "momentum_residual": record.momentum_residual,
        "ke_over_ie": record.ke_over_ie,
        "ripple_N": record.ripple,
        "steps": float(record.steps),
        "particles": float(record.particles),
    }
    return {
        "status": "ok" if record.status == "done" else "failed",
        "reason": "" if record.status == "done" else record.status,
        "fraction": record.fraction,
        "stroke": record.stroke,
        "force": record.resolved,
        "scalars": scalars,
        "seconds": record.wall,
    }


def _whole(scene: Scene, arch: str, threads: int) -> ForceRecord:
    """One simulation in a worker, its whole record."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    return Simulation(scene, Runtime(arch, threads)).run()


class Pool:
    """A pool of worker processes; a context manager that ends them.

    Args:
        workers: Number of processes.
        arch: Taichi device of each.
        threads: CPU threads of each.
    """

    def __init__(self, workers: int = 2, arch: str = "cpu", threads: int = 1) -> None:
        self.workers, self.arch, self.threads = workers, arch, threads
        self._executor = self._start()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.workers, mp_context=get_context("spawn"), initializer=_begin)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the workers at once; runs that have not finished are lost."""
        processes = list((getattr(self._executor, "_processes", None) or {}).values())
        self._executor.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()

    def evaluator(self, scene: Scene, kept: Collection[str] = ()) -> SceneEvaluator:
        """Evaluator of candidates of one scene; ``kept`` sizes do not follow a fitted height."""
        return SceneEvaluator(self, scene, kept)

    def run(self, jobs: Sequence[tuple[Scene, Mapping[str, float]]]) -> Iterator[Evaluation]:
        """Run each scene with its material values; yields in order of completion, ``index`` is the place among the jobs.

        A run whose process was killed is made once more before it counts as failed: the killed one may have been its
        neighbour's.
        """
        waiting = {self.submit(*job): (k, False) for k, job in enumerate(jobs)}
        while waiting:
            done, _ = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                index, again = waiting.pop(future)
                scene, values = jobs[index][0], dict(jobs[index][1])
                if not isinstance(future.exception(), BrokenProcessPool):
                    yield Evaluation(index=index, parameters=values, **future.result())
                elif not again:
                    waiting[self.submit(scene, values)] = (index, True)
                else:
                    yield Evaluation(index, values, "failed", DIED, 0.0, np.empty(0), np.empty(0))

    def each(self, work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Result | None]]:
        """Call ``work(*job, arch, threads)`` for each job; yields (place among the jobs, result) in order of completion.

        A process that is killed takes its neighbours with it. All of them are made again one at a time, so that None is
        the result only of the job whose process was killed when it ran alone.
        """
        waiting, alone = deque(range(len(jobs))), deque[int]()
        running: dict[Future[Result], int] = {}
        while waiting or alone or running:
            while waiting and not alone and len(running) < self.workers:
                k = waiting.popleft()
                running[self._submit(work, *jobs[k], self.arch, self.threads)] = k
            tried = alone.popleft() if alone and not running else None
            if tried is not None:
                running[self._submit(work, *jobs[tried], self.arch, self.threads)] = tried
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                k = running.pop(future)
                if not isinstance(future.exception(), BrokenProcessPool):
                    yield k, future.result()
                elif k == tried:
                    yield k, None
                else:
                    alone.append(k)

    def submit(self, scene: Scene, values: Mapping[str, float]) -> Future[dict[str, Any]]:
        """Queue one run; a broken pool is started anew first."""
        return self._submit(_run, scene, dict(values), self.arch, self.threads)

    def record(self, scene: Scene) -> ForceRecord:
        """The whole record of one scene, from a process that has its kernels.

        Raises:
            SimulationError: Its process was killed twice.
        """
        for _ in range(2):
            try:
                return self._submit(_whole, scene, self.arch, self.threads).result()
            except BrokenProcessPool:
                continue
        raise SimulationError(
            "the process of the last simulation was killed twice, perhaps for lack of memory; every run before it is "
            "stored: free some memory and add --resume",
            reason=DIED,
            fraction=0.0,
        )

    def _submit(self, work: Callable[..., Result], *args: Any) -> Future[Result]:
        try:
            return self._executor.submit(work, *args)
        except BrokenProcessPool:
            self._executor = self._start()
            return self._executor.submit(work, *args)


class SceneEvaluator:
    """Runs candidates of one scene in a pool: material values, and the specimen's height where that is fitted.

    Args:
        pool: Where they run.
        scene: The scene.
        kept: Sizes of the specimen that do not follow a fitted height.
    """

    def __init__(self, pool: Pool, scene: Scene, kept: Collection[str] = ()) -> None:
        self.pool, self.scene, self.kept = pool, scene, kept

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each candidate; yields in order of completion, ``index`` is the place in the batch."""
        for evaluation in self.pool.run([place(self.scene, values, self.kept) for values in batch]):
            yield replace(evaluation, parameters=dict(batch[evaluation.index]))
