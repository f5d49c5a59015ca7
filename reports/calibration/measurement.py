"""What a measurement leaves open of its own curve, and what is left between it and the simulation, in words."""

from __future__ import annotations

import math

from reports.base.format import count, plain, quantity, uncertain
from reports.base.labels import capital, words
from reports.base.run_folder import Data

#: What a measurement leaves open of its own curve.
LEFT_OPEN = {
    "tare": "level of the force before contact",
    "drift": "change of that level until the end",
    "lag": "shift of the force along the stroke",
    "gain": "factor on the force: the sensor",
    "width": "factor on the force: width of the specimen",
    "scale": "factor on the force: width and sensor",
}


def left_open(name: str, n: Data) -> list[str]:
    """What was known of one thing that the measurement leaves open, what the fit says of it, and whether they agree."""
    unit = "fraction" if n["unit"] == "-" else n["unit"]
    before = f"0 ± {quantity(n['prior_sd'], unit, digits=2)}"
    said = "yes" if not n["outside"] else "no"
    return [capital(words(name)), LEFT_OPEN.get(name, ""), before, uncertain(n["value"], n["sd"], unit), said]


def errors(s: Data, points: int) -> list[str]:
    """How the errors of the fit hang together, and how large they are."""
    said = []
    length, reduced = s.get("correlation_length_m"), s.get("reduced_chi2")
    if length is not None and length > 0.0:
        independent = max(round(s["stroke_m"] / length), 1)
        said.append(
            f"The residuals hang together over {quantity(length, 'm', digits=2)} of stroke, so that the {count(points)} "
            f"points of the curve count as about {count(independent)} independent readings."
        )
    if reduced is not None and reduced > 1.0:
        said.append(
            f"Reduced chi-square {plain(reduced)}: what is left is {plain(math.sqrt(reduced), 2)} times as large as the "
            "stated errors of trace and simulation explain, and all intervals were widened by that."
        )
    elif reduced is not None:
        said.append(
            f"Reduced chi-square {plain(reduced)}: what is left is no larger than the stated errors of trace and "
            "simulation explain; no interval was widened or narrowed for it."
        )
    return said
