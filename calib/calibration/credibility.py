"""A calibration in the words of verification and validation: comparison error, validation uncertainty, context of use.

By ASME V&V 20 (2009, section 1-5) the comparison error E = S - D of a simulated and a measured value holds the model's
error within E +- k u_val, where

    u_val^2 = u_num^2 + u_input^2 + u_D^2

are the standard uncertainties of the numerics, of what was put in, and of the measurement. ASME V&V 40 (2018) asks what
the model is used for, how much of a decision rests on it, and what a wrong decision costs; only a user can say that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, ClassVar

from calib.calibration.result import CalibrationResult
from calib.errors import MaterialError
from calib.io import typed_document
from calib.io.folder import write_json
from calib.io.type_schema import NotNegative, Positive, Shared
from calib.io.typed_document import FLAT, NULL
from calib.io.yaml_checks import check_keys, mapping, read_yaml, text
from calib.validation.numerical_checks import HALF_SPEED, VARIANTS, Check, at_rest

NAME = "credibility.json"
COVERAGE = 2.0
"""Coverage factor k: some 95 % of a normal distribution [-]."""
NOT_STATED = "not stated"
NOT_COUNTED = (
    "The parameters were fitted to this very trace, so that S - D is small by construction: it is an error after "
    "calibration, and a prediction of another cut (cutcal predict) is what validates.",
    "u_input is the width of the specimen where nobody measured it and it is not fitted; other sizes and properties "
    "that were put in have no uncertainty here.",
    "u_num takes each change (grid elsewhere, cells of two thirds, and half the speed carried on to rest) as one "
    "standard uncertainty. What half and twice of each constant of the method change is not in it: the verdict has "
    "that. It is no grid convergence index (cutcal converge has that).",
)


@dataclass(frozen=True)
class Context:
    """What the calibration is for, in the words of V&V 40, and what was cut and measured under which conditions.

    Attributes:
        context_of_use: What is decided with the model, for which foods and cuts.
        model_influence: How much of the decision rests on the model.
        decision_consequence: What a wrong decision costs.
        conditions: Of specimen and measurement, such as temperature, moisture, ripeness, sensor or operator, in words;
            empty where nobody has stated any. Nothing is computed with them.
    """

    context_of_use: str = NOT_STATED
    model_influence: str = NOT_STATED
    decision_consequence: str = NOT_STATED
    conditions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class ModelError:
    """A simulated value against a measured one, by V&V 20.

    Attributes:
        simulated: Simulated value S [unit].
        measured: Measured value D [unit].
        unit: SI unit.
        error: Comparison error E = S - D [unit].
        u_num: Standard uncertainty of the numerics [unit]; null where a repeated run broke down or none was made.
        u_input: Standard uncertainty of what was put in [unit].
        u_D: Standard uncertainty of the measurement [unit].
        u_val: Validation uncertainty [unit]; null where that of the numerics is.
        low: Lower end of the model's error, E - k u_val [unit]; null where u_val is.
        high: Upper end [unit]; null where u_val is.
    """

    simulated: float
    measured: float
    unit: str
    error: float
    u_num: NotNegative | None = field(metadata=NULL)
    u_input: NotNegative
    u_D: NotNegative
    u_val: NotNegative | None = field(metadata=NULL)
    low: float | None = field(metadata=NULL)
    high: float | None = field(metadata=NULL)


@dataclass(frozen=True, kw_only=True)
class Credibility:
    """What speaks for a calibration, by V&V 20 and V&V 40.

    ``credibility.json`` beside the summary of ``calibrate``.

    Attributes:
        food: Food of materials.yaml, or of the file given.
        trace_sha256: SHA-256 of a file's content.
        in_sample: Whether the values were fitted to the trace that they are compared with.
        coverage_factor: Coverage factor k.
        peak: Largest force.
        work: Work over the stroke.
        context: What the calibration is for; not stated where nobody has said so.
        not_counted: What the numbers do not say, one sentence each.
    """

    DOCUMENT: ClassVar[str] = "credibility"

    food: str
    trace_sha256: Annotated[str, Shared("sha256")]
    in_sample: bool = True
    coverage_factor: Positive = COVERAGE
    peak: ModelError
    work: ModelError
    context: Context = field(metadata=FLAT)
    not_counted: tuple[str, ...] = NOT_COUNTED


def credibility(result: CalibrationResult, context: Context = Context()) -> Credibility:
    """The words of a finished calibration.

    Args:
        result: The calibration.
        context: What it is for.

    Returns:
        Comparison errors and uncertainties of peak and work.
    """
    m = result.agreement.metrics
    sd = {name: n.prior_sd for name, n in result.nuisances.items()}
    stroke, gain = result.conditioning.stroke_m, sd.get("gain", 0.0)
    of_work = (gain * m.work_real_J, sd.get("tare", 0.0) * stroke, sd.get("drift", 0.0) * stroke / 2.0)
    width = sd.get("width", 0.0)
    return Credibility(
        food=result.food,
        trace_sha256=result.trace_sha256,
        peak=_error(m.peak_sim_N, m.peak_real_N, "N", (_numerics(result, "peak_change"), width, result.peak_sd_N)),
        work=_error(m.work_sim_J, m.work_real_J, "J", (_numerics(result, "work_change"), width, math.hypot(*of_work))),
        context=context,
    )


def _error(simulated: float, measured: float, unit: str, uncertain: tuple[float | None, float, float]) -> ModelError:
    """The comparison; numerics and input are parts of the simulated value, the measurement has the unit."""
    numerics, width, u_measured = uncertain
    u_input, error = width * simulated, simulated - measured
    if numerics is None:
        return ModelError(simulated, measured, unit, error, None, u_input, u_measured, None, None, None)
    u_num = numerics * simulated
    u_val = math.hypot(u_num, u_input, u_measured)
    reach = COVERAGE * u_val
    return ModelError(simulated, measured, unit, error, u_num, u_input, u_measured, u_val, error - reach, error + reach)


def _numerics(result: CalibrationResult, which: str) -> float | None:
    """Root of the sum of squares of what each numerical choice changes, part of the value; what smaller speeds change
    is carried on to rest."""

    def of(check: Check) -> float | None:
        return None if check.reason else getattr(check, which)

    checks = result.numerical_checks
    changes = {c.name: of(c) for c in checks if c.name in VARIANTS} | {HALF_SPEED: at_rest(checks, of)}
    if set(changes) != set(VARIANTS) or None in changes.values():
        return None
    return math.hypot(*(x for x in changes.values() if x is not None))


def write_credibility(result: CalibrationResult, context: Context | None = None) -> Path:
    """Write ``credibility.json`` into the folder of a calibration.

    Args:
        result: The calibration.
        context: What it is for; None for what the folder's file says already, else not stated.

    Returns:
        The file.
    """
    path = result.folder / NAME
    if context is None:
        context = read_credibility(result.folder).context if path.is_file() else Context()
    write_json(path, to_document(credibility(result, context)))
    return path


def to_document(found: Credibility) -> dict[str, Any]:
    """The content of ``credibility.json``."""
    return typed_document.to_document(found)


def read_credibility(folder: Path) -> Credibility:
    """What the folder of a calibration says.

    Raises:
        DocumentError: The file is missing, damaged or incomplete.
    """
    return typed_document.read_document(folder / NAME, Credibility)


def read_context(path: Path | str) -> Context:
    """What a YAML file says that a calibration is for.

    Args:
        path: A file with any of ``context_of_use``, ``model_influence``, ``decision_consequence`` and ``conditions``,
            which has names of its own.

    Returns:
        The context; what the file does not say is not stated.

    Raises:
        MaterialError: The file cannot be read, has another key, or a value that is no text.
    """
    top, content = read_yaml(path, kind=MaterialError)
    known = tuple(f.name for f in fields(Context))
    check_keys(top, content, (), known)
    place, stated = top.at("conditions"), content.pop("conditions", {})
    conditions = {}
    for name, value in mapping(place, stated).items():
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            raise place.at(name).error(f"is {value!r}, a number without a unit; give it in words, with its unit")
        conditions[str(name)] = text(place.at(name), value)
    return Context(**{name: text(top.at(name), value) for name, value in content.items()}, conditions=conditions)
