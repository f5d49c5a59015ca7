"""Do the intervals hold? Cuts simulated with known values, measured by a made-up sensor and calibrated like real ones.

Each truth is drawn from the middle of the food's prior ranges and simulated with other particles than the fit will use.
Its sensor has a baseline, a drift, a gain, white noise and a ripple like that of a robot's arm, and its record goes the
whole way: tare, contact, filter, search, profiles. The fit is told that the model is right, but for the noise of the
particles of two simulations: that of the truth and its own.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from calib.errors import OutputError
from calib.fit.multistart import FitResult
from calib.fit.options import FitOptions
from calib.io.folder import finite, prepare, write_json
from calib.io.progress import Countdown
from calib.io.provenance import code_key, git_commit, key_of, versions
from calib.io.schema import tag
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.posterior.answer import sampled_answer
from calib.problem.food_parameters import fit_parameters
from calib.problem.request import Request
from calib.problem.setup import replicated, set_up
from calib.problem.target import ErrorModel
from calib.simulation.evaluation import Evaluators
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header
from calib.simulation.workers import Workers
from calib.uncertainty.analysis import UncertaintyAnalysis
from calib.uncertainty.global_search import fit_with_uncertainty
from mpm.arrays import FloatArray
from mpm.scene import Scene
from mpm.scene.errors import CutcalError
from mpm.scene.shapes import Shape

RIGHT_MODEL = ErrorModel(discrepancy=0.01, peak=0.02)
"""Error model of a fit with the very model that made the trace: what other particles change of curve and peak
(docs/theory.md, "Measured choices")."""
TRUTH_PART = 0.8
"""Part of each prior range, about its middle, from which truths are drawn [-]."""
TRUTH_SEED = 10_000
"""Added to the number of a trace for the seed of its truth's particles, which no fit has."""
TRIES = 40
"""Truths drawn until one is cut to the end of the stroke (docs/theory.md, "Measured choices")."""
COVERAGE_LIMITS = (0.90, 0.99)
"""Part of the intervals that must hold the truth, where they are 95 % intervals [-]. The upper limit needs
:data:`FEWEST_FOR_UPPER` of them: of 25, all hold it in one study of four that is right."""
FEWEST_FOR_UPPER = 100
MEDIAN_ERROR_LIMIT = 0.10
"""Largest median error of a parameter that is called identified [-]."""
FEWEST_INTERVALS = 20
"""Intervals of one parameter from which its coverage is judged."""


@dataclass(frozen=True)
class MadeUpSensor:
    """How a simulated force is measured; the defaults are those of panda-force's air runs where it has them.

    Attributes:
        rate: Samples a second [Hz].
        speed: Speed of the knife [m/s].
        approach: Time before contact [s].
        baseline: Force without load [N].
        drift_sd: Standard deviation of its drift [N/s].
        gain_sd: Standard deviation of the gain about 1 [-].
        noise: Standard deviation of white noise [N].
        ripple: Amplitude of a ripple like that of a robot's arm [N].
        frequency: Frequency of the ripple [Hz].
    """

    rate: float = 200.0
    speed: float = 0.02
    approach: float = 1.0
    baseline: float = 25.0
    drift_sd: float = 0.1
    gain_sd: float = 0.02
    noise: float = 0.2
    ripple: float = 0.2
    frequency: float = 12.0

    def measure(self, stroke: FloatArray, force: FloatArray, random: np.random.Generator) -> pd.DataFrame:
        """A record of a simulated force.

        Args:
            stroke: Stroke [m] (k,), rising.
            force: Force over it [N] (k,).
            random: Source of gain, drift, phase and noise.

        Returns:
            Columns ``time_s``, ``force_N`` and ``position_m``.
        """
        length = float(stroke[-1])
        t = np.arange(0.0, self.approach + length / self.speed, 1.0 / self.rate)
        way = self.speed * (t - self.approach)
        cut = np.interp(way, np.concatenate([[0.0], stroke]), np.concatenate([[0.0], force]), left=0.0)
        gain = 1.0 + self.gain_sd * random.standard_normal()
        drift = self.drift_sd * random.standard_normal() * t
        phase = 2.0 * np.pi * (self.frequency * t + random.random())
        noise = self.noise * random.standard_normal(len(t)) + self.ripple * np.sin(phase)
        return pd.DataFrame(
            {"time_s": t, "force_N": self.baseline + gain * cut + drift + noise, "position_m": 0.1 - way}
        )


@dataclass(frozen=True)
class CoveragePlan:
    """What a study of coverage makes up and calibrates.

    Attributes:
        food: The food; its ranges are those that truths are drawn from.
        traces: How many traces.
        knife: Name or YAML file.
        dx: Cell of truths and fits [m], or None for the food's own.
        seed: Seed of truths, sensors and fits.
        sensor: How a simulated force is measured.
        sample: Whether each trace's posterior is sampled, in place of a search.
        command: Command line, for provenance.
    """

    food: FoodSpec
    traces: int
    knife: str = "kitchen"
    dx: float | None = None
    seed: int = 0
    sensor: MadeUpSensor = MadeUpSensor()
    sample: bool = False
    command: tuple[str, ...] = ()

    @cached_property
    def shape(self) -> Shape:
        """The specimen."""
        return specimen(self.food, None, Sizing())[0]

    @cached_property
    def scene(self) -> Scene:
        """The cut that truths are simulated with, at the food's own values."""
        return cut_scene(self.food, self.shape, load_knife(self.knife), dx=self.dx)

    @property
    def header(self) -> Header:
        """What the store of the study belongs to."""
        how = {"sample": True} if self.sample else {}
        content = {"scene": self.scene.as_dict(), "sensor": vars(self.sensor), "seed": self.seed, **how}
        return Header("", key_of(content))

    def request(self, k: int, trace: Path, arch: str) -> Request:
        """How the trace of a number is calibrated.

        Args:
            k: Number of the trace.
            trace: Its file.
            arch: Device of the simulations.

        Returns:
            The request.
        """
        shape = self.shape
        return Request(
            food=self.food,
            trace=trace,
            knife=self.knife,
            sizing=Sizing(shape.kind, shape.height, shape.width, shape.length),
            dx=self.dx,
            gain_sd=self.sensor.gain_sd,
            errors=RIGHT_MODEL,
            seed=k,
            arch=arch,
        )


def run(plan: CoveragePlan, out: Path, pool: Workers, *, resume: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Make up traces, calibrate each, and write coverage.json.

    Args:
        plan: What is made up and calibrated.
        out: Output folder; a line for each trace is there as soon as it is calibrated.
        pool: Where the simulations run.
        resume: Go on with the study in ``out``.
        say: Called with a line after each trace.

    Returns:
        The content of ``coverage.json``.

    Raises:
        CutcalError: Anything wrong with the input; nothing that was computed is lost.
    """
    with prepare(out, "coverage", resume=resume):
        began = time.monotonic()
        lines = out / "coverage.jsonl"
        header, done = plan.header, _known(lines)
        todo = [k for k in range(plan.traces) if k not in done]
        rest = Countdown(len(todo))
        with EvaluationStore(out / "evaluations.h5", header, resume=resume, say=say) as store:
            for k in todo:
                done[k] = _one(plan, k, out / f"trace-{k:03d}.csv", store, pool)
                _append(lines, done[k])
                say(f"trace {k + 1} of {plan.traces}: {_words(done[k])}; {rest.left(1.0)}")
        document = {"schema": tag("coverage"), **coverage_of([done[k] for k in range(plan.traces)])}
        document |= {
            "food": plan.food.name,
            "knife": plan.knife,
            "dx_m": plan.scene.numerics.dx,
            "sensor": vars(plan.sensor),
            "seed": plan.seed,
            "wall_s": time.monotonic() - began,
            "command": list(plan.command),
            "versions": versions(),
            "git": git_commit(),
        }
        write_json(out / "coverage.json", document)
        return document


def _one(plan: CoveragePlan, k: int, path: Path, store: EvaluationStore, pool: Workers) -> dict[str, Any]:
    """Make up a trace, calibrate it, and compare with the truth."""
    random = np.random.default_rng([plan.seed, k])
    values, force = _truth(plan, k, random, store, pool)
    plan.sensor.measure(*force, random).to_csv(path, index=False, float_format="%.6g")
    row: dict[str, Any] = {"trace": k, "truth": values, "peak_N": float(force[1].max())}
    request = plan.request(k, path, pool.arch)
    analysis: UncertaintyAnalysis | None
    try:
        setup = set_up(request)
        fine, coarse, again = (
            CachedEvaluator(
                pool.evaluator(scene, setup.kept), store, scene=scene.as_dict(), code=code_key(), fidelity=name
            )
            for name, scene in (("fine", setup.fine), ("coarse", setup.coarse), ("again", replicated(setup.fine)))
        )
        options = FitOptions(budget=request.budget, batch=pool.batch, seed=k)
        evaluators = Evaluators(fine, coarse, again)
        if plan.sample:
            result, analysis, _ = sampled_answer(setup, evaluators, k)
        else:
            result, analysis = fit_with_uncertainty(setup.objective, evaluators, options)
    except CutcalError as e:
        return row | {"error": str(e)}
    if result.status == "interrupted":
        raise KeyboardInterrupt
    if analysis is None:
        return row | {"error": "the search ended before there were intervals"}
    return row | _found(result, analysis)


def _found(result: FitResult, analysis: UncertaintyAnalysis) -> dict[str, Any]:
    """What the row of a calibrated trace says of its fit."""
    return {
        "parameters": {i.parameter.name: i.as_dict() for i in analysis.uncertainty.intervals},
        "inside": analysis.bands[0].inside,
        "misfit": result.best.misfit,
        "reduced_chi2": analysis.uncertainty.reduced_chi2,
        "lengths": list(analysis.uncertainty.data.lengths),
        "simulations": result.simulations,
        "coarse_simulations": result.coarse_simulations,
        "search": result.status,
    }


def _truth(
    plan: CoveragePlan, k: int, random: np.random.Generator, store: EvaluationStore, pool: Workers
) -> tuple[dict[str, float], tuple[FloatArray, FloatArray]]:
    """Values of a food that is cut to the end of the stroke, and that cut: stroke [m] and force [N]."""
    food, scene = plan.food, plan.scene
    parameters = fit_parameters(food, food.default_fit)
    scene = replace(scene, numerics=replace(scene.numerics, seed=TRUTH_SEED + k))
    evaluator = CachedEvaluator(pool.evaluator(scene), store, scene=scene.as_dict(), code=code_key(), fidelity="truth")
    for _ in range(TRIES):
        z = parameters.in_box(0.5 + TRUTH_PART * (random.random(len(parameters)) - 0.5))
        values = parameters.to_dict(z)
        found = next(iter(evaluator.evaluate([values])))
        if found.completed == 1.0:
            return values, (found.stroke, found.force)
    raise OutputError(
        f"none of {TRIES} foods drawn from the ranges of {food.name} reached the end of its cut; "
        "give another --food or --dx"
    )


def coverage_of(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Coverage and errors by parameter and verdict.

    Args:
        rows: One per trace, as written to ``coverage.jsonl``.

    Returns:
        That part of ``coverage.json``.
    """
    sound = [r for r in rows if "parameters" in r]
    names = list(sound[0]["parameters"]) if sound else []
    by_name = {name: _parameter(sound, name) for name in names}
    judged = [p for p in by_name.values() if p["identified"] >= FEWEST_INTERVALS]
    passed = bool(judged) and all(
        COVERAGE_LIMITS[0]
        <= p["covered_identified"]
        <= (COVERAGE_LIMITS[1] if p["identified"] >= FEWEST_FOR_UPPER else 1.0)
        and p["median_error_identified"] <= MEDIAN_ERROR_LIMIT
        for p in judged
    )
    return {
        "traces": len(rows),
        "calibrated": len(sound),
        "errors": [r["error"] for r in rows if "error" in r],
        "parameters": by_name,
        "predictive_inside": float(np.mean([r["inside"] for r in sound])) if sound else None,
        "simulations": float(np.mean([r["simulations"] for r in sound])) if sound else None,
        "coarse_simulations": float(np.mean([r["coarse_simulations"] for r in sound])) if sound else None,
        "limits": {"covered": list(COVERAGE_LIMITS), "median_error": MEDIAN_ERROR_LIMIT, "fewest": FEWEST_INTERVALS},
        "passed": passed and len(sound) == len(rows),
    }


def _parameter(rows: list[dict[str, Any]], name: str) -> dict[str, Any]:
    """Of one parameter: how often its intervals hold the truth, and how far it is off."""
    found = [(r["parameters"][name], r["truth"][name]) for r in rows]
    identified = [(p, t) for p, t in found if p["verdict"] in ("identified", "only_as_product")]
    errors = [abs(p["value"] / t - 1.0) for p, t in identified if t != 0.0]
    verdicts = [p["verdict"] for p, _ in found]
    return {
        "covered": _covered(found),
        "identified": len(identified),
        "covered_identified": _covered(identified),
        "median_error_identified": float(np.median(errors)) if errors else None,
        "verdicts": {v: verdicts.count(v) for v in sorted(set(verdicts))},
    }


def _covered(found: list[tuple[Mapping[str, Any], float]]) -> float | None:
    """Part of the intervals that hold their truth [-]."""
    return float(np.mean([p["low95"] <= t <= p["high95"] for p, t in found])) if found else None


def _words(row: Mapping[str, Any]) -> str:
    """One trace in words."""
    if "error" in row:
        return f"not calibrated ({row['error']})"
    held = sum(p["low95"] <= row["truth"][n] <= p["high95"] for n, p in row["parameters"].items())
    return f"{held} of {len(row['parameters'])} intervals hold the truth, {row['simulations']} simulations"


def _known(path: Path) -> dict[int, dict[str, Any]]:
    """Traces calibrated before an interruption; a line that was being written is left out, and ended."""
    if not path.exists():
        return {}
    if not path.read_text(encoding="utf-8").endswith("\n"):
        with path.open("a", encoding="utf-8") as stream:
            stream.write("\n")
    return {row["trace"]: row for row in _rows(path)}


def _rows(path: Path) -> Iterator[dict[str, Any]]:
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            yield json.loads(line)
        except json.JSONDecodeError:
            continue


def _append(path: Path, row: Mapping[str, Any]) -> None:
    """Write a line; it is on disk when this returns.

    Raises:
        OutputError: It cannot be written.
    """
    try:
        with path.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(finite(row), allow_nan=False) + "\n")
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e.strerror})") from None
