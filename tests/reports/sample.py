"""A synthetic folder of a finished calibration: made-up cuts, but numbers that agree with one another."""

from __future__ import annotations

import json
import re
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from calib.validation.metrics import compare
from calib.validation.null_models import NullModel, ThreeTermCurve, null_models
from reports.base.format import NBSP

STROKE_M = 0.033
SPEED = 0.011
SHA256 = "3b5d5c3712955042212316173ccf37be" * 2
VALUE = ("value", "low95", "high95", "prior_low", "prior_high", "unit", "verdict", "source")
ONSET_S = 0.812
BASELINE_N = 0.314
NOISE_N = 0.06

FIXED = {
    "rho": (960.0, "kg/m^3", "paper_table2", "CulinaryCut Table 2"),
    "nu": (0.35, "-", "paper_table2", "CulinaryCut Table 2"),
    "skin_thickness": (3.0e-3, "m", "proxy", "Kachru 1995: green peel 2.95e-3 and 3.65e-3"),
    "tensile_strength": (None, "Pa", "assumed", "no bulk damage"),
}
FITTED = {
    "E": (4.12e5, 2.9e5, 5.8e5, 5e4, 2e6, "Pa", "identified", "upper part of the whole-fruit grip estimate"),
    "yield_stress": (3.1e4, 1.1e4, 9.0e4, 5e3, 2e5, "Pa", "weak", "ripe pulp, a tenth of E"),
    "R": (287.0, 262.0, 314.0, 100.0, 1200.0, "J/m^2", "identified", "half of the energy for green pulp"),
    "mu": (0.21, 0.02, 0.41, 0.0, 0.6, "-", "only_as_product", "between tomato 0.18 and cucumber 0.5"),
    "R_skin": (455.0, 390.0, 730.0, 100.0, 1600.0, "N/m", "one_sided", "a little above R"),
}
SENSITIVITY = {
    quantity: {
        name: {"first": first, "first_conf": 0.08, "total": first + more, "total_conf": 0.06}
        for name, first, more in zip(FITTED, parts, (0.06, 0.02, 0.05, 0.03, 0.01), strict=True)
    }
    for quantity, parts in (
        ("peak", (0.16, 0.02, 0.48, 0.21, 0.03)),
        ("work", (0.11, 0.03, 0.57, 0.18, 0.01)),
        ("initial_slope", (0.61, 0.01, 0.07, 0.0, 0.22)),
    )
}


@lru_cache
def curves(kind: str = "good") -> dict[str, np.ndarray]:
    """Columns of curves.csv: a cut with a skin peak, a fitted and an unfitted simulation, null models."""
    strength, dulled = (0.72, 2.5) if kind == "failed" else (1.0, 1.0)
    s, real = _measured()
    edge = strength * ThreeTermCurve(5.3, 2.0e-3 * dulled, 2.3, 4.4e-3, 1.5e-3 * dulled, 0.0, 0.021).force(s)
    face = ThreeTermCurve(0.0, 1e-3, 0.0, 0.0, 1e-3, 252.0, 0.0215).force(s)
    start = ThreeTermCurve(6.4, 1.0e-3, 1.4, 3.0e-3, 1.5e-3, 90.0, 0.03).force(s)
    out = {"stroke_m": s, "real_N": real, "sim_N": edge + face, "residual_N": edge + face - real,
           "edge_N": edge, "face_N": face, "start_N": start}  # fmt: skip
    out |= {f"{name}_N": model.curve for name, model in _nulls().items()}
    if kind == "interrupted":
        return out
    half = (0.25 + 0.035 * out["sim_N"]) * (3.3 if kind == "failed" else 1.0)
    return out | {"band_low_N": out["sim_N"] - half, "band_high_N": out["sim_N"] + half}


def summary(kind: str = "good") -> dict[str, Any]:
    """The summary of a ``good``, ``reconstructed``, ``failed`` or ``interrupted`` calibration."""
    data = deepcopy(_base(kind))
    changes = {"reconstructed": _reconstruct, "failed": _fail, "interrupted": _interrupt}
    if kind != "good":
        changes[kind](data)
    coarse, failed = 9, data["failed_simulations"]
    fine = data["simulations"] - coarse
    data["kept"] = {"coarse": {"simulations": coarse, "failed": 0}, "fine": {"simulations": fine, "failed": failed}}
    data["profiles"] = {} if kind == "interrupted" else profiles(data["parameters"])
    return data


def write_run(folder: Path, kind: str = "good", **changes: Any) -> Path:
    """Write the folder of a calibration of a kind, with top-level entries of the summary replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    data = summary(kind)
    (folder / "summary.json").write_text(json.dumps(data | changes, indent=1))
    columns = curves(kind)
    table = np.column_stack(list(columns.values()))
    np.savetxt(folder / "curves.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.8g")
    time, raw, tared = record()
    with h5py.File(folder / "evaluations.h5", "w") as store:
        for name, values in (("time_s", time), ("raw_N", raw), ("tared_N", tared)):
            store.create_dataset(f"conditioning/{name}", data=values)
        status, columns = runs(data)
        store.create_dataset("status", data=status, dtype=h5py.string_dtype())
        for name, values in columns.items():
            store.create_dataset(f"parameters/{name}", data=values)
    return folder


def runs(data: dict[str, Any]) -> tuple[list[str], dict[str, np.ndarray]]:
    """Status and parameter values of the simulations of a summary: spread about the fit, then those that failed."""
    whole = data["simulations"] - data["failed_simulations"]
    random = np.random.default_rng(3)
    columns = {}
    for name, p in data["parameters"].items():
        good = p["value"] * np.exp(0.3 * random.standard_normal(whole))
        columns[name] = np.append(good, [f["parameters"].get(name, np.nan) for f in data["failures"]])
    return ["ok"] * whole + ["failed"] * len(data["failures"]), columns


def pages(pdf: bytes) -> int:
    """Number of page objects of a PDF."""
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


def spaced(text: str) -> str:
    """Text with ordinary spaces in place of those that do not break."""
    return text.replace(NBSP, " ")


def record() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], raw and tared force [N] of the whole record at 1 kHz: waiting, cut, retraction."""
    time = np.arange(0.0, 4.6, 1e-3)
    end = ONSET_S + STROKE_M / SPEED
    force = np.interp(time, ONSET_S + curves()["stroke_m"] / SPEED, curves()["real_N"], left=0.0)
    force = np.where(time > end, force * np.exp(-(time - end) / 0.03) - 0.6 * (time > end + 0.05), force)
    tared = force + NOISE_N * np.random.default_rng(7).standard_normal(len(time))
    return time, tared + BASELINE_N, tared


def _measured() -> tuple[np.ndarray, np.ndarray]:
    """Stroke [m] and force [N] of the cut."""
    s = np.linspace(0.0, STROKE_M, 240)
    wobble = 0.18 * np.sin(2 * np.pi * s / 0.007) * np.clip(s / 0.004, 0.0, 1.0)
    return s, ThreeTermCurve(5.2, 1.8e-3, 2.6, 4.5e-3, 1.4e-3, 260.0, 0.021).force(s) + wobble


@lru_cache
def _nulls() -> dict[str, NullModel]:
    return null_models(*_measured())


@lru_cache
def _base(kind: str) -> dict[str, Any]:
    columns = curves(kind)
    s, real = columns["stroke_m"], columns["real_N"]
    m = compare(s, real, columns["sim_N"]).as_dict()
    nulls = {
        name: {k: n.metrics.as_dict()[k] for k in ("nrmse", "shape_error", "peak_error", "work_error")}
        | {"R": n.metrics.iso18571.R}
        for name, n in _nulls().items()
    }
    return {
        "food": "banana", "created": "2026-03-14T15:09:26+00:00", "status": "done", "passed": True,
        "verdicts": _verdicts(m), "trace_sha256": SHA256,
        "trace": {"source": "banana_run03.csv", "label": "measured", "sha256": SHA256,
                  "samples": 4600, "duration_s": 4.6,
                  "columns": {"time": "time_s", "force": "base_Fz_N", "position": "ee_z_m"}},
        "air": None, "baseline_N": BASELINE_N, "baseline_sd_N": 0.0043, "baseline_kind": "constant",
        "onset_s": ONSET_S, "onset_sd_s": 0.0061, "end_s": ONSET_S + STROKE_M / SPEED, "stroke_m": STROKE_M,
        "stroke_source": "position", "noise_sd_N": NOISE_N, "filter_sd_m": 3e-4,
        "peak_real_N": m["peak_real_N"], "peak_real_sd_N": 0.021, "peak_sim_N": m["peak_sim_N"],
        "peak_error": m["peak_error"], "shape_error": m["shape_error"], "nrmse": m["nrmse"],
        "work_error": m["work_error"], "metrics": m,
        "sprague_geers": m["sprague_geers"], "iso18571": m["iso18571"],
        "null_models": nulls,
        "parameters": {name: dict(zip(VALUE, row, strict=True), status="fitted")
                       for name, row in FITTED.items()},
        "correlations": {"E,yield_stress": -0.62, "E,mu": -0.94, "R,R_skin": 0.11, "E,R": -0.31},
        "fixed_parameters": {name: dict(zip(("value", "unit", "status", "source"), row, strict=True))
                             for name, row in FIXED.items()},
        "nuisances": _nuisances(), "reduced_chi2": 1.3, "correlation_length_m": 2.1e-3,
        "predictive_inside": _inside(columns), "sensitivity": SENSITIVITY,
        "simulations": 61, "failed_simulations": 2, "failures": _failures(2),
        "misfit_history": [[1, 412.0], [3, 160.0], [9, 71.0], [14, 30.2], [22, 21.0], [31, 18.7], [58, 18.5]],
        "wall_s": 2531.0, "dx_m": 1.5e-3, "particles": 118344, "mirror_images": 2, "mach": 0.0086,
        "energy_J": {"kinetic": 0.001, "elastic": 0.002, "plastic": 0.02, "damage": 0.0, "viscous": 0.001,
                     "friction": 0.03, "parting": 0.24, "unbooked": 0.006},
        "counters": {"inverted": 0, "left_grid": 0}, "coarse_simulations": 9,
        "momentum_residual": 0.0021, "ke_over_ie": 0.013, "ripple_N": 0.11,
        "shape": {"kind": "cylinder", "length": 0.1, "width": 0.033, "height": 0.033},
        "knife": {"name": "kitchen", "spine": 2e-3, "angle": 0.0445, "height": 0.045, "length": 0.2, "radius": 0.0},
        "versions": {"cutcal": "0.1.0", "python": "3.11.9", "taichi": "1.7.4", "numpy": "2.4.6",
                     "scipy": "1.17.1", "h5py": "3.16.0"},
        "git": "9f2c1e07d5b84a3396e1f0c2ab47d8e6315c9a70", "seed": 0, "device": "CPU x64, 2 threads, 32 bit",
        "command": ["calibrate", "--food", "banana", "--trace", "banana_run03.csv", "--out", "out/banana"],
        "warnings": ["the baseline drifts by 0.0131 N/s before contact, 0.039 N over the cut (0.3 % of "
                     "the peak); it was not removed: give an air run with --air"],
        "limits": ["One cut was fitted. Nothing here says how much another banana differs.",
                   "The values are constants of this simulation; they are not measured material properties.",
                   "No cut was held out: the curve error is in-sample.",
                   "The material has no rate dependence; another knife speed is an extrapolation."],
    }  # fmt: skip


def _verdicts(m: dict[str, Any]) -> list[dict[str, Any]]:
    def line(name: str, value: Any, limit: Any, unit: str, passed: bool | None, note: str = "") -> Any:
        return {"name": name, "value": value, "limit": limit, "unit": unit, "passed": passed, "note": note}

    below = [("Peak error", m["peak_error"], 0.05, "fraction", "repeatability of the trace is 0.2 %"),
             ("NRMSE", m["nrmse"], 0.05, "fraction", "root mean square difference over the measured peak"),
             ("Shape error", m["shape_error"], 0.05, "-", "each curve over its own peak"),
             ("Work error", m["work_error"], 0.03, "fraction", "")]  # fmt: skip
    rating = m["iso18571"]["R"]
    return [
        *(line(name, x, limit, unit, abs(x) <= limit, note) for name, x, limit, unit, note in below),
        line("ISO 18571-style R", rating, 0.9, "-", rating >= 0.9),
        line("Null models beaten", 2, 2, "-", True, "in R and in shape") | {"relation": ">="},
        line("Parameters at a bound", 0, 0, "-", True),
        line("Momentum residual", 0.0021, 0.01, "fraction", True),
        line("Kinetic / internal energy", 0.013, 0.05, "fraction", True),
        line("Grid uncertainty of the peak", None, 0.05, "fraction", None, "run cutcal converge"),
        line("Held-out NRMSE", None, 0.1, "fraction", None, "needs a second cut of the same food"),
    ]


def _failures(n: int) -> list[dict[str, Any]]:
    reasons = ("inverted", "not_finite", "stopped")
    values = {"E": 5.1e4, "R": 1180.0, "mu": 0.58, "yield_stress": 5.2e3}
    return [
        {
            "reason": reasons[i % 3],
            "fraction": 0.2 + 0.03 * i,
            "parameters": {name: x * (1.0 + 0.08 * ((i * k) % 7)) for k, (name, x) in enumerate(values.items())},
        }
        for i in range(n)
    ]


def _inside(columns: dict[str, np.ndarray]) -> float | None:
    """Part of the measured curve within the band."""
    if "band_low_N" not in columns:
        return None
    real = columns["real_N"]
    return float(np.mean((real >= columns["band_low_N"]) & (real <= columns["band_high_N"])))


def _nuisances() -> dict[str, Any]:
    """What the fit says of the measurement; the lag is that of the contact at the speed of the cut."""
    rows = {"tare": (-0.0007, 0.0042, 0.0043, "N"), "drift": (0.021, 0.033, 0.039, "N"),
            "lag": (3.1e-5, 4.4e-5, 0.0061 * SPEED, "m"), "gain": (-0.003, 0.019, 0.02, "-"),
            "width": (0.06, 0.11, 0.15, "-")}  # fmt: skip
    names = ("value", "sd", "prior_sd", "unit")
    return {
        name: dict(zip(names, row, strict=True)) | {"outside": abs(row[0]) > 3.0 * row[2]} for name, row in rows.items()
    }


def profiles(parameters: dict[str, Any]) -> dict[str, Any]:
    """Profiles that rise by 3.84 at the ends of the intervals; the trace alone sees as much as the verdict says."""
    alone = {"identified": (0.95, 0.95), "weak": (0.7, 0.75), "only_as_product": (0.7, 0.7), "one_sided": (0.9, 0.02)}
    out = {}
    for name, p in parameters.items():
        log = p["unit"] != "-"
        z, low, high = (np.log(x) if log and x else x for x in (p["value"], p["low95"], p["high95"]))
        high = z + 3.0 if high is None else high
        parts = np.linspace(-1.5, 1.5, 15)
        at = z + np.where(parts < 0.0, parts * (z - low), parts * (high - z))
        rise = 3.84 * parts**2
        share = np.where(parts < 0.0, *alone.get(p["verdict"], (0.03, 0.03)))
        value = np.exp(at) if log else at
        columns = {"value": value, "rise": rise, "trace_alone": share * rise}
        out[name] = {key: column[value >= 0.0].tolist() for key, column in columns.items()}
    return out


def _reconstruct(data: dict[str, Any]) -> None:
    data["trace"] |= {"source": "banana_reconstructed.csv", "label": "reconstructed", "samples": 240,
                      "duration_s": 3.2, "columns": {"time": "time_s", "force": "force_N"}}  # fmt: skip
    data |= {"stroke_source": "height", "onset_sd_s": 0.0, "baseline_sd_N": 0.0, "git": None}
    data["warnings"].append("banana_reconstructed.csv is a reconstruction, not a measurement")


def _fail(data: dict[str, Any]) -> None:
    data |= {"passed": False, "simulations": 70, "failed_simulations": 21, "failures": _failures(21),
             "air": {"source": "air_run01.csv", "sha256": "c0ffee00" * 8}, "baseline_kind": "air",
             "baseline_sd_N": 0.031, "reduced_chi2": 14.2, "momentum_residual": 0.034,
             "counters": {"inverted": 12, "left_grid": 3}}  # fmt: skip
    data["nuisances"]["tare"] |= {"value": -0.012, "sd": 0.03, "prior_sd": 0.031}
    data["nuisances"]["gain"] |= {"value": 0.083, "sd": 0.017, "outside": True}
    for line in data["verdicts"]:
        if line["name"] in ("Momentum residual", "Parameters at a bound"):
            line |= {"passed": False, "value": 0.034 if line["unit"] == "fraction" else 1}
    data["iso18571"] |= {"at_bound": True, "shift": 48}
    data["parameters"]["mu"] |= {"verdict": "not_seen", "low95": 0.0, "high95": None, "value": 0.74}
    data["parameters"]["yield_stress"] |= {"verdict": "at_bound", "value": 4e5, "low95": 2.1e5, "high95": 9e8}
    data["correlations"] |= {"E,yield_stress": 0.97, "R,R_skin": -0.913}
    sentences = (
        "21 of 70 simulations broke down; where they lie the fit is blind, and the intervals do not say it",
        "yield_stress ended at its bound of 400 kPa: the trace asks for a value that was not allowed",
        "the force columns differ: base_Fz_N in the cut, knife_Fz_N in the air run",
        "air run and cut differ by up to 3.2 mm in height before contact: not the same motion",
    )
    data["warnings"] = [f"{i + 1} of 12: {sentences[i % 4]}" for i in range(12)]


def _interrupt(data: dict[str, Any]) -> None:
    data |= {"status": "interrupted", "passed": False, "simulations": 17, "failed_simulations": 0}
    data |= {"nuisances": {}, "reduced_chi2": None, "correlation_length_m": None, "sensitivity": {}}
    data |= {"failures": [], "misfit_history": data["misfit_history"][:4], "correlations": {}, "warnings": []}
    for p in data["parameters"].values():
        p |= {"low95": None, "high95": None, "verdict": "not_determined"}
