"""One calibration from files to files: condition, fit, judge, write. The command line is a thin layer over it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from calib.checks import Check, check
from calib.conditioning import Conditioned, condition
from calib.errors import MaterialError
from calib.filters import filter_simulated
from calib.fit import FitOptions, FitResult, calibrate
from calib.knives import load_knife
from calib.materials import FoodSpec, dump_material
from calib.metrics import compare
from calib.nulls import NullModel, null_models
from calib.objective import Objective, Target
from calib.outputs import prepare, write_csv, write_json
from calib.parameters import Parameter, ParameterSet
from calib.pool import Pool
from calib.progress import Progress
from calib.properties import rule_of
from calib.provenance import code_key, key_of
from calib.request import Request, Setup
from calib.scenes import cut_scene, height_range, place, specimen
from calib.store import CachedEvaluator, EvaluationStore, Header
from calib.summary import add_conditioning, summarise
from calib.uncertainty import uncertainty
from mpm.record import ForceRecord

# Hard bounds reach this factor beyond the literature's range, so that a trace may contradict the literature.
BOUND_FACTOR = 5.0
LINEAR = {"nu": (0.0, 0.49), "mu": (0.0, 1.2)}  # fitted on a linear scale, with their hard bounds


def fit_parameters(
    food: FoodSpec, names: tuple[str, ...], heights: tuple[float, float, float] | None = None
) -> ParameterSet:
    """The fitted properties with start value, hard bounds and literature prior.

    Args:
        food: The food.
        names: Properties, and ``height`` for the specimen's.
        heights: Lowest, likely and largest height of the specimen [m]; None where it is known.

    Raises:
        MaterialError: An unknown or repeated name, a property without a literature range, or a height that is known.
    """
    chosen = []
    for name in names:
        if name == "height":
            if heights is None:
                raise MaterialError(
                    "--fit height: the height is known (given, or the trace ends released); leave one of both out"
                )
            low, likely, high = heights
            chosen.append(Parameter(name, likely, low, high, "m", low, high))
            continue
        rule, (low, high) = rule_of(name), food.prior(name)
        value = food.value(name)
        assert value is not None  # prior() has a range only where there is a value
        if name in LINEAR:
            bottom, top = LINEAR[name]
            chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high, scale="linear"))
            continue
        if low <= 0:
            raise MaterialError(f"{food.name}: {name} cannot be fitted from a range that starts at {low:g} {rule.unit}")
        bottom, top = max(rule.low, low / BOUND_FACTOR), min(rule.high, high * BOUND_FACTOR)
        chosen.append(Parameter(name, value, bottom, top, rule.unit, low, high))
    return ParameterSet(tuple(chosen))


def conditioned(request: Request) -> tuple[Conditioned, str | None]:
    """The trace of a request, conditioned, and the SHA-256 of its air run (None without one).

    Raises:
        CutcalError: Anything wrong with the records.
    """
    trace, air = request.records()
    known = request.sizing.height or request.food.dims["height"].value
    curve = condition(trace, air=air, speed=request.speed, height=known, t_end=request.t_end)
    return curve, None if air is None else air.sha256


def _set_up(request: Request) -> Setup:
    """Condition the trace, and make the scenes and the objective of a calibration.

    Raises:
        CutcalError: Anything wrong with the input.
    """
    food = request.food
    curve, air_sha256 = conditioned(request)
    shape, assumed = specimen(food, curve, request.sizing)
    knife = load_knife(request.knife)
    fine, coarse = (
        cut_scene(food, shape, knife, stroke=curve.stroke_length_m, dx=request.dx, seed=request.seed, coarse=screening)
        for screening in (False, True)
    )
    target = Target(curve.stroke, curve.curve, curve.noise_sd_N, curve.peak_sd_N, filter_simulated)
    heights = height_range(food, curve, request.sizing)
    names = request.fit or (food.default_fit if heights is None else (*food.default_fit, "height"))
    objective = Objective(target, fit_parameters(food, names, heights))
    return Setup(curve, fine, coarse, objective, assumed, request.sizing.kept, air_sha256)


def run(
    request: Request,
    out: Path,
    *,
    resume: bool = False,
    progress: Callable[[Progress], None] | None = None,
    say: Callable[[str], None] | None = None,
) -> dict[str, Any]:
    """Calibrate and write all outputs.

    Args:
        request: What to calibrate.
        out: Output folder.
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
    setup = _set_up(request)
    for text in [*request.food.warnings(), *setup.curve.warnings, *setup.assumed]:
        say(text)
    options = FitOptions(budget=request.budget, batch=request.workers, seed=request.seed)
    options.check(len(setup.objective.parameters))
    prepare(out, resume=resume)
    header = Header(setup.curve.trace.sha256, key_of(setup.fine.as_dict()))
    with (
        EvaluationStore(out / "evaluations.h5", header, resume=resume) as store,
        Pool(request.workers, request.arch) as pool,
    ):
        fine, coarse = (
            CachedEvaluator(
                pool.evaluator(scene, setup.kept),
                store,
                scene=scene.as_dict() | {"kept": setup.kept},
                code=code_key(),
                fidelity=name,
            )
            for name, scene in (("fine", setup.fine), ("coarse", setup.coarse))
        )
        result = calibrate(setup.objective, fine, coarse=coarse, options=options, progress=progress)
        start = _start_curve(setup, result, fine)
        say("simulating the best values once more for their full record")
        scene, values = place(setup.fine, result.best.evaluation.parameters, setup.kept)
        setup = replace(setup, fine=scene)
        scene = scene.with_material(**values)
        record = pool.record(scene)
        checks: list[Check] = []
        if result.status != "interrupted":
            say("simulating them at half the speed, and with the grid and the particles elsewhere")
            checks = check(scene, record, pool, store)
    add_conditioning(out / "evaluations.h5", setup.curve)
    return _write(request, setup, result, record, checks, start, out, time.monotonic() - began)


def _start_curve(setup: Setup, result: FitResult, fine: CachedEvaluator) -> np.ndarray:
    """Smoothed curve of the literature values [N], shape (240,); NaN where that run broke down or was not reached."""
    empty = np.full_like(setup.curve.stroke, np.nan)
    if result.status == "interrupted":
        return empty
    evaluation = next(iter(fine.evaluate([{p.name: p.value for p in setup.objective.parameters}])))
    if not evaluation.ok:
        return empty
    return filter_simulated(setup.curve.stroke, evaluation.stroke, evaluation.force)


def _write(
    request: Request,
    setup: Setup,
    result: FitResult,
    record: ForceRecord,
    checks: Sequence[Check],
    start: np.ndarray,
    out: Path,
    wall: float,
) -> dict[str, Any]:
    """Write curves.csv, material.yaml, summary.json and report.pdf; returns the summary."""
    from reports.calibration import write_report

    curve, best = setup.curve, result.best
    metrics = compare(curve.stroke, curve.curve, best.curve)
    nulls = null_models(curve.stroke, curve.curve)
    doubt = None
    if result.jacobian is not None:
        rows = setup.objective.effective_rows
        doubt = uncertainty(result.parameters, result.jacobian, best.residual, effective_rows=rows)
    summary = summarise(request, setup, result, record, metrics, nulls, doubt, checks)
    summary["wall_s"] = wall
    write_csv(out / "curves.csv", _curves(curve, best.curve, record, start, nulls))
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
    curve: Conditioned, best: np.ndarray, record: ForceRecord, start: np.ndarray, nulls: Mapping[str, NullModel]
) -> dict[str, np.ndarray]:
    """Columns of curves.csv, all on the trace's stroke grid."""
    parts = {
        "edge_N": filter_simulated(curve.stroke, record.stroke, record.edge[:, 2]),
        "face_N": filter_simulated(curve.stroke, record.stroke, record.resolved_face),
    }
    columns = {"stroke_m": curve.stroke, "real_N": curve.curve, "sim_N": best, "residual_N": best - curve.curve}
    return columns | parts | {"start_N": start} | {f"{name}_N": n.curve for name, n in nulls.items()}
