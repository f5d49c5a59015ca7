"""A cut predicted with values that were calibrated on another one: the test that a fit to the same trace is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from calib.io.folder import prepare, write_csv, write_json
from calib.io.provenance import git_commit, versions
from calib.io.schema import tag
from calib.material.knife import load_knife
from calib.material.scene import cut_scene, specimen, windowed
from calib.problem.request import Request
from calib.problem.setup import conditioned
from calib.trace.filters import filter_simulated
from calib.validation.metrics import Metrics, compare
from mpm.scene.errors import SimulationError

NRMSE_LIMIT, RATING_LIMIT = 0.10, 0.80
"""Largest curve error and smallest ISO-18571-style rating of a prediction that passes [-]."""


def run(request: Request, out: Path, *, scale_width: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Simulate the cut of a trace with the food's values as they are, compare, and write summary.json and curves.csv.

    The resistances of a cut are known only times the width that is cut. With ``scale_width`` the one number that is
    taken from this trace is that width: the scale that brings the curves closest.

    Raises:
        CutcalError: Anything wrong with the input, or a run that breaks down.
    """
    curve, _ = conditioned(request)
    shape, assumed = specimen(request.food, curve, request.sizing)
    knife = load_knife(request.knife)
    scene = windowed(
        cut_scene(request.food, shape, knife, stroke=curve.stroke_length_m, dx=request.dx, seed=request.seed)
    )
    for text in [*request.food.warnings(), *curve.warnings, *assumed]:
        say(text)
    prepare(out, resume=False)

    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    record = Simulation(scene, Runtime(request.arch)).run()
    if record.status != "done":
        raise SimulationError(
            f"the predicted cut broke down at {record.fraction:.0%} of its stroke ({record.status}); nothing was compared; "
            "try another --dx",
            reason=record.status,
            fraction=record.fraction,
        )
    whole = filter_simulated(curve.stroke, record.stroke, record.resolved)
    bare = compare(curve.stroke, curve.curve, whole)
    factor = bare.best_scale if scale_width else 1.0
    metrics = compare(curve.stroke, curve.curve, factor * whole)
    write_csv(
        out / "curves.csv",
        {
            "stroke_m": curve.stroke,
            "real_N": curve.curve,
            "sim_N": factor * whole,
            "edge_N": factor * filter_simulated(curve.stroke, record.stroke, record.edge[:, 2]),
            "face_N": factor * filter_simulated(curve.stroke, record.stroke, record.resolved_face),
        },
    )
    summary = {
        "schema": tag("predict"),
        "food": request.food.name,
        "trace": curve.trace.label,
        "trace_sha256": curve.trace.sha256,
        "held_out": True,
        "passed": _passes(metrics),
        "width_scale": factor if scale_width else None,
        "width_m": factor * shape.width,
        "metrics": metrics.as_dict(),
        "unscaled": bare.as_dict(),
        "limits": {"nrmse": NRMSE_LIMIT, "rating": RATING_LIMIT},
        "status": record.status,
        "momentum_residual": record.momentum_residual,
        "dx_m": scene.numerics.dx,
        "shape": vars(replace(shape, width=factor * shape.width)),
        "knife": knife.name,
        "seed": request.seed,
        "device": request.arch,
        "command": list(request.command),
        "versions": versions(),
        "git": git_commit(),
        "warnings": [*request.food.warnings(), *curve.warnings, *assumed],
    }
    write_json(out / "summary.json", summary)
    return summary


def _passes(metrics: Metrics) -> bool:
    return metrics.nrmse <= NRMSE_LIMIT and metrics.iso18571.R >= RATING_LIMIT
