"""Radii along an axis, from a table: round ends stay round, and a fault has its row."""

from __future__ import annotations

import numpy as np
import pytest

from calib.errors import ShapeError
from calib.material.scene import Sizing
from calib.outline.outline_file import OutlineFile
from mpm.scene.shapes import OUTLINE, Shape, section_area, volume

Y = np.linspace(-40, 40, 17)
TABLE = "# of an egg\ny_mm,radius_mm\n" + "\n".join(f"{y + 40},{30 * np.sqrt(1 - (y / 40) ** 2)}" for y in Y)


def food(path, way="revolved") -> Shape:
    """The shape of a profile."""
    s = OutlineFile(path, outline_as=way).sizing(Sizing())
    return Shape(OUTLINE, s.length, s.width, s.height, outline=s.outline)


@pytest.mark.parametrize(("way", "kind", "height"), [("revolved", "ellipsoid", 0.06), ("half", "hemisphere", 0.03)])
def test_seventeen_radii_are_an_ellipsoid(tmp_path, way, kind, height):
    """Whole or halved, volume and section to 0.1 %."""
    (tmp_path / "p.csv").write_text(TABLE)
    found, known = food(tmp_path / "p.csv", way), Shape(kind, 0.08, 0.06, height)
    assert (found.length, found.width, found.height) == pytest.approx((0.08, 0.06, height))
    assert volume(found) == pytest.approx(volume(known), rel=1e-3)
    assert section_area(found) == pytest.approx(section_area(known), rel=1e-3)


def test_lists_of_yaml_are_a_profile_too(tmp_path):
    """In centimetres, with ends that are cut off: a cylinder."""
    (tmp_path / "p.yaml").write_text("position_cm: [1, 2, 6]\nradius_cm: [1.5, 1.5, 1.5]\n")
    found = food(tmp_path / "p.yaml")
    assert volume(found) == pytest.approx(np.pi * 0.015**2 * 0.05, rel=1e-3) and found.prism


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("y,radius\n1,2\n", "no column y with its unit"),
        ("y_mm,weight_g\n1,2\n", "no column radius"),
        ("y_kg,radius_mm\n1,2\n2,2\n3,1\n", "'kg' is no unit of length"),
        ("y_mm,radius_mm\n0,1\n1,x\n2,2", "point 2 of radius_mm: 'x' is no number"),
        ("y_mm,radius_mm\n0,1\n1,nan\n2,2", "'nan' is no number"),
        ("y_mm,radius_mm\n0,1\n2,2\n1,2", "point 3: its position"),
        ("y_mm,radius_mm\n0,1\n1,-1\n2,2", "point 2: a radius of -1 mm"),
        ("y_mm,radius_mm\n0,0\n1,0\n2,0", "a radius of 0 mm"),
        ("y_mm,radius_mm\n0,1\n1,1", "at least 3"),
        ("y_mm,radius_mm\n0,1\n1", "row 3 has 1 cells"),
        ("", "is empty"),
    ],
)
def test_a_fault_of_a_profile_has_its_place(tmp_path, text, said):
    """One line with the file, and the row where there is one."""
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(ShapeError, match=said) as error:
        food(tmp_path / "p.csv")
    assert str(error.value).startswith(str(tmp_path)) and "\n" not in str(error.value)


def test_radii_are_neither_bent_nor_extruded(tmp_path):
    """A radius says nothing of that."""
    (tmp_path / "p.csv").write_text(TABLE)
    for way in ("bent", "extruded"):
        with pytest.raises(ShapeError, match="--outline-as revolved or half"):
            food(tmp_path / "p.csv", way)
