"""What a study of several cuts ends with: the content of its ``summary.json``, written by one function and read by one.

The fields have the names of the document's keys (:mod:`calib.io.typed_document`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from calib.calibration.result_parts import Conditioning
from calib.io.folder import write_json
from calib.io.provenance import Invocation, Software
from calib.io.type_schema import Count, Fraction, NotNegative, Positive, Shared, keywords, one_of
from calib.io.typed_document import FLAT, NULL, read_document, to_document
from calib.material.properties import Property
from calib.multi_specimen.compression_modulus import CompressionModulus
from calib.multi_specimen.fitted_cuts import FittedCut
from calib.multi_specimen.held_out import INSIDE_LIMIT, HeldOutPrediction, mean_width
from calib.problem.parameters import Parameter
from calib.problem.setup import Setup
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.uncertainty.intervals import Interval
from calib.validation.acceptance import BAND_LIMIT, Verdict
from calib.validation.metrics import Metrics
from calib.validation.numerical_checks import Check
from calib.validation.prediction import PREDICTION_NRMSE_LIMIT, PREDICTION_RATING_LIMIT
from mpm.scene import Knife
from mpm.scene.shapes import Shape

SUMMARY = "summary.json"

Sha256 = Annotated[str, Shared("sha256")]
Rating = Annotated[float, keywords(minimum=0, maximum=1)]


@dataclass(frozen=True)
class CutSource:
    """The record.

    Attributes:
        source: Name of the file.
        sha256: SHA-256 of a file's content.
        label: Whether the record was measured or reconstructed from published figures.
    """

    source: str
    sha256: Sha256
    label: Annotated[str, one_of("measured", "reconstructed")]

    @classmethod
    def of(cls, setup: Setup) -> CutSource:
        """That of a set-up."""
        trace = setup.curve.trace
        return cls(trace.source, trace.sha256, trace.label)


@dataclass(frozen=True)
class InSampleNull:
    """A null model against the trace.

    Attributes:
        R: Overall rating in the style of ISO/TS 18571; 1 is perfect.
        nrmse: Root mean square difference over the measured peak, a fraction.
    """

    R: Rating
    nrmse: NotNegative


@dataclass(frozen=True)
class HeldOutNull:
    """A null model against the trace.

    Attributes:
        nrmse: Root mean square difference over the measured peak, a fraction.
        shape_error: The same with each curve over its own peak, a fraction.
        R: Overall rating in the style of ISO/TS 18571; 1 is perfect.
    """

    nrmse: NotNegative
    shape_error: NotNegative
    R: Rating


@dataclass(frozen=True)
class HeldOutLimits:
    """Limits of passing.

    Attributes:
        nrmse: Largest curve error.
        rating: Least rating R.
        inside: Least part within the band.
        width: Largest mean width of the band, over the measured peak; missing in older documents.
    """

    nrmse: Positive = PREDICTION_NRMSE_LIMIT
    rating: Positive = PREDICTION_RATING_LIMIT
    inside: Positive = INSIDE_LIMIT
    width: Positive | None = field(default=None, metadata=NULL)


@dataclass(frozen=True)
class InSampleCut:
    """A cut that was fitted.

    Attributes:
        trace: The record.
        in_sample: That the figures are of a cut that was fitted.
        passed: Whether no line of its verdict failed.
        verdicts: Lines of its verdict.
        metrics: A simulated curve against a measured one over the stroke.
        factor: Factor on the simulated force, for width and gain of this specimen.
        nuisances: What the fit says of the measurement, by name.
        predictive_inside: Part of the measured points within the 95 % band; null where the fit ended too early.
        null_models: Curves that explain nothing, by name.
        numerical_checks: What numerical choices change.
        scalars: Numbers of the best simulation, names with units.
        values: Values of the best simulation [SI], by name.
        dx_m: Cell of the grid [m].
        shape: Specimen as it was simulated.
        knife: Knife as it was simulated.
        predictive_width: Mean width of that band over the measured peak; null where the fit ended too early.
        conditioning: How the record became a curve over the stroke; missing in older documents.
        mach: Blade speed over the P-wave speed; missing in older documents.
        speed_real_m_s: Real speed of the knife that was given [m/s]; missing where none was.
        scene: All numbers of the simulated scene, in the layout of the solver's own classes, which is no part of this
            document's contract; missing in older documents.
    """

    trace: CutSource
    in_sample: Annotated[bool, keywords(const=True)]
    passed: bool
    verdicts: Annotated[tuple[Annotated[Verdict, Shared("verdict")], ...], keywords(minItems=1)]
    metrics: Annotated[Metrics, Shared("metrics")]
    factor: Positive
    nuisances: Mapping[str, Annotated[FittedNuisance, Shared("nuisance")]]
    predictive_inside: Fraction | None
    null_models: Mapping[str, InSampleNull]
    numerical_checks: tuple[Annotated[Check, Shared("check")], ...]
    scalars: Mapping[str, float]
    values: Mapping[str, float]
    dx_m: Positive
    shape: Annotated[Shape, Shared("shape")]
    knife: Annotated[Knife, Shared("knife")]
    predictive_width: NotNegative | None = field(default=None, metadata=NULL)
    conditioning: Conditioning | None = None
    mach: Positive | None = None
    speed_real_m_s: float | None = None
    scene: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, cut: FittedCut) -> InSampleCut:
        """That of a fitted cut."""
        knife = cut.scene.knife
        assert isinstance(knife, Knife)  # a study has no presses
        return cls(
            trace=CutSource.of(cut.setup),
            in_sample=True,
            passed=cut.passed,
            verdicts=cut.verdicts,
            metrics=cut.metrics,
            factor=cut.factor,
            nuisances={e.name: FittedNuisance.of(e) for e in cut.nuisances},
            predictive_inside=None if cut.band is None else cut.band.inside,
            null_models={n: InSampleNull(m.iso18571.R, m.nrmse) for n, m in cut.nulls.items()},
            numerical_checks=tuple(cut.checks),
            scalars=cut.run.evaluation.scalars,
            values=cut.values,
            dx_m=cut.setup.fine.numerics.dx,
            shape=cut.scene.food.shape,
            knife=knife,
            predictive_width=None if cut.band is None else mean_width(cut.band, cut.metrics),
            conditioning=Conditioning.of(cut.setup.curve, cut.setup.bandwidth),
            mach=cut.scene.motion.mach,
            speed_real_m_s=cut.setup.request.speed,
            scene=cut.scene.as_dict(),
        )


@dataclass(frozen=True)
class HeldOutCut:
    """A held-out cut.

    Attributes:
        trace: The record.
        trained_on: Cuts whose flesh it is predicted with.
        passed: Whether curve, rating, band, its width and balances are within their limits.
        metrics: A simulated curve against a measured one over the stroke.
        factor: Factor on the simulated force, for width and gain of this specimen: fitted to this cut.
        fitted: What the specimen has for itself [SI], fitted to this cut, by name.
        predictive_inside: Part of the measured points within the 95 % band.
        limits: Limits of passing.
        null_models: Curves that explain nothing, by name; one is the mean of the others.
        beats: Null models that it beats in rating and shape.
        simulations: Simulations it took.
        verdicts: Lines of its balances.
        predictive_width: Mean width of that band over the measured peak; null in older documents.
        nuisances: What the prediction says of the measurement, by name; null in older documents.
        dx_m: Cell of the grid [m]; null in older documents.
        particles: Particles of its simulation; null where nobody counted them.
        shape: Specimen as it was simulated; missing in older documents.
        knife: Knife as it was simulated; missing in older documents.
        conditioning: How the record became a curve over the stroke; missing in older documents.
    """

    trace: CutSource
    trained_on: tuple[str, ...]
    passed: bool
    metrics: Annotated[Metrics, Shared("metrics")]
    factor: Positive
    fitted: Mapping[str, float]
    predictive_inside: Fraction
    limits: HeldOutLimits
    null_models: Mapping[str, HeldOutNull]
    beats: tuple[str, ...]
    simulations: Count
    verdicts: tuple[Annotated[Verdict, Shared("verdict")], ...]
    predictive_width: NotNegative | None = field(default=None, metadata=NULL)
    nuisances: Mapping[str, Annotated[FittedNuisance, Shared("nuisance")]] | None = field(default=None, metadata=NULL)
    dx_m: Positive | None = field(default=None, metadata=NULL)
    particles: Count | None = field(default=None, metadata=NULL)
    shape: Annotated[Shape | None, Shared("shape")] = None
    knife: Annotated[Knife | None, Shared("knife")] = None
    conditioning: Conditioning | None = None

    @classmethod
    def of(cls, found: HeldOutPrediction, setup: Setup) -> HeldOutCut:
        """That of a prediction."""
        knife = found.scene.knife
        assert isinstance(knife, Knife)  # a study has no presses
        return cls(
            trace=CutSource.of(setup),
            trained_on=found.trained_on,
            passed=found.passed,
            metrics=found.metrics,
            factor=found.factor,
            fitted=found.fitted,
            predictive_inside=found.band.inside,
            limits=HeldOutLimits(width=BAND_LIMIT),
            null_models={n: HeldOutNull(m.nrmse, m.shape_error, m.iso18571.R) for n, m in found.nulls.items()},
            beats=found.beats,
            simulations=found.simulations,
            verdicts=found.balances,
            predictive_width=found.width,
            nuisances={e.name: FittedNuisance.of(e) for e in found.nuisances},
            dx_m=found.scene.numerics.dx,
            particles=found.particles,
            shape=found.scene.food.shape,
            knife=knife,
            conditioning=Conditioning.of(setup.curve, setup.bandwidth),
        )


@dataclass(frozen=True)
class StudyParameter(FittedParameter):
    """A fitted parameter, of all cuts or of one.

    Attributes:
        shared: Whether it is the same for all cuts.
    """

    shared: bool = True

    @classmethod
    def of_study(cls, found: Interval | Parameter, known: Property, *, shared: bool) -> StudyParameter:
        """A parameter of a joint fit.

        Args:
            found: Its interval; only the parameter where the fit ended too early for one.
            known: What the literature says of it.
            shared: Whether it is the same for all cuts.

        Returns:
            The parameter as the document has it.
        """
        return cls(**vars(FittedParameter.of(found, known, None)), shared=shared)


@dataclass(frozen=True)
class StudyResult:
    """A calibration on several cuts.

    ``summary.json`` of ``calibrate --config``, and what ``calibrate --config --json`` prints.

    Attributes:
        food: Food of materials.yaml, or of the file given.
        study: File of the study.
        created: When it was made, ISO 8601 with the time zone.
        status: That the run came to its end.
        search: How the search ended: no gain in sight; gains promised, none realised; budget spent; stopped by Ctrl-C.
        passed: Whether every fitted and every held-out cut passed.
        held_out: Names of the cuts under hold_out.
        scatter: Standard deviation of the logarithm of each property of the flesh among specimens, in the bands of
            held-out cuts.
        hold_out: Cuts that no fit has seen, and what was predicted of them, by name.
        traces: Cuts that were fitted together, in-sample, by name.
        parameters: Fitted parameters; one that a specimen has for itself is NAME@CUT.
        reduced_chi2: Chi-square of the residuals over their number, correlation considered; null where the fit ended
            too early.
        failed_simulations: Simulations of the joint search that broke down.
        limits: What the result does not show, one sentence each.
        presses: Compression tests of the study, by name.
        warnings: What a reader of the numbers must know about the input, one sentence each.
        simulations: All simulations that are stored.
        wall_s: Run time [s].
        invocation: How it was called.
        software: What was run.
        correlations: Posterior correlation of two parameters, by "one,other"; missing where the fit ended too early,
            and in older documents.
        discrepancy: How far the fit lets a right model be from a trace, part of the peak; missing in older documents.
    """

    DOCUMENT: ClassVar = "study"

    food: str
    study: str
    created: Annotated[str, Shared("created")]
    status: Annotated[str, one_of("done")]
    search: Annotated[str, one_of("converged", "stalled", "budget", "interrupted")]
    passed: bool
    held_out: tuple[str, ...]
    scatter: NotNegative
    hold_out: Mapping[str, HeldOutCut]
    traces: Annotated[Mapping[str, InSampleCut], keywords(minProperties=1)]
    parameters: Annotated[Mapping[str, Annotated[StudyParameter, Shared("parameter")]], keywords(minProperties=1)]
    reduced_chi2: float | None
    failed_simulations: Count
    limits: Annotated[tuple[str, ...], Shared("limits")]
    presses: Mapping[str, CompressionModulus]
    warnings: Annotated[tuple[str, ...], Shared("warnings")]
    simulations: Count
    wall_s: NotNegative
    invocation: Invocation = field(metadata=FLAT)
    software: Software = field(metadata=FLAT)
    correlations: Mapping[str, Annotated[float, keywords(minimum=-1, maximum=1)]] | None = None
    discrepancy: Fraction | None = None


def write_result(result: StudyResult, folder: Path) -> None:
    """Write ``summary.json`` of a study.

    Raises:
        OutputError: It cannot be written.
    """
    write_json(folder / SUMMARY, to_document(result))


def read_result(folder: Path) -> StudyResult:
    """The result of a finished study from its folder.

    Raises:
        DocumentError: ``summary.json`` is missing, damaged or incomplete.
    """
    return read_document(folder / SUMMARY, StudyResult)
