"""Worker processes on this machine, one Taichi runtime each, kernels compiled once per scene."""

from __future__ import annotations

import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection, get_context, parent_process
from typing import Any

from calib.simulation.workers import Errand, Result, Workers
from mpm.runtime import stop


def _begin() -> None:
    """Start of a worker: Ctrl-C is left to the main process, which then ends the workers; they end with it anyway."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _end)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _end(*_: Any) -> None:
    """End of a worker when it is told to: after the launch it is in.

    What it has compiled is kept for the next process. On Windows nobody is told: there the next process compiles anew.
    """
    stop()
    os._exit(0)


def _follow(parent: int) -> None:
    """End this process as soon as the main one has ended, were it killed: nobody waits for results any more."""
    connection.wait([parent])
    os._exit(1)


class Pool(Workers):
    """Workers on this machine.

    Args:
        workers: Simulations at a time: in as many processes, on a GPU side by side in one. They start when there is
            work for them.
        arch: Taichi device of each.
        threads: CPU threads of each.
    """

    def __init__(self, workers: int = 2, arch: str = "cpu", threads: int = 1) -> None:
        super().__init__(workers, arch, threads)
        self._begun: dict[Future[Any], Errand] = {}
        self._executor = self._start()

    @property
    def together(self) -> int:
        """On a GPU all that are asked for at a time."""
        return 1 if self.arch == "cpu" else self.workers

    @property
    def processes(self) -> int:
        """Processes among which the simulations are shared."""
        return self.workers // self.together

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.processes, mp_context=get_context("spawn"), initializer=_begin)

    def close(self) -> None:
        """End the processes after the launch that each is in; runs that have not finished are lost."""
        self._begun = {}
        processes = list((getattr(self._executor, "_processes", None) or {}).values())
        for process in processes:
            process.terminate()
        # waited for: the executor's thread ends with its processes, and left alone it may trip over Python's own end
        self._executor.shutdown(wait=True, cancel_futures=True)

    def renew(self) -> None:
        """Begin with fresh processes: one keeps the memory of every size of scene that it has had."""
        self.close()
        self._executor = self._start()

    def each(self, work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Result | None]]:
        """Call ``work(*job, arch, threads)`` for each job; yields (place of the job, result) in order of completion.

        A process that is killed takes its neighbours with it. All of them are made again one at a time, so that None is
        the result only of the job whose process was killed when it ran alone.
        """
        waiting, alone = deque(range(len(jobs))), deque[int]()
        running: dict[Future[Result], int] = {}
        while waiting or alone or running:
            while waiting and not alone and len(running) < self.processes:
                k = waiting.popleft()
                running[self._submit(work, *jobs[k], self.arch, self.threads)] = k
            tried = alone.popleft() if alone and not running else None
            if tried is not None:
                running[self._submit(work, *jobs[tried], self.arch, self.threads)] = tried
            done, _ = wait({*running, *self._begun}, return_when=FIRST_COMPLETED)
            self._keep(done)
            for future in done & running.keys():
                k = running.pop(future)
                if not _broken(future):
                    yield k, future.result()
                elif k == tried:
                    yield k, None
                else:
                    alone.append(k)

    def begin(self, errand: Errand) -> None:
        """Make an errand in one of several processes while the others do what is asked for."""
        if self.processes > 1:
            self._begun[self._submit(*errand.job, self.arch, self.threads)] = errand

    def errands(self, errands: Sequence[Errand]) -> None:
        """Make them all, but wait for those that were begun; what was begun and is not among them is dropped."""
        begun = {f: e for f, e in self._begun.items() if any(e.same(other) for other in errands)}
        for future in self._begun.keys() - begun.keys():
            future.cancel()
        self._begun = begun
        super().errands([e for e in errands if not any(e.same(other) for other in begun.values())])
        while self._begun:
            done, _ = wait(self._begun, return_when=FIRST_COMPLETED)
            lost = [self._begun[f] for f in done if _broken(f)]
            self._keep(done)
            super().errands(lost)

    def _keep(self, done: Iterable[Future[Any]]) -> None:
        """Keep what was begun and is made; what its process has lost is made with the rest."""
        for future in done:
            errand = self._begun.get(future)
            if errand is not None and not _broken(future):
                errand.keep(errand.kept(future.result()))
            self._begun.pop(future, None)

    def _submit(self, work: Callable[..., Result], *args: Any) -> Future[Result]:
        try:
            return self._executor.submit(work, *args)
        except BrokenProcessPool:
            self._executor = self._start()
            return self._executor.submit(work, *args)


def _broken(future: Future[Any]) -> bool:
    """Whether the process of a future that is done was killed."""
    return future.cancelled() or isinstance(future.exception(), BrokenProcessPool)
