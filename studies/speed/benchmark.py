"""Run time against error of one cut, what each economy brings, and the rate of the kernels beside the textbook's."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.io.folder import prepare, write_json
from calib.io.progress import clock
from calib.io.provenance import git_commit, versions
from calib.io.typed_document import to_document
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from mpm.runtime import Runtime
from mpm.scene import Scene
from studies.speed.cut_times import ablation, default_cut, size_exponent, variants
from studies.speed.kernel_rates import peers, published_configuration, throughput
from studies.speed.report import write_report
from studies.speed.result import RESULT_FILE, BenchmarkResult
from studies.speed.side_by_side import batch_times, process_scaling
from studies.speed.timing import Say, Session


@dataclass(frozen=True)
class BenchmarkSettings:
    """What is measured, and how.

    Attributes:
        food: What is cut.
        knife: Name of the knife.
        runtime: Device and threads of the default cut.
        repeats: Turns that each of two runs takes.
        finest: Cell size of the reference [m].
        seed: Seed of the particles.
        peers: Interpreter that has the packages of the peers, None where they are not to be measured.
        command: Words of the command line.
    """

    food: FoodSpec
    knife: str
    runtime: Runtime
    repeats: int
    finest: float
    seed: int
    peers: str | None = None
    command: Sequence[str] = ()

    def scene(self, *, coarse: bool = False) -> Scene:
        """The default cut, or the one that a fit screens with."""
        shape, _ = specimen(self.food, None, Sizing())
        return cut_scene(self.food, shape, load_knife(self.knife), seed=self.seed, coarse=coarse)

    def whole_food(self) -> Scene:
        """The cut of the food in its whole length."""
        shape, _ = specimen(self.food, None, Sizing())
        length = self.food.dims["length"].value or shape.length
        return cut_scene(self.food, replace(shape, length=length), load_knife(self.knife))


class ResultFile:
    """``bench.json``, written after each measurement.

    Args:
        path: The file.
        result: What is known before anything is measured.

    Attributes:
        result: What is known by now.
    """

    def __init__(self, path: Path, result: BenchmarkResult) -> None:
        self._path = path
        self.result = result

    def keep(self, **measured: Any) -> None:
        """Add what was measured, by the names of the result, and write the file.

        Raises:
            OutputError: It cannot be written.
        """
        self.result = replace(self.result, **measured)
        write_json(self._path, to_document(self.result))


def run_benchmark(settings: BenchmarkSettings, out: Path, say: Say) -> BenchmarkResult:
    """Measure everything; writes bench.json after each measurement, at the end bench.svg and report.pdf.

    Args:
        settings: What is measured, and how.
        out: Output folder.
        say: Called with a line after each measurement.

    Returns:
        What bench.json holds.

    Raises:
        CutcalError: A food or knife that cannot be used, or a folder that is not empty or cannot be written.
    """
    scene, session = settings.scene(), Session(settings.runtime, settings.repeats, say)
    with prepare(out, "bench", resume=False):
        file = ResultFile(out / RESULT_FILE, _nothing_measured(settings))
        file.keep(throughput=throughput(session, scene))
        paper = published_configuration(session, settings.whole_food(), scene.motion.stroke)
        file.keep(paper_config=paper)
        cut, reference = default_cut(session, scene, settings.finest)
        file.keep(default_cut=cut)
        file.keep(processes=process_scaling(session, scene, cut))
        file.keep(batches=batch_times(session, scene))
        if settings.peers:
            file.keep(peers=peers(session, settings.peers))
        file.keep(ratio_to_paper=paper.wall_s_extrapolated / cut.wall_s, ablations=())
        todo = variants(scene, settings.scene(coarse=True), settings.runtime)
        ablations = []
        began = time.monotonic()
        for done, variant in enumerate(todo, 1):
            ablations.append(ablation(session, scene, variant, reference))
            file.keep(ablations=tuple(ablations))
            left = (time.monotonic() - began) / done * (len(todo) - done)
            say(f"{variant.name}: {ablations[-1].time_ratio:.2f} times the time; about {clock(left)} left")
        file.keep(exponent=size_exponent(cut, ablations), complete=True)
        from reports.studies.benchmark import write_figure

        write_figure(file.result, out)
        write_report(out)
        return file.result


def _nothing_measured(settings: BenchmarkSettings) -> BenchmarkResult:
    return BenchmarkResult(
        food=settings.food.name,
        knife=settings.knife,
        command=tuple(settings.command),
        complete=False,
        device=settings.runtime.arch,
        threads=settings.runtime.cpu_threads,
        versions=versions(),
        git=git_commit(),
    )
