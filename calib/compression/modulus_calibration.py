"""Young's modulus from the files of a compression test: read, press, fit, check, write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.compression.measured import SMALL_STRAIN, MeasuredCompression, area, read_repeats
from calib.compression.modulus import ModulusFit, fit_modulus, modulus_at_other_nu, scaled_modulus
from calib.compression.press import (
    CONTACT_STRAIN,
    Say,
    UnitCurve,
    grid_change,
    press_scene,
    solver_error,
    unit_curve,
)
from calib.compression.report import write_report
from calib.compression.result import (
    Assumptions,
    CompressionResult,
    FittedModulus,
    ForceError,
    OtherPlates,
    PressSimulation,
    RepeatModulus,
    SmallStrainModulus,
    SpecimenSizes,
    StressCurves,
    write_result,
)
from calib.errors import CurveError
from calib.io.folder import prepare
from calib.io.provenance import git_commit, versions
from calib.validation.acceptance import Verdict
from mpm.scene import Scene
from mpm.scene.shapes import Shape

CURVE_ERROR_LIMIT = 0.05
MODULUS_ERROR_LIMIT = 0.10
SOLVER_ERROR_LIMIT = 0.03
COARSER = 2 / 3
"""Part of the cells on which the press between bonded plates is repeated [-]."""
LEAST_CELLS = 4  # over the height, of the coarser grid


@dataclass(frozen=True)
class CompressionTest:
    """What was measured, and what the test does not tell.

    Attributes:
        paths: CSV, JSON or HDF5 files of one material.
        shape: The specimen.
        nu: Poisson's ratio [-].
        strain: Largest engineering strain that is fitted [-].
        bonded: Whether the food sticks to the plates; else they are frictionless.
        compression_col: Column of the compression, None to find it.
        force_col: Column of the load, None to find it.
        sign: Sign of the load that presses, ``+`` or ``-``; None for both way and load positive.
    """

    paths: Sequence[str | Path]
    shape: Shape
    nu: float
    strain: float
    bonded: bool = False
    compression_col: str | None = None
    force_col: str | None = None
    sign: str | None = None


@dataclass(frozen=True)
class PressOptions:
    """How the press is simulated.

    Attributes:
        cells: Cells over the height.
        bracket: Whether the other plates are simulated too, for the modulus that they imply.
        seed: Seed of the particles.
        arch: Device.
    """

    cells: int
    bracket: bool = False
    seed: int = 0
    arch: str = "cpu"


def acceptance_lines(found: ModulusFit, error: float | None, change: float | None) -> list[Verdict]:
    """The lines of the verdict.

    Args:
        found: The fit.
        error: ``solver_error`` [-], None between bonded plates, where there is no closed form.
        change: ``grid_change`` [-], None between frictionless plates.

    Returns:
        A line for each limit.
    """
    hint = "numerics; raise --cells"
    lines = [
        ("curve error (NRMSE)", found.nrmse, CURVE_ERROR_LIMIT, ""),
        ("slope over 0 to 5 % strain, fitted against measured", found.slope_error, MODULUS_ERROR_LIMIT, ""),
    ]
    if error is not None:
        lines.append(("error of the solver against the closed form", error, SOLVER_ERROR_LIMIT, hint))
    if change is not None:
        lines.append(("change from a coarser grid", change, SOLVER_ERROR_LIMIT, hint))
    return [
        Verdict(name, value, limit, "fraction", abs(value) <= limit, "" if abs(value) <= limit else note)
        for name, value, limit, note in lines
    ]


def unshown(test: CompressionTest, bracket: bool, repeats: int) -> list[str]:
    """What the result does not show, in words.

    Args:
        test: The test.
        bracket: Whether the other plates were simulated too.
        repeats: Number of repeats.

    Returns:
        A sentence for each.
    """
    other = "" if bracket else f"; --bracket gives the modulus with {_plates(not test.bonded)} ones"
    out = [
        f"Poisson's ratio nu = {test.nu:g} is assumed: a compression force alone does not tell E from nu",
        f"the plates are assumed to be {_plates(test.bonded)}: friction is not measured{other}",
        "the first sample of each repeat is taken as contact; no toe is corrected",
        "nothing is shown about yield, rate or fracture",
    ]
    if repeats == 1:
        out.append("one repeat: no standard deviation and no interval")
    else:
        out.append("the interval is of the repeats alone, not of nu, plates or numerics")
    if test.bonded:
        out.append(
            "bonded plates have no closed form: the solver's error is judged by a coarser grid, and how the modulus "
            "changes with nu is not shown"
        )
    return out


def _plates(bonded: bool) -> str:
    return "bonded" if bonded else "frictionless"


def calibrate_modulus(
    test: CompressionTest, options: PressOptions, out: Path, *, command: Sequence[str], say: Say
) -> CompressionResult:
    """Calibrate and write compress.json, curves.csv, compress.svg, report.pdf and report.html.

    Args:
        test: What was measured.
        options: How the press is simulated.
        out: Output folder.
        command: Words of the command line.
        say: Called with a line before each simulation, and every few seconds in it.

    Returns:
        What compress.json holds.

    Raises:
        CutcalError: Bad input, a run that broke down, or a folder that cannot be used.
    """
    if test.bonded and round(COARSER * options.cells) < LEAST_CELLS:
        raise CurveError(
            f"--cells {options.cells}: bonded plates need 6 or more, because a coarser grid judges the error"
        )
    scene = _scene(test, options)
    columns = {"compression_col": test.compression_col, "force_col": test.force_col, "sign": test.sign}
    measured = read_repeats(test.paths, test.shape, test.strain, **columns)
    for text in measured.notes:
        say(f"note: {text}")
    with prepare(out, "compress", resume=False):
        plates = _plates(test.bonded)
        say(f"pressing to a strain of {test.strain:g} on {options.cells} cells over the height, plates {plates}")
        unit = unit_curve(scene, test.strain, arch=options.arch, say=say)
        found = fit_modulus(measured, unit.stress)
        error, change = _numerical_errors(test, options, unit, say)
        result = CompressionResult(
            command=tuple(command),
            specimen=SpecimenSizes.of(test.shape, area(test.shape)),
            assumed=Assumptions(test.nu, plates),
            E=FittedModulus((0.0, test.strain), found.mean, found.sd, found.low, found.high, len(found.E)),
            slope=_small_strain_modulus(measured, found),
            nrmse=found.nrmse,
            force_error=ForceError(CONTACT_STRAIN, found.force_error, found.force_error_at),
            solver_error=error,
            grid_change=change,
            sensitivity=None if test.bonded else modulus_at_other_nu(measured, test.nu, found.mean),
            bracket=_other_plates(test, options, measured, say) if options.bracket else None,
            repeats=tuple(
                RepeatModulus(name, float(modulus), float(small))
                for name, modulus, small in zip(measured.names, found.E, measured.slope, strict=True)
            ),
            verdicts=tuple(acceptance_lines(found, error, change)),
            not_shown=(*unshown(test, options.bracket, len(found.E)), *measured.notes),
            simulation=PressSimulation(unit.run, options.seed, options.arch),
            files=measured.files,
            versions=versions(),
            git=git_commit(),
        )
        write_result(result, _curves(measured, found), out)
        write_report(out)
        return result


def _scene(test: CompressionTest, options: PressOptions, *, bonded: bool | None = None, cells: int = 0) -> Scene:
    """The press of a test, or one with other plates or cells."""
    return press_scene(
        test.shape,
        test.nu,
        test.strain,
        cells=cells or options.cells,
        bonded=test.bonded if bonded is None else bonded,
        seed=options.seed,
    )


def _numerical_errors(
    test: CompressionTest, options: PressOptions, unit: UnitCurve, say: Say
) -> tuple[float | None, float | None]:
    """Error against the closed form, or between bonded plates the change from a coarser grid [-]."""
    if not test.bonded:
        return solver_error(unit, test.nu), None
    fewer = round(COARSER * options.cells)
    say(f"pressing again on {fewer} cells")
    coarse = unit_curve(_scene(test, options, cells=fewer), test.strain, arch=options.arch, say=say)
    return None, grid_change(unit, coarse)


def _other_plates(test: CompressionTest, options: PressOptions, measured: MeasuredCompression, say: Say) -> OtherPlates:
    """The modulus if the plates were the other way."""
    plates = _plates(not test.bonded)
    say(f"pressing again, plates {plates}")
    scene = _scene(test, options, bonded=not test.bonded)
    unit = unit_curve(scene, test.strain, arch=options.arch, say=say)
    return OtherPlates(plates, float(scaled_modulus(unit.stress, measured.stress).mean()))


def _small_strain_modulus(measured: MeasuredCompression, found: ModulusFit) -> SmallStrainModulus:
    several = len(found.E) > 1
    return SmallStrainModulus(
        window=(0.0, SMALL_STRAIN),
        measured_Pa=float(measured.slope.mean()),
        measured_sd_Pa=float(measured.slope.std(ddof=1)) if several else None,
        fitted_Pa=found.slope,
        error=found.slope_error,
    )


def _curves(measured: MeasuredCompression, found: ModulusFit) -> StressCurves:
    several = len(found.E) > 1
    sd = measured.stress.std(axis=0, ddof=1) if several else np.full(len(measured.strain), math.nan)
    repeats = dict(zip(measured.names, measured.stress, strict=True))
    return StressCurves(measured.strain, measured.mean, sd, found.stress, repeats)
