"""What a calibration ends with, as a typed value: written to ``summary.json`` by one function, read back by one."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pandas as pd

from calib.calibration.fit_report import fit_report, html_table
from calib.calibration.result_parts import (
    Agreement,
    AirSource,
    Conditioning,
    FixedParameter,
    NullRating,
    Posterior,
    SearchHistory,
    Sha256,
    SimulatedCut,
    SobolIndices,
    TraceSource,
)
from calib.calibration.run_folder import RunFolder
from calib.calibration.withdrawal_result import WithdrawalAgreement
from calib.errors import CurveError, DocumentError, OutputError
from calib.io import typed_document
from calib.io.folder import finite
from calib.io.provenance import Invocation, Software
from calib.io.type_schema import ALWAYS, NotNegative, Shared, keywords, one_of
from calib.io.typed_document import FLAT, NULL, renamed
from calib.io.wide_table import WideTable, table_of_rows
from calib.io.wording import brief
from calib.material.properties import MEANINGS
from calib.material.references import cited
from calib.posterior.estimates import ModeSummary, PosteriorSummary
from calib.simulation.evaluation_frame import evaluation_frame
from calib.uncertainty.estimates import FittedNuisance, FittedParameter
from calib.validation.acceptance import Verdict
from calib.validation.metrics import Metrics, compare
from calib.validation.numerical_checks import Check

SUMMARY, CURVES, WITHDRAWAL_CURVES = "summary.json", "curves.csv", "withdrawal.csv"
REMEDY = "run the same calibrate command again with --resume"
"""What to do about a folder that is not whole."""
RATED = {
    "sprague_geers": ("M", "P", "C"),
    "russell": ("M", "P", "C"),
    "iso18571": ("Z", "EP", "EM", "ES", "R", "shift"),
}
"""Numbers of the published ratings among the metrics."""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class CalibrationResult(RunFolder):
    """A calibration on one trace.

    ``summary.json`` of ``calibrate``, and what ``calibrate --json`` prints.

    It comes with its folder, in which there are the curves, the calibrated food and the report as well. SI units,
    errors as fractions; what is null in the document is None, or NaN among the metrics.

    Attributes:
        folder: The output folder.
        food: Food of materials.yaml, or of the file given.
        created: When it was made, ISO 8601 with the time zone.
        status: Whether the run came to its end or was stopped by Ctrl-C.
        search: How the search ended: no gain in sight; gains promised, none realised; budget spent; stopped by Ctrl-C.
        passed: Whether the run was finished and no line of the verdict failed.
        verdicts: Lines of the verdict table.
        trace: The record that was fitted.
        air: The motion without food that was subtracted; null where there is none.
        conditioning: How the record became a curve over the stroke.
        agreement: The simulated curve, and curves that explain nothing, against the trace.
        fitted: Fitted parameters, by name.
        nuisances: What the fit says of the measurement, by name: tare, drift, lag, bandwidth, gain, width; empty where
            the fit ended too early.
        posterior: What is known of all parameters together.
        fixed_parameters: Properties that were not fitted, by name.
        history: The simulations of the search.
        cut: The cut at the best values, and how it was simulated.
        software: What was run.
        invocation: How it was called.
        numerical_checks: What numerical choices change; empty where the fit was interrupted.
        warnings: What a reader of the numbers must know about the input, one sentence each.
        limits: What the result does not show, one sentence each.
        sensitivity: Sobol indices over the prior, by quantity (peak, work, initial_slope) and parameter; empty where
            the fit ended too early.
        sampled: The posterior over all plausible foods, with --sample; left out without.
        withdrawal: The way up against the trace, with --withdrawal; left out without.
        wall_s: Run time [s].
        at_literature: The simulation at the literature's values against the trace. It is not in the document but
            follows from the curves; None where that simulation did not end.
    """

    DOCUMENT: ClassVar[str] = "calibrate"
    KEYS: ClassVar[tuple[str, ...]] = (
        *("food", "created", "status", "search", "passed", "verdicts", "trace", "trace_sha256", "air", "conditioning"),
        *("agreement", "fitted", "nuisances", "posterior", "fixed_parameters", "history", "cut", "software"),
        *("invocation", "numerical_checks", "warnings", "limits", "sensitivity", "sampled", "withdrawal", "wall_s"),
    )

    folder: Path = Path()
    food: str
    created: Annotated[str, Shared("created")]
    status: Annotated[str, one_of("done", "interrupted")]
    search: Annotated[str | None, one_of("converged", "stalled", "budget", "interrupted"), ALWAYS] = field(
        default=None, metadata=NULL
    )
    passed: bool
    verdicts: Annotated[tuple[Annotated[Verdict, Shared("verdict")], ...], keywords(minItems=1)]
    trace: TraceSource
    air: AirSource | None
    conditioning: Conditioning = field(metadata=FLAT)
    agreement: Agreement = field(metadata=FLAT)
    fitted: Annotated[Mapping[str, Annotated[FittedParameter, Shared("parameter")]], keywords(minProperties=1)] = field(
        metadata=renamed("parameters")
    )
    nuisances: Mapping[str, Annotated[FittedNuisance, Shared("nuisance")]] = field(default_factory=dict)
    posterior: Posterior = field(metadata=FLAT)
    fixed_parameters: Mapping[str, Annotated[FixedParameter, Shared("value")]]
    history: SearchHistory = field(metadata=FLAT)
    cut: SimulatedCut = field(metadata=FLAT)
    software: Software = field(metadata=FLAT)
    invocation: Invocation = field(metadata=FLAT)
    numerical_checks: tuple[Annotated[Check, Shared("check")], ...] = ()
    warnings: Annotated[tuple[str, ...], Shared("warnings")]
    limits: Annotated[tuple[str, ...], Shared("limits")]
    sensitivity: Mapping[str, Mapping[str, SobolIndices]] = field(default_factory=dict)
    sampled: PosteriorSummary | None = None
    withdrawal: WithdrawalAgreement | None = None
    wall_s: Annotated[NotNegative | None, ALWAYS]
    at_literature: NullRating | None = None

    def __repr__(self) -> str:
        return f"CalibrationResult({str(self.folder)!r}, food={self.food!r}, passed={self.passed})"

    @property
    def trace_sha256(self) -> Sha256:
        """SHA-256 of the record, as in trace."""
        return self.trace.sha256

    @property
    def summary(self) -> dict[str, Any]:
        """Content of ``summary.json``: every figure of the report, SI units, errors as fractions."""
        return dict(finite(to_document(self)))

    @property
    def peak_sd_N(self) -> float:
        """Standard uncertainty of the measured peak [N]: of the curve (noise, baseline), the gain and the drift."""
        curve, gain, drift = self.peak_parts_N
        return math.hypot(curve, gain, drift)

    @property
    def peak_parts_N(self) -> tuple[float, float, float]:
        """Parts of the standard uncertainty of the measured peak [N]: curve, gain of the sensor, drift."""
        sd = {name: n.prior_sd for name, n in self.nuisances.items()}
        gain = sd.get("gain", 0.0) * self.agreement.peak_real_N
        return self.agreement.peak_real_sd_N or 0.0, gain, sd.get("drift", 0.0)

    @property
    def parameters(self) -> WideTable:
        """Fitted values by name: value, unit, 95 % interval, literature range, verdict, status, source."""
        return table_of_rows(self.summary["parameters"])

    @property
    def curves(self) -> WideTable:
        """Trace, simulation, its parts and the null models over the stroke [m, N].

        Raises:
            OutputError: curves.csv is missing or damaged.
        """
        return _table(self.folder / CURVES)

    @property
    def withdrawal_curves(self) -> WideTable:
        """Measured and simulated pull over the way up, with the 95 % band [m, N].

        Raises:
            OutputError: No way up was fitted, or withdrawal.csv is missing or damaged.
        """
        if self.withdrawal is None:
            raise OutputError(f"{self.folder}: no withdrawal was fitted; calibrate with withdrawal=True")
        return _table(self.folder / WITHDRAWAL_CURVES)

    @property
    def evaluations(self) -> WideTable:
        """All simulations of the search, a row each: outcome, grid, part of the stroke, time [s], parameters [SI].

        Raises:
            OutputError: evaluations.h5 is missing or damaged.
        """
        return WideTable(evaluation_frame(self.folder))

    @property
    def modes(self) -> tuple[ModeSummary, ...]:
        """Modes of the sampled posterior, the heaviest first; empty where it was not sampled."""
        return () if self.sampled is None else self.sampled.modes

    def fit_report(self) -> str:
        """Statistics, verdicts, parameters and the strongest correlations, as text."""
        return fit_report(self)

    def plot(self, ax: Sequence[Any] | None = None) -> tuple[Any, Any]:
        """Draw trace and simulation with the 95 % band, and the residual below.

        Args:
            ax: Two axes of matplotlib, for forces and residual; None for a new figure.

        Returns:
            The two axes.

        Raises:
            OutputError: curves.csv is missing or damaged.
        """
        from reports.base.interactive import fit_axes

        return fit_axes(self.curves, ax, f"{self.food}: {'passed' if self.passed else 'not passed'}")

    def _repr_html_(self) -> str:
        return html_table(self)

    @property
    def references(self) -> dict[str, str]:
        """What the sources of the values name, in full, by short name."""
        fitted, fixed = self.fitted.values(), self.fixed_parameters.values()
        return cited([*(p.source for p in fitted), *(p.source for p in fixed)])

    def meaning(self, name: str) -> str:
        """What a property is, in words; empty where the name is none of the material."""
        return MEANINGS.get(name, "")


def to_document(result: CalibrationResult) -> dict[str, Any]:
    """The content of ``summary.json``."""
    return typed_document.to_document(result)


def from_document(document: Any, folder: Path, remedy: str = REMEDY) -> CalibrationResult:
    """The calibration that a ``summary.json`` holds, also one of an older version.

    Args:
        document: Its content.
        folder: Where it lies.
        remedy: What to do about a document that is not whole, for errors.

    Returns:
        The calibration.

    Raises:
        DocumentError: Something is missing, or of another kind.
    """
    path = folder / SUMMARY
    try:
        result = typed_document.from_document(CalibrationResult, _completed(document))
        _check(result)
    except DocumentError as e:
        what = "; the file is incomplete or of another version of cutcal" if str(e).endswith("is missing") else ""
        raise DocumentError(f"{path}: {e}{what}; {remedy}") from None
    return replace(result, folder=folder)


def _completed(document: Any) -> Any:
    """The document with those metrics that older ones have at their top alone, or that were not known to them."""
    metrics = document.get("metrics") if isinstance(document, dict) else None
    if not isinstance(metrics, dict):
        return document
    top = {key: document[key] for key in (*Agreement.HEADLINE, *Agreement.RATINGS) if key in document}
    full: dict[str, Any] = dict.fromkeys(f.name for f in fields(Metrics)) | metrics | top
    for name, numbers in RATED.items():
        full[name] = dict.fromkeys(numbers) | (full[name] or {})
    full["iso18571"]["at_bound"] = bool(full["iso18571"].get("at_bound"))
    return document | {"metrics": full}


def _check(result: CalibrationResult) -> None:
    """Refuse what the types let pass.

    Raises:
        DocumentError: A word that nobody knows, a number that must be known and is not, or lists of a profile that do
            not belong together.
    """
    for place, word, words in (
        ("status", result.status, ("done", "interrupted")),
        ("trace.label", result.trace.label, ("measured", "reconstructed")),
    ):
        if word not in words:
            raise DocumentError(f"{place} is {word!r}, not {' or '.join(words)}")
    for place, number in _needed(result).items():
        if math.isnan(number):
            raise DocumentError(f"{place} is null, which it cannot be")
    for name, p in result.posterior.profiles.items():
        if len({len(p.value), len(p.rise), len(p.trace_alone)}) != 1:
            raise DocumentError(f"profiles.{name} has lists of unequal length")


def _needed(result: CalibrationResult) -> dict[str, float]:
    """The numbers without which there is no calibration, by their place in the document."""
    agreement, cut, trace = result.agreement, result.cut, result.trace
    found = {key: value for key, value in vars(result.conditioning).items() if isinstance(value, float)}
    for name in ("baseline_sd_N", "onset_sd_s", "end_sd_s"):  # which an older document may not know
        found.pop(name, None)
    found |= {"peak_real_N": agreement.peak_real_N, "peak_sim_N": agreement.peak_sim_N}
    found |= {"dx_m": cut.dx_m, "trace.duration_s": trace.duration_s}
    found |= {f"parameters.{name}.value": p.value for name, p in result.fitted.items()}
    found |= {f"nuisances.{n}.{key}": getattr(p, key) for n, p in result.nuisances.items() for key in ("value", "sd")}
    for name, profile in result.posterior.profiles.items():
        found |= {f"profiles.{name}.{key}": sum(values) for key, values in vars(profile).items()}
    return found


def read_result(folder: Path, remedy: str = REMEDY) -> CalibrationResult:
    """The finished calibration in a folder, with what its curves say of the literature's values.

    Args:
        folder: The output folder of ``calibrate``.
        remedy: What to do about a folder that is not whole, for errors.

    Returns:
        The calibration.

    Raises:
        OutputError: The folder or its summary is missing, damaged or incomplete.
    """
    if not folder.is_dir():
        raise OutputError(f"{folder}: no such folder; give the output folder of a calibration")
    result = from_document(read_summary(folder / SUMMARY, remedy), folder, remedy)
    return replace(result, at_literature=_rated(result))


def read_summary(path: Path, remedy: str = REMEDY) -> Any:
    """The content of a ``summary.json``; numbers that are not finite are None.

    Args:
        path: The file.
        remedy: What to do about a file that is not whole, for errors.

    Returns:
        Plain data.

    Raises:
        DocumentError: The file is missing or damaged.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"), parse_constant=lambda _: None)
    except OSError as e:
        what = "no such file" if isinstance(e, FileNotFoundError) else f"cannot be read ({e.strerror})"
        raise DocumentError(f"{path}: {what}; {remedy}") from None
    except ValueError as e:
        raise DocumentError(f"{path}: damaged, not JSON ({brief(str(e))}); {remedy}") from None


def _table(path: Path) -> WideTable:
    """A table of curves.

    Raises:
        OutputError: It is missing or damaged.
    """
    try:
        return WideTable(pd.read_csv(path))
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{path}: cannot be read ({brief(str(error))}); run the calibration with resume=True"
        ) from None


def _rated(result: CalibrationResult) -> NullRating | None:
    """The simulation at the literature's values against the trace, by the curves of a calibration; None where there is
    none, or the file is damaged."""
    try:
        curves = result.curves
        stroke, real, start = (curves[name].to_numpy(dtype=float) for name in ("stroke_m", "real_N", "start_N"))
    except (OutputError, ValueError, KeyError):
        return None
    if not np.all(np.isfinite(start)):
        return None
    try:
        return NullRating.of(compare(stroke, real, start))
    except CurveError:  # a simulation without any positive force cannot be rated
        return NullRating(None, None, None, None, None)
