"""Young's modulus from a uniaxial compression test between two plates, with the project's own particles.

The law is rate-independent and hyperelastic. At given Poisson's ratio, plates and geometry the force is therefore
proportional to Young's modulus E at every strain. One simulation gives the unit curve F / (E A0), and each repeat is
fitted by scaling it. Strain is compression / height, stress is force / A0: both are engineering quantities.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student

from calib.columns import candidates, choose, numbers
from calib.errors import CurveError, TraceError
from calib.outputs import prepare, write_csv, write_json
from calib.progress import clock
from calib.provenance import git_commit, versions
from calib.tables import Table, read_table
from calib.trace import MIN_SAMPLES
from calib.verdicts import Verdict
from mpm.errors import SimulationError
from mpm.material import Material
from mpm.runtime import Runtime
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.shapes import Shape, volume
from mpm.solver import Simulation

STEP = 0.001
"""Step of the common strain grid, about [-]."""
SMALL = 0.05
"""Strain up to which the slope of the stress is the small-strain modulus [-]: the window of published moduli."""
CONTACT = 0.02
"""Strain from which relative errors count [-]: below it they divide by nearly nothing."""
NRMSE_LIMIT = 0.05
SLOPE_LIMIT = 0.10
SOLVER_LIMIT = 0.03
COARSER = 2 / 3
"""Part of the cells on which the press between bonded plates is repeated [-]."""
NU_STEP = 0.05
"""Change of Poisson's ratio whose effect on the modulus is reported [-]."""
NU_TOP = 0.499
"""Largest Poisson's ratio of the closed form [-]."""

REFERENCE = Material(E=1e5, nu=0.3, rho=1000.0, loss_factor=0.05)
"""What is pressed. The loss factor damps the ringing; at this speed its force is that of a strain of 1e-4."""
SPEED = 0.004
"""Speed of the plate over that of the longitudinal wave in a bar, sqrt(E / rho) [-]; half of it changes the force by
less than 0.2 % beyond 2 % strain (nu 0.49, 10 and 15 cells over the height)."""
STICKS = 9.9
"""Friction with which nothing slides [-]."""
BEYOND = 1.03
"""Stroke over the largest fitted one [-]: the end of the fitted curve has samples on both sides."""
TELL = 5.0
"""Time between two lines that say how far a press is [s]."""
ROWS = 400
"""Rows of the record of a press."""
DEGREE = 5
"""Degree of the polynomial through the origin that smooths force times (1 - strain)^2, which takes out the ringing after
the plate has met the food. It follows the closed form within 0.1 % up to a strain of 0.7, and 0.6 % up to 0.8."""
REPLICATE = "replicate"
"""Column that splits a file into repeats."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class Measured:
    """Repeats of one compression test on a common strain grid.

    Attributes:
        strain: Engineering strain, compression positive [-], shape (n,).
        stress: Engineering stress of each repeat [Pa], shape (repeats, n).
        slope: Slope of the stress over 0 to 5 % strain of each repeat [Pa], shape (repeats,).
        names: Name of each repeat.
        files: Name, SHA-256 and columns of each file.
    """

    strain: np.ndarray
    stress: np.ndarray
    slope: np.ndarray
    names: list[str]
    files: list[dict[str, Any]]

    @property
    def mean(self) -> np.ndarray:
        """Mean stress of the repeats [Pa], shape (n,)."""
        return self.stress.mean(axis=0)


@dataclass(frozen=True)
class UnitCurve:
    """Simulated stress over Young's modulus.

    Attributes:
        strain: Engineering strain [-], shape (n,).
        stress: Engineering stress / E [-], shape (n,).
        about: Cells, particles, steps and speed of the simulation.
    """

    strain: np.ndarray
    stress: np.ndarray
    about: dict[str, Any]


@dataclass(frozen=True)
class Fit:
    """Young's modulus and how well its curve fits.

    Attributes:
        E: Modulus of each repeat [Pa], shape (repeats,).
        mean: Mean modulus [Pa].
        sd: Standard deviation between the repeats [Pa], NaN for one.
        low, high: Ends of the 95 % interval of the mean (Student's t) [Pa], NaN for one repeat.
        stress: Fitted stress [Pa], shape (n,).
        slope: Its slope over 0 to 5 % strain [Pa].
        slope_error: That slope over the measured one, less 1 [-].
        nrmse: Root mean square of the difference from the mean measured stress over the largest of that [-].
        force_error: Largest relative error of the force beyond 2 % strain, with its sign [-].
        force_error_at: Strain where it is [-].
    """

    E: np.ndarray
    mean: float
    sd: float
    low: float
    high: float
    stress: np.ndarray
    slope: float
    slope_error: float
    nrmse: float
    force_error: float
    force_error_at: float


def area(shape: Shape) -> float:
    """Area under the plate [m^2]."""
    return volume(shape) / shape.height


def strain_grid(strain: float) -> np.ndarray:
    """Strains from 0 to ``strain`` [-].

    Raises:
        CurveError: It ends before the window of the small-strain modulus.
    """
    if strain < SMALL:
        raise CurveError(
            f"--strain {strain:g}: the modulus over 0 to {SMALL:g} is part of the result; give {SMALL:g} or more"
        )
    return np.linspace(0.0, strain, round(strain / STEP) + 1)


def slope(strain: np.ndarray, stress: np.ndarray) -> float:
    """Slope of the least-squares line through stress over 0 to 5 % strain; its offset is free [Pa]."""
    on = strain <= SMALL * (1 + 1e-9)
    return float(np.polyfit(strain[on], stress[on], 1)[0])


def read_repeats(
    paths: Sequence[str | Path],
    shape: Shape,
    strain: float,
    *,
    compression_col: str | None = None,
    force_col: str | None = None,
) -> Measured:
    """Read the repeats of a compression test.

    The first sample of a repeat is its zero of compression and of load; no toe is corrected. Of each repeat the first
    loading is used, up to ``strain``.

    Args:
        paths: CSV, JSON or HDF5 files, each one repeat or several with a column ``replicate``; all of one material.
        shape: The specimen.
        strain: Largest engineering strain [-].
        compression_col: Column of the way of the plate; metres if its name has no unit.
        force_col: Column of the load; newtons if its name has no unit.

    Raises:
        TraceError: A file, a column or a repeat cannot be used; the message says which and why.
        CurveError: ``strain`` is too small.
    """
    grid = strain_grid(strain)
    names: list[str] = []
    rows, slopes, files = [], [], []
    for path in map(Path, paths):
        table = read_table(path)
        compression = choose(table, "compression", compression_col)
        force = choose(table, "force", force_col)
        if compression.name in candidates(table, "force") or force.name in candidates(table, "compression"):
            raise TraceError(
                f"{table.source}: columns {compression.name} (compression) and {force.name} (load) look swapped; "
                "exchange --compression-col and --force-col"
            )
        way, load = numbers(table, compression), numbers(table, force)
        for name, on in _repeats(table):
            label = name if len(paths) == 1 else f"{path.stem} {name}".strip()
            label = label or path.stem
            if label in names:
                raise TraceError(
                    f"{table.source}: a second repeat is called {label!r}; give each file once, by its own name"
                )
            names.append(label)
            e, s = _loading(f"{table.source}{f', repeat {name}' if name else ''}", way[on], load[on], shape, strain)
            rows.append(np.interp(grid, e, s))
            slopes.append(slope(e, s))
        files.append(
            {"name": table.source, "sha256": table.sha256, "compression": compression.name, "force": force.name}
        )
    return Measured(grid, np.array(rows), np.array(slopes), names, files)


def _repeats(table: Table) -> list[tuple[str, np.ndarray]]:
    """Name and rows of each repeat of a file; one without a name where there is no such column."""
    column = next((cells for name, cells in table.columns.items() if name.lower() == REPLICATE), None)
    if column is None:
        return [("", np.arange(len(table.rows)))]
    of = np.array([str(cell).strip() for cell in column])
    return [(name, np.flatnonzero(of == name)) for name in dict.fromkeys(of.tolist())]


def _loading(
    where: str, way: np.ndarray, load: np.ndarray, shape: Shape, strain: float
) -> tuple[np.ndarray, np.ndarray]:
    """Strain and stress of the first loading of a repeat, strain increasing and reaching ``strain``.

    Args:
        where: Name of the file and of the repeat.
        way: Way of the plate [m], shape (n,).
        load: Force on it [N], shape (n,).
        shape: The specimen.
        strain: Largest engineering strain [-].

    Raises:
        TraceError: The repeat cannot be used.
    """
    way, load = way - way[0], load - load[0]
    last = int(np.argmax(way))
    if way[last] <= 0 or -way.min() > way[last]:
        raise TraceError(f"{where}: the compression is negative; count it positive when the plates approach each other")
    if way[last] >= shape.height:
        raise TraceError(
            f"{where}: a compression of {way[last]:g} m is more than the height of {shape.height:g} m; if it is in "
            "millimetres call the column compression_mm, and check that --compression-col and --force-col are not swapped"
        )
    if way[last] < strain * shape.height * (1 - 1e-9):
        raise TraceError(
            f"{where}: the compression reaches a strain of {way[last] / shape.height:.3g}, not {strain:g}; "
            "give a smaller --strain, or check --height"
        )
    e = way / shape.height
    ahead = np.r_[True, e[1:] > np.maximum.accumulate(e)[:-1]]
    ahead[int(np.argmax(e >= strain * (1 - 1e-9))) + 1 :] = False
    if np.count_nonzero(ahead) < MIN_SAMPLES:
        raise TraceError(
            f"{where}: {np.count_nonzero(ahead)} samples of loading up to a strain of {strain:g}, at least {MIN_SAMPLES} "
            "are needed; record at a higher rate"
        )
    e, s = e[ahead], load[ahead] / area(shape)
    part = len(s) // 10 + 1
    rise = s[-part:].mean() - s[:part].mean()
    if abs(rise) <= 3 * np.std(np.diff(s)):
        raise TraceError(f"{where}: there is no load on the plate beyond noise; check --force-col")
    if rise < 0:
        raise TraceError(
            f"{where}: the load falls with compression; count it positive in compression, or exchange "
            "--compression-col and --force-col if they are swapped"
        )
    if np.count_nonzero(e <= SMALL) < 3:
        raise TraceError(
            f"{where}: fewer than 3 samples up to a strain of {SMALL:g}, where the small-strain modulus is taken; "
            "record at a higher rate"
        )
    return e, s


def homogeneous(nu: float, strain: np.ndarray) -> np.ndarray:
    """Stress / E of the press between frictionless plates, closed form of the solver's corotated law.

    The press is homogeneous: the height changes by the factor l = 1 - strain, both widths by s, the volume by
    J = l s^2. The free sides give 2 mu (s - 1) s + lam (J - 1) J = 0.

    Args:
        nu: Poisson's ratio [-].
        strain: Engineering strain, compression positive [-], shape (n,).

    Returns:
        Engineering stress over E, compression positive [-], shape (n,).
    """
    mu, lam = 1 / (2 * (1 + nu)), nu / ((1 + nu) * (1 - 2 * nu))

    def side(wide: float, high: float) -> float:
        """Stress on the free sides over their widening."""
        return 2 * mu * (wide - 1) + lam * (high * wide**2 - 1) * high * wide

    out = np.zeros(len(strain))
    for i in np.flatnonzero(strain > 0):
        high = 1 - strain[i]
        wide = brentq(side, 0.0, 1 / math.sqrt(high), args=(high,), xtol=1e-14)
        out[i] = 2 * mu * (1 - high) + lam * (1 - high * wide**2) * wide**2
    return out


def press_scene(shape: Shape, nu: float, strain: float, *, cells: int, bonded: bool, seed: int = 0) -> Scene:
    """The press that gives a unit curve.

    Args:
        shape: The specimen.
        nu: Poisson's ratio [-].
        strain: Largest engineering strain [-].
        cells: Cells over the height.
        bonded: The food sticks to both plates; else they are frictionless.
        seed: Seed of the particles.

    Raises:
        CurveError: Too few cells.
        SceneError: Impossible Poisson's ratio or sizes.
    """
    if cells < 4:
        raise CurveError(f"--cells {cells}: the press needs 4 or more over the height; 10 to 15 are usual")
    material = Material(**{**vars(REFERENCE), "nu": nu})
    end = min(BEYOND * strain, 0.5 * (1 + strain)) * shape.height
    friction = STICKS if bonded else 0.0
    wider = 1 / math.sqrt(1 - strain) - 1  # at constant volume
    return Scene(
        Food(shape, material),
        Press(mu=friction),
        Motion(end, SPEED * math.sqrt(material.E / material.rho) / material.p_wave),
        Board(friction),
        numerics=Numerics(dx=shape.height / cells, gravity=0.0, output=end / ROWS, room=1.5 * wider + 0.1, seed=seed),
    )


def unit_curve(scene: Scene, strain: float, *, arch: str = "cpu", say: Say | None = None) -> UnitCurve:
    """Press the specimen once.

    Args:
        scene: From :func:`press_scene`.
        strain: Largest engineering strain [-].
        arch: Device.
        say: Called every few seconds with a line that says how far the press is.

    Raises:
        SimulationError: The run broke down.
    """
    began = told = time.monotonic()

    def show(part: float, _: float) -> None:
        nonlocal told
        now = time.monotonic()
        if say is not None and now - told >= TELL and part > 0.02:  # before that most of the time was compilation
            told = now
            say(f"  {part:.0%} of the press, about {clock((now - began) * (1 - part) / part)} left")

    record = Simulation(scene, Runtime(arch, threads=1)).run(progress=show)
    if record.status != "done":
        raise SimulationError(
            f"the press stopped at {record.fraction:.0%} of its stroke: {record.status}; give a smaller --strain or "
            "other --cells",
            reason=record.status,
            fraction=record.fraction,
        )
    shape, material = scene.food.shape, scene.food.material
    # a row's force is the mean over its interval, so it belongs to the middle of that
    middle = (record.stroke - np.diff(record.stroke, prepend=0.0) / 2) / shape.height
    touched = middle > 0
    middle, force = middle[touched], record.face[touched, 2]
    powers = np.arange(1, DEGREE + 1)
    constants = np.linalg.lstsq(middle[:, None] ** powers, force * (1 - middle) ** 2, rcond=None)[0]
    grid = strain_grid(strain)
    smooth = grid[:, None] ** powers @ constants / (1 - grid) ** 2
    about = {
        "cells": round(shape.height / scene.numerics.dx),
        "dx_m": scene.numerics.dx,
        "mach": scene.motion.mach,
        "particles": record.particles,
        "steps": record.steps,
        "wall_s": record.wall,
    }
    return UnitCurve(grid, smooth / (material.E * area(shape)), about)


def solver_error(unit: UnitCurve, nu: float) -> float:
    """Largest relative error of a unit curve between frictionless plates beyond 2 % strain, with its sign [-]."""
    return _largest(unit.strain, unit.stress, homogeneous(nu, unit.strain))[0]


def grid_change(unit: UnitCurve, coarse: UnitCurve) -> float:
    """Largest relative change from the unit curve of a coarser grid beyond 2 % strain, with its sign [-]."""
    return _largest(unit.strain, unit.stress, coarse.stress)[0]


def _largest(strain: np.ndarray, got: np.ndarray, want: np.ndarray) -> tuple[float, float]:
    """Largest relative error beyond 2 % strain, with its sign, and the strain where it is [-]."""
    on = strain >= CONTACT
    errors = got[on] / want[on] - 1
    k = int(np.argmax(np.abs(errors)))
    return float(errors[k]), float(strain[on][k])


def scale(unit: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Least-squares modulus of one or several stresses, shapes (n,) and (..., n) [Pa]."""
    return stress @ unit / (unit @ unit)


def fit(measured: Measured, unit: UnitCurve) -> Fit:
    """Fit Young's modulus to each repeat."""
    moduli = scale(unit.stress, measured.stress)
    n, mean = len(moduli), float(moduli.mean())
    sd = float(moduli.std(ddof=1)) if n > 1 else math.nan
    half = float(student.ppf(0.975, n - 1)) * sd / math.sqrt(n) if n > 1 else math.nan
    fitted, want = mean * unit.stress, measured.mean
    error, at = _largest(measured.strain, fitted, want)
    small = slope(unit.strain, fitted)
    return Fit(
        E=moduli,
        mean=mean,
        sd=sd,
        low=mean - half,
        high=mean + half,
        stress=fitted,
        slope=small,
        slope_error=small / float(measured.slope.mean()) - 1,
        nrmse=float(np.sqrt(np.mean((fitted - want) ** 2)) / want.max()),
        force_error=error,
        force_error_at=at,
    )


def sensitivity(measured: Measured, nu: float, modulus: float) -> list[dict[str, float]]:
    """Modulus that the same curve gives at other Poisson's ratios, between frictionless plates, by the closed form.

    Args:
        measured: The repeats.
        nu: Poisson's ratio of the fit [-].
        modulus: Fitted modulus [Pa].

    Returns:
        Poisson's ratio [-] and modulus [Pa] below and above.
    """
    base = float(scale(homogeneous(nu, measured.strain), measured.mean))
    out = []
    for other in (nu - NU_STEP, min(nu + NU_STEP, NU_TOP)):
        refitted = float(scale(homogeneous(other, measured.strain), measured.mean))
        out.append({"nu": other, "E_Pa": modulus * refitted / base})
    return out


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
        **about,
        "specimen": {**asdict(shape), "area_m2": area(shape)},
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
