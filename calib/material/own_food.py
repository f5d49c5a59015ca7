"""A food of one's own: documented defaults for what its file does not say, and a file to begin with."""

from __future__ import annotations

import statistics
from collections.abc import Collection, Mapping

from calib.material.properties import MEANINGS, PROPERTIES, Property

OPTIONAL_HERE = ("rho", "E", "nu", "yield_stress", "R", "R_initiation", "initiation_depth", "mu", "board_friction",
                 "loss_factor", "strength_ratio")  # fmt: skip
"""Properties that a food's own file may leave out; without skin_thickness it has no skin."""
OF_ANOTHER = {
    "yield_stress": ("E", 0.1, 0.01, 1.0, "a tenth of E, from a hundredth of it to all"),
    "R_initiation": ("R", 1.5, 1.0, 3.0, "1.5 times R, up to three times the highest R"),
}
"""Defaults that follow another property: its name, factors on value, low and high, and the words of the source."""
FLAG = "not given: {source}; give it, or fit it"

TEMPLATE = """# A food of your own, in SI units: calibrate --food {name}.yaml --trace cut.csv
# Needed are kind and sizes. Each property may be left out: what stands here is then taken, and said.
# low and high are the prior of a fit, so be honest about them; status: measured, proxy or assumed.
# Kinds of shapes: cutcal simulate --help. length is across the blade, width along it, height up.
{name}:
  shape:
    kind: block
    length: {{value: 0.05, low: 0.045, high: 0.055, unit: m, status: measured, source: "say how"}}
    width: {{value: 0.03, low: 0.027, high: 0.033, unit: m, status: measured, source: "say how"}}
    height: {{value: 0.03, low: 0.027, high: 0.033, unit: m, status: measured, source: "say how"}}
  properties:
"""


def filled(
    given: Mapping[str, Property], foods: Collection[Mapping[str, Property]], none: Collection[str] = ()
) -> dict[str, Property]:
    """All properties of a food, with defaults for those that its file leaves out.

    Args:
        given: What the file says, by name.
        foods: Properties of the foods of ``materials.yaml``, over which a default without a rule ranges.
        none: Properties that the file says the food does not have.

    Returns:
        The properties; a default is assumed, says where it comes from, and is flagged.
    """
    have = dict(given)
    if "skin_thickness" not in have:
        have["skin_thickness"] = Property("skin_thickness", 0.0, 0.0, 0.0, "m", "no skin was given", "assumed")
    has_strength = "tensile_strength" in have or "tensile_strength" in none
    for name in OPTIONAL_HERE:
        if name not in have and name not in OF_ANOTHER and not (name == "strength_ratio" and has_strength):
            have[name] = _over_all(name, [food[name] for food in foods if name in food])
    for name, (other, *factors, words) in OF_ANOTHER.items():
        if name not in have and name not in none:
            base = have[other]
            value, low, high = (f * x for f, x in zip(factors, (base.value, base.low, base.high), strict=True))
            have[name] = _default(name, value, min(low, value), max(high, value), words)
    return {name: have[name] for name in PROPERTIES if name in have}


def _over_all(name: str, known: Collection[Property]) -> Property:
    """The middle food's value, over the ranges of all."""
    middle = statistics.median_low([p.value for p in known])
    low, high = min(p.low for p in known), max(p.high for p in known)
    return _default(name, middle, low, high, "the range over all foods of materials.yaml")


def _default(name: str, value: float, low: float, high: float, source: str) -> Property:
    v, a, b = (float(f"{x:.3g}") for x in (value, low, high))
    unit, flag = PROPERTIES[name].unit, FLAG.format(source=source)
    return Property(name, v, min(a, v), max(b, v), unit, source, "assumed", flag=flag)


def template(name: str, foods: Collection[Mapping[str, Property]]) -> str:
    """A file to begin a food with: YAML with every default.

    Args:
        name: Of the food, lower case with underscores.
        foods: As of :func:`filled`.

    Returns:
        Its text.
    """
    lines = []
    for key, p in filled({}, foods).items():
        numbers = ", ".join(f"{word}: {x:g}" for word, x in (("value", p.value), ("low", p.low), ("high", p.high)))
        lines.append(f"    # {MEANINGS[key]}")
        lines.append(f'    {key}: {{{numbers}, unit: "{p.unit}", status: {p.status}, source: "{p.source}"}}')
    return TEMPLATE.format(name=name) + "\n".join(lines) + "\n"
