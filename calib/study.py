"""One calibration from files to files: condition, fit, judge, write. The command line is a thin layer over it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import numpy as np

from calib.conditioning import Conditioned, condition
from calib.errors import MaterialError
from calib.filters import filter_simulated
from calib.fit import FitOptions, FitResult, calibrate
from calib.knives import load_knife
from calib.materials import FoodSpec, dump_material
from calib.metrics import Metrics, compare
from calib.nulls import NullModel, null_models
from calib.objective import Objective, Target
from calib.outputs import prepare, write_csv, write_json
from calib.parameters import Parameter, ParameterSet
from calib.pool import Pool
from calib.progress import Progress
from calib.properties import rule_of
from calib.provenance import code_key, git_commit, key_of, versions
from calib.scenes import Sizing, cut_scene, specimen
from calib.store import EvaluationStore, StoredEvaluator
from calib.trace import read_trace
from calib.uncertainty import Uncertainty, assess
from calib.verdicts import judge, limits
from mpm.record import ForceRecord
from mpm.scene import Scene

# Hard bounds reach this factor beyond the literature's range, so that a trace may contradict the literature.
BOUND_FACTOR = 5.0
LINEAR = {"nu": (0.0, 0.49), "mu": (0.0, 1.2)}  # fitted on a linear scale, with their hard bounds


@dataclass(frozen=True)
class Request:
    """What to calibrate.

    Attributes:
        food: The food with its literature ranges.
        trace: CSV of the cut.
        air: CSV of the same motion without food, or None.
        columns: ``time_col``, ``force_col``, ``position_col``, ``sign`` for reading the CSVs.
        knife: Name or YAML file.
        speed: Knife speed [m/s], or None.
        t_end: End of the record [s], or None.
        sizing: What is known of the specimen.
        fit: Names of the fitted properties; None for the food's default.
        dx: Cell size [m], or None.
        budget: Largest number of simulations.
        workers: Simulations at a time.
        seed: Seed of particles and search.
        arch: Device.
        command: Command line, for provenance.
    """

    food: FoodSpec
    trace: Path
    air: Path | None = None
    columns: Mapping[str, Any] = field(default_factory=dict)
    knife: str = "kitchen"
    speed: float | None = None
    t_end: float | None = None
    sizing: Sizing = field(default_factory=Sizing)
    fit: tuple[str, ...] | None = None
    dx: float | None = None
    budget: float = 40
    workers: int = 2
    seed: int = 0
    arch: str = "cpu"
    command: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Setup:
    """Everything that is decided before the first simulation."""

    curve: Conditioned
    fine: Scene
    coarse: Scene
    objective: Objective
    assumed: list[str]


def fit_parameters(food: FoodSpec, names: tuple[str, ...]) -> ParameterSet:
    """The fitted properties with start value, hard bounds and literature prior.

    Raises:
        MaterialError: An unknown or repeated name, or a property without a literature range.
    """
    chosen = []
    for name in names:
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


def _set_up(request: Request) -> _Setup:
    food = request.food
    trace = read_trace(request.trace, **request.columns)
    air = read_trace(request.air, **request.columns) if request.air is not None else None
    known = request.sizing.height or food.dims["height"].value
    curve = condition(trace, air=air, speed=request.speed, height=known, t_end=request.t_end)
    shape, assumed = specimen(food, curve, request.sizing)
    knife = load_knife(request.knife)
    common = {"stroke": curve.stroke_length_m, "dx": request.dx, "seed": request.seed}
    fine = cut_scene(food, shape, knife, **common)
    coarse = cut_scene(food, shape, knife, coarse=True, **common)
    target = Target(curve.stroke, curve.curve, curve.noise_sd_N, curve.peak_sd_N, filter_simulated)
    objective = Objective(target, fit_parameters(food, request.fit or food.default_fit))
    return _Setup(curve, fine, coarse, objective, assumed)


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
    prepare(out, resume=resume)
    header = {"trace_sha256": setup.curve.trace.sha256, "scene": key_of(setup.fine.as_dict()), "code": code_key()}
    options = FitOptions(budget=request.budget, batch=request.workers, seed=request.seed)
    with EvaluationStore(out / "evaluations.h5", header) as store, Pool(request.workers, request.arch) as pool:
        fine = StoredEvaluator(store, pool.evaluator(setup.fine), "fine", setup.fine.as_dict())
        coarse = StoredEvaluator(store, pool.evaluator(setup.coarse), "coarse", setup.coarse.as_dict())
        result = calibrate(setup.objective, fine, coarse=coarse, options=options, progress=progress)
        say("simulating the best values once more for their full record")
        record = _record(setup.fine, result.best.evaluation.parameters, request.arch)
        start = _start_curve(setup, request, fine)
    doubt = assess(result, setup.objective)
    return _write(request, setup, result, record, start, doubt, out, time.monotonic() - began)


def _record(scene: Scene, values: Mapping[str, float], arch: str) -> ForceRecord:
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    return Simulation(scene.with_material(**values), Runtime(arch)).run()


def _start_curve(setup: _Setup, request: Request, evaluator: StoredEvaluator) -> np.ndarray:
    """Smoothed curve of the literature values [N], shape (240,); NaN where that run broke down."""
    values = {p.name: p.value for p in setup.objective.parameters}
    evaluation = next(iter(evaluator.evaluate([values])))
    if not evaluation.ok:
        return np.full_like(setup.curve.stroke, np.nan)
    return filter_simulated(setup.curve.stroke, evaluation.stroke, evaluation.force)
