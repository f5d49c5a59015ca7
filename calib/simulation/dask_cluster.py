"""Workers of a Dask cluster: the runs of a command on other machines, with the store where the command is.

A job goes to one named worker and to no other, so that it is known which job a dead worker had, and only that one is
made again. Left to the scheduler, jobs would queue at workers, a death would count against all of them, and a job that
kills its worker would go on to the next three.
"""

from __future__ import annotations

import asyncio
import functools
import gc
import logging
import pickle
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from importlib import metadata
from queue import Empty, SimpleQueue
from types import NoneType
from typing import TYPE_CHECKING, Any

from calib.errors import ClusterError
from calib.io.provenance import code_key
from calib.simulation.workers import Result, Workers
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from distributed import Client, Future

CONNECT_S = 5.0  # time in which a scheduler must answer
LOOK_S = 1.0  # time between two looks at which workers there are, while no run ends
FETCH_S = 30.0  # time in which the result of a run that has ended must arrive
DESERTED_S = 120.0  # time without any worker after which a command gives up; a nanny needs seconds to start another
GREETINGS = 5  # attempts to be greeted by a scheduler that tells its clients news (docs/theory.md, "Measured choices")
KILLS = 2  # workers that a job may kill
EXECUTED = ("mpm", "fem_reference", "calib", "studies", "intsim")  # packages whose code runs in workers
LOST = object()  # in place of the result of a job that did not come to its end


@functools.cache
def identity() -> dict[str, str]:
    """What must be the same in client and workers.

    It is found out once in a process, of the code that is imported then: a worker that has run since before an update
    of its files runs the old code.
    """
    return {
        "code of cutcal": code_key(*EXECUTED)[:12],
        **{name: metadata.version(name) for name in ("taichi", "numpy")},
    }


def _call(job: bytes) -> bytes:
    """A job in a worker. As bytes it is nothing that Dask would look into, and each number comes back bit for bit."""
    work, args = pickle.loads(job)
    return pickle.dumps(work(*args))


class Cluster(Workers):
    """Workers of a Dask cluster, which lives on when this ends.

    Args:
        address: Of its scheduler, such as ``tcp://host:8786``.
        workers: Jobs at a time at most; when None as many as there are workers, those that join later among them.
        arch: Taichi device of each.
        threads: CPU threads of each.
        say: Called with a sentence about the workers.

    Raises:
        ClusterError: Dask is not installed, the scheduler does not answer, or there are no workers, or such as cannot
            be used.
    """

    def __init__(
        self,
        address: str,
        workers: int | None = None,
        arch: str = "cpu",
        threads: int = 1,
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._address, self._say, self._most = address, say, workers or sys.maxsize
        self._client = _connect(address)
        self._faults: dict[str, str] = {}
        try:
            self._look()
            ready, bad = (
                [worker for worker, f in self._faults.items() if bool(f) == is_bad] for is_bad in (False, True)
            )
            if bad:
                more = f" (and {len(bad) - 1} more that cannot be used)" if len(bad) > 1 else ""
                raise ClusterError(f"--scheduler {address}: worker {bad[0]} {self._faults[bad[0]]}{more}")
            if not ready:
                raise ClusterError(
                    f"--scheduler {address}: it has no workers; start some: dask worker {address} --nthreads 1"
                )
        except BaseException:
            self.close()
            raise
        super().__init__(workers or len(ready), arch, threads)
        if not _is_trusted(address):
            say(
                f"{address} neither encrypts nor asks who is there: whoever reaches it can run code on its workers, "
                "and it can run code here; use tls:// outside a network that you trust"
            )
        say(
            f"{len(ready)} workers at {address}, {self.workers} simulations at a time; --workers {self.workers} asks "
            "for the same ones again when there are other workers"
        )

    def close(self) -> None:
        """Cancel what was asked for and leave the cluster; a simulation that runs goes on to its end there."""
        with suppress(OSError, asyncio.TimeoutError):
            self._client.close(timeout=CONNECT_S)

    def each(self, work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Result | None]]:
        """Call ``work(*job, arch, threads)`` for each job; yields (place of the job, result) in order of completion.

        A job whose worker dies is made again by another one. As a worker has one job at a time, a job whose second
        worker dies has killed both: its result is None.

        Raises:
            ClusterError: Scheduler or all workers are gone.
        """
        waiting, kills = deque(range(len(jobs))), Counter[int]()
        running: dict[Future[bytes], tuple[int, str]] = {}
        ended: SimpleQueue[Future[bytes]] = SimpleQueue()
        seen = time.monotonic()
        try:
            while waiting or running:
                ready = self._ready()
                seen = self._patience(ready, seen)
                busy = {worker for _, worker in running.values()}
                for worker in [w for w in ready if w not in busy][: min(len(waiting), self._most - len(running))]:
                    k = waiting.popleft()
                    future = self._submit(worker, work, (*jobs[k], self.arch, self.threads))
                    running[future] = k, worker
                    future.add_done_callback(ended.put)
                for future in _over(running, ended, ready):
                    k, worker = running.pop(future)
                    result, killed = _outcome(future, worker, left=worker not in ready)
                    kills[k] += killed
                    if result is not LOST or kills[k] >= KILLS:
                        yield k, None if result is LOST else result
                    else:
                        future.cancel()
                        waiting.appendleft(k)
        finally:
            with suppress(OSError, asyncio.TimeoutError):
                self._client.cancel(list(running))

    def _submit(self, worker: str, work: Callable[..., Any], args: tuple[Any, ...]) -> Future[bytes]:
        return self._client.submit(_call, pickle.dumps((work, args)), workers=[worker], pure=False, retries=0)

    def _ready(self) -> list[str]:
        """Addresses of the workers that can be used now; those that have joined and cannot be are named."""
        for worker in self._look():
            if self._faults[worker]:
                self._say(f"worker {worker} is not used: it {self._faults[worker]}")
        return [worker for worker, fault in self._faults.items() if not fault]

    def _look(self) -> list[str]:
        """Bring the list of workers and their faults up to date; returns those that have joined."""
        try:
            present: Mapping[str, int] = self._client.nthreads()
            new = [worker for worker in present if worker not in self._faults]
            answers = self._client.run(identity, workers=new, on_error="return") if new else {}
        except OSError:
            raise ClusterError(
                f"--scheduler {self._address}: the connection was lost; what was computed is stored: start the "
                "scheduler and add --resume"
            ) from None
        joined = [worker for worker in new if not isinstance(answers.get(worker), (OSError, NoneType))]  # and not left
        faults = {worker: _fault(answers[worker], present[worker]) for worker in joined}
        self._faults = {worker: fault for worker, fault in self._faults.items() if worker in present} | faults
        return joined

    def _patience(self, ready: Sequence[str], seen: float) -> float:
        """When there were workers for the last time; raises ClusterError where that is too long ago."""
        now = time.monotonic()
        if ready:
            return now
        if now - seen > DESERTED_S:
            raise ClusterError(
                f"--scheduler {self._address}: it has had no usable worker for {DESERTED_S:g} s; what was computed is "
                "stored: start workers and add --resume"
            )
        return seen


def _is_trusted(address: str) -> bool:
    """Whether an address is this machine's own, or its both sides show certificates."""
    protocol, _, rest = address.rpartition("://")
    host = rest.rpartition(":")[0].strip("[]")
    return protocol in ("tls", "inproc") or host in ("localhost", "::1") or host.startswith("127.")


def _connect(address: str) -> Client:
    try:
        from distributed import Client
    except ImportError:
        raise ClusterError("--scheduler needs the package distributed: pip install 'cutcal[cluster]'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what goes wrong is said once, by an error
    try:
        kind = asyncio.run(_kind(address))
        if kind == "Scheduler":
            return _client(functools.partial(Client, address, timeout=CONNECT_S, set_as_default=False, name="cutcal"))
        why = f"it is the address of a {kind.lower()}"
    except (OSError, ValueError, TypeError, asyncio.TimeoutError) as e:  # TypeError: TLS that is not configured
        why = str(e) or "something else listens there"
    raise ClusterError(
        f"--scheduler {address}: no Dask scheduler answers there ({why}); start one with 'dask scheduler', which "
        "prints its address"
    )


def _client(connect: Callable[[], Client]) -> Client:
    """A client, after :data:`GREETINGS` attempts at most.

    Whatever the scheduler tells all its clients within milliseconds of its greeting, such as what another run has
    cancelled, arrives together with that; ``Client`` asserts that a greeting comes alone. Who connects again is greeted
    anew. A client that was not greeted closes itself when Python collects it, and would wait for ever if that was in
    the midst of another's start, so it is collected before.
    """
    for _ in range(GREETINGS):
        gc.collect()
        with suppress(AssertionError):
            return connect()
    raise OSError("it is too busy to greet a client")


async def _kind(address: str) -> str:
    """Which of Dask's servers listens at an address; a client would wait without end for what never answers."""
    from distributed import Security, rpc

    async with rpc(address, timeout=CONNECT_S, connection_args=Security().get_connection_args("client")) as server:
        answer = await asyncio.wait_for(server.identity(), CONNECT_S + 1)
    return str(answer["type"])


def _fault(answer: object, threads: int) -> str:
    """Why a worker that answered so to :func:`identity` cannot be used; empty where it can."""
    if not isinstance(answer, dict):
        return f"cannot load cutcal ({answer}); install it there, the same version as here"
    other = [f"{name} {answer.get(name)}, here {own}" for name, own in identity().items() if answer.get(name) != own]
    if other:
        return f"runs another version ({'; '.join(other)}); install the same there and restart the worker"
    if threads != 1:  # Taichi has one runtime in a process: the other threads would wait for the first
        return f"has {threads} threads; start it with --nthreads 1, and --nworkers {threads} for as many simulations"
    return ""


def _over(
    running: Mapping[Future[bytes], tuple[int, str]], ended: SimpleQueue[Future[bytes]], ready: Sequence[str]
) -> list[Future[bytes]]:
    """Jobs that have ended, or whose worker has left; waits a moment for one."""
    left = [future for future, (_, worker) in running.items() if worker not in ready]
    if left:
        return left
    try:
        future = ended.get(timeout=LOOK_S)
    except Empty:
        return []
    return [future] if future in running else []


def _outcome(future: Future[bytes], worker: str, *, left: bool) -> tuple[Any, int]:
    """Result of a job that has ended, or whose worker has left, and how many workers died of it.

    Raises:
        ClusterError: What the job asks for is impossible on that worker.
    """
    from distributed import KilledWorker
    from distributed import TimeoutError as Late

    if future.status == "error":
        error = future.exception()
        if isinstance(error, KilledWorker):
            return LOST, 1 + error.allowed_failures
        raise ClusterError(f"worker {worker}: {error}") if isinstance(error, CutcalError) else error
    if future.status == "cancelled":  # by somebody else, or with the scheduler's connection
        return LOST, 0
    if left:  # and a result that was not fetched with it
        return LOST, int(future.status == "pending")
    try:
        return pickle.loads(future.result(timeout=FETCH_S)), 0
    except (Late, CancelledError):
        return LOST, 1
