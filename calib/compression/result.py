"""What the calibration of a modulus ends with: ``compress.json``, and the curves of ``curves.csv``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import pandas as pd

from calib.compression.measured import MeasuredFile
from calib.compression.modulus import ModulusAtNu
from calib.compression.press import PressRun
from calib.io.folder import write_csv, write_json
from calib.io.typed_document import FLAT, to_document
from calib.validation.acceptance import Verdict
from mpm.arrays import FloatArray
from mpm.shapes import Shape

RESULT_FILE, CURVES_FILE = "compress.json", "curves.csv"


@dataclass(frozen=True)
class SpecimenSizes:
    """The specimen: kind of shape, sizes [m], area under the plate [m^2]."""

    kind: str
    length: float
    width: float
    height: float
    area_m2: float

    @classmethod
    def of(cls, shape: Shape, area: float) -> SpecimenSizes:
        """Those of a shape with its area under the plate [m^2]."""
        return cls(shape.kind, shape.length, shape.width, shape.height, area)


@dataclass(frozen=True)
class Assumptions:
    """What the test does not tell: Poisson's ratio [-], and whether the plates are ``frictionless`` or ``bonded``."""

    nu: float
    plates: str


@dataclass(frozen=True)
class FittedModulus:
    """Young's modulus.

    Attributes:
        window: First and last strain of the fit [-].
        mean_Pa: Mean of the repeats [Pa].
        sd_Pa: Standard deviation between the repeats [Pa], NaN for one.
        low_Pa: Lower end of the 95 % interval of the mean [Pa], NaN for one repeat.
        high_Pa: Its upper end [Pa].
        repeats: Number of repeats.
    """

    window: tuple[float, float]
    mean_Pa: float
    sd_Pa: float
    low_Pa: float
    high_Pa: float
    repeats: int


@dataclass(frozen=True)
class SmallStrainModulus:
    """Slope of the stress over a small strain, measured and fitted.

    Attributes:
        window: First and last strain [-].
        measured_Pa: Mean of the repeats [Pa].
        measured_sd_Pa: Standard deviation between them [Pa], None for one.
        fitted_Pa: Slope of the fitted curve [Pa].
        error: Fitted over measured, less 1 [-].
    """

    window: tuple[float, float]
    measured_Pa: float
    measured_sd_Pa: float | None
    fitted_Pa: float
    error: float


@dataclass(frozen=True)
class ForceError:
    """Largest relative error of the fitted force.

    Attributes:
        from_strain: Strain from which it is taken [-].
        value: The error, with its sign [-].
        strain: Strain where it is [-].
    """

    from_strain: float
    value: float
    strain: float


@dataclass(frozen=True)
class OtherPlates:
    """Young's modulus [Pa] if the plates were ``frictionless`` in place of ``bonded``, or the other way."""

    plates: str
    E_Pa: float


@dataclass(frozen=True)
class RepeatModulus:
    """One repeat: its name, Young's modulus [Pa] and slope over a small strain [Pa]."""

    name: str
    E_Pa: float
    slope_Pa: float


@dataclass(frozen=True)
class PressSimulation:
    """The press that was simulated, with the seed of its particles and its device."""

    run: PressRun = field(metadata=FLAT)
    seed: int
    arch: str


@dataclass(frozen=True, kw_only=True)
class CompressionResult:
    """A calibrated modulus.

    Attributes:
        command: Words of the command line.
        specimen: The specimen.
        assumed: What the test does not tell.
        E: Young's modulus.
        slope: Modulus over a small strain.
        nrmse: Root mean square difference of the curves over the largest measured stress [-].
        force_error: Largest relative error of the force.
        solver_error: Largest error of the solver against the closed form [-]; None between bonded plates.
        grid_change: Change from a coarser grid [-]; None between frictionless plates.
        sensitivity: The modulus at other Poisson's ratios; None between bonded plates.
        bracket: The modulus if the plates were the other way; None where that was not simulated.
        repeats: The repeats.
        verdicts: Lines of the verdict.
        not_shown: What the result does not show, in words.
        simulation: The press that was simulated.
        files: Files of the test.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
    """

    DOCUMENT: ClassVar[str] = "compress"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "specimen", "assumed", "E", "slope", "nrmse", "force_error", "solver_error", "grid_change",
        "sensitivity", "bracket", "repeats", "verdicts", "passed", "not_shown", "simulation", "files", "versions",
        "git",
    )  # fmt: skip

    command: tuple[str, ...]
    specimen: SpecimenSizes
    assumed: Assumptions
    E: FittedModulus
    slope: SmallStrainModulus
    nrmse: float
    force_error: ForceError
    solver_error: float | None
    grid_change: float | None
    sensitivity: tuple[ModulusAtNu, ...] | None
    bracket: OtherPlates | None
    repeats: tuple[RepeatModulus, ...]
    verdicts: tuple[Verdict, ...]
    not_shown: tuple[str, ...]
    simulation: PressSimulation
    files: tuple[MeasuredFile, ...]
    versions: Mapping[str, str]
    git: str | None

    @property
    def passed(self) -> bool:
        """Whether every line of the verdict passed."""
        return all(line.passed for line in self.verdicts)


@dataclass(frozen=True, eq=False)
class StressCurves:
    """Stress over strain, measured and fitted.

    Attributes:
        strain: Engineering strain [-], shape (n,).
        measured: Mean of the repeats [Pa], shape (n,).
        sd: Standard deviation between them [Pa], shape (n,), NaN for one.
        fitted: The fitted curve [Pa], shape (n,).
        repeats: Each repeat [Pa], shape (n,), by its name.
    """

    strain: FloatArray
    measured: FloatArray
    sd: FloatArray
    fitted: FloatArray
    repeats: Mapping[str, FloatArray]


AROUND_REPEAT = ("repeat_", "_Pa")
"""What stands before and after the name of a repeat in the name of its column."""


def write_result(result: CompressionResult, curves: StressCurves, out: Path) -> None:
    """Write ``curves.csv`` and ``compress.json``.

    Args:
        result: The calibrated modulus.
        curves: The curves.
        out: Output folder.

    Raises:
        OutputError: A file cannot be written.
    """
    before, after = AROUND_REPEAT
    columns = {
        "strain": curves.strain,
        "measured_Pa": curves.measured,
        "sd_Pa": curves.sd,
        "fitted_Pa": curves.fitted,
        **{f"{before}{name}{after}": row for name, row in curves.repeats.items()},
    }
    write_csv(out / CURVES_FILE, columns)
    write_json(out / RESULT_FILE, to_document(result))


def read_curves(folder: Path) -> StressCurves:
    """Read ``curves.csv`` of a folder, as :func:`write_result` wrote it."""
    columns = {str(name): values.to_numpy(float) for name, values in pd.read_csv(folder / CURVES_FILE).items()}
    before, after = AROUND_REPEAT
    repeats = {
        name.removeprefix(before).removesuffix(after): values
        for name, values in columns.items()
        if name.startswith(before)
    }
    return StressCurves(columns["strain"], columns["measured_Pa"], columns["sd_Pa"], columns["fitted_Pa"], repeats)
