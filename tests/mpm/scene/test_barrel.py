"""The family between a cylinder and an ellipsoid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.scene import Food, Scene
from mpm.scene.errors import SceneError
from mpm.scene.profiles import barrel_radius, profile
from mpm.scene.shapes import Shape, named, section_area, surface, volume
from tests.mpm.scenes import FLESH, PRISM, WEDGE, cut

SIZE = {"length": 0.03, "width": 0.03, "height": 0.015}
ENDS = [("half_barrel", 0.0, "half_cylinder"), ("half_barrel", 1.0, "hemisphere"),
        ("barrel", 0.0, "cylinder"), ("barrel", 1.0, "ellipsoid")]  # fmt: skip


def test_radius_is_a_superellipse() -> None:
    """Upright ends, an ellipse, and the exponent 4 half-way; rounder is nowhere wider."""
    v = np.linspace(-1.0, 1.0, 21)
    assert np.array_equal(barrel_radius(0.0, v), np.ones(21))
    assert barrel_radius(1.0, v) == pytest.approx(np.sqrt(1 - v**2))
    assert barrel_radius(0.5, v) ** 4 + v**4 == pytest.approx(np.ones(21))
    radii = np.array([barrel_radius(part, v) for part in np.linspace(0.0, 1.0, 11)])
    assert (np.diff(radii, axis=0) <= 0.0).all()
    assert profile("barrel") == profile("barrel", 0.5)


@pytest.mark.parametrize(("kind", "roundness", "closed"), ENDS)
def test_the_ends_of_the_family_are_the_closed_forms(kind: str, roundness: float, closed: str) -> None:
    """Volume, section off the middle and surfaces."""
    one, other = Shape(kind, **SIZE, cut=0.006, roundness=roundness), Shape(closed, **SIZE, cut=0.006)
    assert volume(one) == pytest.approx(volume(other), rel=5e-4)
    assert section_area(one) == pytest.approx(section_area(other), rel=5e-4)
    x, y = np.meshgrid(np.linspace(-0.014, 0.014, 9), np.linspace(-0.02, 0.008, 9))
    for drawn, exact in zip(surface(one, x, y), surface(other, x, y), strict=True):
        assert drawn == pytest.approx(exact, abs=2e-5, nan_ok=True)


def test_force_at_the_ends_is_that_of_the_closed_forms() -> None:
    """Peak and work of half a food under a wedge, within 1 %, where the two ends differ by more."""
    scene = replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=0.008, mach=0.02))
    drawn = [Shape("half_barrel", **SIZE, roundness=part) for part in (0.0, 0.5, 1.0)]
    closed = [Shape(kind, **SIZE) for kind in ("half_cylinder", "hemisphere")]
    first, between, last, prism, ball = (cut(replace(scene, food=Food(shape, FLESH))) for shape in (*drawn, *closed))
    for one, other in ((first, prism), (last, ball)):
        assert (one.peak, one.work) == pytest.approx((other.peak, other.work), rel=0.01)
    assert ball.peak < 0.99 * prism.peak
    assert last.work < between.work < first.work


def test_a_scene_names_the_roundness_only_where_there_is_one() -> None:
    """Keys of stored runs of all other shapes stay."""

    def shape_of(**given: float) -> dict[str, object]:
        scene = Scene(
            Food(Shape("half_barrel", **SIZE, **given), FLESH), PRISM.knife, replace(PRISM.motion, stroke=0.01)
        )
        return dict(scene.as_dict()["food"]["shape"])

    assert "roundness" not in shape_of()
    assert shape_of(roundness=0.25)["roundness"] == 0.25


def test_a_name_says_the_roundness() -> None:
    """After a colon, of a barrel alone, from 0 to 1."""
    assert named("sphere") == ("sphere", None) and named("half_barrel:0.3") == ("half_barrel", 0.3)
    assert Shape("barrel", **SIZE, roundness=0.3).words == "barrel of roundness 0.3"
    for text in ("half_barrel:1.2", "barrel:", "barrel:nan", "barrel:round", "sphere:0.5"):
        with pytest.raises(SceneError, match="only barrel and half_barrel have a roundness, from 0"):
            named(text)
    with pytest.raises(SceneError, match="unknown kind 'ball'"):
        named("ball:0.5")
    with pytest.raises(SceneError, match="a sphere has no roundness"):
        Shape("sphere", **SIZE, roundness=0.5)
    with pytest.raises(SceneError, match="roundness 1.5; it goes from 0"):
        Shape("barrel", **SIZE, roundness=1.5)
