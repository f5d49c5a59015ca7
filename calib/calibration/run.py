"""One calibration from files to files. The command line is a thin layer over it.

:func:`run` conditions the trace and decides the problem (:mod:`calib.problem.setup`), fits and quantifies the
uncertainty of the fit (:mod:`calib.uncertainty.global_search`), repeats the best values for their whole record and the
numerical checks, judges, and writes.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from calib.calibration.calibrated import Calibrated
from calib.calibration.credibility import write_credibility
from calib.calibration.report import write_reports_of
from calib.calibration.result import CURVES, SUMMARY, WITHDRAWAL_CURVES, CalibrationResult, read_result, to_document
from calib.calibration.run_clock import RunClock, earlier_runs
from calib.calibration.summary import add_conditioning, summarise
from calib.errors import MaterialError
from calib.fit.multistart import FitResult
from calib.fit.options import FitOptions
from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Progress
from calib.material.food_file import dump_material
from calib.posterior.answer import sampled_answer
from calib.posterior.posterior import SampledPosterior
from calib.posterior.sampling import check_installed
from calib.problem.request import Request
from calib.problem.setup import FINE, Setup, set_up
from calib.problem.withdrawal import TOLD_APART, BothWays
from calib.simulation.evaluation import Evaluators
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore
from calib.simulation.record_file import read_record, record_errands
from calib.simulation.workers import Errand, Workers
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.global_search import Listener, fit_with_uncertainty
from calib.uncertainty.nested_models import NestedModel, nested_models
from calib.validation.numerical_checks import (
    QUARTER_SPEED,
    VARIED,
    FinerCells,
    check,
    check_errands,
    further_errands,
)
from mpm.arrays import FloatArray

STORE, RECORD = "evaluations.h5", "record.h5"
"""Files in the output folder: all evaluations, and the whole record of the best values."""
WRITING = "drawing and writing the report"
PROVENANCE = ("created", "trace_sha256", "passed", "peak_error", "nrmse", "shape_error", "git", "versions")
"""What material.yaml says of the calibration that it is from, as ``summary.json`` calls it."""


def run(
    request: Request,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> CalibrationResult:
    """Calibrate and write all outputs.

    Args:
        request: What to calibrate.
        out: Output folder.
        pool: Where the simulations run; as many of them at a time are asked for as it has workers.
        resume: Continue the run in ``out`` instead of refusing it.
        progress: Called after each simulation.
        say: Called with each warning and stage, as one sentence.

    Returns:
        The result, as ``summary.json`` has it.

    Raises:
        CutcalError: Anything wrong with the input; nothing that was computed is lost.
    """
    say = say or (lambda text: None)
    began = time.monotonic()
    if request.sample and request.withdrawal:
        raise MaterialError("--sample beside --withdrawal, which is for a search of one food; give one of them")
    setup = set_up(request)
    both = BothWays.of(setup) if request.withdrawal else None
    for text in setup.notes:
        say(text)
    options = FitOptions(budget=request.budget, batch=pool.batch, seed=request.seed)
    if request.sample:
        check_installed()
    else:
        options.check(len(setup.objective.parameters))
    with prepare(out, "calibrate", resume=resume):
        with EvaluationStore(out / STORE, setup.header, resume=resume, say=say) as store:
            clock = RunClock(progress, earlier_runs(out, pool.batch) if progress else [])
            work = _Calibration(setup, both, pool, store, out, say, clock)
            clock.begin(options.budget)
            found = work.fitted(options)
            calibrated = work.repeated(found)
        add_conditioning(out / STORE, setup.curve)
        return _write(calibrated, out, began)


@dataclass(frozen=True, eq=False)
class _Found:
    """A fit, its uncertainty where it did not end too early for that, the posterior where it was sampled, and where
    both ways were fitted, the fit without R, without friction and without adhesion."""

    fit: FitResult
    analysis: UncertaintyAnalysis | None
    posterior: SampledPosterior | None = None
    nested: tuple[NestedModel, ...] = ()


class _Stages:
    """The rounds of the intervals, told in words and as a part of all.

    Args:
        clock: Tells how long all takes.
        say: Who is told in words.
    """

    def __init__(self, clock: RunClock, say: Callable[[str], None]) -> None:
        self._clock, self._say, self._words = clock, say, ""

    def say(self, text: str) -> None:
        """A round begins."""
        self._say(text)
        self._words = text.partition(":")[0]
        self._clock.intervals(self._words)

    def made(self, done: int, whole: int) -> None:
        """A simulation of it is done."""
        self._clock.intervals(f"{self._words}, {done} of {whole}", done)


@dataclass(frozen=True, eq=False)
class _Calibration:
    """A calibration while its simulations run.

    Attributes: what was decided, and of the way up where that is fitted too; where the simulations run and where they
    are kept; the output folder; and who is told of each stage, in words and as a part of all.
    """

    setup: Setup
    both: BothWays | None
    pool: Workers
    store: EvaluationStore
    out: Path
    say: Callable[[str], None]
    clock: RunClock

    def fitted(self, options: FitOptions) -> _Found:
        """The fit, and its uncertainty."""
        setup = self.setup
        problem = self.both or setup
        evaluators = problem.evaluators(self.pool, self.store)
        if self.both is None:
            evaluators = replace(evaluators, finer=FinerCells(setup.scene, self.pool, self.store))
        if setup.request.sample:
            return self._sampled(evaluators)
        stages = _Stages(self.clock, self.say)
        listener = Listener(self.clock.search, stages.say, self._searched, self.say, stages.made)
        asked = [name for name in TOLD_APART if self.both is not None and name in self._fitted]
        fit, analysis = fit_with_uncertainty(problem.objective, evaluators, options, listener, asked)
        nested = () if analysis is None else nested_models(problem.objective, analysis.result, asked)
        return _Found(fit if analysis is None else analysis.result, analysis, nested=nested)

    def _sampled(self, evaluators: Evaluators) -> _Found:
        """The best food of the sampled posterior, and what is uncertain."""
        found = _Found(*sampled_answer(self.setup, evaluators, self.setup.request.seed, self.say))
        self._begin_longest_check(found.fit)
        return found

    @property
    def _fitted(self) -> tuple[str, ...]:
        """Names of what is fitted."""
        return self.setup.objective.parameters.names

    def _searched(self, fit: FitResult) -> None:
        """The search has ended."""
        self.clock.analysis()
        self._begin_longest_check(fit)

    def _begin_longest_check(self, fit: FitResult) -> None:
        """Begin the longest of the last simulations, beside those of the intervals."""
        scene = self.setup.scene(fit.best.evaluation.parameters)
        for errand in sorted(check_errands(scene, self.store, self._fitted), key=lambda e: e.haste)[:1]:
            self.pool.begin(errand)

    def repeated(self, found: _Found) -> Calibrated:
        """The best values simulated once more, whole and otherwise, and those of the literature."""
        fit = found.fit
        setup, best, path = self.setup, fit.best.each[0].evaluation, self.out / RECORD
        scene, ended = setup.scene(best.parameters), fit.status != "interrupted"
        errands = record_errands(scene, path)
        if ended:
            errands += [*check_errands(scene, self.store, self._fitted), *self._start_errands()]
        if errands:
            self.say(f"simulating the best values once more: {'whole, and ' + VARIED if ended else 'whole'}")
            self.pool.errands(self._counted(errands))
        record = read_record(scene, path)
        way = setup.curve.stroke_length_m
        more = further_errands(scene, best, self.store, way) if ended else []
        if more:
            self.say(f"simulating the best values once more: {QUARTER_SPEED}, as half of it still changes the force")
            self.pool.errands(self._counted(more))
        self.clock.closing(WRITING)
        checks = check(scene, best, self.store, way, self._fitted) if ended else []
        start = self._start_curve() if ended else np.full_like(setup.curve.stroke, np.nan)
        sized = setup.sized(best.parameters)
        return Calibrated(sized, fit, found.analysis, record, checks, start, found.posterior, self.both, found.nested)

    def _counted(self, errands: Sequence[Errand]) -> list[Errand]:
        """The same errands, each of which tells when it is made."""
        numbers, whole = itertools.count(1), len(errands)
        self.clock.last("last simulations", 0, whole)

        def counted(errand: Errand) -> Errand:
            def keep(made: Any) -> None:
                errand.keep(made)
                number = next(numbers)
                self.clock.last(f"last simulations, {number} of {whole}", number, whole)

            return replace(errand, keep=keep)

        return [counted(errand) for errand in errands]

    @cached_property
    def _fine(self) -> CachedEvaluator:
        return self.setup.evaluator(self.setup.fine, self.pool, self.store, FINE)

    def _start_errands(self) -> list[Errand]:
        """The simulation of the literature's values, where the search has not made it."""
        values = self.setup.start_values
        keep = self._fine.keeper(values)
        return [] if keep is None else [Errand(self.setup.scene(values), keep)]

    def _start_curve(self) -> FloatArray:
        """Smoothed curve of the literature's values [N] (n,); NaN where that run broke down."""
        stroke = self.setup.curve.stroke
        run = next(iter(self._fine.evaluate([self.setup.start_values])))
        smooth = self.setup.objective.target.smooth
        return smooth(stroke, run.stroke, run.force) if run.ok else np.full_like(stroke, np.nan)


def _write(done: Calibrated, out: Path, began: float) -> CalibrationResult:
    """Write curves.csv, withdrawal.csv where the way up was fitted, material.yaml, summary.json, credibility.json,
    report.pdf and report.html; returns the result, as the folder has it."""
    document = to_document(summarise(done, out, began))
    write_csv(out / CURVES, done.curves())
    if done.withdrawal is not None:
        write_csv(out / WITHDRAWAL_CURVES, done.withdrawal.columns())
    provenance = {key: document[key] for key in PROVENANCE} | {"trace": done.setup.curve.trace.label}
    dump_material(done.food(), out / "material.yaml", provenance)
    write_json(out / SUMMARY, document)
    result = read_result(out)
    write_credibility(result)
    write_reports_of(result)
    return result
