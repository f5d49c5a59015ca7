"""One calibration from files to files: condition, fit, judge, write. The command line is a thin layer over it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.calibration.summary import add_conditioning, summarise
from calib.fit.multistart import FitResult
from calib.fit.options import FitOptions
from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Progress
from calib.io.provenance import code_key, key_of
from calib.material.food import FoodSpec, dump_material
from calib.material.scene import place
from calib.problem.request import Request, Setup
from calib.problem.setup import set_up
from calib.simulation.evaluation import Evaluators
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header
from calib.simulation.record_file import read_record, record_errands
from calib.simulation.workers import Errand, Workers
from calib.trace.conditioning import Conditioned
from calib.trace.filters import filter_simulated
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.global_search import Listener, fit_with_uncertainty
from calib.uncertainty.sobol import sensitivity
from calib.validation.metrics import compare
from calib.validation.null_models import NullModel, null_models
from calib.validation.numerical_checks import VARIED, Check, check, check_errands, otherwise
from mpm.output.record import ForceRecord


def run(
    request: Request,
    out: Path,
    pool: Workers,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Calibrate and write all outputs.

    Args:
        request: What to calibrate.
        out: Output folder.
        pool: Where the simulations run; as many of them at a time are asked for as it has workers.
        resume: Continue the run in ``out`` instead of refusing it.
        progress: Called after each simulation.
        say: Called with each warning and stage, as one sentence.

    Returns:
        The content of ``summary.json``.

    Raises:
        CutcalError: Anything wrong with the input; nothing that was computed is lost.
    """
    say = say or (lambda text: None)
    began = time.monotonic()
    setup = set_up(request)
    for text in [*request.food.warnings(), *setup.curve.warnings, *setup.assumed]:
        say(text)
    options = FitOptions(budget=request.budget, batch=pool.batch, seed=request.seed)
    options.check(len(setup.objective.parameters))
    prepare(out, resume=resume)
    header = Header(setup.curve.trace.sha256, key_of(setup.fine.as_dict()))
    with EvaluationStore(out / "evaluations.h5", header, resume=resume) as store:
        fine, coarse, again = (
            CachedEvaluator(
                pool.evaluator(scene, setup.kept),
                store,
                scene=scene.as_dict() | {"kept": setup.kept},
                code=code_key(),
                fidelity=name,
            )
            for name, scene in (("fine", setup.fine), ("coarse", setup.coarse), ("again", otherwise(setup.fine)))
        )

        def begin(found: FitResult) -> None:
            """The longest of the last simulations, beside those of the intervals."""
            scene, values = place(setup.fine, found.best.evaluation.parameters, setup.kept)
            for errand in sorted(check_errands(scene.with_material(**values), store), key=lambda e: e.haste)[:1]:
                pool.begin(errand)

        result, analysis = fit_with_uncertainty(
            setup.objective,
            Evaluators(fine, coarse, again),
            options,
            sample=request.sample,
            listener=Listener(progress, say, begin),
        )
        scene, values = place(setup.fine, result.best.evaluation.parameters, setup.kept)
        first, setup = setup, replace(setup, fine=scene)
        scene = scene.with_material(**values)
        errands, ended = record_errands(scene, out / "record.h5"), result.status != "interrupted"
        if ended:
            errands += [*check_errands(scene, store), *_start_errands(first, fine)]
        if errands:
            say(f"simulating the best values once more: {'whole, and ' + VARIED if ended else 'whole'}")
            pool.errands(errands)
        record = read_record(scene, out / "record.h5")
        checks = check(scene, result.best.evaluation, store, setup.curve.stroke_length_m) if ended else []
        start = _start_curve(first, fine) if ended else np.full_like(setup.curve.stroke, np.nan)
    add_conditioning(out / "evaluations.h5", setup.curve)
    return _write(request, setup, result, analysis, record, checks, start, out, time.monotonic() - began)


def _literature(setup: Setup) -> dict[str, float]:
    """The values that the fit began with, by name [SI]."""
    return {p.name: p.value for p in setup.objective.parameters}


def _start_errands(setup: Setup, fine: CachedEvaluator) -> list[Errand]:
    """The simulation of the literature values, where the search has not made it."""
    keep = fine.keeper(_literature(setup))
    scene, values = place(setup.fine, _literature(setup), setup.kept)
    return [] if keep is None else [Errand(scene.with_material(**values), keep)]


def _start_curve(setup: Setup, fine: CachedEvaluator) -> np.ndarray:
    """Smoothed curve of the literature values [N], shape (240,); NaN where that run broke down."""
    evaluation = next(iter(fine.evaluate([_literature(setup)])))
    if not evaluation.ok:
        return np.full_like(setup.curve.stroke, np.nan)
    return filter_simulated(setup.curve.stroke, evaluation.stroke, evaluation.force)


def _write(
    request: Request,
    setup: Setup,
    result: FitResult,
    analysis: UncertaintyAnalysis | None,
    record: ForceRecord,
    checks: Sequence[Check],
    start: np.ndarray,
    out: Path,
    wall: float,
) -> dict[str, Any]:
    """Write curves.csv, material.yaml, summary.json and report.pdf; returns the summary."""
    from reports.calibration.report import write_report

    curve, best = setup.curve, result.best
    metrics = compare(curve.stroke, curve.curve, best.curve)
    nulls = null_models(curve.stroke, curve.curve)
    summary = summarise(request, setup, result, record, metrics, nulls, analysis, checks)
    summary |= {"sensitivity": sensitivity(setup.objective, result, seed=request.seed), "wall_s": wall}
    write_csv(out / "curves.csv", _curves(curve, best.curve, record, start, nulls, analysis))
    fitted = _fitted_food(request, setup, best.evaluation.parameters)
    keep = ("created", "trace_sha256", "passed", "peak_error", "nrmse", "shape_error", "git", "versions")
    dump_material(fitted, out / "material.yaml", {k: summary[k] for k in keep} | {"trace": curve.trace.label})
    write_json(out / "summary.json", summary)
    write_report(out)
    return summary


def _fitted_food(request: Request, setup: Setup, parameters: Mapping[str, float]) -> FoodSpec:
    """The food with the fitted values, and the specimen's height (and width, unless measured) where it was fitted."""
    _, values = place(setup.fine, parameters)
    how = {"status": "fitted", "source": f"fitted to {setup.curve.trace.source}"}
    food = request.food.with_values(values, **how)
    if len(values) == len(parameters):
        return food
    shape = setup.fine.food.shape
    names = [name for name in ("height", "width") if name not in setup.kept]
    return food.with_sizes({name: getattr(shape, name) for name in names}, **how)


def _curves(
    curve: Conditioned,
    best: np.ndarray,
    record: ForceRecord,
    start: np.ndarray,
    nulls: Mapping[str, NullModel],
    analysis: UncertaintyAnalysis | None,
) -> dict[str, np.ndarray]:
    """Columns of curves.csv, all on the trace's stroke grid."""
    parts = {
        "edge_N": filter_simulated(curve.stroke, record.stroke, record.edge[:, 2]),
        "face_N": filter_simulated(curve.stroke, record.stroke, record.resolved_face),
    }
    columns = {"stroke_m": curve.stroke, "real_N": curve.curve, "sim_N": best, "residual_N": best - curve.curve}
    band = {} if analysis is None else {"band_low_N": analysis.bands[0].low, "band_high_N": analysis.bands[0].high}
    return columns | parts | {"start_N": start} | {f"{name}_N": n.curve for name, n in nulls.items()} | band
