"""Options of an outline: what is missing or there twice is one line, and what is whole becomes a specimen."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest

from calib.errors import ShapeError
from calib.io.typed_document import from_document, to_document
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, blade_warnings, cut_scene, specimen
from calib.outline.outline_file import OutlineFile, scale_of, unit_size
from mpm.scene.errors import SceneError
from mpm.scene.shapes import Shape, volume
from tests.calib.made_outlines import ellipse, half_ellipsoid, mesh, picture


@pytest.mark.parametrize(("text", "size"), [("0.1mm/px", 1e-4), ("10px/mm", 1e-4), ("0.02 cm / pixel", 2e-4)])
def test_a_scale_is_the_size_of_a_pixel(text, size):
    """Either way round, with its units."""
    assert scale_of(text) == pytest.approx(size)


@pytest.mark.parametrize(
    "text", ["big", "0.0001/px", "0px/mm", "mm/px", "0.1mm", "-1mm/px", "1m/px", "1nm/px", "nan mm/px"]
)
def test_an_impossible_scale_is_refused(text):
    """No number, no unit, or none of a photograph of food."""
    with pytest.raises(ShapeError, match=r"--scale"):
        scale_of(text)


@pytest.mark.parametrize(("text", "size"), [("mm", 1e-3), ("1mm", 1e-3), ("2.5 cm", 0.025), ("inch", 0.0254)])
def test_a_unit_of_a_mesh_has_a_size(text, size):
    """One of it, or as many as are said."""
    assert unit_size(text) == pytest.approx(size)


@pytest.mark.parametrize("text", ["1", "", "kg", "0mm", "-1mm", "0.1mm/px", "1e400mm", "m m"])
def test_an_impossible_unit_is_refused(text):
    """No unit of length, or nothing of it."""
    with pytest.raises(ShapeError, match="--scale"):
        unit_size(text)


@pytest.mark.parametrize("options", [{"scale": "1mm/px"}, {"outline_as": "half"}])
def test_options_of_a_file_need_the_file(options):
    """They say how it is read."""
    with pytest.raises(ShapeError, match="give its file with --outline"):
        OutlineFile(**options)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """A folder with a picture and a mesh."""
    picture(tmp_path / "p.png", ellipse(100, 60))
    mesh(tmp_path / "m.stl", *half_ellipsoid(35, 50, 30, 6, 16))
    return tmp_path


@pytest.mark.parametrize(
    ("options", "given", "said"),
    [
        (("p.png", None, "half"), {}, "a picture has no scale"),
        (("p.png", "1mm/px"), {}, "how does the outline become a food.*say --outline-as"),
        (("p.png", "1mm/px", "z,y"), {}, "'z,y' is no way"),
        (("no.png", "1mm/px", "half"), {}, "cannot be read"),
        (("", "1mm/px", "half"), {}, "cannot be read"),
        (("p.csv", "1mm/px", "half"), {}, "leave --scale out"),
        (("m.stl",), {}, "a mesh has no unit.*--scale 1mm"),
        (("m.stl", "mm", "y"), {}, "name two axes"),
        (("m.stl", "mm", "y,-y"), {}, "name two axes"),
        (("m.stl", "mm", "half"), {}, "name two axes"),
        (("m.stl", "mm"), {"height": 0.03}, "--height beside --outline"),
        (("m.stl", "mm"), {"shape": "block"}, "--shape block beside --outline"),
        (("p.png", "0.5mm/px", "extruded"), {"width": 0.1}, "--width beside --outline"),
    ],
)
def test_what_a_file_needs_is_said(files, options, given, said):
    """A scale, a way, a unit, two axes, and nothing that the file says itself."""
    (files / "p.csv").write_text("y_mm,radius_mm\n")
    name, *how = options
    with pytest.raises(ShapeError, match=said):
        OutlineFile(files / name, *how).sizing(Sizing(**given))


def test_without_a_file_nothing_changes():
    """The sizes are those that were given."""
    assert OutlineFile().sizing(Sizing("block", 0.03)) == Sizing("block", 0.03)


def test_an_outline_makes_the_specimen(files):
    """Its sizes and place of the cut, with the file's hash, and nothing is assumed; a scene can be made of it."""
    file = OutlineFile(files / "p.png", "0.5mm/px", "revolved")
    shape, said = specimen(load_food("apple"), None, file.sizing(Sizing(at=0.4)))
    assert (shape.kind, said) == ("outline", [])
    assert (shape.length, shape.width, shape.cut) == pytest.approx((0.1, 0.06, -0.01), rel=5e-3)
    assert shape.outline.sha256 == hashlib.sha256((files / "p.png").read_bytes()).hexdigest()
    scene = cut_scene(load_food("apple"), shape, load_knife("kitchen"))
    assert scene.mirrors == (True, False) and scene.food.shape is shape
    (wide,) = blade_warnings(replace(shape, width=0.15, length=0.1, cut=0.0), load_knife("edc"))
    assert "150 mm wide" in wide and "42.5 mm on each side" in wide


def test_an_extruded_outline_is_as_long_as_it_matters(files):
    """Without --length it is cut short as other foods with parallel sides are."""
    sized = OutlineFile(files / "p.png", "0.5mm/px", "extruded").sizing(Sizing())
    shape, said = specimen(load_food("banana"), None, sized)
    assert shape.length == pytest.approx(4 * shape.height) and any("--length" in text for text in said)
    file = OutlineFile(files / "p.png", "0.5mm/px", "extruded")
    shape, _ = specimen(load_food("banana"), None, file.sizing(Sizing(length=0.05)))
    assert shape.length == 0.05


def test_a_bent_default_is_as_thick_as_the_food():
    """The width over all holds the arc; the section has the food's own width."""
    shape, _ = specimen(load_food("banana"), None, Sizing("bent"))
    straight, _ = specimen(load_food("banana"), None, Sizing())
    assert shape.width > 1.3 * straight.width and shape.height == straight.height


def test_a_bent_food_lies_beyond_one_end_of_the_blade():
    """What stays uncut is on the side of the bend."""
    (said,) = blade_warnings(Shape("bent", 0.18, 0.1, 0.05), load_knife("edc"))
    assert "17.5 mm on one side" in said


def test_a_document_keeps_where_an_outline_comes_from(files):
    """Name, hash and way go to the document and come back, the table does not; other shapes have no word of it."""
    sized = OutlineFile(files / "m.stl", "mm").sizing(Sizing())
    shape = Shape("outline", sized.length, sized.width, sized.height, outline=sized.outline)
    document = to_document(shape)
    assert document["outline"] == {"source": "m.stl", "sha256": sized.outline.sha256, "how": "mesh, mm, z up, y across"}
    again = from_document(Shape, document)
    assert to_document(again) == document and again.outline.table is None
    with pytest.raises(SceneError, match="give the file again"):
        volume(again)
    assert "outline" not in to_document(Shape("block", 0.1, 0.1, 0.1))
