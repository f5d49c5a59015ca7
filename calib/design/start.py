"""Where a design starts: what is known of a food, from a finished calibration or from the literature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from calib.calibration.result import SUMMARY, CalibrationResult, read_result, read_summary
from calib.errors import OutputError
from calib.io.schema import tag
from calib.material.food import FoodSpec
from calib.material.scene import Sizing, specimen
from calib.problem.food_parameters import KNOWN, fit_parameters
from calib.problem.nuisance import GAIN_SD
from calib.problem.parameters import Z95, ParameterSet
from calib.problem.target import ErrorModel
from mpm.arrays import FloatArray
from mpm.scene import Knife
from mpm.scene.shapes import Shape

ASSUMED_SENSOR: Mapping[str, float] = {"curve": 0.05, "tare": 0.03, "drift": 0.1, "lag": 2e-4, "gain": GAIN_SD}
"""Errors of a sensor of which nothing is known: those that conditioning finds in records of the made-up sensor of
``cutcal coverage`` [N, N, N, m, -]."""


@dataclass(frozen=True)
class SensorErrors:
    """What a force sensor leaves open of a conditioned curve, as standard deviations.

    Attributes:
        curve: Noise of a point of the curve, and of its peak [N].
        tare: Force without load [N].
        drift: Drift over the stroke [N].
        lag: Place of contact [m].
        gain: Relative error of the gain [-].
    """

    curve: float
    tare: float
    drift: float
    lag: float
    gain: float


@dataclass(frozen=True, eq=False)
class Start:
    """What is known before the next test.

    Attributes:
        food: The food with the present values.
        parameters: Its parameters, with present values and the literature's priors.
        shape: The specimen that was cut, or the food's usual one.
        knife: The blade of that cut.
        stroke: Its stroke [m].
        sensor: Errors of the sensor.
        errors: How far a right model is from a curve: discrepancy, its correlation length, tolerance of the peak.
        widened: Factor on the variance of all errors of a curve [-]; above 1 where the calibration missed its own.
        width_sd: Relative standard deviation of the specimen's width [-]; 0 where it was measured.
        run: Folder of the calibration; None where nothing was cut yet.
        reported: 95 % intervals of that calibration [unit], by name.
    """

    food: FoodSpec
    parameters: ParameterSet
    shape: Shape
    knife: Knife
    stroke: float
    sensor: SensorErrors
    errors: ErrorModel
    widened: float = 1.0
    width_sd: float = 0.0
    run: Path | None = None
    reported: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def kept(self) -> tuple[str, ...]:
        """Sizes of the specimen that do not follow a fitted height."""
        return ("length",) if self.width_sd > 0.0 else ("width", "length")

    @property
    def present_sd(self) -> FloatArray:
        """Standard deviations in internal coordinates (p,): those of the reported intervals, else of the priors."""
        out = self.parameters.prior_sd.copy()
        for k, p in enumerate(self.parameters):
            if p.name in self.reported:
                low, high = (p.to_internal(x) for x in self.reported[p.name])
                out[k] = min(out[k], (high - low) / (2.0 * Z95))
        return out


def start_of_run(folder: Path) -> Start:
    """What a finished calibration on one trace leaves to be known.

    Args:
        folder: Its output folder.

    Returns:
        The start.

    Raises:
        OutputError: There is no finished calibration on one trace in the folder.
    """
    path = folder / SUMMARY
    if path.is_file() and _schema(path) == tag("study"):
        raise OutputError(
            f"--run {folder}: is a fit of several specimens; design starts from one: give the folder of calibrate on "
            "one of its traces"
        )
    result = read_result(folder)
    if result.status != "done" or any(p.low95 is None or p.high95 is None for p in result.fitted.values()):
        raise OutputError(
            f"--run {folder}: the calibration ended before it had intervals; run it again with --resume and more "
            "--budget"
        )
    parameters = _fitted_parameters(result)
    length = result.posterior.correlation_length_m
    own = ErrorModel() if length is None else ErrorModel(correlation=min(length / result.conditioning.stroke_m, 1.0))
    return Start(
        food=result.material,
        parameters=parameters,
        shape=result.cut.shape,
        knife=result.cut.knife,
        stroke=result.conditioning.stroke_m,
        sensor=_sensor(result),
        errors=own,
        widened=max(1.0, result.posterior.reduced_chi2 or 1.0),
        width_sd=result.nuisances["width"].prior_sd if "width" in result.nuisances else 0.0,
        run=folder,
        reported={name: (float(p.low95 or 0.0), float(p.high95 or 0.0)) for name, p in result.fitted.items()},
    )


def start_of_food(food: FoodSpec, knife: Knife, sizing: Sizing | None = None) -> Start:
    """What the literature leaves to be known of a food that nobody has cut.

    Args:
        food: The food.
        knife: The blade that a cut would have.
        sizing: Sizes of the specimen that it would have; None for the food's usual ones.

    Returns:
        The start.

    Raises:
        CutcalError: A food that cannot be fitted.
    """
    shape, _ = specimen(food, None, Sizing() if sizing is None else sizing)
    parameters = fit_parameters(food, food.default_fit)
    return Start(food, parameters, shape, knife, shape.height, SensorErrors(**ASSUMED_SENSOR), ErrorModel())


def _schema(path: Path) -> str:
    """What a summary says it is."""
    summary = read_summary(path)
    return str(summary.get("schema", "")) if isinstance(summary, dict) else ""


def _fitted_parameters(result: CalibrationResult) -> ParameterSet:
    """The parameters of a calibration with their values and the literature's ranges."""
    sizes = {
        name: (p.prior_low, p.value, p.prior_high)
        for name, p in result.fitted.items()
        if name in KNOWN and p.prior_low is not None and p.prior_high is not None
    }
    parameters = fit_parameters(result.material, tuple(result.fitted), sizes)
    held = {p.name: float(np.clip(result.fitted[p.name].value, p.low, p.high)) for p in parameters}
    return parameters.with_values(held)


def _sensor(result: CalibrationResult) -> SensorErrors:
    """The errors of the sensor of a calibration, as its nuisances have them."""
    known = {name: n.prior_sd for name, n in result.nuisances.items()}
    noise = result.agreement.peak_real_sd_N
    return SensorErrors(
        curve=result.conditioning.noise_sd_N if noise is None else noise,
        tare=known.get("tare", 0.0),
        drift=known.get("drift", 0.0),
        lag=known.get("lag", 0.0),
        gain=known.get("gain", 0.0),
    )
