"""What a measurement leaves open of its own curve, and what is left between it and the simulation, in words."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from reports.base.format import before_and_after, count, plain, quantity
from reports.base.labels import capital, in_words

if TYPE_CHECKING:
    from calib.calibration.result import CalibrationResult
    from calib.uncertainty.estimates import FittedNuisance

#: What a measurement leaves open of its own curve.
LEFT_OPEN = {
    "tare": "level of the force before contact",
    "drift": "change of that level until the end",
    "lag": "shift of the force along the stroke",
    "bandwidth": "logarithm of the cut-off of the sensor's low-pass",
    "gain": "factor on the force: the sensor",
    "width": "factor on the force: width of the specimen",
    "scale": "factor on the force: width and sensor",
}
#: Independent readings of a curve that the search assumes: residuals hang together over a twentieth of the stroke.
ASSUMED_READINGS = 20
#: The line of the verdict table that the size of the residuals decides.
EXPLAINED = "curve explained by the food"
#: What is another thing on the way up.
LEFT_OPEN_UP = {"tare": "level of the force on the way up: that before contact, and the drift until then"}


def left_open(name: str, n: FittedNuisance | Any, *, up: bool = False) -> list[str]:
    """What was known of one thing that the measurement leaves open, what the fit says of it, and whether they agree.

    Args:
        name: Its name.
        n: Its value, standard deviations and unit.
        up: Whether it is of the way up.

    Returns:
        Cells of a line: name, what it is, before, after, and ``yes`` or ``no``.
    """
    unit = "fraction" if n.unit == "-" else n.unit
    before, after = before_and_after(n.value, n.sd, n.prior_sd, unit)
    what = (LEFT_OPEN | LEFT_OPEN_UP if up else LEFT_OPEN).get(name, "")
    return [capital(in_words(name)), what, before, after, "no" if n.outside else "yes"]


def errors(result: CalibrationResult, points: int) -> list[str]:
    """How the errors of the fit hang together, and how large they are, in sentences.

    Args:
        result: The calibration.
        points: Number of points of the curve.

    Returns:
        The sentences; none where the fit ended too early.
    """
    said = []
    stroke, length = result.conditioning.stroke_m, result.posterior.correlation_length_m
    reduced, over = result.posterior.reduced_chi2, ""
    if length is not None and length > 0.0:
        independent = max(round(stroke / length), 1)
        over = f" of the curve's {count(independent)} readings and the peak, less what the parameters take up"
        said.append(
            f"The residuals hang together over {quantity(length, 'm', digits=2)} of stroke, so that the {count(points)}"
            f" points of the curve count as about {count(independent)} independent readings."
        )
    over = "" if result.withdrawal is not None else over
    if reduced is not None:
        said.append(f"{size_of_errors(reduced, over)}{_assumed(result, points)}")
    return said


def size_of_errors(reduced: float, over: str = "") -> str:
    """What a reduced chi-square says, in a sentence.

    Args:
        reduced: The reduced chi-square [-].
        over: What it is taken over, with a blank before it; empty where that is not said.
    """
    begin = f"Reduced chi-square {plain(reduced)}{over}: what is left is"
    if reduced > 1.0:
        return (
            f"{begin} {plain(math.sqrt(reduced), 2)} times as large as the stated errors of trace and simulation "
            "explain, and all intervals were widened by that."
        )
    return (
        f"{begin} no larger than the stated errors of trace and simulation explain; no interval was widened or "
        "narrowed for it."
    )


def assumed_data(result: CalibrationResult, points: int) -> int:
    """Number of independent data of all curves and their peaks, as the search assumes before it knows the residuals.

    Args:
        result: The calibration.
        points: Number of points of the curve.

    Returns:
        The number [-].
    """
    ways = 1 if result.withdrawal is None else 2
    return ways * (min(points, ASSUMED_READINGS) + 1)


def _assumed(result: CalibrationResult, points: int) -> str:
    """The chi-square by which the search goes, and that of the verdict table; nothing where none is known."""
    if not result.history.misfit_history:
        return ""
    least, data = result.history.misfit_history[-1][1], assumed_data(result, points)
    said = (
        f" The search cannot know that length, and assumes {ASSUMED_READINGS} readings of a curve: by that the least "
        f"chi-square, with the literature's part, is {plain(least)} for {count(data)} independent data (curve and peak"
        f"{'' if result.withdrawal is None else ', down and up'}), {plain(least / data)} each."
    )
    if result.sampled is not None or not any(v.name == EXPLAINED for v in result.verdicts):
        return said
    return f"{said} The line “{EXPLAINED}” of the verdict table has the less probable of these two chi-squares."
