"""What a calibration does not show, in words, and what to do about a line of the verdict that failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from calib.material.food import FoodSpec
from calib.material.properties import ADHESION, property_of
from calib.uncertainty.estimates import FittedParameter
from calib.validation.acceptance import Verdict
from calib.validation.numerical_checks import FINER_GRID
from mpm.output.number_text import listed, quantity

OPENING_REMARKED = 0.1  # part of the new surface that opens ahead of the edge, from which on it is said [-]
HELD_WEAK = {"R": 0.92, "R_skin": 0.90, "E": 0.88, "yield_stress": 0.80, "initiation_depth": 0.84}
"""Part of the weak 95 % intervals that held the truth on 100 made-up bananas, where it is less and there are
more than ten (docs/pitfalls.md, how far to trust an interval)."""

HARDLY_KNOWN = {
    "not_seen": "The trace says nothing of {}: the intervals are the literature's, and the values are of one food "
    "of many that draw the curve.",
    "one_sided": "The trace bounds {} on one side; where it leaves the other open, the end is the literature's or that "
    "of what is possible.",
    "weak": "The trace bounds {} on both sides, but not closely, or not surely.",
}
"""What is said of parameters by the verdict on them; the names take the place of the braces."""


def limits(
    label: str,
    stroke_source: str,
    baseline_kind: str,
    verdicts: Sequence[Verdict],
    fitted: Mapping[str, FittedParameter],
    assumptions: Sequence[str],
    food: FoodSpec,
    fracture: Mapping[str, float] | None = None,
) -> list[str]:
    """What the calibration does not show.

    Args:
        label: Whether the trace was ``measured`` or ``reconstructed``.
        stroke_source: What its stroke rests on: ``position``, ``speed`` or ``height``.
        baseline_kind: What was subtracted: ``constant``, ``linear``, ``zero`` or ``air``.
        verdicts: The verdict table.
        fitted: Fitted parameters by name.
        assumptions: What was assumed of the specimen and the sensor, each a sentence without capital and full stop.
        food: The food, as it was simulated.
        fracture: Energy of new surface at the edge and by opening ahead of it [J/m^2]; None where nothing was cut.

    Returns:
        One sentence for each.
    """
    said = []
    if label != "measured":
        said.append(f"The trace is {label}, not a measurement: agreement with it says nothing about a real food.")
    said.append("All figures are in-sample: the same trace was fitted and compared. Nothing here is validated.")
    said += [f"{v.name}: failed; see the verdict table." for v in verdicts if v.passed is False]
    said += _limits_of_parameters(fitted)
    said += _limits_of_measurement(stroke_source, baseline_kind)
    said += [f"{_as_sentence(a)}." for a in assumptions]
    said += _limits_of_simulation(food, fracture)
    said += [f"{_as_sentence(remedy)}." for remedy in map(remedied, verdicts) if remedy]
    return said


def _as_sentence(text: str) -> str:
    """With a capital, unless it begins with a name of a file or column, which keeps its own."""
    first = text.split(maxsplit=1)[0]
    return text if any(mark in first for mark in "_./:") else text[0].upper() + text[1:]


def _limits_of_parameters(fitted: Mapping[str, FittedParameter]) -> list[str]:
    said = []
    for verdict, told in HARDLY_KNOWN.items():
        names = [n for n, p in fitted.items() if p.verdict == verdict]
        if names:
            said.append(told.format(listed(names)))
    weak = [n for n, p in fitted.items() if p.verdict == "weak" and property_of(n) in HELD_WEAK]
    if weak:
        held = listed([f"{quantity(HELD_WEAK[property_of(n)], 'fraction', digits=None)} for {n}" for n in weak])
        said.append(f"Weak intervals hold the truth less often than in 95 %: of 100 made-up banana cuts in {held}.")
    return said


def _limits_of_measurement(stroke_source: str, baseline_kind: str) -> list[str]:
    said = []
    if stroke_source != "position":
        how = (
            "one constant speed" if stroke_source == "speed" else "one constant speed and a stroke of the food's height"
        )
        said.append(f"The trace has no position: its stroke axis rests on {how}.")
    if baseline_kind == "constant":
        said.append("A constant baseline was subtracted: drift of the sensor along the stroke is in the force.")
    if baseline_kind == "linear":
        said.append("The drift before contact was removed: one that was not steady along the stroke is in the force.")
    if baseline_kind == "zero":
        said.append("The machine's own zero was taken: what it was off by is in the force.")
    return said


def not_simulated(food: FoodSpec) -> str:
    """What of a food was left out of its simulation, in a sentence.

    Args:
        food: The food, as it was simulated.
    """
    has = food.properties
    left = ["moisture"]
    if not any(name in has for name in ADHESION):
        left.insert(0, "adhesion")
    if "relaxing_share" not in has or has["relaxing_share"].value == 0.0:
        left.insert(0, "relaxation")
    rate = "" if food.rate_dependent else "The laws are independent of rate. "
    under_it = has["skin_thickness"].value > 0.0 and "R_rind" not in has
    skin = "; of a whole fruit only the upper skin is cut" if under_it else ""
    return f"{rate}Not simulated: {listed(left)}{skin}."


def _limits_of_simulation(food: FoodSpec, fracture: Mapping[str, float] | None) -> list[str]:
    said = []
    if fracture is not None and "opening_J_m2" in fracture:
        edge, opening = fracture["edge_J_m2"], fracture["opening_J_m2"]
        if opening > OPENING_REMARKED * (edge + opening):
            part = quantity(opening / (edge + opening), "fraction")
            said.append(
                f"The blade opens the food ahead of its edge: of the energy of new surface {part} went there, "
                "against the tensile strength, which then trades with R and the yield stress."
            )
    return [
        *said,
        "One cut of one specimen says nothing about the scatter between specimens.",
        not_simulated(food),
        "The blade lay on a plane of the grid's nodes. Between two planes the same values give other work, by 1 to 2 % "
        "(cutcal converge --material --offset 0.5 measures it).",
        "One finer grid was tried, which gives a difference but neither an order nor an uncertainty (cutcal converge "
        "--material measures both; calibrate --u-num takes them into the likelihood).",
    ]


def remedied(line: Verdict) -> str:
    """What to do about a line of the table that failed, where a command does it; empty for all others."""
    if line.name != FINER_GRID or line.passed is not False:
        return ""
    return (
        "values and intervals answer for these cells alone: cutcal converge --material measures what they leave out, "
        "and the same calibration with --u-num takes it into the likelihood"
    )
