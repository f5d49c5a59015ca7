"""What the calibration of a modulus ends with: ``compress.json``, and the curves of ``curves.csv``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

import pandas as pd

from calib.compression.measured import CompressionFile
from calib.compression.modulus import ModulusAtNu
from calib.compression.press import PressRun
from calib.io.folder import write_csv, write_json
from calib.io.provenance import CommandLine, Commit, DeviceName, Seed, Versions
from calib.io.type_schema import Count, NotNegative, NumberOrNull, Positive, Shared, keywords, one_of
from calib.io.typed_document import FLAT, to_document
from calib.validation.acceptance import Verdict
from mpm.arrays import FloatArray
from mpm.scene.shapes import Shape

RESULT_FILE, CURVES_FILE = "compress.json", "curves.csv"
ONE = keywords(description="One of them")
Plates = Annotated[str, one_of("frictionless", "bonded")]
Window = Annotated[tuple[float, float], keywords(prefixItems=None, items={"type": "number"})]


@dataclass(frozen=True)
class SpecimenSizes:
    """The specimen: kind of shape, sizes [m], area under the plate [m^2].

    Attributes:
        kind: Outline.
        length: Length, or diameter [m].
        width: Width, or diameter [m].
        height: Height [m].
        area_m2: Area under the plate [m^2].
    """

    kind: Annotated[str, one_of("block", "upright_cylinder")]
    length: Positive
    width: Positive
    height: Positive
    area_m2: Positive

    @classmethod
    def of(cls, shape: Shape, area: float) -> SpecimenSizes:
        """Those of a shape with its area under the plate [m^2]."""
        return cls(shape.kind, shape.length, shape.width, shape.height, area)


@dataclass(frozen=True)
class Assumptions:
    """What the test does not tell: Poisson's ratio [-], and whether the plates are ``frictionless`` or ``bonded``.

    Attributes:
        nu: Poisson's ratio.
        plates: What the food does at the plates: slides without friction, or sticks.
    """

    nu: float
    plates: Plates


@dataclass(frozen=True)
class FittedModulus:
    """Young's modulus.

    Attributes:
        window: Strains between which it is fitted.
        mean_Pa: Mean of the repeats [Pa].
        sd_Pa: Their standard deviation [Pa]; null for one repeat.
        low_Pa: Lower end of the 95 % interval of the mean [Pa]; null for one repeat.
        high_Pa: Upper end [Pa]; null for one repeat.
        repeats: Number of repeats.
    """

    window: Window
    mean_Pa: Positive
    sd_Pa: NumberOrNull
    low_Pa: NumberOrNull
    high_Pa: NumberOrNull
    repeats: Count


@dataclass(frozen=True)
class SmallStrainModulus:
    """Slope of the stress over a small strain, measured and fitted.

    Attributes:
        window: Strains between which it is taken.
        measured_Pa: Mean of the repeats [Pa].
        measured_sd_Pa: Their standard deviation [Pa]; null for one repeat.
        fitted_Pa: Of the fitted curve [Pa].
        error: Fitted over measured less 1.
    """

    window: Window
    measured_Pa: float
    measured_sd_Pa: float | None
    fitted_Pa: Positive
    error: float


@dataclass(frozen=True)
class ForceError:
    """Largest relative error of the fitted force.

    Attributes:
        from_strain: Strain from which it is taken.
        value: The error, a fraction.
        strain: Strain where it is.
    """

    from_strain: Positive
    value: float
    strain: float


@dataclass(frozen=True)
class OtherPlates:
    """Young's modulus [Pa] if the plates were ``frictionless`` in place of ``bonded``, or the other way.

    Attributes:
        plates: What the food does at the plates: slides without friction, or sticks.
        E_Pa: Modulus [Pa].
    """

    plates: Plates
    E_Pa: Positive


@dataclass(frozen=True)
class RepeatModulus:
    """One repeat: its name, Young's modulus [Pa] and slope over a small strain [Pa].

    Attributes:
        name: Its name.
        E_Pa: Modulus [Pa].
        slope_Pa: Slope over a small strain [Pa].
    """

    name: str
    E_Pa: Positive
    slope_Pa: float


@dataclass(frozen=True)
class PressSimulation:
    """The press that was simulated, with the seed of its particles and its device.

    Attributes:
        run: The simulation.
        seed: Seed of the particles, and of the search or the draws where there are any.
        arch: Device of the simulations.
    """

    run: PressRun = field(metadata=FLAT)
    seed: Seed
    arch: DeviceName


@dataclass(frozen=True, kw_only=True)
class CompressionResult:
    """Young's modulus from a compression test.

    ``compress.json`` of ``cutcal compress``, and what ``cutcal compress --json`` prints.

    Attributes:
        command: Command line, or the call from Python, that made the document.
        specimen: The specimen.
        assumed: What the test does not tell.
        E: Young's modulus.
        slope: Slope of stress over a small strain.
        nrmse: Root mean square difference of fitted and mean measured stress over the largest, a fraction.
        force_error: Largest error of the force.
        solver_error: Largest error of the solver against the closed form; null between bonded plates.
        grid_change: Change from a coarser grid; null between frictionless plates.
        sensitivity: Modulus at other Poisson's ratios; null between bonded plates.
        bracket: The modulus if the plates were the other way, with --bracket; null without.
        repeats: Repeats.
        verdicts: Lines of the verdict.
        not_shown: What the result does not show, one sentence each.
        simulation: The press that was simulated.
        files: Files of the test.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    DOCUMENT: ClassVar[str] = "compress"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "specimen", "assumed", "E", "slope", "nrmse", "force_error", "solver_error", "grid_change",
        "sensitivity", "bracket", "repeats", "verdicts", "passed", "not_shown", "simulation", "files", "versions",
        "git",
    )  # fmt: skip

    command: CommandLine
    specimen: SpecimenSizes
    assumed: Assumptions
    E: FittedModulus
    slope: SmallStrainModulus
    nrmse: NotNegative
    force_error: ForceError
    solver_error: float | None
    grid_change: float | None
    sensitivity: Annotated[tuple[Annotated[ModulusAtNu, ONE], ...], keywords(type=("array", "null"))] | None
    bracket: Annotated[OtherPlates, keywords(description=None)] | None
    repeats: Annotated[tuple[Annotated[RepeatModulus, ONE], ...], keywords(minItems=1)]
    verdicts: Annotated[tuple[Annotated[Verdict, Shared("verdict")], ...], keywords(minItems=1)]
    not_shown: Annotated[tuple[str, ...], Shared("limits")]
    simulation: PressSimulation
    files: Annotated[tuple[CompressionFile, ...], keywords(minItems=1)]
    versions: Versions
    git: Commit

    @property
    def passed(self) -> bool:
        """Whether every line passed."""
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
