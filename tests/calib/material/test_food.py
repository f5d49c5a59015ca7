from __future__ import annotations

import math
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import yaml

from calib.errors import MaterialError, OutputError
from calib.io.yaml_checks import data_path
from calib.material.food import (
    FoodSpec,
    check_override,
    load_food,
    load_foods,
    load_material_file,
)
from calib.material.food_file import dump_material
from calib.material.properties import (
    ADHESION,
    DIMENSIONS,
    LAYER_STIFFNESS,
    LAYERS,
    PROPERTIES,
    RATE_EXPONENT,
    RELAXATION,
    RELAXING_BULK,
    Property,
    Source,
    check_override,
)
from tests.data_dir import data_file

TABLE2 = {  # rho, E, nu of CulinaryCut, Table 2
    "apple": (850, 3.0e6, 0.33),
    "cucumber": (980, 1.0e6, 0.35),
    "melon": (1100, 1.2e6, 0.45),
    "banana": (960, 7.0e3, 0.35),
    "orange": (1020, 5.84e5, 0.24),
    "peach": (968, 8.9e5, 0.29),
    "strawberry": (1010, 2.0e5, 0.40),
}
# The fifteen of the paper, and potato.
FOODS = (
    *TABLE2, "potato", "kiwi", "tomato", "pear", "lemon", "grape", "shine_muscat", "plum", "cherry",
)  # fmt: skip
STONES = ("peach", "plum", "cherry")


@pytest.fixture(scope="module")
def foods() -> dict[str, FoodSpec]:
    """All foods of the shipped file."""
    return load_foods()


@pytest.fixture
def document() -> dict[str, Any]:
    """Plain data of one valid food, to be broken by a test."""
    return {"banana": load_food("banana").as_dict()}


def write(tmp_path: Path, document: Any, name: str = "materials.yaml") -> Path:
    """A YAML file of a document, or of text as it is."""
    path = tmp_path / name
    path.write_text(document if isinstance(document, str) else yaml.safe_dump(document), encoding="utf-8")
    return path


def message(path: Path) -> str:
    """What the loader says about a broken file."""
    with pytest.raises(MaterialError) as caught:
        load_foods(path)
    return str(caught.value)


# The shipped file ---------------------------------------------------------------------------------


def test_shipped_foods(foods: dict[str, FoodSpec]) -> None:
    """The fifteen foods of the paper and potato are there, each with every property but the nullable ones."""
    assert set(FOODS) == set(foods)
    for food in foods.values():
        assert set(PROPERTIES) - set(food.properties) <= {
            "board_suction",
            "bow",
            "R_skin",
            "tensile_strength",
            "strength_ratio",
            "fracture_energy",
            "skin_stiffness",
            *ADHESION,
            *RELAXATION,
            RELAXING_BULK,
            RATE_EXPONENT,
            *LAYER_STIFFNESS.values(),
            *LAYERS,
            *LAYERS.values(),
        }
        assert tuple(food.dims) == tuple(DIMENSIONS)


@pytest.mark.parametrize("name", FOODS)
def test_shipped_food_makes_a_scene(name: str, foods: dict[str, FoodSpec]) -> None:
    """Every food is accepted by the solver's own validation and keeps its numbers on the way."""
    food = foods[name]
    scene = food.to_scene_food()
    assert scene.shape.kind == food.shape_kind
    assert scene.shape.height == food.dims["height"].value
    for prop in ("E", "nu", "rho", "yield_stress", "R", "R_initiation", "R_skin", "skin_thickness", "mu"):
        assert getattr(scene.material, prop) == food.value(prop)


@pytest.mark.parametrize("name", sorted(TABLE2))
def test_table2_is_among_the_sources(name: str, foods: dict[str, FoodSpec]) -> None:
    """Each number of the paper's Table 2 is either the value used or listed beside it, never lost."""
    for prop, published in zip(("rho", "E", "nu"), TABLE2[name], strict=True):
        p = foods[name].properties[prop]
        assert any(math.isclose(published, x) for x in [p.value, *(s.value for s in p.sources)]), prop


def test_values_said_to_be_of_table2_are(foods: dict[str, FoodSpec]) -> None:
    """A value with status paper_table2 is the number of the table."""
    seen = 0
    for name, food in foods.items():
        for i, prop in enumerate(("rho", "E", "nu")):
            if food.properties[prop].status == "paper_table2":
                assert food.value(prop) == pytest.approx(TABLE2[name][i])
                seen += 1
    assert seen >= 8
    table = [p for f in foods.values() for p in f.properties.values() if p.status == "paper_table2"]
    assert {p.name for p in table} <= {"rho", "E", "nu"}


def test_banana_stiffness_is_not_the_papers(foods: dict[str, FoodSpec]) -> None:
    """The paper's 7 kPa for banana is outside its range, flagged, and named in a warning."""
    p = foods["banana"].properties["E"]
    assert 1e5 < p.value < 1e6 and p.low > 7e3
    assert any(s.value == 7e3 and "Table 2" in s.source for s in p.sources)
    said = [w for w in foods["banana"].warnings() if w.startswith("banana.properties.E:")]
    assert any("7 kPa" in w for w in said) and any("42.9 times" in w for w in said)


def test_kiwi_yield_and_potato_density(foods: dict[str, FoodSpec]) -> None:
    """The measured kiwi yield stress is used; a potato sinks, whatever a simulation's settings say."""
    assert foods["kiwi"].properties["yield_stress"].status == "measured"
    assert foods["kiwi"].value("yield_stress") == 24e3
    rho = foods["potato"].properties["rho"]
    assert rho.low > 1000 and 630 not in [s.value for s in rho.sources]


@pytest.mark.parametrize("name", FOODS)
def test_ranges_are_honest(name: str, foods: dict[str, FoodSpec]) -> None:
    """Ranges contain every published value that is not flagged, and an assumed stiffness spans a decade."""
    for prop in foods[name].properties.values():
        assert prop.low < prop.high, prop.name
        if prop.status == "assumed" and PROPERTIES[prop.name].unit in ("Pa", "J/m^2", "N/m"):
            assert prop.high >= 10 * prop.low, prop.name
        if prop.flag is None:
            assert all(prop.low <= s.value <= prop.high for s in prop.sources), prop.name


def test_published_numbers_are_listed(foods: dict[str, FoodSpec]) -> None:
    """Each published density, modulus, Poisson's ratio and toughness of these foods is the value used or beside it,
    the settings of a simulation excepted.
    """
    table = pd.read_csv(data_file("literature_properties.csv"), dtype=str)
    columns = {
        "density_kg_m3": ("rho",),
        "E_Pa_low": ("E",),
        "E_Pa_high": ("E",),
        "poisson": ("nu",),
        "strength_Pa_low": ("yield_stress",),
        "fracture_energy_J_m2_low": ("R", "fracture_energy"),
        "fracture_energy_J_m2_high": ("R", "fracture_energy"),
    }
    seen = 0
    for row in table.to_dict("records"):
        food = None if row["test"] == "simulation input" else foods.get(row["food"].replace(" ", "_"))
        for column, names in columns.items():
            if food is None or not isinstance(row[column], str) or "~" in row[column]:
                continue  # "~0" for peel alone is no number
            have = [food.properties[n] for n in names if n in food.properties]
            listed = [x for p in have for x in (p.value, *(s.value for s in p.sources))]
            for number in row[column].split("-"):
                assert any(math.isclose(float(number), x, rel_tol=5e-3) for x in listed), (food.name, column, number)
                seen += 1
    assert seen > 60


@pytest.mark.parametrize("name", STONES)
def test_stone_that_is_not_modelled_is_said(name: str, foods: dict[str, FoodSpec], tmp_path: Path) -> None:
    """Whoever uses a fruit with a stone is told that it is not modelled, also after a calibration."""
    assert any(w.startswith(f"{name}: not modelled: the stone") for w in foods[name].warnings())
    dump_material(foods[name], tmp_path / "material.yaml", {})
    assert load_material_file(tmp_path / "material.yaml").warnings() == foods[name].warnings()


@pytest.mark.parametrize("name", FOODS)
def test_cut_starts_no_easier_than_it_goes_on(name: str, foods: dict[str, FoodSpec]) -> None:
    """R_initiation is at least R, as the solver's edge law requires."""
    start, go = foods[name].value("R_initiation"), foods[name].value("R")
    assert start is not None and go is not None and start >= go


def test_default_fit_follows_the_skin(foods: dict[str, FoodSpec]) -> None:
    """With a skin R_skin is fitted, without one R_initiation."""
    assert foods["cucumber"].default_fit == (
        "E",
        "yield_stress",
        "strength_ratio",
        "R",
        "R_rind",
        "rind_thickness",
        "rind_stiffness",
        "R_core",
        "core_ratio",
        "core_stiffness",
        "R_skin",
        "skin_thickness",
        "initiation_depth",
        "mu",
        "board_friction",
        "bow",
    )
    start = ("R_initiation", "initiation_depth", "mu", "board_friction", "board_suction")
    assert foods["potato"].default_fit == ("E", "yield_stress", "strength_ratio", "R", *start)


def test_import_is_light() -> None:
    """Loading foods imports neither Taichi nor plotting."""
    code = (
        "import sys; from calib.material.food import load_foods; load_foods();"
        "sys.exit(len({'taichi', 'matplotlib', 'pyvista', 'skfem'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=data_path("materials.yaml").parent).returncode == 0


# Warnings -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("largest", "warned"), [(2.9e5, False), (3.1e5, True)])
def test_sources_that_disagree(largest: float, warned: bool) -> None:
    """A warning appears when published values differ by more than three times, and not before."""
    sources = (Source(1e5, "a"), Source(largest, "b"))
    prop = Property("E", 2e5, 1e4, 1e6, "Pa", "a", "proxy", sources)
    assert any("times" in w for w in prop.warnings()) is warned


def test_the_used_value_is_compared_too() -> None:
    """A used literature value far from a single source is a disagreement; a fitted one is not literature."""
    far = Property("E", 1e6, 1e4, 1e7, "Pa", "a", "proxy", (Source(1e5, "b"),))
    own = Property("E", 1e6, 1e4, 1e7, "Pa", "a", "fitted", (Source(1e5, "b"),))
    assert far.warnings() and not own.warnings()


def test_fitted_value_outside_its_range(foods: dict[str, FoodSpec]) -> None:
    """A fitted value may leave the literature's range, and a warning then says so."""
    food = foods["kiwi"].with_values({"E": 9e6}, status="fitted", source="a trace")
    (said,) = [w for w in food.warnings() if "outside the literature's range" in w]
    assert said.startswith("kiwi.properties.E") and "e+" not in said and "\u00a0MPa" in said


def test_half_of_bulk_damage(foods: dict[str, FoodSpec]) -> None:
    """A fracture energy without a strength is not used, with a warning; with both it is used."""
    apple = foods["apple"]
    rest = {name: item for name, item in apple.properties.items() if name != "strength_ratio"}
    half = replace(apple, properties=rest).with_values({"fracture_energy": 200.0})
    assert half.to_scene_food().material.fracture_energy is None
    assert any("bulk damage also needs a strength" in w for w in half.warnings())
    both = half.with_values({"tensile_strength": 3e5})
    assert both.to_scene_food().material.fracture_energy == 200.0
    assert not any("bulk damage" in w for w in both.warnings())


@pytest.mark.parametrize("name", FOODS)
def test_strength_is_known_and_breaks_nothing_in_bulk(name: str, foods: dict[str, FoodSpec]) -> None:
    """Each food has that part of its yield stress at which the one food that was measured parts; none has bulk
    damage, and none says that its strength is not used."""
    food, material = foods[name], foods[name].to_scene_food().material
    ratio, flow = food.value("strength_ratio"), food.value("yield_stress")
    assert ratio == 0.8 and flow is not None and food.value("tensile_strength") is None
    assert material.strength == material.cohesion == ratio * flow and not material.damaged
    assert not any("not used, because" in w for w in food.warnings())


def test_one_strength_takes_the_place_of_the_other(foods: dict[str, FoodSpec]) -> None:
    """Whatever was given last is the strength, and the file of such a food reads back."""
    absolute = foods["apple"].with_values({"tensile_strength": 2e6})
    assert absolute.to_scene_food().material.cohesion == 2e6 and "strength_ratio" not in absolute.properties
    assert absolute.default_fit[2] == "tensile_strength"
    again = absolute.with_values({"strength_ratio": 0.5, "yield_stress": 2e5})
    assert again.to_scene_food().material.cohesion == 1e5
    with pytest.raises(MaterialError, match="give one of them"):
        replace(absolute, properties={**absolute.properties, **again.properties})
    with pytest.raises(MaterialError, match="or fit strength_ratio"):
        foods["apple"].prior("tensile_strength")
    with pytest.raises(MaterialError, match="flows before it parts has a tensile_strength"):
        foods["apple"].with_values({"strength_ratio": 1.5})


# Values by hand -----------------------------------------------------------------------------------


def test_with_values(foods: dict[str, FoodSpec]) -> None:
    """The named values change, with their provenance; everything else and the original stay."""
    food = foods["banana"].with_values({"E": 4e5, "mu": 0.0})
    assert food.value("E") == 4e5 and food.value("mu") == 0.0 and food.value("R") == foods["banana"].value("R")
    assert food.properties["E"].status == "given" and food.prior("E") == foods["banana"].prior("E")
    assert foods["banana"].value("E") == 3e5
    fitted = foods["banana"].with_values({"E": 4e5, "strength_ratio": 0.7}, status="fitted", source="trace 7")
    for name in ("E", "strength_ratio"):
        assert (fitted.properties[name].status, fitted.properties[name].source) == ("fitted", "trace 7")
    assert fitted.prior("strength_ratio") == foods["banana"].prior("strength_ratio")
    assert foods["banana"].with_values({"fracture_energy": 200.0}).prior("fracture_energy") == (20.0, 2000.0)
    with pytest.raises(MaterialError, match="unknown property 'youngs', did you mean 'E'"):
        foods["banana"].with_values({"youngs": 4e5})


def test_sizes_by_hand(foods: dict[str, FoodSpec]) -> None:
    """Height, width, length and outline can be those of the specimen."""
    shape = foods["potato"].to_scene_food(height=0.047, width=0.05, length=0.06, shape="block").shape
    assert (shape.kind, shape.length, shape.width, shape.height) == ("block", 0.06, 0.05, 0.047)


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("E", "3e5", 3e5),
        ("nu", 0.3, 0.3),
        ("mu", "0", 0.0),
        ("skin_thickness", "0.3mm", 3e-4),
        ("E", "300 kPa", 3e5),
        ("R", "0.2 kJ/m^2", 200.0),
        ("R_skin", "0.4N/mm", 400.0),
        ("rho", "1.03 g/cm3", 1030.0),
        ("core_ratio", "55%", 0.55),
    ],
)
def test_check_override(name: str, value: Any, expected: float) -> None:
    """Numbers, and text that is one, become numbers; each may have its unit."""
    assert check_override(name, value) == expected


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("youngs", 1e5, ("unknown property 'youngs'", "did you mean 'E'")),
        ("Yield_Stress", 1e5, ("did you mean 'yield_stress'",)),
        ("xyzzy", 1, ("known: rho, E, nu",)),
        ("E", "300 mm", ("E: '300 mm' is not a stress", "in Pa", "kPa, MPa", "Young's modulus")),
        ("E", "3e5m", ("'3e5m'", "write it in Pa")),
        ("skin_thickness", "3px", ("'3px' is not a length", "write it in m")),
        ("nu", "0,3", ("'0,3' is not a part", "0.3")),
        ("E", -1.0, ("E: -1 Pa", "between 100 and 1e+10 Pa")),
        ("E", float("nan"), ("E: is nan", "finite")),
        ("E", "inf", ("finite",)),
        ("E", True, ("true/false",)),
        ("nu", 0.495, ("0.49", "locks volumetrically")),
        ("nu", -1.0, ("-1 < nu < 0.5",)),
    ],
)
def test_check_override_errors(name: str, value: Any, words: tuple[str, ...]) -> None:
    """Each mistake is named with its value, unit and remedy."""
    with pytest.raises(MaterialError) as caught:
        check_override(name, value)
    for word in words:
        assert word in str(caught.value)


def test_unknown_food() -> None:
    """An unknown food is answered with the nearest one and the list."""
    with pytest.raises(MaterialError, match="unknown food 'Bananna', did you mean 'banana'.*known: banana, cucumber"):
        load_food("Bananna")
    with pytest.raises(MaterialError, match="unknown food 'quartz'; known: banana"):
        load_food("quartz")


def test_prior_of_a_missing_property(foods: dict[str, FoodSpec]) -> None:
    """A property without a value has no prior, and the error names food and property."""
    assert foods["banana"].value("fracture_energy") is None
    with pytest.raises(MaterialError, match="banana: no literature range for fracture_energy"):
        foods["banana"].prior("fracture_energy")


# Calibrated files ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FOODS)
def test_round_trip(name: str, tmp_path: Path, foods: dict[str, FoodSpec]) -> None:
    """A written food comes back equal, to the last bit, with sources, flags and missing properties."""
    food = foods[name].with_values({"E": 123456.7890123456, "R": 1 / 3}, status="fitted", source="trace: a, b")
    path = tmp_path / "material.yaml"
    dump_material(
        food, path, {"trace_sha256": "7e12345", "seeds": [1, 2], "versions": {"cutcal": "0.1.0"}, "gpu": None}
    )
    back = load_material_file(path)
    assert back == food
    assert back.calibration == {
        "trace_sha256": "7e12345",
        "seeds": [1, 2],
        "versions": {"cutcal": "0.1.0"},
        "gpu": None,
    }
    assert load_foods(path) == {name: food}
    assert not list(tmp_path.glob("*.draft"))


@pytest.mark.parametrize("odd", ["1e5", "-2.E+03", "no", "2026-11-21", "1:30", "null", "0x1f", " a ", "ü: #"])
def test_text_stays_text(odd: str, tmp_path: Path, foods: dict[str, FoodSpec]) -> None:
    """A hash or label that looks like a number, date or truth value is still text after a round trip."""
    path = tmp_path / "material.yaml"
    dump_material(foods["kiwi"], path, {"git": odd})
    assert load_material_file(path).calibration == {"git": odd}


def test_dump_errors(tmp_path: Path, foods: dict[str, FoodSpec]) -> None:
    """A folder that is not there and data that is not plain are refused before an old file is touched."""
    with pytest.raises(OutputError, match="cannot be written"):
        dump_material(foods["kiwi"], tmp_path / "none" / "material.yaml", {})
    path = tmp_path / "material.yaml"
    dump_material(foods["kiwi"], path, {})
    with pytest.raises(OutputError, match="plain data"):
        dump_material(foods["kiwi"], path, {"where": object()})
    assert load_material_file(path) == foods["kiwi"]


def test_material_file_has_one_food() -> None:
    """A file with all foods is not a calibrated one."""
    with pytest.raises(MaterialError, match="materials.yaml: has 16 foods, but one is needed"):
        load_material_file(data_path("materials.yaml"))


# Broken files -------------------------------------------------------------------------------------


def test_unknown_key(tmp_path: Path, document: dict[str, Any]) -> None:
    """A misspelled property is named with file, place and the nearest property."""
    document["banana"]["properties"]["youngs"] = document["banana"]["properties"].pop("E")
    expected = "materials.yaml: banana.properties.youngs: unknown key, did you mean 'E'?"
    assert message(write(tmp_path, document)) == expected


def test_unknown_key_without_a_near_one(tmp_path: Path, document: dict[str, Any]) -> None:
    """A key that is like none is answered with the list."""
    document["banana"]["colour"] = "yellow"
    assert (
        message(write(tmp_path, document))
        == "materials.yaml: banana.colour: unknown key; known: shape, properties, not_modelled, stone, cavity"
    )


def test_missing_key(tmp_path: Path, document: dict[str, Any]) -> None:
    """A missing property and a missing key of a property are both named."""
    del document["banana"]["properties"]["E"]["source"]
    assert "banana.properties.E: misses source" in message(write(tmp_path, document))
    del document["banana"]["properties"]["E"]
    assert "banana.properties: misses E" in message(write(tmp_path, document))


@pytest.mark.parametrize(
    ("prop", "change", "words"),
    [
        ("E", {"unit": "kPa", "value": 300}, ("E: has unit 'kPa'", "value: 300000, unit: 'Pa'")),
        ("E", {"unit": "psi"}, ("has unit 'psi', but its unit is 'Pa'",)),
        ("rho", {"unit": "g/cm^3", "value": 0.96}, ("value: 960, unit: 'kg/m^3'",)),
        ("E", {"value": "soft"}, ("E.value: is text 'soft'", "plain number")),
        ("E", {"value": None}, ("E.value: is empty",)),
        ("E", {"value": True}, ("E.value: is true/false True",)),
        ("E", {"high": math.inf}, ("E.high: is inf", "finite")),
        ("E", {"low": math.nan}, ("E.low: is nan",)),
        ("E", {"value": -3e5}, ("E.value: -300000 Pa", "Young's modulus")),
        ("E", {"low": 4e5}, ("E: has the value 300000 outside its range 400000 to 2e+06 Pa",)),
        ("E", {"low": 1e6, "high": 1e5}, ("E: has the range 1e+06 to 100000 Pa", "low <= high")),
        ("nu", {"value": 0.5}, ("nu.value: 0.5 cannot be", "-1 < nu < 0.5")),
        ("nu", {"high": 0.495}, ("nu.high: 0.495", "locks volumetrically")),
        ("E", {"status": "measurd"}, ("E.status: unknown value 'measurd', did you mean 'measured'",)),
        ("E", {"source": ""}, ("E.source: is empty",)),
        ("E", {"flag": 3}, ("E.flag: is a number, but text",)),
        ("E", {"sources": 3}, ("E.sources: must be a list",)),
        ("E", {"sources": [{"value": 1, "from": "x"}]}, ("E.sources.0.from: unknown key",)),
        ("E", {"sources": [{"value": "x", "source": "y"}]}, ("E.sources.0.value: is text 'x'",)),
        ("R_skin", None, ("banana.properties: skin_thickness > 0 needs R_skin",)),
        ("E", None, ("banana.properties.E: is empty",)),
    ],
)
def test_wrong_entries(
    prop: str, change: dict[str, Any] | None, words: tuple[str, ...], tmp_path: Path, document: dict[str, Any]
) -> None:
    """Each wrong entry is named with file, food, property, what was wrong and what to write."""
    properties = document["banana"]["properties"]
    properties[prop] = None if change is None else properties[prop] | change
    said = message(write(tmp_path, document))
    assert said.startswith("materials.yaml: banana.properties")
    for word in words:
        assert word in said


def test_wrong_shape(tmp_path: Path, document: dict[str, Any]) -> None:
    """An outline that the solver does not know is answered with the nearest."""
    document["banana"]["shape"]["kind"] = "cylnder"
    expected = "materials.yaml: banana.shape.kind: unknown value 'cylnder', did you mean 'cylinder'?"
    assert message(write(tmp_path, document)) == expected
    document["banana"]["shape"] = [1, 2]
    assert "banana.shape: is a list" in message(write(tmp_path, document))


@pytest.mark.parametrize("odd", [True, "", ["the stone"]])
def test_what_is_not_modelled_is_text(odd: Any, tmp_path: Path, document: dict[str, Any]) -> None:
    """A flag in place of the sentence is refused at its place."""
    document["banana"]["not_modelled"] = odd
    assert message(write(tmp_path, document)).startswith("materials.yaml: banana.not_modelled: is ")


def test_syntax_error_has_its_line(tmp_path: Path) -> None:
    """A YAML syntax error names file, line and column."""
    said = message(write(tmp_path, "banana:\n  shape: {kind: block\n  properties: 3\n"))
    assert said.startswith("materials.yaml: line 3, column ")


def test_key_given_twice(tmp_path: Path) -> None:
    """A key given twice is an error with its line, not the last of the two."""
    said = message(write(tmp_path, "banana: {}\nkiwi: {}\nbanana: {}\n"))
    assert said == "materials.yaml: line 3, column 1: the key 'banana' is given twice; keep one of them"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "is empty"),
        ("- a\n- b\n", "is a list"),
        ("no: {}\n", "the key False is true/false, not text"),
        ("a: *b\n", "line 1"),
        ("a: \x07\n", "not YAML"),
    ],
)
def test_not_a_materials_file(content: str, words: str, tmp_path: Path) -> None:
    """Files that are something else are named as such, with the file."""
    said = message(write(tmp_path, content))
    assert said.startswith("materials.yaml") and words in said


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("a: !!int x", "'x' is no whole number in decimal"),
        ("a: !!bool perhaps", "holds a value that YAML does not have"),
        ("a: !!timestamp now", "holds a value that YAML does not have"),
        ("a: 2001-99-99", "holds a value that YAML does not have (month must be in 1..12); put it in quotes"),
        ("a: &a {b: *a}", "*a stands for a list or mapping; write it out"),
        ("a: " + "[" * 2000, "is nested too deeply"),
        ("a: \0", "not YAML: unacceptable character #x0000"),
        ('"a\\nb": {}', "the key 'a\\nb' is no name"),
        ("x" * 500 + ": {}", "xxx...' is no name: use one line"),
        ("1" * 300 + ": {}", "the key '1111"),
        ("1" * 20 + ": {}", "the key 1111"),
    ],
)
def test_what_yaml_lets_through(line: str, words: str, tmp_path: Path) -> None:
    """Values, nesting and names on which PyYAML or Python stumbles are one line with the file's name."""
    said = message(write(tmp_path, f"{line}\n"))
    assert said.startswith("materials.yaml: ") and words in said and said.isprintable() and len(said) < 200


def test_values_without_end(tmp_path: Path, document: dict[str, Any]) -> None:
    """A whole number too large for a float, and anchors that stand for 10^11 words, where a unit or a kind should
    be."""
    document["banana"]["properties"]["E"]["value"] = 10**400
    assert "E.value: is text '1000" in message(write(tmp_path, document))
    document["banana"]["properties"]["E"]["value"] = 1e5
    laughs = "calibration:\n  - &l0 [ha]\n" + "".join(
        f"  - &l{i} [{', '.join([f'*l{i - 1}'] * 10)}]\n" for i in range(1, 12)
    )
    text = yaml.safe_dump(document)
    for old, new in (("unit: Pa", "unit: *l11"), ("kind: cylinder", "kind: *l11")):
        said = message(write(tmp_path, laughs + text.replace(old, new)))
        assert "*l0 stands for a list or mapping; write it out" in said and len(said) < 300


def test_unreadable_files(tmp_path: Path) -> None:
    """No file, a folder and a binary file each have their own message."""
    assert "no such file" in message(tmp_path / "none.yaml")
    assert "cannot be read" in message(tmp_path)
    binary = tmp_path / "x.yaml"
    binary.write_bytes(b"a: \xff\n")
    assert message(binary) == "x.yaml: byte 3 is not UTF-8 text; save the file as UTF-8"


def test_exponents_are_numbers(tmp_path: Path, document: dict[str, Any]) -> None:
    """``3e5`` is a number, as in YAML 1.2 and everywhere else; PyYAML alone reads it as text."""
    text = yaml.safe_dump(document).replace("value: 300000.0", "value: 3e5")
    assert "value: 3e5" in text
    assert load_foods(write(tmp_path, text))["banana"].value("E") == 3e5


RIND = {"R_rind": 500.0, "rind_thickness": 2e-3}


def test_layers_are_read_fitted_and_written_where_a_food_has_them(tmp_path: Path) -> None:
    """Values for a rind and a core join the default fit and the solver's material, and a file gives them back."""
    plain = load_food("banana")
    assert plain.layers == () and not set(LAYERS) & set(plain.as_dict()["properties"])
    food = plain.with_values(RIND | {"R_core": 60.0, "core_ratio": 0.3})
    assert food.layers == ("R_rind", "rind_thickness", "R_core", "core_ratio")
    assert set(food.layers) <= set(food.default_fit)
    assert food.properties["core_ratio"].high <= 0.95
    material = food.to_scene_food().material
    assert (material.rind_thickness, material.R_core, material.layered) == (2e-3, 60.0, True)
    dump_material(food, tmp_path / "food.yaml", {})
    assert load_material_file(tmp_path / "food.yaml") == food
    assert food.with_values({"rind_thickness": 0.0}).layers == ("R_core", "core_ratio")


@pytest.mark.parametrize("name", [*LAYERS, *LAYERS.values()])
def test_half_a_layer_is_an_error(name: str) -> None:
    """A size without a resistance, or a resistance without a size, says what is missing."""
    with pytest.raises(MaterialError, match=f"banana.properties: {name} needs .*; give both, or neither"):
        load_food("banana").with_values({name: 0.01 if name in LAYERS else 100.0})


def test_a_skin_that_bears_tension_is_asked_for() -> None:
    """No food has one by default, and its file says nothing of it; a given one reaches the solver and comes back."""
    plain = load_food("grape")
    assert (
        plain.to_scene_food().material.skin_stiffness == 0.0 and "skin_stiffness" not in plain.as_dict()["properties"]
    )
    skinned = plain.with_values({"skin_stiffness": 3000.0})
    assert skinned.to_scene_food().material.skin_stiffness == 3000.0
    assert skinned.as_dict()["properties"]["skin_stiffness"]["value"] == 3000.0


@pytest.mark.parametrize(
    ("name", "size", "layer"),
    [("rind_stiffness", "rind_thickness", RIND), ("core_stiffness", "core_ratio", {"R_core": 60.0, "core_ratio": 0.3})],
)
def test_the_stiffness_of_a_layer_is_fitted_where_it_is_known(name: str, size: str, layer: dict[str, float]) -> None:
    """It reaches the solver and comes back; a layer without it is as stiff as the flesh, and without a layer there is
    none to be stiff."""
    food = load_food("cucumber")
    value = food.properties[name].value
    assert getattr(food.to_scene_food().material, name) == value != 1.0 and name in food.default_fit
    assert food.with_values({name: 4.0}).as_dict()["properties"][name]["value"] == 4.0
    assert name not in food.with_values({size: 0.0}).default_fit
    plain = load_food("banana").with_values(layer)
    assert not plain.to_scene_food().material.graded and name not in plain.default_fit
    assert plain.with_values({name: 4.0}).to_scene_food().material.graded
    with pytest.raises(MaterialError, match=f"banana.properties: {name} needs {size}; give it, and R_"):
        load_food("banana").with_values({name: 4.0})


def test_a_food_that_sticks_is_asked_for() -> None:
    """No food does by default; strength and energy come together, reach the solver and come back."""
    plain = load_food("banana")
    assert plain.to_scene_food().material.adhesion == 0.0 and "adhesion" not in plain.as_dict()["properties"]
    sticky = plain.with_values({"adhesion": "5kPa", "adhesion_energy": 2.0})
    material = sticky.to_scene_food().material
    assert (material.adhesion, material.adhesion_energy) == (5e3, 2.0)
    assert sticky.as_dict()["properties"]["adhesion_energy"]["value"] == 2.0
    with pytest.raises(MaterialError, match="adhesion_energy needs adhesion; give both, or neither"):
        plain.with_values({"adhesion_energy": 2.0})


def test_a_food_that_relaxes_is_asked_for() -> None:
    """No food has it by default; share and time come together, reach the solver as a branch, and come back; a fit
    moves them."""
    plain = load_food("banana")
    assert plain.to_scene_food().material.branches == () and "relaxing_share" not in plain.as_dict()["properties"]
    relaxing = plain.with_values({"relaxing_share": 0.4, "relaxation_time": 0.5})
    material = relaxing.to_scene_food().material
    assert material.branches == ((0.4, 0.5),) and material.rate_dependent
    assert relaxing.as_dict()["properties"]["relaxation_time"]["value"] == 0.5
    with pytest.raises(MaterialError, match="relaxing_share needs relaxation_time; give both, or neither"):
        plain.with_values({"relaxing_share": 0.4})
    whole = relaxing.with_values({RELAXING_BULK: 0.5})
    assert whole.to_scene_food().material.relaxing_bulk == 0.5 and whole.prior(RELAXING_BULK) == (0.0, 1.0)
    assert material.relaxing_bulk == 0.0 and RELAXING_BULK not in relaxing.as_dict()["properties"]
    with pytest.raises(MaterialError, match="relaxing_bulk is a part of relaxing_share; give that too"):
        plain.with_values({RELAXING_BULK: 0.5})
    with pytest.raises(MaterialError, match="1 cannot be the part of the instantaneous shear stiffness"):
        check_override("relaxing_share", 1.0)


def test_sources_write_their_numbers_with_a_unit() -> None:
    """A report prints them beside values in kPa and mm: none has an exponent where a prefix of its unit would do."""
    for name in FoodSpec.list():
        food = FoodSpec.load(name)
        for key, known in {**food.properties, **food.sizes}.items():
            texts = " ".join(filter(None, (known.source, known.flag)))
            assert not re.search(r"(?<!x)\b\d+(?:\.\d+)?e[-+]?\d", texts), f"{name}.{key}: {texts}"
