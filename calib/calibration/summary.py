"""The content of ``summary.json``: every figure that a report quotes, in SI units, errors as fractions."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import h5py

from calib.errors import OutputError
from calib.fit.multistart import FitResult
from calib.io.provenance import git_commit, versions
from calib.io.schema import tag
from calib.problem.parameters import STRESS_LIKE, plain
from calib.problem.request import Request, Setup
from calib.trace.conditioning import Conditioned
from calib.uncertainty.analysis import Doubt
from calib.uncertainty.intervals import Uncertainty
from calib.validation.acceptance import judge, limits
from calib.validation.metrics import Metrics
from calib.validation.null_models import NullModel
from calib.validation.numerical_checks import Check
from mpm.files import replacing
from mpm.output.record import ForceRecord

WITH_WIDTH = 0.5  # an interval that a measured width would halve belongs to the product with it
UNKNOWN = "unknown"  # verdict of a parameter when a fit ended before its curvature was known


def summarise(
    request: Request,
    setup: Setup,
    result: FitResult,
    record: ForceRecord,
    metrics: Metrics,
    nulls: Mapping[str, NullModel],
    doubt: Doubt | None,
    checks: Sequence[Check],
) -> dict[str, Any]:
    """All figures of a calibration but its run time.

    Args:
        request: What was asked.
        setup: Trace, scenes and objective.
        result: The fit.
        record: Full record of the best values.
        metrics: Best curve against the trace.
        nulls: Null models against the trace.
        doubt: What the fit does not know; None when it ended too early for that.
        checks: What numerical choices change.
    """
    parameters = _parameters(request, result, None if doubt is None else doubt.uncertainty)
    for name, ends in ({} if doubt is None else doubt.sampled).items():
        parameters[name]["sampled95"] = list(ends)
    open_ends = {} if doubt is None else {e.name: e.as_dict() for e in doubt.nuisances}
    verdicts = judge(
        metrics,
        {n: m.metrics for n, m in nulls.items()},
        momentum_residual=record.momentum_residual,
        ke_over_ie=record.ke_over_ie,
        parted=record.parted,
        parameters=parameters,
        checks=checks,
        nuisances=open_ends,
    )
    trace = setup.curve.trace
    stopped = result.status == "interrupted"
    said = limits(
        trace.label,
        setup.curve.stroke_source,
        setup.curve.baseline_kind,
        verdicts,
        parameters,
        setup.assumed,
        record.fracture,
    )
    return {
        "schema": tag("calibrate"),
        "food": request.food.name,
        "created": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "status": "interrupted" if stopped else "done",
        "search": result.status,
        "passed": not stopped and all(v.passed is not False for v in verdicts),
        "verdicts": [v.as_dict() for v in verdicts],
        **_trace(request, setup),
        **_agreement(metrics, nulls),
        "peak_real_sd_N": setup.curve.peak_sd_N,
        "parameters": parameters,
        "nuisances": open_ends,
        **_doubt(setup, doubt),
        "correlations": _correlations(result, None if doubt is None else doubt.uncertainty),
        "fixed_parameters": _fixed(request, parameters),
        **_runs(result),
        **_numerics(request, setup, record),
        "numerical_checks": [c.as_dict() for c in checks],
        "warnings": [*request.food.warnings(), *setup.curve.warnings],
        "limits": [*(() if doubt is None else doubt.said), *said],
    }


def _trace(request: Request, setup: Setup) -> dict[str, Any]:
    curve = setup.curve
    trace = curve.trace
    return {
        "trace": {
            "source": trace.source,
            "label": trace.label,
            "sha256": trace.sha256,
            "samples": len(trace.time),
            "duration_s": float(trace.time[-1] - trace.time[0]),
            "columns": dict(trace.columns),
        },
        "trace_sha256": trace.sha256,
        "air": None if request.air is None else {"source": request.air_source, "sha256": setup.air_sha256},
        "baseline_N": curve.baseline_N,
        "baseline_sd_N": curve.baseline_sd_N,
        "baseline_kind": curve.baseline_kind,
        "onset_s": curve.onset_s,
        "onset_sd_s": curve.onset_sd_s,
        "end_s": curve.end_s,
        "stroke_m": curve.stroke_length_m,
        "stroke_source": curve.stroke_source,
        "noise_sd_N": curve.noise_sd_N,
        "filter_sd_m": curve.filter_sd_m,
    }


def _agreement(metrics: Metrics, nulls: Mapping[str, NullModel]) -> dict[str, Any]:
    all_of = metrics.as_dict()
    headline = ("peak_real_N", "peak_sim_N", "peak_error", "shape_error", "nrmse", "work_error")
    null = {}
    for name, model in nulls.items():
        theirs = model.metrics.as_dict()
        null[name] = {k: theirs[k] for k in ("nrmse", "shape_error", "peak_error", "work_error")}
        null[name]["R"] = theirs["iso18571"]["R"]
    return {
        **{k: all_of[k] for k in headline},
        "metrics": all_of,
        "sprague_geers": all_of["sprague_geers"],
        "iso18571": all_of["iso18571"],
        "null_models": null,
    }


def _parameters(request: Request, result: FitResult, doubt: Uncertainty | None) -> dict[str, dict[str, Any]]:
    out: dict[str, dict[str, Any]] = {}
    for k, p in enumerate(result.parameters):
        if doubt is not None:
            entry: dict[str, Any] = dict(doubt.intervals[k].as_dict())
        else:
            entry = {"value": p.value, "unit": p.unit, "low95": None, "high95": None}
            entry |= {"prior_low": p.prior_low, "prior_high": p.prior_high, "verdict": UNKNOWN}
        known = (request.food.dims if p.name == "height" else request.food.properties)[p.name]
        out[p.name] = entry | {"status": known.status, "source": known.source}
    if doubt is not None:
        names = result.parameters.names
        for tie in doubt.only_as_product:
            for name in names:
                if name in tie.combination.split() and out[name]["verdict"] in ("identified", "weak"):
                    out[name]["verdict"] = "only_as_product"
        for name, part in doubt.known_width().items():
            if part < WITH_WIDTH and plain(name) in STRESS_LIKE and out[name]["verdict"] in ("identified", "weak"):
                out[name]["verdict"] = "only_as_product"
    return out


def _doubt(setup: Setup, doubt: Doubt | None) -> dict[str, Any]:
    """Profiles, the size and correlation of the errors, and how much of the trace lies in the predictive band."""
    if doubt is None:
        return {"profiles": {}, "reduced_chi2": None, "correlation_length_m": None, "predictive_inside": None}
    found = doubt.uncertainty
    chosen = setup.objective.parameters
    return {
        "profiles": {
            p.name: {
                "value": [chosen[p.name].from_internal(z) for z in p.z],
                "rise": [float(x) for x in p.rise],
                "trace_alone": [float(x) for x in p.data],
            }
            for p in doubt.profiles
        },
        "reduced_chi2": found.reduced_chi2,
        "correlation_length_m": found.data.lengths[0] * setup.curve.stroke_length_m,
        "predictive_inside": doubt.bands[0].inside,
    }


def _correlations(result: FitResult, doubt: Uncertainty | None) -> dict[str, float]:
    if doubt is None:
        return {}
    n = result.parameters.names
    return {f"{n[i]},{n[j]}": float(doubt.correlation[i, j]) for i in range(len(n)) for j in range(i)}


def _fixed(request: Request, fitted: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    return {
        name: {"value": p.value, "unit": p.unit, "status": p.status, "source": p.source}
        for name, p in request.food.properties.items()
        if name not in fitted
    }


def _runs(result: FitResult) -> dict[str, Any]:
    history, best = [], math.inf
    for number, trial in enumerate(result.history, 1):
        if trial.ok and not trial.coarse and trial.misfit < best:
            best = trial.misfit
        if math.isfinite(best):
            history.append([number, best])
    failed = [t.evaluation for t in (*result.history, *result.replicates) if not t.ok]
    return {
        "simulations": result.simulations + result.coarse_simulations,
        "fine_simulations": result.simulations,
        "coarse_simulations": result.coarse_simulations,
        "failed_simulations": len(failed),
        "failures": [{"reason": e.reason, "fraction": e.fraction, "parameters": e.parameters} for e in failed],
        "misfit_history": history,
        "repeatability": result.repeatability,
    }


def _numerics(request: Request, setup: Setup, record: ForceRecord) -> dict[str, Any]:
    scene = setup.fine
    return {
        "dx_m": scene.numerics.dx,
        "particles": record.particles,
        "mirror_images": record.images,
        "mach": scene.motion.mach,
        "speed_real_m_s": request.speed,
        "momentum_residual": record.momentum_residual,
        "ke_over_ie": record.ke_over_ie,
        "ripple_N": record.ripple,
        "energy_J": record.budget,
        "fracture": record.fracture,
        "parted": None if math.isnan(record.parted) else record.parted,
        "counters": dict(record.counters),
        "shape": vars(scene.food.shape),
        "knife": vars(scene.knife),
        "scene": scene.as_dict(),
        "versions": versions(),
        "git": git_commit(),
        "seed": request.seed,
        "device": request.arch,
        "command": list(request.command),
    }


def add_conditioning(path: Path, curve: Conditioned) -> None:
    """Write the whole record into ``/conditioning`` of a closed store: time [s], raw and tared force [N].

    A copy is changed and put in place of the store, so that a kill on the way leaves the store as it was.

    Raises:
        OutputError: The file cannot be written.
    """
    columns = {"time_s": curve.time, "raw_N": curve.trace.force, "tared_N": curve.force}
    try:
        with replacing(path) as draft:
            shutil.copyfile(path, draft)
            with h5py.File(draft, "a") as file:
                if "conditioning" in file:
                    del file["conditioning"]
                group = file.create_group("conditioning")
                for name, values in columns.items():
                    group[name] = values
    except OSError as e:
        raise OutputError(f"{path}: cannot be written ({e}); check the disk") from None
