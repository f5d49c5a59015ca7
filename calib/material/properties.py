"""Properties of foods: what each one is, its SI unit and limits, and a value with its range and sources."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from calib.errors import MaterialError
from calib.io.kinds import check_kind
from calib.io.wording import quoted
from calib.io.yaml_checks import Place, check_keys, check_unit, choice, finite_number, mapping, suggest, text
from calib.table.si_numbers import si_number
from mpm.output.number_text import interval, quantity
from mpm.scene.material import LARGEST_RATE_EXPONENT, MAX_POISSON, REFERENCE_SPEED

#: Where a literature value comes from: measured on this food; Table 2 of the CulinaryCut paper; another food,
#: another test or a second-hand quotation; nobody's measurement.
LITERATURE_STATUSES = ("measured", "paper_table2", "proxy", "assumed")

#: Where another value comes from: fitted to a trace, or given by the user.
OTHER_STATUSES = ("fitted", "given")

#: Published values further apart than this are worth a warning (the test method alone can move E by 13 times:
#: limequat, Vatani et al. 2024, Microsc. Res. Tech.).
DISAGREEMENT = 3.0

#: Keys of a property in a file.
REQUIRED_KEYS = ("value", "low", "high", "unit", "source", "status")
OPTIONAL_KEYS = ("sources", "flag")
#: What people call the properties, in lower case.
SYNONYMS = {
    "young": "E", "youngs": "E", "youngs_modulus": "E", "modulus": "E", "stiffness": "E",
    "poisson": "nu", "poissons_ratio": "nu", "density": "rho",
    "yield": "yield_stress", "sigma_y": "yield_stress", "yield_strength": "yield_stress",
    "stickiness": "adhesion", "work_of_adhesion": "adhesion_energy",
    "friction": "mu", "friction_coefficient": "mu",
    "toughness": "R", "fracture_toughness": "R", "cutting_resistance": "R", "resistance": "R",
    "initiation": "R_initiation", "depth": "initiation_depth", "damping": "loss_factor",
    "skin": "skin_thickness", "skin_resistance": "R_skin", "rind": "rind_thickness", "peel": "rind_thickness",
    "wall": "rind_thickness", "core": "core_ratio", "core_part": "core_ratio",
    "rate": "rate_exponent", "speed_exponent": "rate_exponent", "exponent": "rate_exponent",
    "gf": "fracture_energy", "strength": "tensile_strength", "cohesive_strength": "tensile_strength",
    "sigma_c": "tensile_strength", "sigma_t": "tensile_strength", "diameter": "width",
}  # fmt: skip


@dataclass(frozen=True)
class Rule:
    """What a property may be.

    Attributes:
        unit: SI unit.
        low: Smallest value [unit].
        high: Largest value [unit].
        meaning: What it is.
        why: Why it has these limits.
    """

    unit: str
    low: float
    high: float
    meaning: str
    why: str = "anything else is a slip of the unit"


RELAXING_BULK = "relaxing_bulk"
"""How much the volume relaxes beside the shape. Only foods of which it is known have it; others' volume is elastic."""

PROPERTIES: dict[str, Rule] = {
    "rho": Rule("kg/m^3", 50.0, 5e3, "density"),
    "E": Rule("Pa", 1e2, 1e10, "Young's modulus"),
    "nu": Rule(
        "-", -0.999, MAX_POISSON, "Poisson's ratio",
        f"an isotropic solid has -1 < nu < 0.5, and above {MAX_POISSON} the solver locks volumetrically",
    ),
    "yield_stress": Rule("Pa", 10.0, 1e9, "von Mises yield stress"),
    "R": Rule("J/m^2", 0.1, 1e5, "cutting (propagation) resistance of the flesh"),
    "R_initiation": Rule("N/m", 0.1, 1e5, "line force at which a cut starts in bare flesh"),
    "R_skin": Rule("N/m", 0.1, 1e5, "line force at which the edge goes through the skin"),
    "skin_thickness": Rule("m", 0.0, 0.05, "thickness of the skin, 0 = no skin"),
    "skin_stiffness": Rule("N/m", 0.0, 1e6, "Young's modulus of the skin times its thickness, 0 = it bears no tension"),
    "R_rind": Rule("J/m^2", 0.1, 1e5, "cutting (propagation) resistance of the rind"),
    "rind_thickness": Rule("m", 0.0, 0.05, "thickness of the rind all round, 0 = no rind"),
    "rind_stiffness": Rule("-", 0.01, 100.0, "Young's modulus and yield stress of the rind over those of the flesh"),
    "R_core": Rule("J/m^2", 0.1, 1e5, "cutting (propagation) resistance of the core"),
    "core_ratio": Rule(
        "-", 0.0, 0.95, "radius of the core over that of the food's section, 0 = no core",
        "a larger one leaves no flesh around it",
    ),
    "core_stiffness": Rule("-", 0.001, 100.0, "Young's modulus and yield stress of the core over those of the flesh"),
    "initiation_depth": Rule("m", 1e-4, 0.05, "indentation under the edge at which a cut starts"),
    "mu": Rule("-", 0.0, 2.0, "Coulomb friction of food on blade"),
    "board_friction": Rule("-", 0.0, 2.0, "Coulomb friction of food on board"),
    "board_suction": Rule(
        "Pa", 0.0, 1.1e5, "largest tension between board and flat face of the food, 0 = it lifts off freely",
        "the air presses with no more than its own pressure",
    ),
    "bow": Rule(
        "m", -0.05, 0.05, "rise of the middle of the food's underside over its ends, negative where the ends are up",
    ),
    "loss_factor": Rule("-", 0.0, 1.0, "mechanical loss factor tan(delta) at the first axial mode"),
    "adhesion": Rule("Pa", 1.0, 1e6, "largest normal traction of the food on the blade's faces"),
    "adhesion_energy": Rule("J/m^2", 1e-4, 1e3, "work to take a unit of the food's face off the blade"),
    "relaxing_share": Rule(
        "-", 0.0, 0.99, "part of the instantaneous shear stiffness that relaxes, 0 = none; E is then instantaneous",
        "a solid keeps some of its stiffness",
    ),
    "relaxation_time": Rule("s", 1e-4, 1e6, "time in which that part relaxes to 1/e"),
    RELAXING_BULK: Rule(
        "-", 0.0, 1.0, "relaxing share of the bulk stiffness over that of the shear stiffness, 0 = none",
        "at 1 the volume relaxes as much as the shape",
    ),
    "rate_exponent": Rule(
        "-", -LARGEST_RATE_EXPONENT, LARGEST_RATE_EXPONENT,
        f"power of the real speed, over {1e3 * REFERENCE_SPEED:g} mm/s, in all resistances, 0 = none",
        "one in proportion to the speed is beyond all that is known of foods",
    ),
    "tensile_strength": Rule("Pa", 10.0, 1e9, "tension at which the flesh parts"),
    "strength_ratio": Rule(
        "-", 0.01, 1.0, "tension at which the flesh parts over its yield stress",
        "a food that flows before it parts has a tensile_strength [Pa] in place of it",
    ),
    "fracture_energy": Rule("J/m^2", 0.1, 1e6, "energy per crack area of bulk damage"),
}  # fmt: skip

ADHESION = ("adhesion", "adhesion_energy")
"""How a food sticks to the blade. Only foods of which it is known have the two."""

RELAXATION = ("relaxing_share", "relaxation_time")
"""One branch of a Prony series of the shear stiffness. Only foods of which it is known have the two."""

RATE_EXPONENT = "rate_exponent"
"""How resistances depend on the real speed. Only foods of which it is known have it; the others' do not."""
GIVEN_SPREAD = 10.0
"""Range of a property that has no literature and is given by the user: the value over and times this."""
GIVEN_RATE_RANGE = 0.5
"""The same of a rate exponent, which may be none or negative: the value less and plus this [-]. Assumed: published
toughnesses of a starch-based food have 0.17 and 0 (docs/theory.md, "Speed of the cut")."""

GIVEN_BOW_RANGE = 1e-3
"""The same of a bow: the value less and plus this [m]. Assumed: more than a millimetre changes no force."""

BOARD_FRICTION, BOARD_SUCTION, BOW = BOARD = ("board_friction", "board_suction", "bow")
"""Friction on the board, what holds a flat wet face down on it, and where the food touches it. They are none of the
food's material, but of how it lies there."""

LAYERS = {"rind_thickness": "R_rind", "core_ratio": "R_core"}
"""The size of each layer beside the flesh and its resistance. Only foods whose anatomy has the layer have the two."""

LAYER_STIFFNESS = {"rind_thickness": "rind_stiffness", "core_ratio": "core_stiffness"}
"""The size of each layer and its stiffness over the flesh's; a layer without it is as stiff as the flesh."""

DIMENSIONS: dict[str, Rule] = {
    "length": Rule("m", 1e-3, 1.0, "size along y, across the blade"),
    "width": Rule("m", 1e-3, 1.0, "size along x, along the blade"),
    "height": Rule("m", 1e-3, 1.0, "size along z, up"),
}

FORM: dict[str, Rule] = {"roundness": Rule("-", 0.0, 1.0, "roundness along y, 0 a cylinder and 1 an ellipsoid")}
"""What a shape has beside its size, where the food's anatomy leaves it open."""

SPECIMEN: dict[str, Rule] = {"aspect": Rule("-", 0.1, 10.0, "width of the specimen over its height")}
"""What else may be fitted of a specimen."""

MEANINGS = {name: rule.meaning for name, rule in {**PROPERTIES, **FORM, **SPECIMEN}.items()}
"""What each property is, in words, and what else may be fitted."""

INCLUSIONS = ("stone", "cavity")
"""What may lie in a food; each has a length, a width and a height."""


OF_TRACE = "@"
"""Between the name of a property and that of the trace which has a value of its own: ``R_skin@cut2``."""


@dataclass(frozen=True)
class Source:
    """One published value.

    Attributes:
        value: In the unit of its property.
        source: Where it was published and how it was got.
    """

    value: float
    source: str


@dataclass(frozen=True)
class Property:
    """One property of a food, or one of its dimensions.

    Attributes:
        name: As in ``materials.yaml``.
        value: The value used unless it is fitted [unit].
        low: Lower end of the literature's 95 % range [unit].
        high: Upper end of the literature's 95 % range [unit].
        unit: SI unit.
        source: Where ``value`` comes from; for an assumed value the reason.
        status: One of ``LITERATURE_STATUSES`` or ``OTHER_STATUSES``.
        sources: Published values, the used one may be among them.
        flag: Reason why a published value must not be trusted, or None.

    Raises:
        MaterialError: Unknown name, wrong unit or status, a number out of its limits, low > high, or a
            literature value outside its own range. (A fitted or given value may leave the range;
            :meth:`warnings` says so.)
    """

    name: str
    value: float
    low: float
    high: float
    unit: str
    source: str
    status: str
    sources: tuple[Source, ...] = ()
    flag: str | None = None

    def __post_init__(self) -> None:
        here = Place("", (self.name,))
        rule = rule_of(self.name, PROPERTIES | DIMENSIONS | FORM | SPECIMEN)
        for key in ("value", "low", "high"):
            object.__setattr__(self, key, finite_number(here.at(key), getattr(self, key)))
        check_unit(here, self.unit, rule.unit, self.value)
        for key in ("value", "low", "high"):
            _check_limits(here.at(key), getattr(self, key), rule)
        text(here.at("source"), self.source)
        choice(here.at("status"), self.status, (*LITERATURE_STATUSES, *OTHER_STATUSES))
        for i, entry in enumerate(self.sources):
            finite_number(here.at("sources").at(str(i)).at("value"), entry.value)
            text(here.at("sources").at(str(i)).at("source"), entry.source)
        if self.flag is not None:
            text(here.at("flag"), self.flag)
        self._check_range(here)

    @property
    def left_open(self) -> bool:
        """Whether a cut is asked for it, of how a food lies: none of it is held, and what may have either sign and is
        given was measured."""
        return self.status != "given" if self.low < 0 else self.value != 0

    def _check_range(self, here: Place) -> None:
        if self.low > self.high:
            raise here.error(f"has the range {self.low:g} to {self.high:g} {self.unit}; write low <= high")
        if self.status in LITERATURE_STATUSES and not self.low <= self.value <= self.high:
            raise here.error(
                f"has the value {self.value:g} outside its range {self.low:g} to {self.high:g} {self.unit}; "
                "correct the value or widen the range"
            )

    def warnings(self) -> list[str]:
        """What a reader of this value must know, one sentence each; empty where there is nothing."""
        said = [] if self.disagreement is None else [self.disagreement]
        if self.flag:
            said.append(self.flag)
        if not self.low <= self.value <= self.high:
            said.append(
                f"{quantity(self.value, self.unit, digits=None)} ({self.status}) is outside the literature's range "
                f"{interval(self.low, self.high, self.unit, digits=None)}"
            )
        return said

    @property
    def disagreement(self) -> str | None:
        """How far published values lie apart, as a sentence; None where they agree."""
        values = [s.value for s in self.sources] + ([self.value] if self.status in LITERATURE_STATUSES else [])
        if not (min(values, default=0.0) > 0.0 and max(values) > DISAGREEMENT * min(values)):
            return None
        apart = f"{max(values) / min(values):.3g} times"
        return f"published values go from {interval(min(values), max(values), self.unit, digits=None)}, {apart}"

    def as_dict(self) -> dict[str, Any]:
        """Plain data in the layout of ``materials.yaml``."""
        out: dict[str, Any] = {key: getattr(self, key) for key in REQUIRED_KEYS}
        if self.sources:
            out["sources"] = [{"value": s.value, "source": s.source} for s in self.sources]
        if self.flag:
            out["flag"] = self.flag
        return out


def check_override(name: str, value: float | str) -> float:
    """A value given by hand for a property, as a number [SI].

    Args:
        name: Property name.
        value: A number, or text that is one, in the property's SI unit or with its own, as in ``3mm`` or ``0.3MPa``.

    Raises:
        MaterialError: An unknown property, text that is no number, or a value out of its limits.
    """
    rule = rule_of(name)
    place = Place("", (name,))
    if isinstance(value, str):
        try:
            value = si_number(value, rule.unit)
        except ValueError as e:
            raise place.error(f"{e}; it is the {rule.meaning}") from None
    x = finite_number(place, value)
    _check_limits(place, x, rule)
    return x


def given_range(name: str, value: float) -> tuple[float, float]:
    """Range of a property that is given by hand and has no literature.

    Args:
        name: The property.
        value: What was given [SI].

    Returns:
        Its lower and upper end [SI], within what the property may be.
    """
    rule = rule_of(name)
    ends = (value / GIVEN_SPREAD, value * GIVEN_SPREAD)
    if name == RELAXING_BULK:
        ends = (rule.low, rule.high)
    if name == RATE_EXPONENT:
        ends = (value - GIVEN_RATE_RANGE, value + GIVEN_RATE_RANGE)
    if name == BOW:
        ends = (value - GIVEN_BOW_RANGE, value + GIVEN_BOW_RANGE)
    return max(ends[0], rule.low), min(ends[1], rule.high)


def rule_of(name: str, rules: Mapping[str, Rule] = PROPERTIES) -> Rule:
    """Unit and limits of a property.

    Raises:
        CutcalError: The name is no text.
        MaterialError: There is no property of that name (with the nearest one).
    """
    check_kind("a property", "name", name, (str,), "text, such as 'E'")
    if name not in rules:
        raise MaterialError(f"unknown property {name!r}{suggest(name, rules, SYNONYMS)}")
    return rules[name]


def _check_limits(place: Place, x: float, rule: Rule) -> None:
    if not rule.low <= x <= rule.high:
        unit = "" if rule.unit == "-" else f" {rule.unit}"
        raise place.error(
            f"{x:g}{unit} cannot be the {rule.meaning}; "
            f"it must lie between {rule.low:g} and {rule.high:g}{unit}: {rule.why}"
        )


def property_of(name: str) -> str:
    """Name of the property that a parameter is.

    >>> property_of("R_skin@cut2"), property_of("E")
    ('R_skin', 'E')
    """
    return name.split(OF_TRACE)[0]


def read_property(parent: Place, name: str, raw: Any) -> Property:
    """A property in the layout of ``materials.yaml``.

    Args:
        parent: The place that it stands in, for errors.
        name: Its name.
        raw: What YAML has there.

    Returns:
        The property, checked.

    Raises:
        CutcalError: Of the class of ``parent``: unknown name or key, wrong unit or status, a number out of its limits.
    """
    place = parent.at(name)
    if isinstance(raw, (str, float, int)):
        unit = PROPERTIES[name].unit if name in PROPERTIES else "m"
        raise place.error(
            f'is {quoted(raw)} alone; write {{value: 1.0, low: 0.9, high: 1.1, unit: "{unit}", status: measured, '
            'source: "how"} with your numbers, as cutcal foods --template shows'
        )
    given = mapping(place, raw)
    check_keys(place, given, REQUIRED_KEYS, OPTIONAL_KEYS)
    listed = given.get("sources", [])
    if not isinstance(listed, list):
        raise place.at("sources").error("must be a list of {value, source}")
    for i, entry in enumerate(listed):
        here = place.at("sources").at(str(i))
        check_keys(here, mapping(here, entry), ("value", "source"))
    sources = tuple(Source(**entry) for entry in listed)
    try:
        return Property(name, **{**given, "sources": sources})
    except MaterialError as e:
        raise parent.wrap(e) from None
