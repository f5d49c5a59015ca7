"""From simulated cuts about a point to what a test would say there: the rows of the product's own objective."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.compression.measured import strain_grid
from calib.compression.press import homogeneous
from calib.design.linear import LinearTest
from calib.design.start import Start
from calib.design.stencil import Stencil
from calib.multi_specimen.compression_modulus import PLATES_SD
from calib.problem.nuisance import Nuisance, nuisances_of_size
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.problem.target import ErrorModel, Target
from calib.simulation.evaluation import Evaluation
from calib.trace.filters import N_STROKE, filter_simulated
from mpm.arrays import FloatArray

GAIN = "gain"
"""What all cuts have in common: they are measured with one sensor."""
PRESS_STRAIN = 0.3
"""Largest engineering strain of a compression test [-]."""
PRESS_ERRORS = ErrorModel(discrepancy=0.1, correlation=0.2, peak=0.1)
"""How far elastic and perfectly plastic flesh is from a compressed one: it bends at its corner. Assumed."""
PRESS_SPREAD = 0.1 / math.sqrt(3.0)
"""Relative standard deviation of the mean of three cylinders [-]. Assumed."""
PRESS_DIAMETER = 0.02
"""Diameter of a cylinder [m]; only the sensor's noise depends on it."""
PRESS_STEP = 0.02
"""Step of a difference along a logarithm, where there is no noise [-]."""


@dataclass(frozen=True, eq=False)
class CutTest:
    """How a cut is measured.

    Attributes:
        name: Its name, which no other test has.
        stroke: Its stroke [m].
        width_sd: Relative standard deviation of the width of its specimen [-].
        own: Parameters that its specimen has of its own: nothing else is said of them.
        model: Cuts of one name have the same error of the model; empty: of its own.
    """

    name: str
    stroke: float
    width_sd: float
    own: Collection[str] = ()
    model: str = ""


def curve_of(run: Evaluation, stroke: float) -> FloatArray:
    """The curve of a simulated cut as a conditioned record has it [N] (240,)."""
    return filter_simulated(np.linspace(0.0, stroke, N_STROKE), run.stroke, run.force)


def cut_measurement(start: Start, stencil: Stencil, test: CutTest) -> LinearTest:
    """What a cut would say about the point of a stencil.

    Args:
        start: Parameters, sensor, errors of the model.
        stencil: The cut and its neighbours.
        test: How it is measured.

    Returns:
        The measurement.
    """
    sensor, parameters, bare = start.sensor, start.parameters, _bare(start, stencil, test)
    grid, curve = bare.target.stroke, bare.target.curve
    sizes = {name: getattr(sensor, name) for name in ("tare", "drift", "lag", GAIN)} | {"width": test.width_sd}
    rows = {id(run): _rows(bare, curve_of(run, test.stroke)) for run in _runs(stencil)}
    noise = _noise(stencil, rows)
    slopes, feigned = np.zeros((len(noise), len(parameters))), np.zeros((len(noise), len(parameters)))
    for k, sides in enumerate(stencil.sides):
        ends = sorted([(0.0, stencil.centre), *sides], key=lambda side: side[0])
        (low, below), (high, above) = ends[0], ends[-1]
        if high > low:
            slopes[:, k] = (rows[id(above)] - rows[id(below)]) / (high - low)
            feigned[:, k] = noise / (high - low)
    columns = _columns(bare, nuisances_of_size(grid, curve, sizes), test.name)
    for name in test.own:
        k = parameters.names.index(name)
        columns[f"{test.name}:{name}"] = slopes[:, k] * parameters.prior_sd[k]
        slopes[:, k] = feigned[:, k] = 0.0
    return _widened(LinearTest(slopes, feigned, columns, _model_error(bare), test.model), start.widened)


def _noise(stencil: Stencil, rows: Mapping[int, FloatArray]) -> FloatArray:
    """Difference of two runs by their noise alone (n,).

    Other particles and another place of the grid change more than runs beside each other differ by chance. So does the
    bend of a curve of three runs, which is scaled to two of them: of all parameters' bends the median, where it is
    less.
    """
    centre = rows[id(stencil.centre)]
    found = rows[id(stencil.again)] - centre
    bends = []
    for sides in stencil.sides:
        if len(sides) == 2 and math.isclose(sides[0][0], -sides[1][0], rel_tol=1e-6):
            bends.append((rows[id(sides[0][1])] + rows[id(sides[1][1])] - 2.0 * centre) / math.sqrt(3.0))
    if bends:
        middle = sorted(bends, key=lambda bend: float(bend @ bend))[len(bends) // 2]
        found = min(found, middle, key=lambda one: float(one @ one))
    return found


def measured_rows(start: Start, stencil: Stencil, test: CutTest, record: FloatArray) -> FloatArray:
    """Record less simulation in the rows of :func:`cut_measurement`.

    Args:
        start: Parameters, sensor, errors of the model.
        stencil: The cut and its neighbours.
        test: How it is measured.
        record: Measured force [N] on 240 equal steps of the stroke, (240,).

    Returns:
        The rows [-] (241,).
    """
    out: FloatArray = _rows(_bare(start, stencil, test), record) / math.sqrt(start.widened)
    return out


def _bare(start: Start, stencil: Stencil, test: CutTest) -> Objective:
    """The objective of a record that is the simulation itself, and leaves nothing open."""
    grid, curve = np.linspace(0.0, test.stroke, N_STROKE), curve_of(stencil.centre, test.stroke)
    target = Target(grid, curve, start.sensor.curve, start.sensor.curve, filter_simulated)
    return Objective(target, start.parameters, start.errors)


def compression_measurement(start: Start, z: FloatArray) -> LinearTest:
    """What compressed cylinders would say about a point, by the closed form between frictionless plates.

    Args:
        start: Parameters and sensor.
        z: Internal coordinates of the point [-], (p,).

    Returns:
        The measurement: of E and of the yield stress, as far as they are among the parameters.
    """
    parameters = start.parameters
    strain = strain_grid(PRESS_STRAIN)
    area = math.pi / 4.0 * PRESS_DIAMETER**2
    force = area * _stress(start, parameters, z, strain)
    bare = Objective(Target(strain, force, start.sensor.curve, start.sensor.curve, np.interp), parameters, PRESS_ERRORS)
    slopes = np.zeros((len(force) + 1, len(parameters)))
    for k, name in enumerate(parameters.names):
        if name in ("E", "yield_stress"):
            step = PRESS_STEP * np.eye(len(parameters))[k]
            up, down = (_rows(bare, area * _stress(start, parameters, z + s * step, strain)) for s in (1, -1))
            slopes[:, k] = (up - down) / (2.0 * PRESS_STEP)
    common = math.hypot(PLATES_SD, PRESS_SPREAD)
    columns = _columns(bare, (Nuisance("plates", "-", common, force, float(force.max()), False),), "compression")
    return LinearTest(slopes, np.zeros_like(slopes), columns, np.zeros(len(slopes)))


def sizes_measurement(parameters: ParameterSet, z: FloatArray, sd: Mapping[str, float]) -> LinearTest | None:
    """What measured sizes of a specimen say.

    Args:
        parameters: The parameters.
        z: Internal coordinates of the point [-], (p,).
        sd: Standard deviations of ``height`` and ``aspect``, relative [-], and of ``roundness`` [-], by name.

    Returns:
        The measurement; None where none of them is a parameter.
    """
    known = [name for name in sd if name in parameters.names]
    if not known:
        return None
    slopes = np.zeros((len(known), len(parameters)))
    for row, name in enumerate(known):
        k = parameters.names.index(name)
        absolute = name != "height" or parameters[name].log
        slopes[row, k] = 1.0 / (sd[name] * (1.0 if absolute else abs(float(z[k]))))
    return LinearTest(slopes, np.zeros_like(slopes), {}, np.zeros(len(known)))


def pressed_stress(modulus: float, nu: float, yield_stress: float, strain: FloatArray) -> FloatArray:
    """Engineering stress of elastic and perfectly plastic flesh between frictionless plates, in closed form.

    The Kirchhoff stress along the load is the height's ratio times the engineering stress; it stays at the yield stress
    once it has reached it, and the volume then changes no more.

    Args:
        modulus: Young's modulus [Pa].
        nu: Poisson's ratio [-].
        yield_stress: Yield stress [Pa].
        strain: Engineering strain, compression positive [-], (n,).

    Returns:
        Stress, compression positive [Pa], (n,).
    """
    out: FloatArray = np.minimum(modulus * homogeneous(nu, strain), yield_stress / (1.0 - strain))
    return out


def _stress(start: Start, parameters: ParameterSet, z: FloatArray, strain: FloatArray) -> FloatArray:
    """Stress of the food at a point, with its own values for what is no parameter."""
    values = {name: start.food.properties[name].value for name in ("E", "nu", "yield_stress")}
    values |= {name: x for name, x in parameters.to_dict(z).items() if name in values}
    return pressed_stress(values["E"], values["nu"], values["yield_stress"], strain)


def _runs(stencil: Stencil) -> list[Evaluation]:
    return [stencil.centre, stencil.again, *(run for sides in stencil.sides for _, run in sides)]


def _rows(bare: Objective, curve: FloatArray) -> FloatArray:
    """Rows of curve and peak of an objective that leaves nothing open (n + 1,)."""
    return bare.data_residual(curve)[:-1]


def _columns(bare: Objective, found: tuple[Nuisance, ...], name: str) -> dict[str, FloatArray]:
    """Rows by one prior standard deviation of what a measurement leaves open, by name."""
    whole = replace(bare, nuisances=tuple(replace(n, searched=False) for n in found)).unsearched()[:-1]
    return {n.name if n.name == GAIN else f"{name}:{n.name}": column for n, column in zip(found, whole.T, strict=True)}


def _model_error(bare: Objective) -> FloatArray:
    """Part of each row's standard deviation that is error of the model (n + 1,)."""
    errors, peak = bare.errors, bare.target.peak
    return np.append(errors.discrepancy * peak / bare.sigmas, errors.peak * peak / bare.sigma_peak)


def _widened(test: LinearTest, widened: float) -> LinearTest:
    """The measurement with larger errors of its rows."""
    size = math.sqrt(widened)
    columns = {name: column / size for name, column in test.columns.items()}
    return replace(test, slopes=test.slopes / size, feigned=test.feigned / size, columns=columns)
