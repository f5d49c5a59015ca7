from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from calib.io.yaml_checks import data_path
from calib.material.knife import WEDGE_TOLERANCE, load_knife, load_knives, wedge_height
from cutcal.main import main
from mpm.scene.errors import SceneError
from tests.calib.documents import valid

GOOD = """\
mine:
  spine:  {value: 1.8e-3, unit: m}
  angle:  {value: 12, unit: deg}
  height: {value: 0.03, unit: m}
  length: {value: 0.12, unit: m, source: calliper, status: measured}
"""


def write(tmp_path: Path, text: str) -> Path:
    """A user's knife file."""
    path = tmp_path / "knife.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def message(path: Path) -> str:
    """What the loader says about a broken file."""
    with pytest.raises(SceneError) as caught:
        load_knife(path)
    return str(caught.value)


@pytest.mark.parametrize("name", ["edc", "slicing", "kitchen", "vegetable"])
def test_shipped_knives(name: str) -> None:
    """Each shipped knife loads, and its wedge reaches the thickness of the spine at or below the spine."""
    knife = load_knife(name)
    assert knife.name == name
    assert 2 * knife.height * math.tan(knife.angle / 2) >= (1 - WEDGE_TOLERANCE) * knife.spine


def test_published_geometry() -> None:
    """The two knives of the published robot cuts have the published sizes, and 11 and 2.75 degrees."""
    edc, slicing = load_knife("edc"), load_knife("slicing")
    assert (edc.spine, edc.height, edc.length) == (2e-3, 10e-3, 65e-3)
    assert (slicing.spine, slicing.height, slicing.length) == (2e-3, 40e-3, 254e-3)
    assert math.degrees(edc.angle) == pytest.approx(2 * math.degrees(math.atan(0.96 / 10)), rel=5e-3)
    assert math.degrees(slicing.angle) == pytest.approx(2 * math.degrees(math.atan(0.96 / 40)), rel=5e-3)


def test_every_shipped_number_has_a_source() -> None:
    """Each field of the shipped file says where it comes from and what it is worth."""
    content = yaml.safe_load(data_path("knives.yaml").read_text(encoding="utf-8"))
    assert set(load_knives()) == set(content)
    for fields in content.values():
        for field in fields.values():
            assert field["source"] and field["status"] in ("measured", "proxy", "assumed")


def test_own_knife(tmp_path: Path) -> None:
    """A file with one knife is read, degrees become radians, and sources may be left out."""
    path = write(tmp_path, GOOD)
    for knife in (load_knife(path), load_knife(str(path))):
        assert (knife.name, knife.spine, knife.height, knife.length) == ("mine", 1.8e-3, 0.03, 0.12)
        assert knife.angle == pytest.approx(math.radians(12), rel=1e-15)


def test_wedge_height(tmp_path: Path) -> None:
    """At 60 degrees the wedge is an equilateral triangle, so its height is sqrt(3)/2 of the spine."""
    knife = load_knife(write(tmp_path, GOOD.replace("value: 12", "value: 60")))
    assert wedge_height(knife) == pytest.approx(math.sqrt(3) / 2 * 1.8e-3, rel=1e-12)


@pytest.mark.parametrize(("angle", "good"), [("3.44", True), ("3.30", True), ("3.10", False)])
def test_wedge_and_spine(angle: str, good: bool, tmp_path: Path) -> None:
    """2 atan(0.9 / 30) = 3.437 deg fits the spine exactly; a wedge that misses it by over 6 % is refused."""
    path = write(tmp_path, GOOD.replace("value: 12", f"value: {angle}"))
    if good:
        assert load_knife(path).spine == 1.8e-3
    else:
        said = message(path)
        assert said.startswith("knife.yaml: mine: with an angle of 3.1 deg the faces are only 1.62 mm apart")
        assert said.endswith("for instance angle: 3.44")


def test_unknown_knife() -> None:
    """An unknown name is answered with the nearest one and the list."""
    with pytest.raises(SceneError, match="unknown knife 'kichen', did you mean 'kitchen'.*known: edc, slicing"):
        load_knife("kichen")
    with pytest.raises(SceneError, match=r"unknown knife 'laser'; known: edc.*path of a \.yaml file"):
        load_knife("laser")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("spine:", "thickness:", "mine.thickness: unknown key, did you mean 'spine'?"),
        ("  spine:  {value: 1.8e-3, unit: m}\n", "", "mine: misses spine"),
        (
            "0.03, unit: m",
            "30, unit: mm",
            "mine.height: has unit 'mm'; write it in 'm': value: 0.03, unit: 'm'",
        ),
        ("12, unit: deg", "0.2, unit: rad", "mine.angle: has unit 'rad'; write it in 'deg': value: 11.4592"),
        (
            "0.03, unit: m",
            "30, unit: m",
            "mine.height: 30 m is no knife; it must lie between 0.002 and 0.2 m",
        ),
        ("value: 12", "value: sharp", "mine.angle.value: is text 'sharp'"),
        ("value: 12", "value: .nan", "mine.angle.value: is nan"),
        ("status: measured", "status: guessed", "mine.length.status: unknown value 'guessed'"),
        ("value: 12, unit: deg", "value: 12", "mine.angle: misses unit"),
        ("{value: 12, unit: deg}", "12", "mine.angle: is a number"),
        ("mine:", "mine: {}\nmine:", "line 2, column 1: the key 'mine' is given twice"),
        ("mine:", "other: {}\nmine:", "other: misses spine"),
    ],
)
def test_wrong_knives(old: str, new: str, words: str, tmp_path: Path) -> None:
    """Each mistake in a knife file is named with file, place and what to write."""
    assert old in GOOD
    said = message(write(tmp_path, GOOD.replace(old, new)))
    assert said.startswith("knife.yaml: ") and words in said


def test_a_file_with_several_knives() -> None:
    """A file with several knives does not say which one is meant."""
    with pytest.raises(SceneError, match="has 4 knives, but one is needed"):
        load_knife(data_path("knives.yaml"))


def test_no_such_file(tmp_path: Path) -> None:
    """A path that does not exist is an error of the path, not an unknown name."""
    with pytest.raises(SceneError, match=r"none\.yaml: no such file"):
        load_knife(str(tmp_path / "none.yaml"))


def test_knives_are_listed_with_their_sources(capsys, tmp_path):
    """The list has every knife; one knife has source and status of every size, as a table and as JSON; a file too."""
    assert main(["knives"]) == 0
    listed = capsys.readouterr().out
    assert all(name in listed for name in load_knives())
    assert main(["knives", "edc"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("edc: a wedge of 11°") and out.count("DiSECt") == 3
    assert main(["knives", "edc", "--json"]) == 0
    spine = valid(json.loads(capsys.readouterr().out))["edc"]["spine"]
    assert spine["value"] == load_knife("edc").spine and spine["unit"] == "m" and spine["status"] == "proxy"
    mine = tmp_path / "mine.yaml"
    mine.write_text(
        "thin: {spine: {value: 1e-3, unit: m}, angle: {value: 2, unit: deg}, height: {value: 0.03, unit: m}, "
        "length: {value: 0.1, unit: m}}"
    )
    assert main(["knives", str(mine)]) == 0
    assert "no source" in capsys.readouterr().out
    assert main(["knives", "ecd"]) == 1
    assert "edc" in capsys.readouterr().err


def test_a_template_is_a_knife(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What the command prints is read back as a knife; an unknown knife names the command; odd names begin none."""
    assert main(["knives", "--template", "mine"]) == 0
    path = tmp_path / "mine.yaml"
    path.write_text(capsys.readouterr().out, encoding="utf-8")
    assert load_knife(path) == replace(load_knife("kitchen"), name="mine")
    assert main(["knives", str(path)]) == 0 and "mine: a wedge" in capsys.readouterr().out
    with pytest.raises(SceneError, match="cutcal knives --template"):
        load_knife("spoon")
    for name in ("edc", "My knife"):
        assert main(["knives", "--template", name]) == 1
    assert "no name for a new knife" in capsys.readouterr().err
