"""Foods: shapes and properties with range, source and status, from ``materials.yaml`` or a calibrated file.

Every property is {value, low, high, unit, source, status}. ``low`` and ``high`` are the 95 % range of the
literature, which a fit uses as its prior. ``sources`` lists the published values, so that the loader can say
where they disagree.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from calib.errors import MaterialError
from calib.io.kinds import FILE, NAMED, TEXT, check_kind
from calib.io.wording import listed
from calib.io.yaml_checks import Place, check_keys, choice, data_path, mapping, read_yaml, suggest, text
from calib.material.food_file import dump_material
from calib.material.own_food import OPTIONAL_HERE, filled
from calib.material.properties import (
    ADHESION,
    BOARD,
    DIMENSIONS,
    FORM,
    INCLUSIONS,
    LAYER_STIFFNESS,
    LAYERS,
    PROPERTIES,
    RATE_EXPONENT,
    RELAXATION,
    RELAXING_BULK,
    SYNONYMS,
    Property,
    Source,
    check_override,
    given_range,
    read_property,
    rule_of,
)
from calib.material.together import BY_NAME, STRENGTHS, check_parts, check_together
from mpm.scene.profiles import BARRELS, FAMILY
from mpm.scene.shapes import SHAPE_KINDS

if TYPE_CHECKING:
    from calib.io.wide_table import WideTable
    from mpm.scene import Food

__all__ = ["FoodSpec", "Property", "Source", "check_override", "load_food", "load_foods", "load_material_file"]

FILES = (".yaml", ".yml")
"""How the name of a food's file ends."""
_LAYERS = (*LAYERS, *LAYERS.values(), *LAYER_STIFFNESS.values())
_OPTIONAL = (*_LAYERS, "skin_stiffness", *BOARD, *ADHESION, *RELAXATION, RELAXING_BULK, RATE_EXPONENT,
             *STRENGTHS)  # fmt: skip
_NULLABLE = ("R_skin", "fracture_energy", *_OPTIONAL)  # a file may leave the optional ones out

Sentences: TypeAlias = list[str]


@dataclass(frozen=True, repr=False)
class FoodSpec:
    """A food: outline, dimensions and properties.

    Attributes:
        name: Lower case with underscores.
        shape_kind: One of ``mpm.scene.shapes.SHAPE_KINDS``.
        dims: ``length``, ``width``, ``height`` [m].
        properties: By name; a property the food has no value for (null in the file) is absent.
        calibration: Provenance of a calibrated food, or None.
        not_modelled: What a real one has and the simulated one has not, such as a stone, or None.
        roundness: Of a food whose anatomy leaves it open how much of a cylinder it is and how much of an ellipsoid;
            None for the others. A cut draws it where its shape is a barrel.
        inclusions: Sizes of ``stone`` and ``cavity`` [m], as far as the food has them, by name; a cut has them where it
            is asked for them (:func:`calib.material.inclusions.with_inclusions`).

    Raises:
        CutcalError: A part of a wrong kind.
        MaterialError: Unknown shape, a missing property, or a skin without resistance.
    """

    name: str
    shape_kind: str
    dims: Mapping[str, Property]
    properties: Mapping[str, Property]
    calibration: Mapping[str, Any] | None = field(default=None, compare=False)
    not_modelled: str | None = None
    inclusions: Mapping[str, Mapping[str, Property]] = field(default_factory=dict)
    roundness: Property | None = None

    def __post_init__(self) -> None:
        check_parts(vars(self))
        here = Place("", (self.name,))
        choice(here.at("shape").at("kind"), self.shape_kind, SHAPE_KINDS)
        check_keys(here.at("shape"), self.dims, DIMENSIONS)
        check_keys(here, self.inclusions, (), INCLUSIONS)
        for name, sizes in self.inclusions.items():
            check_keys(here.at(name), sizes, DIMENSIONS)
        if self.roundness is not None and self.shape_kind not in FAMILY:
            raise here.at("shape").error(f"a {self.shape_kind} has no roundness; {listed(list(FAMILY))} have one")
        needed = [p for p in PROPERTIES if p not in _NULLABLE]
        check_keys(here.at("properties"), self.properties, needed, _NULLABLE, SYNONYMS)
        check_together(here, self.properties)

    def __repr__(self) -> str:
        size = " x ".join(f"{1e3 * self.dims[name].value:.3g}" for name in DIMENSIONS)
        return f"Food({self.name!r}, {self.shape_kind}, {size} mm)"

    @staticmethod
    def list() -> tuple[str, ...]:
        """Names of the foods in ``materials.yaml``."""
        return tuple(load_foods())

    def frame(self) -> WideTable:
        """The properties, a row each: ``value``, ``low``, ``high`` (95 % range), ``unit``, ``status``, ``source``."""
        from calib.io.wide_table import table_of_rows

        rows = {name: vars(p) for name, p in self.properties.items()}
        kept = ["value", "low", "high", "unit", "status", "source"]
        return table_of_rows(rows)[kept].rename_axis("property")

    def plot(self, ax: Any = None) -> Any:
        """Draw the literature's range of each property over its value, but for 0, on axes of matplotlib or new ones."""
        from reports.base.interactive import range_axes

        ranges = {name: (p.low, p.value, p.high, p.unit) for name, p in self.properties.items()}
        return range_axes(ranges, ax, self.name)

    def save(self, path: str | Path) -> None:
        """Write the food to a ``.yaml`` file, which :meth:`load` reads back.

        Raises:
            CutcalError: It is no path.
            OutputError: The file cannot be written.
        """
        check_kind("Food.save", "path", path, *FILE)
        dump_material(self, path, self.calibration or {})

    @classmethod
    def load(cls, name: str | Path) -> FoodSpec:
        """A food by its name in ``materials.yaml``, or from the YAML file of one food, as a calibration writes it.

        Raises:
            CutcalError: It is neither a name nor a path.
            MaterialError: There is no such food, or something is wrong with the file.
        """
        check_kind("Food.load", "name", name, *NAMED)
        if isinstance(name, Path) or str(name).endswith(FILES):
            return load_material_file(name)
        return load_food(name)

    @property
    def default_fit(self) -> tuple[str, ...]:
        """Names of the properties that a calibration fits unless told otherwise."""
        start = ("R_skin", "skin_thickness") if self.properties["skin_thickness"].value > 0.0 else ("R_initiation",)
        strength = tuple(name for name in STRENGTHS if name in self.properties)
        board = tuple(name for name in BOARD if name in self.properties and self.properties[name].left_open)
        return ("E", "yield_stress", *strength, "R", *self.layers, *start, "initiation_depth", "mu", *board)

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers' properties: of each resistance, size, and stiffness where it is another than flesh's."""
        there = [size for size in LAYERS if size in self.properties and self.properties[size].value > 0.0]
        each = [name for size in there for name in (LAYERS[size], size, LAYER_STIFFNESS[size])]
        return tuple(name for name in each if name in self.properties)

    def value(self, name: str) -> float | None:
        """Value of a property [SI], None where the food has none.

        Raises:
            MaterialError: There is no property of that name.
        """
        rule_of(name)
        return self.properties[name].value if name in self.properties else None

    def prior(self, name: str) -> tuple[float, float]:
        """The literature's 95 % range of a property, (low, high) [SI].

        Raises:
            MaterialError: There is no property of that name, or the food has no value for it.
        """
        rule_of(name)
        if name not in self.properties:
            other = (
                "; or fit strength_ratio" if name == "tensile_strength" and "strength_ratio" in self.properties else ""
            )
            raise MaterialError(f"{self.name}: no literature range for {name}; give a value for it first{other}")
        return self.properties[name].low, self.properties[name].high

    def with_sizes(self, sizes: Mapping[str, float], *, status: str, source: str) -> FoodSpec:
        """The same food with other dimensions; ranges stay.

        Args:
            sizes: Dimensions [m] by name.
            status: ``given`` or ``fitted``.
            source: Where they come from.

        Returns:
            The food.

        Raises:
            CutcalError: No dict was given.
            MaterialError: An unknown or impossible size.
        """
        check_kind("Food.with_sizes", "sizes", sizes, *BY_NAME)
        check_keys(Place("", (self.name, "shape")), sizes, (), DIMENSIONS)
        new = dict(self.dims)
        for name, x in sizes.items():
            new[name] = replace(new[name], value=x, status=status, source=source)
        return replace(self, dims=new)

    def with_values(
        self, values: Mapping[str, float], *, status: str = "given", source: str = "given by the user"
    ) -> FoodSpec:
        """The same food with other values [SI]; ranges and published values stay.

        Args:
            values: By property name.
            status: ``given``, ``fitted`` or ``assumed``.
            source: Where the values come from.

        Returns:
            The food; a property that it had no value for has a range about it (:func:`given_range`). One of
            ``strength_ratio`` and ``tensile_strength`` takes the place of the other.

        Raises:
            CutcalError: No dict was given.
            MaterialError: An unknown property, or a value out of its limits.
        """
        check_kind("Food.with_values", "values", values, *BY_NAME)
        new = dict(self.properties)
        for name, raw in values.items():
            x = check_override(name, raw)
            if name in STRENGTHS:
                new.pop(STRENGTHS[1 - STRENGTHS.index(name)], None)
            old = new.get(name)
            if old is None:
                new[name] = Property(name, x, *given_range(name, x), PROPERTIES[name].unit, source, status)
            else:
                new[name] = replace(old, value=x, status=status, source=source)
        return replace(self, properties=new)

    def warnings(self) -> Sentences:
        """What a user of this food must know: what is not modelled, sources that disagree or are flagged, odd ones."""
        both = {"shape": self.sizes, "properties": self.properties}
        said = [] if self.not_modelled is None else [f"{self.name}: not modelled: {self.not_modelled}"]
        said += [
            f"{self.name}.{group}.{name}: {w}"
            for group, items in both.items()
            for name, item in items.items()
            for w in item.warnings()
        ]
        if self._lacks_strength:
            said.append(f"{self.name}.properties.fracture_energy: not used, because bulk damage also needs a strength")
        return said

    @property
    def sizes(self) -> dict[str, Property]:
        """Its dimensions, and its roundness where its shape is open."""
        return {**self.dims, **({} if self.roundness is None else {"roundness": self.roundness})}

    @property
    def _lacks_strength(self) -> bool:
        """Whether bulk damage has its energy, but not the stress at which it starts."""
        return "fracture_energy" in self.properties and not set(STRENGTHS) & set(self.properties)

    @property
    def rate_dependent(self) -> bool:
        """Whether its force depends on the real speed: a part of its stiffness relaxes, or it has a rate exponent, be
        it 0, from where a fit begins."""
        relaxes = "relaxing_share" in self.properties and self.properties["relaxing_share"].value > 0.0
        return relaxes or RATE_EXPONENT in self.properties

    def to_scene_food(
        self,
        *,
        height: float | None = None,
        width: float | None = None,
        length: float | None = None,
        shape: str | None = None,
    ) -> Food:
        """The food as the solver takes it.

        Args:
            height: Another height [m].
            width: Another width along the blade [m].
            length: Another length across the blade [m].
            shape: Another outline, as ``mpm.scene.shapes.named`` reads it.

        Returns:
            The food; bulk damage is left out where there is no tensile strength at which it starts.

        Raises:
            CutcalError: A shape that is no text.
            SceneError: A shape or size that the solver cannot take.
        """
        check_kind("Food.to_scene_food", "shape", self.shape_kind if shape is None else shape, *TEXT)
        from mpm.scene import Food
        from mpm.scene.material import Material
        from mpm.scene.shapes import Shape, named

        sizes = {"length": length, "width": width, "height": height}
        size: dict[str, Any] = {n: self.dims[n].value if given is None else given for n, given in sizes.items()}
        values: dict[str, Any] = {n: p.value for n, p in self.properties.items() if n not in BOARD}
        if self._lacks_strength:
            del values["fracture_energy"]
        kind, roundness = named(shape or self.shape_kind)
        if shape is None and kind in BARRELS and self.roundness is not None:
            roundness = self.roundness.value
        return Food(Shape(kind, **size, roundness=roundness), Material(**values))

    def as_dict(self) -> dict[str, Any]:
        """Plain data in the layout of ``materials.yaml``."""
        sizes = self.sizes
        shape = {"kind": self.shape_kind} | {n: sizes[n].as_dict() for n in (*DIMENSIONS, *FORM) if n in sizes}
        have = {n: p.as_dict() for n, p in self.properties.items()}
        said = {} if self.not_modelled is None else {"not_modelled": self.not_modelled}
        named = [n for n in PROPERTIES if n in have or n not in _OPTIONAL]
        held = {n: {d: p.as_dict() for d, p in sizes.items()} for n, sizes in self.inclusions.items()}
        return {**said, "shape": shape, **held, "properties": {n: have.get(n) for n in named}}


def load_foods(path: Path | str | None = None) -> dict[str, FoodSpec]:
    """All foods of a materials file, by name.

    Args:
        path: A file in the layout of ``materials.yaml``; by default the one shipped with cutcal.

    Raises:
        MaterialError: The file cannot be read or has an error; the message names file and place.
    """
    top, content = read_yaml(data_path("materials.yaml") if path is None else path)
    return {name: _read_food(top.at(name), raw) for name, raw in content.items() if name != "calibration"}


def load_food(name: str, path: Path | str | None = None) -> FoodSpec:
    """One food of a materials file.

    Args:
        name: Lower case with underscores; or, where no other file is named, the YAML file of one food.
        path: As in :func:`load_foods`.

    Raises:
        MaterialError: As :func:`load_foods`, or an unknown food (with the nearest known one and the list).
    """
    if path is None and name.endswith(FILES):
        return load_material_file(name)
    foods = load_foods(path)
    if name not in foods:
        near = suggest(name, foods)
        listing = "" if near.startswith(";") else f"; known: {', '.join(foods)}"
        begin = "" if path is not None else "; a food of your own is a file that cutcal foods --template begins"
        raise MaterialError(f"unknown food {name!r}{near}{listing}{begin}")
    return foods[name]


def load_material_file(path: Path | str) -> FoodSpec:
    """The food of a file with one food, as a calibration writes it; ``calibration`` holds its provenance.

    Raises:
        MaterialError: As :func:`load_foods`, or not exactly one food in the file.
    """
    top, content = read_yaml(path)
    provenance = content.pop("calibration", None)
    if len(content) != 1:
        raise top.error(f"has {len(content)} foods, but one is needed; leave one of: {listed(list(content))}")
    name, raw = next(iter(content.items()))
    kept = None if provenance is None else mapping(top.at("calibration"), provenance)
    return replace(_read_food(top.at(name), raw, own=True), calibration=kept)


def _read_food(place: Place, raw: Any, own: bool = False) -> FoodSpec:
    """A food as a file has it; what a file of one's own leaves out has a default."""
    food = mapping(place, raw)
    check_keys(place, food, ("shape",) if own else ("shape", "properties"), ("properties", "not_modelled", *INCLUSIONS))
    said = text(place.at("not_modelled"), food["not_modelled"]) if "not_modelled" in food else None
    shape = mapping(place.at("shape"), food["shape"])
    none = own and food.get("properties") is None
    given = {} if none else mapping(place.at("properties"), food["properties"])
    check_keys(place.at("shape"), shape, ("kind", *DIMENSIONS), tuple(FORM), SYNONYMS)
    needed = [] if own else [n for n in PROPERTIES if n not in _OPTIONAL]
    check_keys(place.at("properties"), given, needed, PROPERTIES, SYNONYMS)
    dims = {n: read_property(place.at("shape"), n, shape[n]) for n in DIMENSIONS}
    form = {n: read_property(place.at("shape"), n, shape[n]) for n in FORM if n in shape}
    held = {n: _read_sizes(place.at(n), food[n]) for n in INCLUSIONS if n in food}
    have = [n for n in PROPERTIES if given.get(n) is not None or (n in given and n not in _NULLABLE)]
    properties = {n: read_property(place.at("properties"), n, given[n]) for n in have}
    if own and any(name not in given for name in OPTIONAL_HERE):
        absent = [name for name in given if given[name] is None]
        properties = filled(properties, [food.properties for food in load_foods().values()], absent)
    try:
        return FoodSpec(place.path[-1], shape["kind"], dims, properties, None, said, held, **form)
    except MaterialError as e:
        raise replace(place, path=()).error(str(e)) from None


def _read_sizes(place: Place, raw: Any) -> dict[str, Property]:
    given = mapping(place, raw)
    check_keys(place, given, DIMENSIONS, synonyms=SYNONYMS)
    return {n: read_property(place, n, given[n]) for n in DIMENSIONS}
