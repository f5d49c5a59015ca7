"""Layers of a section: which point lies in which, what ties stand for, and how many joules all of it takes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mpm.scene.errors import SceneError
from mpm.scene.layers import in_whole, layer_ties, mean_toughness, toughness
from mpm.scene.material import Material
from mpm.scene.shapes import SHAPE_KINDS, Shape, section_area, slice_powers, slices

FLESH = Material(E=1e6, nu=0.35, rho=1000, R=80.0, tensile_strength=1e5)
FRUIT = replace(FLESH, R_rind=500.0, rind_thickness=2e-3, R_core=30.0, core_ratio=0.5)


def lattice(shape: Shape, spacing: float) -> np.ndarray:
    """Places of ties at the middle of the squares of a section, shape (k, 2)."""
    x = np.arange(-shape.width / 2, shape.width / 2, spacing) + spacing / 2
    at = np.stack(np.meshgrid(x, np.arange(0, shape.height, spacing) + spacing / 2), -1).reshape(-1, 2)
    near = shape.height if shape.kind in ("half_cylinder", "hemisphere") else shape.height / 2
    middle = shape.height - near
    return at[(at[:, 0] / (shape.width / 2)) ** 2 + ((at[:, 1] - middle) / near) ** 2 < 1]


def test_a_point_has_the_toughness_of_its_layer():
    """Rind at top, flank and bottom of a whole fruit, core about its middle, flesh between."""
    ball = Shape("sphere", 0.04, 0.04, 0.04)
    places = np.array([[0, 0, 0.039], [0.019, 0, 0.02], [0, 0, 0.001], [0, 0.0185, 0.02], [0, 0, 0.025], [0, 0, 0.035]])
    assert toughness(ball, FRUIT, places).tolist() == [500, 500, 500, 500, 30, 80]


def test_a_whole_number_is_a_toughness_too():
    """R as an integer takes no decimals off the other layers."""
    ball = Shape("sphere", 0.04, 0.04, 0.04)
    whole = replace(FRUIT, R=80, R_rind=500.5)
    assert toughness(ball, whole, np.array([[0, 0, 0.039]])).tolist() == [500.5]


def test_a_half_fruit_has_no_rind_where_it_was_halved():
    """The flat face of a half cylinder is flesh, and its core lies there."""
    half = Shape("half_cylinder", 0.1, 0.04, 0.02)
    at = np.array([[0, 0, 1e-4], [0.012, 0, 1e-4], [0.0195, 0, 1e-4], [0, 0, 0.019]])
    assert toughness(half, FRUIT, at).tolist() == [30, 80, 500, 500]


def test_a_cut_off_the_middle_has_more_rind_and_less_core():
    """Near its end a fruit is rind, and the core has ended."""
    middle = mean_toughness(Shape("ellipsoid", 0.06, 0.04, 0.04), FRUIT)
    aside = mean_toughness(Shape("ellipsoid", 0.06, 0.04, 0.04, cut=0.02), FRUIT)
    assert aside > 1.2 * middle
    assert mean_toughness(Shape("ellipsoid", 0.06, 0.04, 0.04, cut=0.02), replace(FRUIT, rind_thickness=0.0)) == 80


def test_the_whole_section_takes_the_sum_of_its_rings():
    """Mean toughness of a circle with rind and core, by the areas of its rings."""
    rind, core = 1 - (18 / 20) ** 2, 0.25
    want = 500 * rind + 30 * core + 80 * (1 - rind - core)
    assert mean_toughness(Shape("cylinder", 0.1, 0.04, 0.04), FRUIT) == pytest.approx(want, rel=2e-3)
    assert mean_toughness(Shape("cylinder", 0.1, 0.04, 0.04), FRUIT, 0.02) == pytest.approx(500, rel=0.01)


@pytest.mark.parametrize(("thickness", "rows"), [(2e-3, 1), (2e-3, 8), (3e-4, 8), (2e-3, 16)])
def test_ties_stand_for_the_whole_section(thickness, rows):
    """A rind thinner than the spacing counts with its share: the ties together take what the section takes."""
    fruit, shape, spacing = replace(FRUIT, rind_thickness=thickness), Shape("cylinder", 0.1, 0.04, 0.04), 1.5e-3
    tough, share = in_whole(*layer_ties(shape, fruit, spacing, lattice(shape, spacing), rows))
    assert share.sum() * spacing**2 == pytest.approx(section_area(shape), rel=2e-3)
    want = mean_toughness(shape, fruit) * section_area(shape)
    assert (tough * share).sum() * spacing**2 == pytest.approx(want, rel=1e-2)


def test_rows_of_a_tie_lie_in_their_own_layer():
    """A block with a rind of a third of the spacing: that part of the highest ties is rind, the rest flesh."""
    shape, spacing = Shape("block", 0.012, 0.012, 0.012), 1.5e-3
    fruit = replace(FLESH, R_rind=500.0, rind_thickness=0.5e-3)
    middles = np.arange(spacing / 2, 0.012, spacing)
    places = np.stack(np.meshgrid(middles - 0.006, middles), -1).reshape(-1, 2)
    tough, share = layer_ties(shape, fruit, spacing, places, 12)
    middle = (places[:, 1] == places[:, 1].max()) & (np.abs(places[:, 0]) < 4e-3)
    assert np.unique(share[middle]) == pytest.approx([1.0])
    assert (tough[middle] == [80.0] * 8 + [500.0] * 4).all()


def test_without_layers_every_tie_is_flesh():
    """Nothing is sampled, so that the numbers are those of a food that has no layers, to the last bit."""
    shape = Shape("cylinder", 0.1, 0.04, 0.04)
    tough, share = layer_ties(shape, FLESH, 1.5e-3, lattice(shape, 1.5e-3), 8)
    assert set(tough.ravel()) == {80.0} and set(share.ravel()) == {1.0} and mean_toughness(shape, FLESH) == 80.0


@pytest.mark.parametrize("kind", SHAPE_KINDS)
def test_a_slice_is_entered_over_its_own_area(kind):
    """The chord that the powers give holds the area between the first and the last point of the upper surface."""
    shape, dx = Shape(kind, 0.06, 0.04, 0.04), 3e-3
    x = np.arange(-8, 9) * dx
    top, low, width, floor, under = slices(shape, x, dx)
    powers = slice_powers(shape, x, dx)
    upper = low + (top - low) / (powers[0] + 1)
    lower = under + (floor - under) / (powers[1] + 1)
    assert (width * (upper - lower)).sum() * dx == pytest.approx(section_area(shape), rel=5e-3)


def test_the_toughest_layer_sets_what_a_grid_resolves():
    """Ties of tough rind soften over the same opening at a higher stress, and must not snap back either."""
    spacing = 1.5e-3
    strong = replace(FRUIT, tensile_strength=1e7)
    rind = strong.tie_strength(spacing, 0.5) * 500 / 80
    assert strong.E * 500 / rind**2 == pytest.approx(spacing / 2)
    assert FLESH.tie_strength(spacing, 0.5) == min(1e5, math.sqrt(1e6 * 80 / (spacing / 2)))
    assert strong.E * 80 / strong.tie_strength(spacing, 5.0) ** 2 == pytest.approx(5 * spacing)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rind_thickness": 1e-3}, "needs R_rind"),
        ({"core_ratio": 0.3}, "needs R_core"),
        ({"core_ratio": 1.5, "R_core": 30.0}, "core_ratio"),
        ({"rind_thickness": -1e-3, "R_rind": 30.0}, "rind_thickness"),
        ({"R": 0.0, "core_ratio": 0.3, "R_core": 30.0}, "give R > 0"),
    ],
)
def test_half_a_layer_is_refused(wrong, said):
    """A size without a resistance, a core larger than the fruit, and layers in flesh that nothing holds."""
    with pytest.raises(SceneError, match=said):
        replace(FLESH, **wrong)
