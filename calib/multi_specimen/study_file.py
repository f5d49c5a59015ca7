"""A study of several cuts in one YAML file: which traces, what they share, which are held out.

    food: potato
    knife: edc                      # of every trace that names none
    traces:
      cut1: {trace: cut1.csv, air: air.csv}
      cut2: {trace: cut2.csv, air: air.csv, width: 0.05}
      gel:  {kind: compression, trace: [gel.csv], height: 0.03, diameter: 0.05, nu: 0.45}
    hold_out: each                  # or names; left out: none
    scatter: 0.25                   # of the flesh among specimens, for the bands of held-out cuts

Paths are taken from the folder of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from calib.errors import MaterialError, ShapeError
from calib.io.yaml_checks import Place, check_keys, choice, finite_number, mapping, read_yaml, text
from calib.material.food import FoodSpec, load_food, load_material_file
from calib.material.properties import BOARD, OF_TRACE, check_override
from calib.material.scene import MID_LENGTH, Sizing
from calib.multi_specimen.spec import (
    COMPRESSION,
    CUT,
    KNIFE_PROPERTIES,
    SCATTER,
    SPECIMEN_PROPERTIES,
    CompressionSpec,
    StudySpec,
)
from calib.outline.outline_file import OutlineFile
from calib.problem.request import Request
from calib.table.si_numbers import si_number

LARGEST_SCATTER = 1.0
"""Standard deviation of a logarithm [-]: a factor of seven either way."""
EACH = "each"
"""What ``hold_out`` says where each cut is held out in turn."""
TOP = ("material", "knife", "fit", "own", "by_knife", "hold_out", "scatter", "budget", "seed", "dx", "set")
SENSOR = ("gain_sd", "lag_sd", "bandwidth")
NUMBERS = ("speed", "board_z", "t_end", "height", "width", "length", "at", *SENSOR, "rate", "cut")
TEXTS = ("time_col", "force_col", "position_col", "depth_col", "sign", "decimal", "baseline", "shape", "knife")
OUTLINES = tuple(one.name for one in fields(OutlineFile))
UNITS = {"speed": "m/s", "board_z": "m", "t_end": "s", "height": "m", "width": "m", "length": "m", "diameter": "m"}
UNITS |= {"dx": "m", "lag_sd": "s", "bandwidth": "/s", "rate": "/s"}
"""What a number is in, where it may be written with a unit of its own."""
COMPRESSION_SIZES = ("height", "diameter", "width", "length")


def read_study(path: Path | str) -> StudySpec:
    """Read a study of several cuts.

    Args:
        path: The YAML file.

    Returns:
        The study.

    Raises:
        CutcalError: Anything wrong with the file; the message names the place in it.
    """
    top, content = read_yaml(path)
    check_keys(top, content, ("food", "traces"), TOP, {"specimens": "traces", "holdout": "hold_out"})
    folder = Path(path).resolve().parent
    food = _food(top, content, folder)
    base = Request(
        food=food,
        trace=folder,
        fit=_names(top.at("fit"), content.get("fit")),
        dx=_number(top, content, "dx"),
        seed=int(finite_number(top.at("seed"), content.get("seed", 0))),
        budget=finite_number(top.at("budget"), content.get("budget", 100)),
        scaled=True,
        knife=text(top.at("knife"), content.get("knife", "kitchen")),
    )
    requests, compressions = _traces(top.at("traces"), content["traces"], folder, base)
    hold_out = _hold_out(top.at("hold_out"), content.get("hold_out"), tuple(requests))
    own, by_knife = (_names(top.at(key), content.get(key)) for key in ("own", "by_knife"))
    return StudySpec(
        source=Path(path).name,
        food=food,
        requests=requests,
        compressions=compressions,
        specimen_properties=SPECIMEN_PROPERTIES if own is None else own,
        hold_out=hold_out,
        budget=base.budget,
        seed=base.seed,
        scatter=_scatter(top.at("scatter"), content.get("scatter", SCATTER)),
        knife_properties=KNIFE_PROPERTIES if by_knife is None else by_knife,
    )


def _food(top: Place, content: Mapping[str, Any], folder: Path) -> FoodSpec:
    name = text(top.at("food"), content["food"])
    material = content.get("material")
    own = material is None and is_file(name)
    file = name if own else None if material is None else text(top.at("material"), material)
    try:
        food = load_food(name) if file is None else load_material_file(folder / file)
    except MaterialError as e:
        raise top.at("food").error(str(e)) from None
    if not own and food.name != name:
        raise top.at("material").error(f"holds {food.name}, but food is {name}; make them the same")
    given = content.get("set")
    if given is None:
        return food
    return food.with_values(_values(top.at("set"), given))


def _traces(
    top: Place, content: Any, folder: Path, base: Request
) -> tuple[dict[str, Request], tuple[CompressionSpec, ...]]:
    """The cuts by name, and the compression tests."""
    requests, compressions = {}, []
    for name, raw in mapping(top, content).items():
        place = top.at(name)
        if OF_TRACE in name or "," in name:
            raise place.error(f"a name of a trace may not hold {OF_TRACE!r} or a comma; write letters, digits and _")
        given = mapping(place, raw)
        if choice(place.at("kind"), given.get("kind", CUT), (CUT, COMPRESSION)) == COMPRESSION:
            compressions.append(_compression(place, name, given, folder))
        else:
            requests[name] = _request(place, given, folder, base)
    if not requests:
        raise top.error("holds no cut; add one with trace: FILE")
    return requests, tuple(compressions)


def _request(place: Place, given: Mapping[str, Any], folder: Path, base: Request) -> Request:
    check_keys(place, given, ("trace",), ("kind", "air", "set", *NUMBERS, *TEXTS, *OUTLINES))
    numbers = {n: _number(place, given, n) for n in NUMBERS}
    words = {n: None if n not in given else text(place.at(n), given[n]) for n in TEXTS}
    air = given.get("air")
    return replace(
        base,
        food=base.food.with_values(_board(place.at("set"), given.get("set", {}))),
        trace=folder / text(place.at("trace"), given["trace"]),
        air=None if air is None else folder / text(place.at("air"), air),
        columns={n: words[n] for n in ("time_col", "force_col", "position_col", "depth_col", "sign", "decimal")}
        | {"rate": numbers["rate"]},
        knife=_knife(words["knife"] or base.knife, folder),
        sizing=_sizing(place, given, folder, numbers, words["shape"]),
        speed=numbers["speed"],
        board_z=numbers["board_z"],
        t_end=numbers["t_end"],
        baseline=words["baseline"] or base.baseline,
        cut=None if numbers["cut"] is None else int(numbers["cut"]),
        gain_sd=numbers["gain_sd"],
        lag_sd=numbers["lag_sd"],
        bandwidth=numbers["bandwidth"],
    )


def _board(place: Place, given: Any) -> dict[str, float]:
    """Values of the board under one cut; those of the food are set for all cuts."""
    for name in mapping(place, given):
        if name not in BOARD:
            known = f"{', '.join(BOARD[:-1])} and {BOARD[-1]}"
            raise place.at(name).error(f"only {known} are set for one cut; set the food's at the top")
    return _values(place, given)


def _values(place: Place, given: Any) -> dict[str, float]:
    """Properties that are set, by name."""
    return {n: check_override(n, finite_number(place.at(n), x)) for n, x in mapping(place, given).items()}


def _sizing(
    place: Place, given: Mapping[str, Any], folder: Path, numbers: Mapping[str, float | None], shape: str | None
) -> Sizing:
    """Sizes of a specimen, and its outline where a file beside the study has it."""
    words: dict[str, Any] = {n: text(place.at(n), given[n]) for n in OUTLINES if n in given}
    if "outline" in words:
        words["outline"] = folder / words["outline"]
    known = Sizing(shape, numbers["height"], numbers["width"], numbers["length"], numbers["at"] or MID_LENGTH)
    try:
        return OutlineFile(**words).sizing(known)
    except ShapeError as e:
        raise place.error(str(e)) from None


def _knife(name: str, folder: Path) -> str:
    """A knife of knives.yaml by its name, or a file beside the study."""
    return str(folder / name) if is_file(name) else name


def is_file(name: str) -> bool:
    """Whether a food or a knife is named by a file beside the study."""
    return name.endswith((".yaml", ".yml"))


def _compression(place: Place, name: str, given: Mapping[str, Any], folder: Path) -> CompressionSpec:
    check_keys(place, given, ("kind", "trace", "height", "nu"), COMPRESSION_SIZES)
    raw = given["trace"] if isinstance(given["trace"], list) else [given["trace"]]
    files = tuple(folder / text(place.at("trace"), entry) for entry in raw)
    sizes = {n: _finite(place, given, n) for n in COMPRESSION_SIZES if n in given}
    if ("diameter" in sizes) == ("width" in sizes and "length" in sizes):
        raise place.error("give height and diameter of an upright cylinder, or height, width and length of a block [m]")
    return CompressionSpec(name, files, sizes, finite_number(place.at("nu"), given["nu"]))


def _hold_out(place: Place, given: Any, names: tuple[str, ...]) -> tuple[str, ...]:
    if given is None:
        return ()
    chosen = names if given == EACH else (_names(place, given) or ())
    unknown = [n for n in chosen if n not in names]
    if unknown:
        raise place.error(f"{unknown[0]!r} is no trace of this study; known: {', '.join(names)}, or the word {EACH}")
    if len(names) < 2 or (given != EACH and set(chosen) == set(names)):
        raise place.error(f"nothing would be left to fit; hold out fewer than the {len(names)} traces, or write {EACH}")
    return tuple(chosen)


def _scatter(place: Place, given: Any) -> float:
    x = finite_number(place, given)
    if not 0.0 <= x <= LARGEST_SCATTER:
        raise place.error(f"is {x:g}; give 0 to {LARGEST_SCATTER:g}, the standard deviation of a logarithm")
    return x


def _names(place: Place, given: Any) -> tuple[str, ...] | None:
    """A list of names, or one; None where nothing is given."""
    if given is None:
        return None
    entries = given if isinstance(given, list) else [given]
    return tuple(text(place, entry) for entry in entries)


def _number(place: Place, given: Mapping[str, Any], name: str) -> float | None:
    if given.get(name) is None:
        return None
    x = _finite(place, given, name)
    if not x > 0.0:
        raise place.at(name).error(f"is {x:g}; it must be positive")
    return x


def _finite(place: Place, given: Mapping[str, Any], name: str) -> float:
    """A number in SI, or with a unit of its own, as on the command line."""
    value = given[name]
    if isinstance(value, str) and name in UNITS:
        try:
            value = si_number(value, UNITS[name])
        except ValueError as e:
            raise place.at(name).error(str(e)) from None
    return finite_number(place.at(name), value)
