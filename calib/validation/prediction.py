"""A cut predicted with values that were calibrated on another one: the test that a fit to the same trace is not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from calib.io import typed_document
from calib.io.folder import prepare, write_csv, write_json
from calib.io.provenance import Invocation, Software
from calib.io.type_schema import NotNegative, Positive, Shared, one_of
from calib.io.typed_document import FLAT
from calib.material.food import FoodSpec
from calib.material.knife import load_knife
from calib.material.remarks import notes
from calib.material.scene import blade_warnings, cut_scene, specimen, windowed
from calib.problem.nuisance import sensor_of
from calib.problem.request import Request
from calib.problem.setup import conditioned, way_of, with_height
from calib.trace.filters import BandLimited
from calib.validation.metrics import Metrics, compare
from mpm.output.record import ForceRecord
from mpm.scene import Scene
from mpm.scene.errors import SimulationError
from mpm.scene.shapes import Shape

PREDICTION_NRMSE_LIMIT, PREDICTION_RATING_LIMIT = 0.10, 0.80
"""Largest curve error and smallest ISO-18571-style rating of a prediction that passes [-]."""


@dataclass(frozen=True)
class PredictionLimits:
    """Limits of passing.

    Attributes:
        nrmse: Largest curve error.
        rating: Least rating R.
    """

    nrmse: Positive = PREDICTION_NRMSE_LIMIT
    rating: Positive = PREDICTION_RATING_LIMIT

    def hold(self, metrics: Metrics) -> bool:
        """Whether a prediction passes."""
        return metrics.nrmse <= self.nrmse and metrics.iso18571.R >= self.rating


@dataclass(frozen=True, eq=False, kw_only=True)
class PredictionResult:
    """A cut predicted with values of another.

    ``summary.json`` of ``cutcal predict``, and what ``cutcal predict --json`` prints.

    Attributes:
        food: Food of materials.yaml, or of the file given.
        trace: Whether the record was measured or reconstructed from published figures.
        trace_sha256: SHA-256 of a file's content.
        held_out: Whether no value but the width was fitted to this trace, by its SHA-256.
        passed: Whether curve error and rating are within the limits.
        width_scale: Factor on the force that was fitted to this trace, with --scale-width; null without.
        width_m: Width of the specimen, with that factor [m].
        metrics: Prediction against trace, with the factor.
        unscaled: Prediction against trace, without the factor.
        limits: Limits of passing.
        status: How the simulation ended; another end is an error.
        momentum_residual: Part of the momentum balance that does not close, over the peak force.
        dx_m: Cell of the grid [m].
        shape: Specimen as it was simulated.
        knife: Knife of knives.yaml, or of the file given.
        invocation: How it was called.
        software: What was run.
        warnings: What a reader of the numbers must know about the input, one sentence each.
    """

    DOCUMENT: ClassVar[str] = "predict"

    food: str
    trace: Annotated[str, one_of("measured", "reconstructed")]
    trace_sha256: Annotated[str, Shared("sha256")]
    held_out: bool
    passed: bool
    width_scale: float | None
    width_m: Positive
    metrics: Annotated[Metrics, Shared("metrics")]
    unscaled: Annotated[Metrics, Shared("metrics")]
    limits: PredictionLimits = PredictionLimits()
    status: Annotated[str, one_of("done")]
    momentum_residual: NotNegative
    dx_m: Positive
    shape: Annotated[Shape, Shared("shape")]
    knife: str
    invocation: Invocation = field(metadata=FLAT)
    software: Software = field(metadata=FLAT)
    warnings: Annotated[tuple[str, ...], Shared("warnings")]


def to_document(result: PredictionResult) -> dict[str, Any]:
    """The content of ``summary.json``."""
    return typed_document.to_document(result)


def read_prediction(folder: Path) -> PredictionResult:
    """The finished prediction in a folder.

    Args:
        folder: The output folder of ``cutcal predict``.

    Returns:
        The prediction.

    Raises:
        DocumentError: The summary is missing, damaged or incomplete.
    """
    return typed_document.read_document(folder / "summary.json", PredictionResult)


def run(request: Request, out: Path, *, scale_width: bool, say: Callable[[str], None]) -> PredictionResult:
    """Simulate the cut of a trace with the food's values as they are, compare, and write summary.json and curves.csv.

    The resistances of a cut are known only times the width that is cut. With ``scale_width`` the one number that is
    taken from this trace is that width: the scale that brings the curves closest.

    Args:
        request: What was cut and measured, and the calibrated food.
        out: Output folder.
        scale_width: Whether the width of the specimen is fitted.
        say: Called with each warning, as one sentence.

    Returns:
        The prediction.

    Raises:
        CutcalError: Anything wrong with the input, or a run that breaks down.
    """
    curve, _ = conditioned(request)
    request = with_height(request, curve)
    shape, assumed = specimen(request.food, curve, request.sizing)
    knife = load_knife(request.knife)
    scene = windowed(
        cut_scene(request.food, shape, knife, stroke=way_of(request.food, curve), dx=request.dx, seed=request.seed)
    )
    sensor, of_sensor = sensor_of(curve, 0.0, request.lag_sd, request.bandwidth)  # no prediction has a gain
    smooth = BandLimited(sensor.bandwidth, curve.stroke, curve.clock)
    blade = blade_warnings(shape, knife)
    warnings: tuple[str, ...] = (*curve.warnings, *assumed, *of_sensor, *blade)
    unseen = held_out(request.food, curve.trace.sha256)
    if not unseen:
        said = "in-sample: the values were fitted to this very trace (equal SHA-256), so the agreement predicts nothing"
        warnings = (*warnings, said)
    for text in (*notes(request.food), *warnings):
        say(text)
    warnings = (*request.food.warnings(), *warnings)
    with prepare(out, "predict", resume=False):
        record = _simulated(scene, request.arch)
        whole = smooth(curve.stroke, record.stroke, record.resolved)
        unscaled = compare(curve.stroke, curve.curve, whole)
        factor = unscaled.best_scale if scale_width else 1.0
        metrics = compare(curve.stroke, curve.curve, factor * whole)
        write_csv(
            out / "curves.csv",
            {
                "stroke_m": curve.stroke,
                "real_N": curve.curve,
                "sim_N": factor * whole,
                "edge_N": factor * smooth(curve.stroke, record.stroke, record.edge[:, 2]),
                "face_N": factor * smooth(curve.stroke, record.stroke, record.resolved_face),
            },
        )
        result = PredictionResult(
            food=request.food.name,
            trace=curve.trace.label,
            trace_sha256=curve.trace.sha256,
            held_out=unseen,
            passed=PredictionLimits().hold(metrics),
            width_scale=factor if scale_width else None,
            width_m=factor * shape.width,
            metrics=metrics,
            unscaled=unscaled,
            status=record.status,
            momentum_residual=record.momentum_residual,
            dx_m=scene.numerics.dx,
            shape=replace(shape, width=factor * shape.width),
            knife=knife.name,
            invocation=Invocation(request.seed, request.arch, tuple(request.command)),
            software=Software.here(),
            warnings=warnings,
        )
        write_json(out / "summary.json", to_document(result))
        return result


def held_out(food: FoodSpec, sha256: str) -> bool:
    """Whether a food's values were not fitted to a trace, as far as its file says.

    Args:
        food: The food, with the provenance of a calibration on one trace or of a study on several.
        sha256: SHA-256 of the trace.

    Returns:
        False where the trace is among those that were fitted.
    """
    provenance = food.calibration or {}
    several = provenance.get("traces")
    fitted = [*(several.values() if isinstance(several, Mapping) else ()), provenance.get("trace_sha256")]
    return sha256 not in fitted


def _simulated(scene: Scene, arch: str) -> ForceRecord:
    """The record of a cut that ends its stroke.

    Raises:
        SimulationError: It did not.
    """
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    record = Simulation(scene, Runtime(arch)).run()
    if record.status != "done":
        raise SimulationError(
            f"the predicted cut broke down at {record.fraction:.0%} of its stroke ({record.status}); nothing was "
            "compared; try another --dx",
            reason=record.status,
            fraction=record.fraction,
        )
    return record
