"""Parts of a report on laws of rate: the verdict, the parameters, and each speed that was predicted unseen."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from reports.base.brief import ReportPart, ReportTable
from reports.base.format import plain
from reports.press.tables import MARKS, verdict_table

if TYPE_CHECKING:
    from calib.texture.texture_result import TextureResult

LAW = (
    "Instantaneous stress E (exp(b e) - 1) / b at the strain e, relaxing by a spectrum of times from 0.01 to 1000 s "
    "whose shares fall with a power of the time (quasi-linear viscoelasticity, Fung 1993); damage grows with the "
    "work that goes through (Miehe 1995), and is in the law where the information criterion is for it. The plate "
    "does not pull."
)
PREDICTED = (
    "Each speed by the law of the others. Scatter: 95 % interval of one more repeat. Area: area between prediction and "
    "distribution of the repeats over their mean (Ferson and Oberkampf), in brackets that of the repeats' own mean."
)
UNITS = {
    "E_Pa": ("E [kPa]", 1e-3),
    "stiffening": ("b", 1.0),
    "equilibrium": ("remains", 1.0),
    "power": ("power", 1.0),
    "damage": ("damage", 1.0),
}


def law_parts(result: TextureResult) -> list[ReportPart]:
    """The parts of a report on the laws of a texture test.

    Args:
        result: The texture profiles, with laws.

    Returns:
        Verdict, parameters, predictions.
    """
    parts = [ReportPart("Law of rate: verdict", table=verdict_table(result.verdicts))] if result.verdicts else []
    parts.append(ReportPart("Law of each direction", LAW, table=_parameters(result)))
    if result.verdicts:
        parts.append(ReportPart("Speeds that were left out", PREDICTED, table=_predictions(result)))
    return parts


def _parameters(result: TextureResult) -> ReportTable:
    """A row for each direction: values with their intervals."""
    rows = []
    for law in result.laws:
        cells = []
        for one in law.parameters:
            factor = UNITS[one.name][1]
            ends = f" ({plain(factor * one.low, 2)} to {plain(factor * one.high, 2)})" if one.high > one.low else ""
            cells.append(plain(factor * one.value) + ends)
        rows.append([law.direction, *cells, plain(law.damage_evidence, 2)])
    head = ("Direction", *(UNITS[one.name][0] for one in result.laws[0].parameters), "Evidence for damage")
    return ReportTable(head, ("auto", *["1fr"] * (len(head) - 1)), rows)


def _predictions(result: TextureResult) -> ReportTable:
    """A row for each quantity of each speed that was left out."""
    rows = []
    for law in result.laws:
        for one in law.left_out:
            for k, each in enumerate(one.quantities):
                ends = "–" if math.isnan(each.low) else f"{plain(each.low, 2)} to {plain(each.high, 2)}"
                area = f"{plain(each.area_metric, 2)} ({plain(each.area_of_mean, 2)})"
                name = each.quantity.removesuffix("_N") + (" [N]" if each.quantity.endswith("_N") else "")
                row = [one.group if not k else "", name, plain(each.predicted), plain(each.mean), ends, area]
                rows.append([*row, MARKS[each.inside]])
            share = one.curve_inside
            told = None if math.isnan(share) else share >= 0.95
            text = "–" if told is None else f"{100 * share:.0f} %"
            rows.append(["", "curve inside", text, "", "95 % or more", "", MARKS[told]])
    head = ("Left out", "Quantity", "Predicted", "Mean", "Scatter", "Area", "Inside")
    return ReportTable(head, ("auto", "1fr", "auto", "auto", "auto", "auto", "22mm"), rows, marked=6, left=2)
