"""Knives: ``knives.yaml`` or a user's file with one knife, checked and turned into the solver's blade."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calib.io.wording import listed
from calib.io.yaml_checks import (
    Place,
    check_keys,
    check_unit,
    choice,
    data_path,
    finite_number,
    mapping,
    read_yaml,
    suggest,
    text,
)
from mpm.scene import Knife
from mpm.scene.errors import SceneError

#: Unit of each field in the file.
KNIFE_UNITS = {"spine": "m", "angle": "deg", "height": "m", "length": "m"}

#: Smallest and largest value of each field in its unit: from a scalpel to a cleaver.
KNIFE_LIMITS = {"spine": (1e-4, 0.02), "angle": (0.1, 60.0), "height": (2e-3, 0.2), "length": (5e-3, 0.6)}

KNIFE_STATUSES = ("measured", "proxy", "assumed", "given")

#: Part of the spine by which the faces may miss it at the top of the blade: the flat of the edge is not
#: modelled (0.08 mm of 2 mm, 4 %) and angles are given to three digits.
WEDGE_TOLERANCE = 0.06

_SYNONYMS = {
    "thickness": "spine", "width": "spine", "bevel": "angle", "included_angle": "angle", "wedge": "angle",
    "blade_height": "height", "blade_length": "length",
}  # fmt: skip

TEMPLATE = """# A knife of your own, in SI units: calibrate --knife {name}.yaml --food potato --trace cut.csv
# A straight symmetric blade: a wedge from the edge up to the thickness of the spine, parallel above it.
# status: measured, proxy, assumed or given.
{name}:
  # thickness of the spine
  spine:  {{value: 2.0e-3, unit: m, status: measured, source: "say how"}}
  # included angle of the wedge, not that of the sharpening bevel: 2 atan(spine / 2 / height)
  angle:  {{value: 2.55, unit: deg, status: measured, source: "say how"}}
  # from edge to spine
  height: {{value: 0.045, unit: m, status: measured, source: "say how"}}
  # of the edge
  length: {{value: 0.2, unit: m, status: measured, source: "say how"}}
"""
"""A file to begin a knife with."""


@dataclass(frozen=True)
class KnifeNumber:
    """One number of a knife as its file has it.

    Attributes:
        value: The number [unit].
        unit: SI unit, degrees for the angle.
        status: One of ``KNIFE_STATUSES``.
        source: Where it comes from.
    """

    value: float
    unit: str
    status: str
    source: str


def knife_fields(path: Path | str | None = None) -> dict[str, dict[str, KnifeNumber]]:
    """Every number of all knives of a file with its source.

    Args:
        path: As :func:`load_knives`.

    Returns:
        The numbers by knife and by ``spine``, ``angle``, ``height`` and ``length``.

    Raises:
        SceneError: As :func:`load_knives`.
    """
    top, content = read_yaml(data_path("knives.yaml") if path is None else path, kind=SceneError)
    out = {}
    for name, raw in content.items():
        _read_knife(top.at(name), raw)
        out[name] = {n: _field(float(raw[n]["value"]), n, raw[n]) for n in KNIFE_UNITS}
    return out


def _field(value: float, name: str, raw: dict[str, Any]) -> KnifeNumber:
    return KnifeNumber(value, KNIFE_UNITS[name], raw.get("status", "given"), raw.get("source", "no source"))


def load_knives(path: Path | str | None = None) -> dict[str, Knife]:
    """All knives of a file, by name.

    Args:
        path: A file in the layout of ``knives.yaml``; by default the one shipped with cutcal.

    Raises:
        SceneError: The file cannot be read or has an error; the message names file and place.
    """
    top, content = read_yaml(data_path("knives.yaml") if path is None else path, kind=SceneError)
    return {name: _read_knife(top.at(name), raw) for name, raw in content.items()}


def load_knife(name: str | Path) -> Knife:
    """One knife.

    Args:
        name: A name in ``knives.yaml``, or the path of a YAML file with one knife in the same layout.

    Raises:
        SceneError: As :func:`load_knives`, an unknown name, or a file with another number of knives.
    """
    if isinstance(name, Path) or name.endswith((".yaml", ".yml")):
        knives = load_knives(name)
        if len(knives) != 1:
            raise SceneError(
                f"{name}: has {len(knives)} knives, but one is needed; leave one of: {listed(list(knives))}"
            )
        return next(iter(knives.values()))
    knives = load_knives()
    if name not in knives:
        near = suggest(name, knives)
        listing = "" if near.startswith(";") else f"; known: {', '.join(knives)}"
        begin = ", or the path of a .yaml file, which cutcal knives --template begins"
        raise SceneError(f"unknown knife {name!r}{near}{listing}{begin}")
    return knives[name]


def wedge_height(knife: Knife) -> float:
    """Height above the edge where the faces are a spine's thickness apart [m]: spine / (2 tan(angle / 2))."""
    return knife.spine / (2.0 * math.tan(0.5 * knife.angle))


def _read_knife(place: Place, raw: Any) -> Knife:
    given = mapping(place, raw)
    check_keys(place, given, KNIFE_UNITS, synonyms=_SYNONYMS)
    value = {field: _read_field(place.at(field), field, given[field]) for field in KNIFE_UNITS}
    knife = Knife(place.path[-1], value["spine"], math.radians(value["angle"]), value["height"], value["length"])
    top = 2.0 * knife.height * math.tan(0.5 * knife.angle)
    if top < (1.0 - WEDGE_TOLERANCE) * knife.spine:
        angle = math.degrees(2.0 * math.atan(0.5 * knife.spine / knife.height))
        raise place.error(
            f"with an angle of {value['angle']:g} deg the faces are only {top * 1e3:.3g} mm apart at the top "
            f"of the blade ({knife.height * 1e3:g} mm), but the spine has {knife.spine * 1e3:g} mm; "
            f"correct one of them, for instance angle: {angle:.3g}"
        )
    return knife


def _read_field(place: Place, field: str, raw: Any) -> float:
    given = mapping(place, raw)
    check_keys(place, given, ("value", "unit"), ("source", "status"))
    value = finite_number(place.at("value"), given["value"])
    check_unit(place, given["unit"], KNIFE_UNITS[field], value)
    low, high = KNIFE_LIMITS[field]
    if not low <= value <= high:
        unit = KNIFE_UNITS[field]
        raise place.error(f"{value:g} {unit} is no knife; it must lie between {low:g} and {high:g} {unit}")
    if "source" in given:
        text(place.at("source"), given["source"])
    if "status" in given:
        choice(place.at("status"), given["status"], KNIFE_STATUSES)
    return value
