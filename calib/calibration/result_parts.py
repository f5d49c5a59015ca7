"""The parts of a calibration's result, each as ``summary.json`` has it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from calib.io.type_schema import ALWAYS, Count, Fraction, NotNegative, Positive, Shared, keywords, one_of
from calib.io.typed_document import ANY, FORMER, NULL
from calib.material.properties import PROPERTIES
from calib.trace.conditioning import Conditioned
from calib.validation.metrics import IsoRating, Metrics, SpragueGeers
from mpm.scene import Knife
from mpm.scene.shapes import Shape

Sha256 = Annotated[str, Shared("sha256")]


@dataclass(frozen=True)
class TraceSource:
    """The record that was fitted.

    Attributes:
        source: Name of the file, or of the object in Python.
        label: Whether the record was measured or reconstructed from published figures.
        sha256: SHA-256 of a file's content.
        samples: Number of samples.
        duration_s: Time from the first to the last sample [s].
        columns: Column that was used for time, force and position, by these names.
    """

    source: str
    label: Annotated[str, one_of("measured", "reconstructed")]
    sha256: Sha256
    samples: Count
    duration_s: Positive
    columns: Mapping[str, str]


@dataclass(frozen=True)
class AirSource:
    """The record without food.

    Attributes:
        source: Name of the file, or of the object in Python.
        sha256: SHA-256 of a file's content.
    """

    source: Annotated[str | None, ALWAYS] = field(default=None, metadata=NULL)
    sha256: Annotated[str | None, Shared("sha256"), ALWAYS] = field(default=None, metadata=NULL)


@dataclass(frozen=True)
class Conditioning:
    """How the record became a curve over the stroke.

    Attributes:
        baseline_N: Force before contact that was subtracted [N].
        baseline_sd_N: Its standard deviation [N].
        baseline_kind: What was subtracted: a constant, the line through the force before contact, nothing, or the air
            run at equal time.
        onset_s: Time of first contact [s].
        onset_sd_s: Its standard deviation [s].
        end_s: Time at which the cut ends [s].
        stroke_m: Way of the edge from contact to that end [m].
        stroke_source: What the stroke rests on: the trace's position, a constant speed, or the height of the food.
        noise_sd_N: Standard deviation of the noise of the force [N].
        filter_sd_m: Width of the Gaussian filter on both curves [m].
        bandwidth_Hz: Cut-off of the sensor's low-pass, through which the simulated force goes too [Hz]; missing: none.
        baseline_window_s: Start and end of the baseline window [s].
        end_sd_s: Standard deviation of the end [s].
    """

    baseline_N: float
    baseline_sd_N: Annotated[NotNegative | None, ALWAYS]
    baseline_kind: Annotated[str, one_of("constant", "linear", "zero", "air")]
    onset_s: float
    onset_sd_s: Annotated[NotNegative | None, ALWAYS]
    end_s: float
    stroke_m: Positive
    stroke_source: Annotated[str, one_of("position", "speed", "height")]
    noise_sd_N: NotNegative
    filter_sd_m: NotNegative
    bandwidth_Hz: Positive | None = None
    baseline_window_s: tuple[float, float] | None = field(default=None, metadata=FORMER)
    end_sd_s: float | None = field(default=None, metadata=FORMER)

    @classmethod
    def of(cls, curve: Conditioned, bandwidth: float) -> Conditioning:
        """That of a conditioned trace, whose sensor has a low-pass of this cut-off [Hz]; infinite for none."""
        return cls(
            baseline_N=curve.baseline_N,
            baseline_sd_N=curve.baseline_sd_N,
            baseline_kind=curve.baseline_kind,
            onset_s=curve.onset_s,
            onset_sd_s=curve.onset_sd_s,
            end_s=curve.end_s,
            stroke_m=curve.stroke_length_m,
            stroke_source=curve.stroke_source,
            noise_sd_N=curve.noise_sd_N,
            filter_sd_m=curve.filter_sd_m,
            bandwidth_Hz=bandwidth if math.isfinite(bandwidth) else None,
        )


@dataclass(frozen=True)
class NullRating:
    """A null model against the trace.

    Attributes:
        nrmse: Root mean square difference over the measured peak, a fraction.
        shape_error: The same with each curve over its own peak, a fraction.
        peak_error: Peak over the measured peak less 1.
        work_error: Work over the measured work less 1.
        R: Overall rating in the style of ISO/TS 18571; 1 is perfect.
    """

    nrmse: Annotated[NotNegative | None, ALWAYS]
    shape_error: Annotated[NotNegative | None, ALWAYS]
    peak_error: Annotated[float | None, ALWAYS]
    work_error: Annotated[float | None, ALWAYS]
    R: Annotated[Fraction | None, ALWAYS]

    @classmethod
    def of(cls, metrics: Metrics) -> NullRating:
        """The part of a comparison that null models are rated by."""
        m = metrics
        return cls(m.nrmse, m.shape_error, m.peak_error, m.work_error, m.iso18571.R)


@dataclass(frozen=True)
class Agreement:
    """The simulated curve, and curves that explain nothing, against the trace.

    Attributes:
        metrics: A simulated curve against a measured one over the stroke.
        null_models: Curves that explain nothing against the trace, by name.
        peak_real_sd_N: Standard deviation of the measured peak [N].
    """

    HEADLINE: ClassVar[tuple[str, ...]] = (
        "peak_real_N", "peak_sim_N", "peak_error", "shape_error", "nrmse", "work_error"
    )  # fmt: skip
    RATINGS: ClassVar[tuple[str, ...]] = ("sprague_geers", "iso18571")
    KEYS: ClassVar[tuple[str, ...]] = (*HEADLINE, "metrics", *RATINGS, "null_models", "peak_real_sd_N")

    metrics: Annotated[Metrics, Shared("metrics")]
    null_models: Mapping[str, NullRating]
    peak_real_sd_N: Annotated[NotNegative | None, ALWAYS]

    @property
    def peak_real_N(self) -> Positive:
        """Largest measured force [N]."""
        return self.metrics.peak_real_N

    @property
    def peak_sim_N(self) -> Positive:
        """Largest simulated force at the best values [N]."""
        return self.metrics.peak_sim_N

    @property
    def peak_error(self) -> float:
        """Simulated over measured peak less 1, a fraction."""
        return self.metrics.peak_error

    @property
    def shape_error(self) -> NotNegative:
        """Root mean square difference of the curves, each over its own peak, a fraction."""
        return self.metrics.shape_error

    @property
    def nrmse(self) -> NotNegative:
        """Root mean square difference over the measured peak, a fraction."""
        return self.metrics.nrmse

    @property
    def work_error(self) -> float:
        """Simulated over measured work less 1, a fraction."""
        return self.metrics.work_error

    @property
    def R(self) -> float:
        """Overall rating in the style of ISO/TS 18571; 1 is perfect."""
        return self.metrics.iso18571.R

    @property
    def sprague_geers(self) -> Annotated[SpragueGeers, Shared("spragueGeers")]:
        """Sprague and Geers' errors, fractions."""
        return self.metrics.sprague_geers

    @property
    def iso18571(self) -> Annotated[IsoRating, Shared("iso18571")]:
        """Rating in the style of ISO/TS 18571; 1 is perfect."""
        return self.metrics.iso18571


@dataclass(frozen=True)
class ProfileCurve:
    """Profile likelihood of one parameter, points in rising order.

    Attributes:
        value: Value of the parameter [unit].
        rise: Rise of the chi-square above its least value, all others fitted again; 3.84 ends a 95 % interval.
        trace_alone: Part of that rise which is the trace's and not the prior's.
    """

    value: tuple[float, ...]
    rise: tuple[float, ...]
    trace_alone: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class Posterior:
    """What is known of all parameters together.

    Attributes:
        profiles: Profile likelihoods, by parameter; empty where the fit ended too early.
        reduced_chi2: Chi-square of the residuals over their number, correlation considered; null where the fit ended
            too early.
        correlation_length_m: Correlation length of the residuals along the stroke [m]; null where the fit ended too
            early.
        predictive_inside: Part of the measured points within the 95 % band; null where the fit ended too early.
        correlations: Posterior correlation of two parameters, by "one,other".
        R_if_known: Width of the interval of R over what it is [-], if one thing more of specimen or sensor was known,
            by its name; missing where R was not fitted or the fit ended too early.
        discrepancy: How far the fit lets a right model be from the trace, part of the peak; missing in documents of
            older versions.
    """

    profiles: Mapping[str, ProfileCurve] = field(default_factory=dict)
    reduced_chi2: float | None = field(default=None, metadata=NULL)
    correlation_length_m: float | None = field(default=None, metadata=NULL)
    predictive_inside: Fraction | None = field(default=None, metadata=NULL)
    correlations: Mapping[str, Annotated[float | None, keywords(minimum=-1, maximum=1), ALWAYS]]
    R_if_known: Mapping[str, float] | None = None
    discrepancy: Fraction | None = None


@dataclass(frozen=True)
class FixedParameter:
    """A value that was not fitted.

    Attributes:
        value: Value [unit].
        unit: SI unit, - where there is none.
        status: How far it can be trusted, as in ``materials.yaml``.
        source: Where the value comes from.
    """

    value: float | None
    unit: str
    status: str
    source: Annotated[str | None, ALWAYS]


@dataclass(frozen=True)
class BrokenRun:
    """A simulation that broke down.

    Attributes:
        reason: Why a run broke down: not_finite, left_grid, inverted, worker_died, or what else the solver said.
        fraction: Part of the stroke that was reached.
        parameters: Its values [SI], by name.
    """

    reason: str
    fraction: Annotated[Fraction | None, ALWAYS]
    parameters: Mapping[str, float]

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each of its values; - of what is no property of the material."""
        return {name: PROPERTIES[name].unit if name in PROPERTIES else "-" for name in self.parameters}


@dataclass(frozen=True)
class Tally:
    """Simulations of one kind.

    Attributes:
        simulations: How many there are.
        failed: How many of them broke down.
    """

    simulations: Count
    failed: Count


@dataclass(frozen=True, kw_only=True)
class SearchHistory:
    """The simulations of the search.

    Attributes:
        simulations: Simulations of the search, on both grids.
        fine_simulations: Those on the grid that counts.
        coarse_simulations: Those on the screening grid.
        failed_simulations: Those that broke down.
        failures: Simulations that broke down.
        misfit_history: Least misfit so far, after each simulation from the first sound one: number of the simulation
            and misfit.
        repeatability: Noise of a simulated curve as the fit sees it, part of the peak; null where the fit ended too
            early.
        kept: All simulations that evaluations.h5 holds, those of intervals and checks too, by fidelity: coarse, fine,
            again (half the speed, other particles), check.
    """

    simulations: Count
    fine_simulations: Annotated[Count | None, ALWAYS] = field(default=None, metadata=NULL)
    coarse_simulations: Annotated[Count | None, ALWAYS] = field(default=None, metadata=NULL)
    failed_simulations: Count
    failures: tuple[Annotated[BrokenRun, keywords(description="One of them")], ...]
    misfit_history: tuple[tuple[Annotated[int, keywords(minimum=1)], float], ...]
    repeatability: float | None = field(default=None, metadata=NULL)
    kept: Mapping[str, Tally] = field(default_factory=dict)

    @property
    def every(self) -> Tally:
        """All simulations of the calibration, those of intervals and checks too; of older ones those of the search."""
        kept = self.kept.values()
        if not kept:
            return Tally(self.simulations, self.failed_simulations)
        return Tally(sum(t.simulations for t in kept), sum(t.failed for t in kept))


@dataclass(frozen=True, kw_only=True)
class SimulatedCut:
    """The cut at the best values, and how it was simulated.

    Attributes:
        dx_m: Cell of the grid [m].
        particles: Particles of the simulated part.
        mirror_images: Parts that the simulated one stands for.
        mach: Blade speed over the P-wave speed.
        speed_real_m_s: Real speed of the knife that was given [m/s]; null where none was.
        momentum_residual: Part of the momentum balance that does not close, over the peak force.
        ke_over_ie: Kinetic over internal energy.
        ripple_N: Ripple of the simulated force [N].
        energy_J: Where the work of knife and gravity has gone [J].
        fracture: Energy of new surface; null where nothing was cut.
        parted: Energy that the edge has taken over R times the new area; below 0.8 the food was pressed away rather
            than cut; null where there is nothing to judge.
        counters: How often each exceptional branch was taken, by name; all zero in a sound run.
        shape: Specimen as it was simulated.
        knife: Knife as it was simulated.
        scene: All numbers of the simulated scene, in the layout of the solver's own classes; they are for repeating it,
            and their layout is not a part of this document's contract.
    """

    dx_m: Positive
    particles: Annotated[Count | None, ALWAYS]
    mirror_images: Annotated[int, one_of(1, 2, 4)] = field(metadata=ANY)
    mach: Annotated[Positive | None, ALWAYS]
    speed_real_m_s: float | None = field(default=None, metadata=NULL)
    momentum_residual: Annotated[NotNegative | None, ALWAYS]
    ke_over_ie: Annotated[float | None, ALWAYS]
    ripple_N: Annotated[float | None, ALWAYS]
    energy_J: Annotated[Mapping[str, float] | None, Shared("energy"), ALWAYS] = field(default=None, metadata=NULL)
    fracture: Annotated[Mapping[str, float] | None, Shared("fracture")] = field(default=None, metadata=NULL)
    parted: NotNegative | None = field(default=None, metadata=NULL)
    counters: Annotated[Mapping[str, int] | None, Shared("counters"), ALWAYS] = field(default=None, metadata=NULL)
    shape: Annotated[Shape, Shared("shape")]
    knife: Annotated[Knife, Shared("knife")]
    scene: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class SobolIndices:
    """Sobol indices of a quantity for one parameter.

    Attributes:
        first: First-order index; null for a quantity that nothing moves.
        first_conf: Half its 95 % interval.
        total: Total index.
        total_conf: Half its 95 % interval.
    """

    first: float | None
    first_conf: float | None = field(default=None, metadata=NULL)
    total: float | None
    total_conf: float | None
