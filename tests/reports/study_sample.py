"""A synthetic folder of a finished study of three cuts, one of which was held out."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np

from calib.material.food import load_foods
from calib.material.food_file import dump_material
from calib.validation.metrics import Metrics, compare
from calib.validation.null_models import ThreeTermCurve, null_models
from tests.reports import sample

CONDITIONING = {
    "baseline_N": 0.41, "baseline_sd_N": 0.02, "baseline_kind": "constant", "onset_s": 1.25, "onset_sd_s": 0.01,
    "end_s": 2.9, "stroke_m": 0.033, "stroke_source": "position", "noise_sd_N": 0.05, "filter_sd_m": 0.0005,
}  # fmt: skip
SCENE = {
    "board": {"mu": 0.5, "suction": 0.0}, "edge": {"zone": 0.0067, "slip": 0.001},
    "numerics": {"ppc": 2, "safety": 0.7, "gravity": 9.81, "crack_ties": 3.0},
}  # fmt: skip
"""What the report reads of a simulated scene."""
SPEED = "peak +0.8 %, work −0.40 %, extrapolated to rest"
STROKE = np.linspace(0.0, 0.033, 240)
#: By cut: strength of its specimen, height of its skin peak [N], and the error of its simulation.
CUTS = {"first": (1.0, 2.4, 0.02), "second": (1.15, 2.0, -0.03), "third": (0.9, 2.9, 0.06)}
HELD = "third"


def curves(name: str) -> dict[str, np.ndarray]:
    """Columns of curves-NAME.csv."""
    strength, skin, error = CUTS[name]
    real = strength * ThreeTermCurve(5.2, 1.8e-3, skin, 4.5e-3, 1.4e-3, 260.0, 0.021).force(STROKE)
    sim = real * (1.0 + error * np.cos(2.0 * np.pi * STROKE / 0.02))
    half = 0.3 + 0.04 * sim
    out = {"stroke_m": STROKE, "real_N": real}
    if name == HELD:
        return out | {"predicted_N": sim, "predicted_low_N": sim - half, "predicted_high_N": sim + half}
    return out | {"sim_N": sim, "band_low_N": sim - half, "band_high_N": sim + half}


def summary() -> dict[str, Any]:
    """Its summary; the figures are those of the curves."""
    traces = {name: _fitted(name) for name in CUTS if name != HELD}
    parameters = deepcopy(sample.summary()["parameters"])
    own = {f"R_skin@{name}": parameters["R_skin"] | {"shared": False} for name in traces}
    shared = {name: p | {"shared": True} for name, p in parameters.items() if name != "R_skin"}
    base = sample.summary()
    return {
        "food": "banana", "study": "cuts.yaml", "created": "2026-03-14T15:09:26+00:00", "status": "done",
        "passed": True, "held_out": [HELD], "scatter": 0.25, "hold_out": {HELD: _predicted()}, "traces": traces,
        "parameters": shared | own, "reduced_chi2": 1.2, "failed_simulations": 3, "simulations": 240, "wall_s": 5421.0,
        "limits": ["3 cuts say little of the scatter between specimens."],
        "warnings": ["first: no position and no speed"],
        "command": ["calibrate", "--config", "cuts.yaml", "--out", "out"],
        "versions": base["versions"], "git": base["git"], "seed": 0, "device": "cpu", "presses": {},
        "correlations": {"R,E": -0.93, "mu,E": 0.21, "mu,R": 0.4}, "discrepancy": 0.03,
    }  # fmt: skip


def write_study(folder: Path, **changes: Any) -> Path:
    """Write the folder, with top-level entries of the summary replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "summary.json").write_text(json.dumps(summary() | changes, indent=1))
    dump_material(load_foods()["banana"], folder / "material.yaml", {"study": "cuts.yaml"})
    for name in CUTS:
        columns = curves(name)
        table = np.column_stack(list(columns.values()))
        np.savetxt(
            folder / f"curves-{name}.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.8g"
        )
    return folder


def _compared(name: str) -> Metrics:
    columns = curves(name)
    return compare(STROKE, columns["real_N"], columns["predicted_N" if name == HELD else "sim_N"])


def _nulls(name: str) -> dict[str, Any]:
    found = null_models(STROKE, curves(name)["real_N"])
    return {
        n: {"R": m.metrics.iso18571.R, "nrmse": m.metrics.nrmse, "shape_error": m.metrics.shape_error}
        for n, m in found.items()
    }


def _fitted(name: str) -> dict[str, Any]:
    return {
        "trace": {"source": f"{name}.csv", "sha256": "3b5d5c3712955042212316173ccf37be" * 2, "label": "measured"},
        "shape": sample.summary()["shape"], "knife": sample.summary()["knife"], "in_sample": True, "passed": True,
        "metrics": _compared(name).as_dict(), "factor": 1.04, "predictive_inside": 1.0, "verdicts": _lines(name),
        "predictive_width": _width(name), "scalars": {"particles": 5120.0}, "dx_m": 0.003,
        "conditioning": CONDITIONING, "mach": 0.01, "scene": SCENE,
        "nuisances": {"tare": {"value": 0.01, "sd": 0.02, "prior_sd": 0.03, "unit": "N", "outside": False},
                      "scale": {"value": 0.04, "sd": 0.06, "prior_sd": 0.15, "unit": "-", "outside": False}},
        "null_models": {n: {k: m[k] for k in ("R", "nrmse")} for n, m in _nulls(name).items()},
        "numerical_checks": [
            {"name": "half the simulated speed", "reason": None, "peak_change": 0.004, "work_change": -0.002},
            {"name": "cells of two thirds", "reason": None, "peak_change": -0.012, "work_change": 0.006},
        ],
    }  # fmt: skip


def _predicted() -> dict[str, Any]:
    others = {"mean of the others": {"R": 0.91, "nrmse": 0.06, "shape_error": 0.05}}
    return {
        "trace": {"source": f"{HELD}.csv", "sha256": "c0ffee00" * 8, "label": "measured"},
        "trained_on": [name for name in CUTS if name != HELD], "passed": True, "metrics": _compared(HELD).as_dict(),
        "factor": 0.91, "fitted": {"R_skin": 510.0}, "predictive_inside": 1.0, "predictive_width": _width(HELD),
        "limits": {"nrmse": 0.1, "rating": 0.8, "inside": 0.9, "width": 0.5}, "null_models": _nulls(HELD) | others,
        "beats": ["ramp", "half_sine"], "simulations": 31, "verdicts": _lines(HELD)[3:4], "dx_m": 0.003,
        "particles": 4096, "shape": sample.summary()["shape"], "knife": sample.summary()["knife"],
        "conditioning": CONDITIONING | {"bandwidth_Hz": 15.0},
        "nuisances": {"scale": {"value": -0.094, "sd": 0.02, "prior_sd": 0.15, "unit": "-", "outside": False}},
    }  # fmt: skip


def _width(name: str) -> float:
    """Mean width of its band over its peak."""
    columns, start = curves(name), "predicted" if name == HELD else "band"
    return float(np.mean(columns[f"{start}_high_N"] - columns[f"{start}_low_N"]) / columns["real_N"].max())


def _lines(name: str) -> list[dict[str, Any]]:
    """Lines of a verdict, of which none fails."""
    m = _compared(name)
    found = (("peak force error", m.peak_error, 0.1, ""), ("curve error (NRMSE)", m.nrmse, 0.08, ""),
             ("normalised-shape error", m.shape_error, 0.08, ""),
             ("kinetic over internal energy", 0.002, 0.1, ""), ("half the simulated speed", 0.008, 0.05, SPEED),
             ("cells of two thirds", 0.012, 0.05, "peak −1.2 %, work +0.60 %"))  # fmt: skip
    return [
        {"name": n, "value": x, "limit": limit, "unit": "fraction", "passed": abs(x) <= limit, "note": note}
        for n, x, limit, note in found
    ]
