"""What worker processes are asked to do, wherever they are: run candidates of a scene, one at a time each."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from calib.material.scene import of_specimen
from calib.simulation.evaluation import Evaluation
from mpm.output.record import ForceRecord
from mpm.scene import Scene
from mpm.scene.errors import SimulationError
from mpm.scene.material import Material

Result = TypeVar("Result")
Kind = TypeVar("Kind", bound="Workers")

RECORD_SECTIONS = 24
"""Sections of the food in a whole record, of which a report shows three."""
LEAST_BATCH = 2
"""Simulations of a round of a search, whatever the workers: a lone worker finds what two find, bit for bit. With rounds
of one the search ends sooner and worse, and what it calls identified is often wrong (docs/theory.md, "Measured
choices")."""
STROKE_DECIMALS, FORCE_DECIMALS = 9, 6
"""Decimals to which an evaluation keeps stroke [m] and force [N]. Two builds of the solver agree to some fifteen
digits. A search that is told them all may still end elsewhere: one of two points that differ by a step of its lattice
is run, and then all others differ."""
DIED = "worker_died"
"""Reason of a run whose process was killed, for instance for lack of memory."""


def _run(scene: Scene, values: dict[str, Any], arch: str, threads: int) -> Evaluation:
    """One simulation in a worker."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    simulation = Simulation(scene, Runtime(arch, threads))
    material: Material = replace(scene.food.material, **values)
    return evaluation_of(simulation.run(material))


def _run_together(jobs: Sequence[tuple[Scene, dict[str, Any]]], arch: str, threads: int) -> list[Evaluation]:
    """Several simulations side by side in a worker."""
    from mpm.batch import simulate_together
    from mpm.runtime import Runtime

    scenes = [scene.with_material(**values) for scene, values in jobs]
    return [evaluation_of(record) for record in simulate_together(scenes, runtime=Runtime(arch, threads))]


def evaluation_of(record: ForceRecord) -> Evaluation:
    """What an evaluation keeps of a record, without its values: ``index`` is 0 and ``parameters`` are empty."""
    scalars = {
        "peak_N": record.peak,
        "work_J": record.work,
        "unbooked_J": record.budget["unbooked"],
        "momentum_residual": record.momentum_residual,
        "ke_over_ie": record.ke_over_ie,
        "ripple_N": record.ripple,
        "steps": float(record.steps),
        "particles": float(record.particles),
    }
    if not math.isnan(record.parted):
        scalars["parted"] = record.parted
    way = record.stroke
    if len(way) > record.cut_rows > 0:
        turn = float(way[record.cut_rows - 1])
        scalars["turn_m"] = round(turn, STROKE_DECIMALS)
        way = np.append(way[: record.cut_rows], 2.0 * turn - way[record.cut_rows :])
    done = record.status == "done"
    return Evaluation(
        index=0,
        parameters={},
        status="ok" if done else "failed",
        reason="" if done else record.status,
        fraction=record.fraction,
        stroke=np.round(way, STROKE_DECIMALS),
        force=np.round(record.resolved, FORCE_DECIMALS),
        scalars=scalars,
        seconds=record.wall,
    )


def _whole(scene: Scene, arch: str, threads: int) -> ForceRecord:
    """One simulation in a worker, its whole record."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    return Simulation(scene, Runtime(arch, threads)).run(sections=RECORD_SECTIONS)


def _errand(work: Callable[..., Result], *args: Any) -> Result:
    """Whatever is asked for, in a worker."""
    return work(*args)


@dataclass(frozen=True)
class Errand:
    """One of several simulations that are made together, each of its own kind.

    Attributes:
        scene: What is simulated.
        keep: Told the result: a record where ``whole``, else an evaluation of no values.
        whole: Whether the whole record is wanted.
    """

    scene: Scene
    keep: Callable[[Any], None]
    whole: bool = False

    @property
    def haste(self) -> float:
        """Inverse of what the run takes, but for a factor of the food."""
        return self.scene.motion.mach * self.scene.numerics.dx**4

    @property
    def job(self) -> tuple[Any, ...]:
        """What a worker is asked for, but for device and threads."""
        return (_whole, self.scene) if self.whole else (_run, self.scene, {})

    def same(self, other: Errand) -> bool:
        """Whether another one asks for the same."""
        return (self.scene, self.whole) == (other.scene, other.whole)

    def kept(self, result: Any) -> Any:
        """What is kept of what a worker has sent back, None where it was killed twice.

        Raises:
            SimulationError: That of a whole record.
        """
        return _alive(result) if self.whole else _evaluation(0, {}, result)


class Workers(ABC):
    """Processes that run jobs; a context manager that ends what they were asked for.

    Args:
        workers: Jobs at a time: what a search should ask for at once.
        arch: Taichi device of each.
        threads: CPU threads of each.
    """

    def __init__(self, workers: int, arch: str, threads: int) -> None:
        self.workers, self.arch, self.threads = workers, arch, threads

    @property
    def together(self) -> int:
        """Simulations that a process makes side by side, each launch a step of them all.

        There is more than one only on a GPU, which the launch of one cut does not fill. On CPUs as many processes do it
        as well and do not wait for each other.
        """
        return 1

    @property
    def batch(self) -> int:
        """Simulations that a search asks for at once: those of all workers, and no fewer than :data:`LEAST_BATCH`."""
        return max(self.workers, LEAST_BATCH)

    def __enter__(self: Kind) -> Kind:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """End at once; runs that have not finished are lost."""

    @abstractmethod
    def each(self, work: Callable[..., Result], jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Result | None]]:
        """Call ``work(*job, arch, threads)`` for each job; yields (place of the job, result) in order of completion.

        A job whose process was killed is made once more. None is the result only of a job whose process was killed a
        second time, when nothing else ran in it.
        """

    def renew(self) -> None:  # noqa: B027 - a cluster keeps its workers
        """Begin with fresh processes, where they are this one's: each keeps the memory of all sizes of scene it had."""

    def run(self, jobs: Sequence[tuple[Scene, Mapping[str, float]]]) -> Iterator[Evaluation]:
        """Run each scene with its material values; yields in order of completion, ``index`` is the place of the job.

        A run that killed its process twice is a failed one, for the reason :data:`DIED`; where several were made side
        by side, each of them is tried by itself first.
        """
        asked = [(scene, dict(values)) for scene, values in jobs]
        alone = list(range(len(asked)))
        if self.together > 1:
            packs = [alone[k : k + self.together] for k in alone[:: self.together]]
            alone = []
            for which, results in self.each(_run_together, [([asked[k] for k in pack],) for pack in packs]):
                if results is None:
                    alone += packs[which]
                else:
                    for k, result in zip(packs[which], results, strict=True):
                        yield _evaluation(k, asked[k][1], result)
        for which, found in self.each(_run, [asked[k] for k in alone]):
            k = alone[which]
            yield _evaluation(k, asked[k][1], found)

    def begin(self, errand: Errand) -> None:  # noqa: B027 - where it is not begun it is made when its time has come
        """Make an errand beside what else is asked for, where there are processes to spare.

        It is kept when it is made and something is waited for.
        """

    def errands(self, errands: Sequence[Errand]) -> None:
        """Make them all, the longest first, or the workers of the others would wait for it.

        Each is kept as soon as it is made.

        Raises:
            SimulationError: The process of a whole record was killed twice.
        """
        order = sorted(errands, key=lambda errand: errand.haste)
        for k, result in self.each(_errand, [e.job for e in order]):
            order[k].keep(order[k].kept(result))

    def evaluator(self, scene: Scene, kept: Collection[str] = ()) -> SceneEvaluator:
        """Evaluator of candidates of one scene; ``kept`` sizes do not follow a fitted height."""
        return SceneEvaluator(self, scene, kept)


def _evaluation(index: int, values: dict[str, float], result: Evaluation | None) -> Evaluation:
    """What a worker has sent back, or that it was killed twice."""
    if result is None:
        return Evaluation(index, values, "failed", DIED, 0.0, np.empty(0), np.empty(0))
    return replace(result, index=index, parameters=values)


def _alive(record: ForceRecord | None) -> ForceRecord:
    if record is None:
        raise SimulationError(
            "the process of the last simulation was killed twice, perhaps for lack of memory; every run before it is "
            "stored: free some memory and add --resume",
            reason=DIED,
            fraction=0.0,
        )
    return record


class SceneEvaluator:
    """Runs candidates of one scene: material values, and the specimen's height where that is fitted.

    Args:
        workers: Where they run.
        scene: The scene.
        kept: Sizes of the specimen that do not follow a fitted height.
    """

    def __init__(self, workers: Workers, scene: Scene, kept: Collection[str] = ()) -> None:
        self.workers, self.scene, self.kept = workers, scene, kept

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Run each candidate; yields in order of completion, ``index`` is the place in the batch."""
        for evaluation in self.workers.run([of_specimen(self.scene, values, self.kept) for values in batch]):
            yield replace(evaluation, parameters=dict(batch[evaluation.index]))
