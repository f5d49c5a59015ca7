"""Published numbers of cuts without a curve: a largest force, an energy per cut area, and the specimen they are of.

A file names the food, what is known of it beyond ``materials.yaml``, the knife, and specimens. Each number of a
specimen is either given or predicted: it is fitted to, or compared with what the fit to the others gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from calib.errors import PublishedError
from calib.io.yaml_checks import Place, check_keys, choice, finite_number, mapping, read_yaml, text
from calib.material.food import FoodSpec, load_food
from calib.material.knife import load_knife
from calib.material.properties import DIMENSIONS, Rule, read_property
from calib.material.scene import LENGTH_PER_HEIGHT
from calib.problem.food_parameters import fit_parameters
from calib.problem.parameters import ParameterSet
from mpm.scene import Knife
from mpm.scene.errors import CutcalError, SceneError
from mpm.scene.shapes import PRISMS, SHAPE_KINDS, Shape, section_area

PEAK_FORCE, CUT_ENERGY = "peak_N", "energy_J_m2"
QUANTITIES = {PEAK_FORCE: "largest force [N]", CUT_ENERGY: "work over the area of the cut [J/m^2]"}
DEFAULT_FIT = ("R", "mu")  # what two numbers of one cut are spent on unless the file says otherwise
ERROR_LIMIT = 0.2  # error of a prediction that passes: two specimens of a food differ by as much
LARGEST_RELATIVE_SD = 1.0
SIZE_KEYS = {"width": "width_m", "height": "height_m", "length": "length_m"}
_SYNONYMS = {
    "peak": PEAK_FORCE, "force": PEAK_FORCE, "force_n": PEAK_FORCE, "max_force": PEAK_FORCE,
    "energy": CUT_ENERGY, "specific_energy": CUT_ENERGY, "energy_j": CUT_ENERGY, "work": CUT_ENERGY,
    "sd": "relative_sd", "spread": "relative_sd", "uncertainty": "relative_sd",
    "diameter": "width_m", "diameter_m": "width_m", "width": "width_m", "height": "height_m", "length": "length_m",
    "kind": "shape", "predict": "predicted", "measured": "given", "tolerance": "limit",
}  # fmt: skip


@dataclass(frozen=True)
class PublishedNumber:
    """One published number.

    Attributes:
        quantity: One of :data:`QUANTITIES`.
        value: Its value [unit of the quantity].
        relative_sd: Standard deviation of its mean, a fraction of it [-].
    """

    quantity: str
    value: float
    relative_sd: float


@dataclass(frozen=True)
class PublishedCut:
    """A specimen that was cut through.

    Attributes:
        name: Its name.
        shape: Outline and sizes [m].
        given: Numbers that are fitted to.
        predicted: Numbers that are compared with their prediction.
    """

    name: str
    shape: Shape
    given: tuple[PublishedNumber, ...] = ()
    predicted: tuple[PublishedNumber, ...] = ()

    @property
    def area(self) -> float:
        """Area that the knife severs [m^2]."""
        return section_area(self.shape)

    @property
    def fullness(self) -> float | None:
        """Published largest over mean force of the stroke [-]; None where one of both numbers is missing.

        The mean force is energy times area over height. A resistance that is the same everywhere has 1 for a prism and
        4 / pi for a round section, whatever its size and its resistance.
        """
        values = {s.quantity: s.value for s in (*self.given, *self.predicted)}
        if len(values) < len(QUANTITIES):
            return None
        return values[PEAK_FORCE] * self.shape.height / (values[CUT_ENERGY] * self.area)

    @property
    def uniform_fullness(self) -> float:
        """What :attr:`fullness` is for a force that goes with the width cut [-]."""
        return self.shape.width * self.shape.height / self.area


@dataclass(frozen=True)
class PublishedData:
    """Published numbers of cuts of one food with one knife.

    Attributes:
        source: Where they were published.
        food: The food, with what the file says of it.
        knife: The knife.
        cuts: The specimens.
        fit: Properties that are fitted to the given numbers.
        vary: Properties that are drawn from their priors for the band.
        limit: Error of a prediction that passes [-].
    """

    source: str
    food: FoodSpec
    knife: Knife
    cuts: tuple[PublishedCut, ...]
    fit: tuple[str, ...]
    vary: tuple[str, ...]
    limit: float = ERROR_LIMIT

    def __post_init__(self) -> None:
        twice = sorted(set(self.fit) & set(self.vary))
        if twice:
            raise PublishedError(f"{', '.join(twice)}: is fitted and drawn from its prior; leave it out of one of both")
        if not self.given:
            raise PublishedError("specimens: no number is given, so there is nothing to fit to; move one to 'given'")
        if len(self.fit) > len(self.given):
            raise PublishedError(
                f"fit: {len(self.given)} given numbers do not determine {', '.join(self.fit)}; "
                f"fit at most {len(self.given)}"
            )
        for names in (self.fit, self.vary):
            if names:
                fit_parameters(self.food, names)

    @property
    def given(self) -> tuple[tuple[PublishedCut, PublishedNumber], ...]:
        """All given numbers with their specimens, in order."""
        return tuple((cut, scalar) for cut in self.cuts for scalar in cut.given)

    @property
    def fitted(self) -> ParameterSet:
        """The fitted properties with their priors and bounds."""
        return fit_parameters(self.food, self.fit)

    @property
    def varied(self) -> ParameterSet | None:
        """The drawn properties with their priors; None where there is none."""
        return fit_parameters(self.food, self.vary) if self.vary else None

    def fitting(self, names: tuple[str, ...]) -> PublishedData:
        """The same numbers with other properties fitted; those fitted before are drawn now.

        Raises:
            CutcalError: An unknown property, or more of them than given numbers.
        """
        vary = tuple(n for n in dict.fromkeys((*self.vary, *self.fit)) if n not in names)
        return replace(self, fit=names, vary=vary)

    def all_given(self) -> PublishedData:
        """The same with all numbers given: whether any values of the fitted properties meet all of them."""
        cuts = (replace(cut, given=(*cut.given, *cut.predicted), predicted=()) for cut in self.cuts)
        return replace(self, cuts=tuple(cuts))


def load_published(path: Path | str) -> PublishedData:
    """Read a file of published numbers.

    Raises:
        CutcalError: It cannot be read or has an error; the message names file and place.
    """
    top, content = read_yaml(path, kind=PublishedError)
    needed = ("source", "food", "knife", "specimens")
    check_keys(top, content, needed, ("properties", "fit", "vary", "limit"), _SYNONYMS)
    food = _food(top, content)
    fit = _names(top.at("fit"), content.get("fit", list(DEFAULT_FIT)))
    default = [name for name in food.default_fit if name not in fit]
    try:
        return PublishedData(
            source=text(top.at("source"), content["source"]),
            food=food,
            knife=_knife(top.at("knife"), content["knife"], Path(path).parent),
            cuts=_cuts(top.at("specimens"), content["specimens"]),
            fit=fit,
            vary=_names(top.at("vary"), content.get("vary", default)),
            limit=_within(top.at("limit"), content.get("limit", ERROR_LIMIT), 1.0),
        )
    except CutcalError as e:
        raise e if str(e).startswith(top.file) else top.error(str(e)) from None


def _food(top: Place, content: Mapping[str, Any]) -> FoodSpec:
    """The food of materials.yaml with the properties that the file gives."""
    try:
        food = load_food(text(top.at("food"), content["food"]))
    except CutcalError as e:
        raise e if str(e).startswith(top.file) else top.at("food").error(str(e)) from None
    if "properties" not in content:
        return food
    here = top.at("properties")
    own = {name: read_property(here, name, raw) for name, raw in mapping(here, content["properties"]).items()}
    return replace(food, properties=dict(food.properties) | own)


def _knife(place: Place, raw: Any, folder: Path) -> Knife:
    """A knife by name, or from a file beside this one."""
    name = text(place, raw)
    try:
        return load_knife(folder / name if name.endswith((".yaml", ".yml")) else name)
    except SceneError as e:
        raise place.error(str(e)) from None


def _names(place: Place, raw: Any) -> tuple[str, ...]:
    if not isinstance(raw, list):
        raise place.error("must be a list of property names, for instance [R, mu]")
    return tuple(text(place.at(str(k)), name) for k, name in enumerate(raw))


def _cuts(place: Place, raw: Any) -> tuple[PublishedCut, ...]:
    return tuple(_cut(place.at(name), name, one) for name, one in mapping(place, raw).items())


def _cut(place: Place, name: str, raw: Any) -> PublishedCut:
    given = mapping(place, raw)
    check_keys(place, given, ("shape", "width_m", "height_m"), ("length_m", "given", "predicted"), _SYNONYMS)
    kind = choice(place.at("shape"), given["shape"], SHAPE_KINDS)
    here = {n: key for n, key in SIZE_KEYS.items() if key in given}
    size: dict[str, Any] = {n: _size(place.at(key), given[key], DIMENSIONS[n]) for n, key in here.items()}
    size.setdefault("length", (LENGTH_PER_HEIGHT if kind in PRISMS else 1.0) * size["height"])
    try:
        shape = Shape(kind, **size)
    except SceneError as e:
        raise place.error(str(e)) from None
    roles = {role: _scalars(place.at(role), given[role]) for role in ("given", "predicted") if role in given}
    names = [s.quantity for role in roles.values() for s in role]
    if not names:
        raise place.error("has neither given nor predicted numbers; add one of them, or leave the specimen out")
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise place.error(f"{', '.join(twice)} is given and predicted; leave it in one of both")
    return PublishedCut(name, shape, **roles)


def _scalars(place: Place, raw: Any) -> tuple[PublishedNumber, ...]:
    entries = mapping(place, raw)
    check_keys(place, entries, (), QUANTITIES, _SYNONYMS)
    found = []
    for quantity, entry in entries.items():
        here = place.at(quantity)
        one = mapping(here, entry)
        check_keys(here, one, ("value", "relative_sd"), ("source",), _SYNONYMS)
        value = finite_number(here.at("value"), one["value"])
        if value <= 0:
            raise here.at("value").error(f"is {value:g}; {QUANTITIES[quantity]} of a cut is positive")
        if "source" in one:
            text(here.at("source"), one["source"])
        found.append(
            PublishedNumber(quantity, value, _within(here.at("relative_sd"), one["relative_sd"], LARGEST_RELATIVE_SD))
        )
    return tuple(found)


def _size(place: Place, raw: Any, rule: Rule) -> float:
    """A size of a specimen [m]."""
    value = finite_number(place, raw)
    if not rule.low <= value <= rule.high:
        raise place.error(f"is {value:g} m, but must lie between {rule.low:g} and {rule.high:g} m; write metres")
    return value


def _within(place: Place, raw: Any, high: float) -> float:
    """A positive fraction."""
    value = finite_number(place, raw)
    if not 0.0 < value <= high:
        raise place.error(f"is {value:g}, but must lie above 0 and at most at {high:g} (0.05 is 5 %)")
    return value
