"""A food of one's own: a file may be short, what it leaves out is said, and a template begins it."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from calib.errors import MaterialError
from calib.material.food import FoodSpec, load_food, load_foods
from calib.material.own_food import OPTIONAL_HERE, template
from calib.material.remarks import notes
from cutcal.main import main

SIZES = "".join(
    f"    {name}: {{value: {x}, low: {x}, high: {x}, unit: m, status: measured, source: mould}}\n"
    for name, x in (("length", 0.05), ("width", 0.03), ("height", 0.03))
)


def written(folder: Path, properties: str) -> str:
    """Path of a file of a gel with these properties."""
    path = folder / "gel.yaml"
    path.write_text(f"gel:\n  shape:\n    kind: block\n{SIZES}  properties: {properties}\n", encoding="utf-8")
    return str(path)


def test_a_template_is_a_food(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the command prints is read back as a food, with all its properties given and none flagged."""
    assert main(["foods", "--template", "tofu"]) == 0
    path = tmp_path / "tofu.yaml"
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    food = load_food(str(path))
    assert (food.name, food.shape_kind) == ("tofu", "block")
    assert set(OPTIONAL_HERE) <= set(food.properties) and food.warnings() == []
    assert main(["foods", str(path)]) == 0 and "tofu: block" in capsys.readouterr().out


def test_what_a_file_leaves_out_is_wide_and_said(tmp_path: Path) -> None:
    """Defaults follow the documented rules, reach over all foods, are assumed, and each is flagged."""
    given = "{E: {value: 5.0e+4, low: 4.0e+4, high: 6.0e+4, unit: Pa, status: measured, source: ours}}"
    food = load_food(written(tmp_path, given))
    p = food.properties
    assert (p["E"].value, p["E"].flag) == (5e4, None)
    assert (p["yield_stress"].value, p["yield_stress"].low, p["yield_stress"].high) == (5e3, 400.0, 6e4)
    assert p["strength_ratio"].value == 0.8 and "tensile_strength" not in p
    foods = [one.properties for one in load_foods().values()]
    assert p["R"].low == min(one["R"].low for one in foods) and p["R"].high == max(one["R"].high for one in foods)
    assert p["R_initiation"].value == pytest.approx(1.5 * p["R"].value, rel=5e-3)
    assert p["skin_thickness"].value == 0.0 and "R_skin" not in p
    said = food.warnings()
    assert len(said) == len(OPTIONAL_HERE) - 1 and all("not given" in text for text in said)
    assert FoodSpec.load(written(tmp_path, given)).properties == p


@pytest.mark.parametrize("properties", ["", "  properties:\n", "  properties: {}\n"])
def test_a_file_of_a_shape_alone_is_a_food(tmp_path: Path, properties: str) -> None:
    """All properties may be left out: each then has its default, and is flagged."""
    path = tmp_path / "gel.yaml"
    path.write_text(f"gel:\n  shape:\n    kind: block\n{SIZES}{properties}", encoding="utf-8")
    food = load_food(str(path))
    assert set(OPTIONAL_HERE) <= set(food.properties) and len(food.warnings()) == len(OPTIONAL_HERE)
    assert food.shape_kind == "block"


def test_null_is_an_answer(tmp_path: Path) -> None:
    """A food whose file says that it has no tensile strength of its own gets none."""
    assert "strength_ratio" not in load_food(written(tmp_path, "{tensile_strength: null}")).properties


def test_a_list_of_foods_has_no_defaults(tmp_path: Path) -> None:
    """A file in the layout of the bundled one must say all: a slip there would go unseen."""
    with pytest.raises(MaterialError, match="rho"):
        load_foods(written(tmp_path, "{}"))


def test_an_unknown_food_names_the_template(capsys: pytest.CaptureFixture[str]) -> None:
    """Who asks for a food that is not there learns how to make one; a known or odd name begins none."""
    with pytest.raises(MaterialError, match="cutcal foods --template"):
        load_food("tofoo")
    for name in ("banana", "To fu"):
        assert main(["foods", "--template", name]) == 1
    assert "no name for a new food" in capsys.readouterr().err
    assert template("tofu", [f.properties for f in load_foods().values()]).startswith("# A food of your own")


YIELD = "{value: 100, low: 90, high: 110, unit: Pa, status: measured, source: ours}"


@pytest.mark.parametrize(("said", "unit"), [("20kPa", "Pa"), ("3", "Pa"), ("true", "Pa")])
def test_a_number_alone_is_told_how_to_be_written(said: str, unit: str, tmp_path: Path) -> None:
    """The layout stands in the message, with the unit; it can be copied."""
    with pytest.raises(MaterialError, match="gel.properties.E: is .* alone; write") as caught:
        load_food(written(tmp_path, f"{{E: {said}}}"))
    layout = str(caught.value).partition("write ")[2].partition(" with")[0]
    assert yaml.safe_load(layout)["unit"] == unit
    for example, number in (("1.0", "1000"), ("0.9", "900"), ("1.1", "1e5")):
        layout = layout.replace(example, number)
    given = f"{{E: {layout}, yield_stress: {YIELD}}}"
    assert load_food(written(tmp_path, given)).properties["E"].value == 1000.0


def test_a_run_counts_remarks_and_says_what_is_left_out(tmp_path: Path) -> None:
    """Remarks on published values are one sentence for a known food; defaults of a food's own file are all said."""
    banana = load_food("banana")
    said = notes(banana)
    assert said == ["banana: 2 remarks on published values, which cutcal foods banana and the report have"]
    assert len(banana.warnings()) == 2
    odd = banana.with_values({"E": 1e8})
    assert [text for text in notes(odd) if "outside the literature's range" in text] and len(notes(odd)) == 2
    own = load_food(written(tmp_path, "{}"))
    assert notes(own) == own.warnings() and len(notes(own)) == len(OPTIONAL_HERE)
    stone = next(food for food in load_foods().values() if food.not_modelled)
    assert any("not modelled" in text for text in notes(stone))
