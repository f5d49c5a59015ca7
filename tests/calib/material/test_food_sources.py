"""What the values of ``materials.yaml`` rest on: no trace that cutcal is fitted to or judged by, and a name where there
is one."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from calib.io.yaml_checks import data_path
from calib.material.food import FoodSpec, load_foods
from calib.material.properties import Property
from calib.material.references import references as full_references

#: What a source may not name, and why: a prior is not made of what it is fitted to or judged by.
NOT_A_SOURCE = {
    r"panda[-_ ]?force|Franka|real cuts|robot's (knife )?cut": "cuts that are calibrated to",
    r"SliceIt": "cuts of cucumber and potato on which the fit is compared with the published one",
    r"Fruit ?Rupture|gripper|fingertip": "whole fruits gripped until they burst, which forces are compared with",
    r"fungi|steak|meat substitute": "presses of a meat substitute that show rate, direction and scatter of repeats",
    r"silicone|Ecoflex|Dawood": "compressions of known modulus that compress is judged by",
    r"DiSECt|LS-?DYNA": "settings of a simulation, no measurement; its curves are compared with",
    r"CulinaryCut(?! Table 2)": "the cut of a banana that is calibrated to; Table 2 has constants cited from elsewhere",
}
FOODS = load_foods()
REFERENCE_COLUMN = slice(4, 28)
"""Where a name stands in the list of references of ``materials.yaml``."""


def items() -> Iterator[tuple[FoodSpec, Property]]:
    """Each property and each size of each food."""
    for food in FOODS.values():
        for item in (*food.dims.values(), *food.properties.values()):
            yield food, item


def named(said: str) -> list[str]:
    """Why a text is no source of a prior: one reason for each set of data that it names."""
    return [why for words, why in NOT_A_SOURCE.items() if re.search(words, said, re.IGNORECASE)]


def references() -> list[str]:
    """Names in the list of references at the head of ``materials.yaml``."""
    head = data_path("materials.yaml").read_text(encoding="utf-8").split("\n\nbanana:")[0]
    lines = head[head.index("\n# References") :].splitlines()[2:]
    return [line[REFERENCE_COLUMN].strip() for line in lines if re.match(r"#   \S", line)]


@pytest.mark.parametrize("name", list(FOODS))
def test_no_prior_is_made_of_what_it_is_fitted_to(name: str) -> None:
    """No source of a value or of a size names a trace or a simulation that cutcal is fitted to or compared with."""
    for food, item in items():
        if food.name == name:
            for said in (item.source, *(s.source for s in item.sources)):
                assert not named(said), (item.name, said, named(said))


@pytest.mark.parametrize(
    "said",
    [
        "cucumber under the large knife, panda-force",
        "Franka, cut 2",
        "fit of SliceIt",
        "FruitRuptureEstimate, bananas",
        "presses of a fungi steak",
        "Ecoflex 00-10",
        "Jamdagni and Jia 2019; also DiSECt 2021",
        "LS-DYNA, prism",
        "CulinaryCut, the robot's cut of a banana",
    ],
)
def test_a_trace_for_a_source_is_seen(said: str) -> None:
    """Each of the data sets is known by its names; what is independent of them all is not taken for one."""
    assert named(said)
    assert not named("CulinaryCut Table 2, citing Mattos et al. 2005")
    assert not named("Jamdagni and Jia 2019, fit of robotic knife cuts")


def test_what_is_measured_names_who_measured_it() -> None:
    """A measured value, and one of another food or test, name a reference of the list; an assumed one is nobody's."""
    known = references()
    assert len(known) == len(set(known)) > 40 and {"Thompson 1992", "J. Texture Stud. 14:155"} <= set(known)
    for food, item in items():
        if item.status in ("measured", "proxy"):
            assert any(name in item.source for name in known), (food.name, item.name, item.source)


def test_layers_are_of_foods_that_have_them() -> None:
    """Rind and core are where anatomy has them, and in the default cut of no other food."""
    rind, core = ("R_rind", "rind_thickness", "rind_stiffness"), ("R_core", "core_ratio")
    assert {name: food.layers for name, food in FOODS.items() if food.layers} == {
        "cucumber": (*rind, *core, "core_stiffness"),
        "melon": rind,
        "orange": rind,
        "kiwi": core,
        "tomato": core,
    }
    for food in FOODS.values():
        if food.layers:
            shape, outer = food.to_scene_food().shape, food.properties.get("rind_thickness")
            assert outer is None or outer.high < min(shape.height, shape.width) / 4


def test_a_reference_has_authors_and_year_or_says_that_it_has_not() -> None:
    """Authors stand first and a year in brackets; what nobody found is named as incomplete."""
    full = full_references()
    assert len(full) > 50
    for name, text in full.items():
        gaps = "".join(re.findall(r"incomplete: ([^)]*)", text))
        person, several = r"[^\W\d]\S*( [^\W\d]\S*)?, [A-Z]\.", r"[A-Z]\S+(, [A-Z]\S+)*( et al\.| and [A-Z])"
        by = rf"{person}|{several}|[A-Z]\S+ \("
        assert re.match(by, text) or "authors" in gaps, (name, text)
        assert re.search(r"\((19|20)\d\d[,)]", text) or "year" in gaps, (name, text)
    assert (
        full["Muscadine"].startswith("Conner, P. J. (2013)") and "J. Mater. Sci. 28:45-51" in full["Khan and Vincent"]
    )
