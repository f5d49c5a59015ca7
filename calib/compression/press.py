"""The press as it is simulated: a unit curve, its closed form between frictionless plates, the errors of the grid."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from calib.compression.measured import area, strain_grid
from calib.errors import CurveError
from calib.io.progress import clock
from calib.io.type_schema import Count, NotNegative, Positive
from mpm.arrays import FloatArray
from mpm.runtime import Runtime
from mpm.scene import Board, Food, Motion, Numerics, Press, Scene
from mpm.scene.errors import SimulationError
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation

CONTACT_STRAIN = 0.02
"""Strain from which relative errors count [-]: below it they divide by nearly nothing."""
PRESSED_MATERIAL = Material(E=1e5, nu=0.3, rho=1000.0, loss_factor=0.05)
"""What is pressed. The loss factor damps the ringing; at this speed its force is that of a strain of 1e-4."""
PLATE_SPEED = 0.004
"""Speed of the plate over that of the longitudinal wave in a bar, sqrt(E / rho) [-]. See docs/theory.md, "Measured
choices"."""
NO_SLIP_FRICTION = 9.9
"""Friction with which nothing slides [-]."""
OVERSTROKE = 1.03
"""Stroke over the largest fitted one [-]: the end of the fitted curve has samples on both sides."""
TELL_EVERY = 5.0
"""Time between two lines that say how far a press is [s]."""
RECORD_ROWS = 400
"""Rows of the record of a press."""
SMOOTHING_DEGREE = 5
"""Degree of the polynomial through the origin that smooths force times (1 - strain)^2, which takes out the ringing
after the plate has met the food. See docs/theory.md, "Measured choices"."""

Say = Callable[[str], None]


@dataclass(frozen=True)
class PressRun:
    """A press that was simulated.

    Attributes:
        cells: Cells over the height.
        dx_m: Cell [m].
        mach: Speed of the plate over the P-wave speed.
        particles: Particles.
        steps: Time steps.
        wall_s: Run time [s].
    """

    cells: Count
    dx_m: Positive
    mach: Positive
    particles: Count
    steps: Count
    wall_s: NotNegative


@dataclass(frozen=True)
class UnitCurve:
    """Simulated stress over Young's modulus.

    Attributes:
        strain: Engineering strain [-], shape (n,).
        stress: Engineering stress / E [-], shape (n,).
        run: The simulation.
    """

    strain: FloatArray
    stress: FloatArray
    run: PressRun


def homogeneous(nu: float, strain: FloatArray) -> FloatArray:
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

    Returns:
        The press.

    Raises:
        CurveError: Too few cells.
        SceneError: Impossible Poisson's ratio or sizes.
    """
    if cells < 4:
        raise CurveError(f"--cells {cells}: the press needs 4 or more over the height; 10 to 15 are usual")
    material = Material(**{**vars(PRESSED_MATERIAL), "nu": nu})
    end = min(OVERSTROKE * strain, 0.5 * (1 + strain)) * shape.height
    friction = NO_SLIP_FRICTION if bonded else 0.0
    wider = 1 / math.sqrt(1 - strain) - 1  # at constant volume
    return Scene(
        Food(shape, material),
        Press(mu=friction),
        Motion(end, PLATE_SPEED * math.sqrt(material.E / material.rho) / material.p_wave),
        Board(friction),
        numerics=Numerics(
            dx=shape.height / cells, gravity=0.0, output=end / RECORD_ROWS, room=1.5 * wider + 0.1, seed=seed
        ),
    )


def unit_curve(scene: Scene, strain: float, *, arch: str = "cpu", say: Say | None = None) -> UnitCurve:
    """Press the specimen once.

    Args:
        scene: From :func:`press_scene`.
        strain: Largest engineering strain [-].
        arch: Device.
        say: Called every few seconds with a line that says how far the press is.

    Returns:
        The unit curve.

    Raises:
        SimulationError: The run broke down.
    """
    began = told = time.monotonic()

    def show(part: float, _: float) -> None:
        nonlocal told
        now = time.monotonic()
        if say is not None and now - told >= TELL_EVERY and part > 0.02:  # before that most of the time was compilation
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
    powers = np.arange(1, SMOOTHING_DEGREE + 1)
    constants = np.linalg.lstsq(middle[:, None] ** powers, force * (1 - middle) ** 2, rcond=None)[0]
    grid = strain_grid(strain)
    smooth = grid[:, None] ** powers @ constants / (1 - grid) ** 2
    run = PressRun(
        cells=round(shape.height / scene.numerics.dx),
        dx_m=scene.numerics.dx,
        mach=scene.motion.mach,
        particles=record.particles,
        steps=record.steps,
        wall_s=record.wall,
    )
    return UnitCurve(grid, smooth / (material.E * area(shape)), run)


def solver_error(unit: UnitCurve, nu: float) -> float:
    """Largest relative error of a unit curve between frictionless plates beyond 2 % strain, with its sign [-]."""
    return largest_error(unit.strain, unit.stress, homogeneous(nu, unit.strain))[0]


def grid_change(unit: UnitCurve, coarse: UnitCurve) -> float:
    """Largest relative change from the unit curve of a coarser grid beyond 2 % strain, with its sign [-]."""
    return largest_error(unit.strain, unit.stress, coarse.stress)[0]


def largest_error(strain: FloatArray, got: FloatArray, want: FloatArray) -> tuple[float, float]:
    """Largest relative error beyond 2 % strain, with its sign, and the strain where it is [-].

    Args:
        strain: Engineering strain [-], shape (n,).
        got: Stress [Pa] or stress over Young's modulus [-], shape (n,).
        want: What it should be, in the same unit [Pa or -], shape (n,).

    Returns:
        The error, and the strain.
    """
    on = strain >= CONTACT_STRAIN
    errors = got[on] / want[on] - 1
    k = int(np.argmax(np.abs(errors)))
    return float(errors[k]), float(strain[on][k])
