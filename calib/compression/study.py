"""One compression test from files to files: read, press, fit, judge, write."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from calib.compression.measured import SMALL, area, read_repeats
from calib.compression.modulus import Fit, fit, scale, sensitivity
from calib.compression.press import CONTACT, Say, grid_change, press_scene, solver_error, unit_curve
from calib.errors import CurveError
from calib.io.folder import prepare, write_csv, write_json
from calib.io.provenance import git_commit, versions
from calib.io.schema import tag
from calib.validation.acceptance import Verdict
from mpm.scene.shapes import Shape

NRMSE_LIMIT = 0.05
SLOPE_LIMIT = 0.10
SOLVER_LIMIT = 0.03
COARSER = 2 / 3
"""Part of the cells on which the press between bonded plates is repeated [-]."""


def judge(found: Fit, error: float | None, change: float | None) -> list[Verdict]:
    """The lines of the verdict.

    Args:
        found: The fit.
        error: ``solver_error``, None between bonded plates, where there is no closed form.
        change: ``grid_change``, None between frictionless plates.
    """
    lines = [
        ("curve error (NRMSE)", found.nrmse, NRMSE_LIMIT, ""),
        ("modulus 0-5 %, fitted against measured", found.slope_error, SLOPE_LIMIT, ""),
    ]
    if error is not None:
        lines.append(("solver_error", error, SOLVER_LIMIT, "numerics; raise --cells"))
    if change is not None:
        lines.append(("change from a coarser grid", change, SOLVER_LIMIT, "numerics; raise --cells"))
    return [
        Verdict(name, value, limit, "fraction", abs(value) <= limit, "" if abs(value) <= limit else hint)
        for name, value, limit, hint in lines
    ]


def unshown(nu: float, bonded: bool, bracket: bool, repeats: int) -> list[str]:
    """What the result does not show, in words.

    Args:
        nu: Poisson's ratio [-].
        bonded: The plates are bonded.
        bracket: The other plates were simulated too.
        repeats: Number of repeats.
    """
    other = "" if bracket else f"; --bracket gives the modulus with {_plates(not bonded)} ones"
    out = [
        f"nu = {nu:g} is assumed: a compression force alone does not tell E from nu",
        f"the plates are assumed to be {_plates(bonded)}: friction is not measured{other}",
        "the first sample of each repeat is taken as contact; no toe is corrected",
        "nothing is shown about yield, rate or fracture",
    ]
    if repeats == 1:
        out.append("one repeat: no standard deviation and no interval")
    else:
        out.append("the interval is of the repeats alone, not of nu, plates or numerics")
    if bonded:
        out.append(
            "bonded plates have no closed form: the solver's error is judged by a coarser grid, and how the modulus changes "
            "with nu is not shown"
        )
    return out


def _plates(bonded: bool) -> str:
    return "bonded" if bonded else "frictionless"


def run(
    paths: Sequence[str | Path],
    shape: Shape,
    nu: float,
    out: Path,
    *,
    strain: float,
    cells: int,
    bonded: bool = False,
    bracket: bool = False,
    compression_col: str | None = None,
    force_col: str | None = None,
    seed: int = 0,
    arch: str = "cpu",
    about: Mapping[str, Any],
    say: Say,
) -> dict[str, Any]:
    """Calibrate and write compress.json, curves.csv and compress.svg.

    Args:
        paths: CSV, JSON or HDF5 files of one material.
        shape: The specimen.
        nu: Poisson's ratio [-].
        out: Output folder.
        strain: Largest engineering strain that is fitted [-].
        cells: Cells over the height.
        bonded: The food sticks to the plates; else they are frictionless.
        bracket: Simulate the other plates too, and give the modulus that they imply.
        compression_col: Column of the compression.
        force_col: Column of the load.
        seed: Seed of the particles.
        arch: Device.
        about: What compress.json says beside the result.
        say: Called with a line before each simulation, and every few seconds in it.

    Returns:
        The content of compress.json.

    Raises:
        CutcalError: Bad input, a run that broke down, or a folder that cannot be used.
    """
    if bonded and round(COARSER * cells) < 4:
        raise CurveError(f"--cells {cells}: bonded plates need 6 or more, because a coarser grid judges the error")
    scene = press_scene(shape, nu, strain, cells=cells, bonded=bonded, seed=seed)
    measured = read_repeats(paths, shape, strain, compression_col=compression_col, force_col=force_col)
    prepare(out, resume=False)
    say(f"pressing to a strain of {strain:g} on {cells} cells over the height, plates {_plates(bonded)}")
    unit = unit_curve(scene, strain, arch=arch, say=say)
    found = fit(measured, unit)
    error, change = None, None
    if bonded:
        fewer = round(COARSER * cells)
        say(f"pressing again on {fewer} cells")
        coarse = press_scene(shape, nu, strain, cells=fewer, bonded=True, seed=seed)
        change = grid_change(unit, unit_curve(coarse, strain, arch=arch, say=say))
    else:
        error = solver_error(unit, nu)
    other = None
    if bracket:
        say(f"pressing again, plates {_plates(not bonded)}")
        second = press_scene(shape, nu, strain, cells=cells, bonded=not bonded, seed=seed)
        modulus = scale(unit_curve(second, strain, arch=arch, say=say).stress, measured.stress).mean()
        other = {"plates": _plates(not bonded), "E_Pa": float(modulus)}
    lines = judge(found, error, change)
    document: dict[str, Any] = {
        "schema": tag("compress"),
        **about,
        "specimen": {
            **{name: getattr(shape, name) for name in ("kind", "length", "width", "height")},
            "area_m2": area(shape),
        },
        "assumed": {"nu": nu, "plates": _plates(bonded)},
        "E": {
            "window": [0.0, strain],
            "mean_Pa": found.mean,
            "sd_Pa": found.sd,
            "low_Pa": found.low,
            "high_Pa": found.high,
            "repeats": len(found.E),
        },
        "slope": {
            "window": [0.0, SMALL],
            "measured_Pa": measured.slope.mean(),
            "measured_sd_Pa": measured.slope.std(ddof=1) if len(found.E) > 1 else None,
            "fitted_Pa": found.slope,
            "error": found.slope_error,
        },
        "nrmse": found.nrmse,
        "force_error": {"from_strain": CONTACT, "value": found.force_error, "strain": found.force_error_at},
        "solver_error": error,
        "grid_change": change,
        "sensitivity": None if bonded else sensitivity(measured, nu, found.mean),
        "bracket": other,
        "repeats": [
            {"name": name, "E_Pa": modulus, "slope_Pa": small}
            for name, modulus, small in zip(measured.names, found.E, measured.slope, strict=True)
        ],
        "verdicts": [line.as_dict() for line in lines],
        "passed": all(line.passed for line in lines),
        "not_shown": unshown(nu, bonded, bracket, len(found.E)),
        "simulation": {**unit.about, "seed": seed, "arch": arch},
        "files": measured.files,
        "versions": versions(),
        "git": git_commit(),
    }
    deviation = measured.stress.std(axis=0, ddof=1) if len(found.E) > 1 else np.full(len(unit.strain), math.nan)
    columns = {"strain": unit.strain, "measured_Pa": measured.mean, "sd_Pa": deviation, "fitted_Pa": found.stress}
    columns |= {f"repeat_{name}_Pa": row for name, row in zip(measured.names, measured.stress, strict=True)}
    write_csv(out / "curves.csv", columns)
    write_json(out / "compress.json", document)
    from reports.compression import write_figure

    write_figure(out)
    return document
