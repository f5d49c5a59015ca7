"""What a convergence study ends with: ``converge.json``, and the curves of ``curves.csv``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pandas as pd

from calib.errors import DocumentError
from calib.io.folder import write_csv, write_json
from calib.io.typed_document import REMEDY, read_document, to_document
from mpm.arrays import FloatArray
from mpm.scene.shapes import Shape
from studies.convergence.gci import Estimate

RESULT_FILE, CURVES_FILE = "converge.json", "curves.csv"


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """One run: the value that was varied, and what came out.

    Attributes:
        dx_m: Cell size [m], of a run on one of the grids; each of the next six is of a run of its own axis.
        safety: Time step over its limit [-].
        mach: Speed of the blade over that of the P-wave [-].
        ppc: Particles per cell and direction.
        offset: Place of the blade in the grid [cells].
        repeat: Number of a run with other particles and the grid elsewhere, 0 for the one that they differ from.
        value: Of a constant of the method [SI].
        peak_N: Largest force [N]; this and the next numbers are None where the run broke down.
        work_J: Work [J].
        parted: Energy that the edge has taken over R times the new area [-]; NaN where there is nothing to judge.
        particles: Particles of the simulated part.
        steps: Time steps.
        momentum_residual: Part of the momentum balance that does not close, over the largest force [-].
        ke_over_ie: Kinetic over internal energy [-].
        ripple_N: Ripple of the force [N].
        wall_s: Run time [s].
        status: ``ok`` or ``failed``.
        reason: Why the run broke down, empty where it did not.
        fraction: Part of the stroke that was reached [-].
    """

    dx_m: float | None = None
    safety: float | None = None
    mach: float | None = None
    ppc: float | None = None
    offset: float | None = None
    repeat: float | None = None
    value: float | None = None
    peak_N: float | None
    work_J: float | None
    parted: float | None
    particles: float | None
    steps: float | None
    momentum_residual: float | None
    ke_over_ie: float | None
    ripple_N: float | None
    wall_s: float
    status: str
    reason: str
    fraction: float

    @property
    def ok(self) -> bool:
        """Whether the run came to its end."""
        return self.status == "ok"


@dataclass(frozen=True, kw_only=True)
class AxisResult:
    """What one thing changes that is varied apart from the cell size.

    Attributes:
        rows: The runs, by rising value.
        spread_peak: Largest distance of a peak from their mean, a fraction of it [-]; None with fewer than two peaks.
        slope_peak: Log-log slope of the peak over the speed [-]; None for other axes.
        spread_work: Largest distance of a work from their mean, a fraction of it [-].
        slope_work: Log-log slope of the work over the speed [-].
    """

    rows: tuple[RunResult, ...]
    spread_peak: float | None = None
    slope_peak: float | None = None
    spread_work: float | None = None
    slope_work: float | None = None


@dataclass(frozen=True, kw_only=True)
class ConstantResult(AxisResult):
    """What a constant of the method changes.

    Attributes:
        name: What it is, in words.
    """

    name: str


@dataclass(frozen=True)
class ConvergenceLimits:
    """What counts as converged.

    Attributes:
        work: Largest change of the work between the two finest grids [-].
        peak: Largest change of the peak between them [-].
        gci: Largest grid convergence index of either on the finest grid [-]; None in documents of versions that did not
            ask for it.
    """

    work: float
    peak: float
    gci: float | None = None


@dataclass(frozen=True, kw_only=True)
class ConvergenceResult:
    """A finished convergence study.

    Attributes:
        food: Name of the food.
        knife: Name of the knife.
        shape: The specimen.
        command: Words of the command line.
        warnings: What a reader should know of input and runs.
        grids: The runs on the grids, from coarse to fine.
        limits: What counts as converged.
        peak: What the grids say of the peak [N].
        work: What they say of the work [J].
        order_curve: Order by which the curves approach each other [-], None where there is none.
        gci_curve_median: Median over the stroke of the curve's grid convergence index, over the peak [-].
        gci_curve_max: Its largest value [-].
        repeat_sd_peak_N: Standard deviation of the peak between runs that should agree [N].
        repeat_sd_work_J: The same of the work [J].
        safety: What the time step changes, None where it was not varied; so with the next four.
        mach: What the speed changes.
        ppc: What the number of particles changes.
        offset: What the place of the blade in the grid changes.
        repeat: What should not matter: other particles, the grid elsewhere.
        constants: What each constant of the method changes when it is halved and doubled, by its key; None where they
            were not varied.
        device: Device of the runs.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
    """

    DOCUMENT: ClassVar[str] = "converge"
    KEYS: ClassVar[tuple[str, ...]] = (
        "food", "knife", "shape", "command", "warnings", "grids", "order", "gci_peak", "gci_work", "verdict",
        "converged", "limits", "peak", "work", "order_curve", "gci_curve_median", "gci_curve_max", "repeat_sd_peak_N",
        "repeat_sd_work_J", "safety", "mach", "ppc", "offset", "repeat", "constants", "device", "versions", "git",
    )  # fmt: skip

    food: str
    knife: str
    shape: Shape
    command: tuple[str, ...]
    warnings: tuple[str, ...]
    grids: tuple[RunResult, ...]
    limits: ConvergenceLimits
    peak: Estimate
    work: Estimate
    order_curve: float | None
    gci_curve_median: float
    gci_curve_max: float
    repeat_sd_peak_N: float
    repeat_sd_work_J: float
    safety: AxisResult | None
    mach: AxisResult | None
    ppc: AxisResult | None
    offset: AxisResult | None
    repeat: AxisResult | None
    constants: Mapping[str, ConstantResult] | None = None
    device: str
    versions: Mapping[str, str]
    git: str | None

    @property
    def order(self) -> float | None:
        """Observed order of the work [-]."""
        return self.work.order

    @property
    def gci_peak(self) -> float:
        """Grid convergence index of the peak on the finest grid [-]."""
        return self.peak.gci

    @property
    def gci_work(self) -> float:
        """Grid convergence index of the work on the finest grid [-]."""
        return self.work.gci

    @property
    def verdict(self) -> str:
        """What the work does on the three finest grids, one of :data:`studies.convergence.gci.TRENDS`."""
        return self.work.verdict

    @property
    def converged(self) -> bool:
        """Whether work and peak change by no more than the limits between the two finest grids, and their grid
        convergence indices are within theirs.
        """
        near = abs(self.work.change) <= self.limits.work and abs(self.peak.change) <= self.limits.peak
        return near and (self.limits.gci is None or max(self.gci_work, self.gci_peak) <= self.limits.gci)

    def axis(self, name: str) -> AxisResult | None:
        """What a thing changes that was varied apart; None where it was not, or fewer than two runs ended."""
        found: AxisResult | None = getattr(self, name)
        return None if found is None or found.spread_work is None else found

    @property
    def constants_seen(self) -> Mapping[str, ConstantResult]:
        """The constants of the method whose spread is known, by key."""
        return {key: found for key, found in (self.constants or {}).items() if found.spread_work is not None}


@dataclass(frozen=True, eq=False)
class ForceCurves:
    """The force over the stroke on every grid.

    Attributes:
        stroke: Stroke [m], shape (m,).
        forces: Force on the knife [N], shape (m,), by cell size [m].
        u_num: Standard numerical uncertainty of the finest curve [N], shape (m,).
        u_num_coarsest: The same of the coarsest curve [N], shape (m,).
    """

    stroke: FloatArray
    forces: Mapping[float, FloatArray]
    u_num: FloatArray
    u_num_coarsest: FloatArray


def _column(dx: float) -> str:
    return f"force_dx_{dx:g}_N"


def write_result(result: ConvergenceResult, curves: ForceCurves, out: Path) -> None:
    """Write ``converge.json`` and ``curves.csv``.

    Args:
        result: The result.
        curves: The curves.
        out: Output folder.

    Raises:
        OutputError: A file cannot be written.
    """
    forces = {_column(dx): force for dx, force in curves.forces.items()}
    own = {"u_num_N": curves.u_num, "u_num_coarsest_N": curves.u_num_coarsest}
    write_csv(out / CURVES_FILE, {"stroke_m": curves.stroke, **forces, **own})
    write_json(out / RESULT_FILE, to_document(result))


def read_result(folder: Path) -> tuple[ConvergenceResult, ForceCurves]:
    """Read ``converge.json`` and ``curves.csv`` of a folder.

    Raises:
        DocumentError: A file is missing, damaged or incomplete.
    """
    result = read_document(folder / RESULT_FILE, ConvergenceResult)
    path = folder / CURVES_FILE
    try:
        columns = {name: values.to_numpy(float) for name, values in pd.read_csv(path).items()}
        cells = [grid.dx_m for grid in result.grids if grid.ok and grid.dx_m is not None]
        forces = {dx: columns[_column(dx)] for dx in cells}
        curves = ForceCurves(columns["stroke_m"], forces, columns["u_num_N"], columns["u_num_coarsest_N"])
    except KeyError as e:
        raise DocumentError(f"{path}: column {e.args[0]} is missing; {REMEDY}") from None
    except (OSError, ValueError) as e:
        raise DocumentError(f"{path}: cannot be read ({e}); {REMEDY}") from None
    return result, curves
