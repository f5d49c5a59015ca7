"""A silhouette and a mesh are cut with the force of the shape that they are of."""

from __future__ import annotations

from dataclasses import replace

import pytest

from calib.material.scene import Sizing
from calib.outline.outline_file import OutlineFile
from mpm.scene import EdgeLaw, Food, Motion, Numerics, Scene
from mpm.scene.shapes import OUTLINE, Shape
from tests.calib.made_outlines import half, half_ellipsoid, mesh, picture
from tests.mpm.scenes import FLESH, THIN, cut

KNOWN = Shape("hemisphere", 0.03, 0.03, 0.015)
CUT = Scene(Food(KNOWN, FLESH), THIN, Motion(0.015, 0.02), edge=EdgeLaw(zone=3e-3), numerics=Numerics(dx=3e-3))


def test_peak_and_work_are_within_one_per_cent(tmp_path):
    """Half a ball of 30 mm, cut through on a coarse grid."""
    photo = OutlineFile(picture(tmp_path / "p.png", half(100, 100), size=(240, 240)), "0.15mm/px", "half")
    surface = OutlineFile(mesh(tmp_path / "m.stl", *half_ellipsoid(15, 15, 15, 48, 96)), "mm")
    known = cut(CUT)
    for file in (photo, surface):
        s = file.sizing(Sizing())
        shape = Shape(OUTLINE, s.length, s.width, s.height, outline=s.outline)
        found = cut(replace(CUT, food=Food(shape, FLESH)))
        assert found.peak == pytest.approx(known.peak, rel=0.01)
        assert found.work == pytest.approx(known.work, rel=0.01)
