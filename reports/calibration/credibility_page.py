"""The page in the words of verification and validation: what ``credibility.json`` of a calibration says."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reports import ReportError
from reports.base.format import breakable, difference, interval, quantity
from reports.base.labels import capital, in_words
from reports.base.run_folder import REMEDY, Data, read_json

FILE = "credibility.json"
CONTEXT = {
    "context_of_use": "context of use",
    "model_influence": "influence of the model",
    "decision_consequence": "consequence of a wrong decision",
}
"""Keys of the context, and how the page calls them."""
VALUES = {"peak": "Peak force", "work": "Work"}
UNCERTAINTIES = ("u_num", "u_input", "u_D", "u_val")


def credibility(folder: Path) -> Data | None:
    """Comparison errors, uncertainties and context of a calibration, as text.

    Args:
        folder: The folder of the calibration.

    Returns:
        What the template prints; None where the folder has no ``credibility.json``, as those of older versions.

    Raises:
        ReportError: The file is damaged or incomplete.
    """
    path = folder / FILE
    if not path.is_file():
        return None
    found = read_json(path)
    try:
        return {
            "standards": ["[@ASME V&V 20]", "[@ASME V&V 40]"],
            "factor": f"{found['coverage_factor']:g}",
            "rows": [[label, *_row(found[key], found["coverage_factor"])] for key, label in VALUES.items()],
            "context": [[capital(label), breakable(found[key])] for key, label in CONTEXT.items()],
            "conditions": [[capital(in_words(n)), breakable(x)] for n, x in found.get("conditions", {}).items()],
            "stated": any(found[key] != "not stated" for key in CONTEXT),
            "not_counted": [_without_E(text) for text in found["not_counted"]],
        }
    except (KeyError, TypeError) as e:
        raise ReportError(f"{path}: damaged, incomplete ({e}); {REMEDY}") from None


def _without_E(text: str) -> str:
    """What older files call E, the comparison error, by its own name: E is Young's modulus."""
    return text.replace("so that E is small", "so that S - D is small").replace("S - D", "S \u2212 D")


def _row(one: Mapping[str, Any], factor: float) -> list[str]:
    """Simulated and measured value, error, uncertainties, the interval of the model's error, and what follows."""
    unit, error, reach = one["unit"], one["error"], one["u_val"]
    values = difference(one["simulated"], one["measured"], unit)
    uncertain = [quantity(one[key], unit, digits=2, like=one["measured"]) for key in UNCERTAINTIES]
    if reach is None:
        return [*values, *uncertain, "not known", "nothing: a repeated run broke down, or none was made"]
    within = abs(error) <= factor * reach
    said = "an error of the model is not shown" if within else "an error of the model is shown"
    return [*values, *uncertain, interval(one["low"], one["high"], unit, like=one["measured"]), said]
