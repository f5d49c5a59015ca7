"""Meshes of known foods: sizes, volume and section come back in every pose, and a mesh that is no food is one line."""

from __future__ import annotations

import meshio
import numpy as np
import pytest

from calib.errors import ShapeError
from calib.material.scene import Sizing
from calib.outline.outline_file import OutlineFile
from mpm.scene.shapes import OUTLINE, Shape, section_area, volume
from tests.calib.made_outlines import half_ellipsoid, mesh, tilted

POINTS, FACES = half_ellipsoid(35, 50, 30)
KNOWN = Shape("hemisphere", 0.1, 0.07, 0.03)


def food(path, unit="mm", pose=None) -> Shape:
    """The shape of a mesh."""
    s = OutlineFile(path, unit, pose).sizing(Sizing())
    return Shape(OUTLINE, s.length, s.width, s.height, outline=s.outline)


def is_known(found: Shape) -> None:
    """Sizes are those of the half ellipsoid, volume and section those of one with so many facets."""
    for name in ("length", "width", "height"):
        assert getattr(found, name) == pytest.approx(getattr(KNOWN, name), rel=1e-6)
    corners = POINTS[FACES] * 1e-3
    own = np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert own == pytest.approx(volume(KNOWN), rel=7e-3)
    assert volume(found) == pytest.approx(own, rel=5e-3)
    assert section_area(found) == pytest.approx(section_area(KNOWN), rel=5e-3)
    assert found.symmetric == (True, True) and found.table.halved


@pytest.mark.parametrize("suffix", ["stl", "obj", "vtk", "msh"])
def test_a_mesh_is_the_food_that_it_is_of(tmp_path, suffix):
    """In every format; an STL names each vertex anew for each face."""
    is_known(food(mesh(tmp_path / f"food.{suffix}", POINTS, FACES)))


def test_a_mesh_is_turned_and_sized_as_it_is_said(tmp_path):
    """Up along -y, across along z, in centimetres, and anywhere in space."""
    x, y, z = POINTS.T / 10  # of the scene
    path = mesh(tmp_path / "food.obj", np.stack([x, -z, y], 1) + [5.0, -3.0, 11.0], FACES)
    is_known(food(path, "1 cm", "-y, z"))


def test_quadrilaterals_and_tetrahedra_have_a_surface_too(tmp_path):
    """A box of six quadrilaterals, and one of five tetrahedra, are a block."""
    corners = np.array([[i, j, k] for i in (0, 30) for j in (0, 50) for k in (0, 20)], float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    tetra = np.array([[0, 4, 2, 1], [6, 2, 4, 7], [5, 4, 1, 7], [3, 1, 2, 7], [1, 4, 2, 7]])
    for name, kind, cells in (("q.obj", "quad", quads), ("t.vtk", "tetra", tetra)):
        meshio.write_points_cells(tmp_path / name, corners, [(kind, cells)])
        block = food(tmp_path / name)
        assert (block.length, block.width, block.height) == pytest.approx((0.05, 0.03, 0.02))
        assert volume(block) == pytest.approx(3e-5, rel=1e-4) and block.prism and block.walled


def test_what_lies_aside_stays_aside(tmp_path):
    """A food whose top is moved along the blade has no mirror there, and one that is thicker at an end none across."""
    leaning = POINTS + [0.3, 0.0, 0.0] * POINTS[:, [2]]
    thicker = POINTS * np.column_stack([1 + 0.004 * POINTS[:, 1], np.ones(len(POINTS)), np.ones(len(POINTS))])
    assert food(mesh(tmp_path / "l.stl", leaning, FACES)).symmetric == (False, True)
    assert food(mesh(tmp_path / "t.stl", thicker, FACES)).symmetric == (True, False)


def waisted() -> np.ndarray:
    """The points drawn in below the middle, so that what is above hangs over."""
    part = 1 - 0.6 * np.exp(-(((POINTS[:, [2]] - 8) / 4) ** 2))
    return POINTS * np.hstack([part, part, np.ones_like(part)])


def crossed() -> tuple[np.ndarray, np.ndarray]:
    """A surface that is drawn through itself at its waist, and lies inside out below."""
    points = POINTS.copy()
    low = points[:, 2] < 12
    points[low, :2] *= -1 + 2 * points[low, 2:] / 12
    return points, FACES


BAD = {
    "tilted": (lambda: (tilted(POINTS, 3.0), FACES), "tilted.*--outline-as"),
    "on its side": (lambda: (tilted(POINTS, 90.0), FACES), "tilted"),
    "mirrored": (lambda: (POINTS * [-1, 1, 1], FACES), "look inwards"),
    "normals": (lambda: (POINTS, FACES[:, ::-1]), "look inwards"),
    "mixed": (lambda: (POINTS, np.vstack([FACES[:1, ::-1], FACES[1:]])), "others outwards, at 3 edges"),
    "hole": (lambda: (POINTS, FACES[1:]), "has holes: 3 edges"),
    "two": (lambda: (np.vstack([POINTS, POINTS + 200]), np.vstack([FACES, FACES + len(POINTS)])), "2 bodies"),
    "waist": (lambda: (waisted(), FACES), "enters the food twice"),
    "crossed": (crossed, "enters the food twice"),
    "nested": (lambda: (np.vstack([POINTS, POINTS / 2]), np.vstack([FACES, FACES + len(POINTS)])), "crosses itself"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_mesh_that_is_no_food_is_one_clear_line(tmp_path, name):
    """Tilted, mirrored, with a hole, with faces turned, two bodies, a waist, parts within each other that
    hang together at a point."""
    make, said = BAD[name]
    with pytest.raises(ShapeError, match=said) as error:
        food(mesh(tmp_path / "food.obj", *make()))
    assert "food.obj" in str(error.value) and "\n" not in str(error.value)


def test_a_file_that_is_no_mesh_is_refused(tmp_path, capfd):
    """Text, and an empty file; what the reader prints stays unsaid."""
    for name in ("a.stl", "b.obj", "d.msh"):
        (tmp_path / name).write_text("" if name == "b.obj" else "nothing")
        with pytest.raises(ShapeError, match="no mesh can be read|no triangles"):
            food(tmp_path / name)
    assert capfd.readouterr() == ("", "")
