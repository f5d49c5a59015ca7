"""Shapes, seeds, records and the refusals of impossible scenes: plain NumPy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mpm.discretisation.grid import lay_out
from mpm.discretisation.particles import seed
from mpm.output.record import _moving_mean
from mpm.scene import Food, Knife, Motion, Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.material import Material
from mpm.scene.profiles import TABLES
from mpm.scene.shapes import SHAPE_KINDS, Shape, inside, section_area, skin_path, slices, surface, volume

MATERIAL = Material(E=1e6, nu=0.35, rho=1000.0)
KNIFE = Knife("k", 2e-3, 0.1, 0.04, 0.2)


def scene(kind: str, **numerics: object) -> Scene:
    """A food of one kind, 60 x 40 x 30 mm."""
    return Scene(
        Food(Shape(kind, 0.06, 0.04, 0.03), MATERIAL), KNIFE, Motion(0.02), numerics=Numerics(dx=3e-3, **numerics)
    )


@pytest.mark.parametrize("cut", [0.0, 0.016, -0.022])
@pytest.mark.parametrize("kind", SHAPE_KINDS)
def test_volume_and_section_agree_with_counting(kind, cut):
    """The closed forms agree with a count of random points within 3 standard deviations, and the surface with
    inside."""
    shape = Shape(kind, 0.06, 0.04, 0.03, cut)
    rng = np.random.default_rng(0)
    n, box = 200_000, 0.06 * 0.04 * 0.03
    points = rng.uniform([-0.02, shape.ends[0], 0], [0.02, shape.ends[1], 0.03], (n, 3))
    share = inside(shape, points).mean()
    assert volume(shape) / box == pytest.approx(share, abs=3 * math.sqrt(0.25 / n))
    x = np.linspace(-0.02, 0.02, 20001)
    bottom, top = surface(shape, x, 0 * x)
    assert section_area(shape) == pytest.approx(np.trapezoid(np.nan_to_num(top - bottom), x), rel=1e-3)


@pytest.mark.parametrize("kind", SHAPE_KINDS)
@pytest.mark.parametrize(("mirror", "cut"), [(True, 0.0), (False, 0.0), (True, 0.02), (False, -0.015)])
def test_particles_add_up_to_the_food(kind, mirror, cut):
    """All images of the particles have the volume of the shape, lie in it, and fill the modelled part evenly.

    A blade that is not in the middle leaves the mirror along it, and has two layers of particles on either side all the
    same.
    """
    sc = scene(kind, mirror=mirror)
    sc = replace(sc, food=replace(sc.food, shape=replace(sc.food.shape, cut=cut)))
    seeds = seed(sc)
    along, across = sc.food.shape.symmetric
    assert (along, across) == (kind != "bent", cut == 0 and kind not in ("pear", "cone"))
    images = (2 if mirror and along else 1) * (2 if mirror and across else 1)
    assert sc.mirrors == (mirror and along, mirror and across)
    assert seeds.total * images == pytest.approx(volume(sc.food.shape), rel=1e-12)
    assert inside(sc.food.shape, seeds.x).all()
    assert seeds.volume == pytest.approx(seeds.spacing**3, rel=0.06)
    assert (seeds.board_gap >= 0).all() and seeds.board_gap.max() <= seeds.spacing
    if mirror and along:
        assert seeds.x[:, 0].min() >= 0
    if mirror and across:
        assert seeds.x[:, 1].max() <= 0
    else:
        near = np.abs(seeds.x[:, 1]) < seeds.spacing
        assert (seeds.beside == near).all() and near[seeds.x[:, 1] > 0].any() and near[seeds.x[:, 1] < 0].any()
    grid = lay_out(sc)
    low, high = grid.origin, grid.origin + (np.array(grid.nodes) - 1) * sc.numerics.dx
    assert (seeds.x.min(axis=0) > low + 1.5 * sc.numerics.dx).all() and (
        seeds.x.max(axis=0) < high - 1.5 * sc.numerics.dx
    ).all()


def test_a_blade_beside_the_food_or_at_its_very_end_is_refused():
    """Beyond the end, and so near to it that the slice has no two cells."""
    with pytest.raises(SceneError, match="misses a food 60 mm long"):
        Shape("block", 0.06, 0.04, 0.03, 0.03)
    sc = scene("block")
    with pytest.raises(SceneError, match="leaves a slice of 5 mm, under 2 cells"):
        replace(sc, food=replace(sc.food, shape=replace(sc.food.shape, cut=-0.025)))


@pytest.mark.parametrize("kind", SHAPE_KINDS)
@pytest.mark.parametrize("mirror", [True, False])
def test_far_from_the_cut_a_particle_stands_for_a_cell_across_the_blade(kind, mirror):
    """Half as many, within the food an eighth; those beside the cut, the mass and its middle are the same, and so is
    the outline: what lies on the board to 3 %, of foods that taper to 7 %."""
    far, sc = 6e-3, scene(kind, mirror=mirror)
    all_, some = seed(sc), seed(replace(sc, numerics=replace(sc.numerics, far=far)))
    assert some.total == pytest.approx(all_.total, rel=1e-12) and set(some.volume_ratio) <= {1.0, 2.0, 8.0}
    np.testing.assert_allclose(some.volume_ratio @ some.x, all_.volume_ratio @ all_.x, atol=1e-9)
    a, b = (s.x[np.abs(s.x[:, 1]) < far] for s in (all_, some))
    np.testing.assert_allclose(a, b, atol=1e-15)
    assert len(some.x) - len(b) < 0.7 * (len(all_.x) - len(a))
    outer = some.bottom | some.top
    assert some.volume_ratio[outer].max() == 2.0 and some.areas @ some.bottom == pytest.approx(
        all_.areas @ all_.bottom, rel=0.07 if kind in TABLES else 0.03
    )
    assert (some.beside == (np.abs(some.x[:, 1]) < some.spacing)).all()
    np.testing.assert_array_equal(np.bincount(some.owner), some.volume_ratio)


def test_seeds_repeat_and_differ():
    """The same seed gives the same particles, another one others."""
    a, b, c = (seed(scene("cylinder", seed=s)).x for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert a.shape != c.shape or not np.allclose(a, c)


def test_particles_are_no_lattice_aligned_with_the_blade():
    """Distances from the blade plane are spread over the middle quarter of each lattice cell, not stacked on planes."""
    y = seed(scene("block", mirror=False)).x[:, 1]
    phase = (y / 1.5e-3) % 1.0
    counts, _ = np.histogram(phase, bins=16, range=(0, 1))
    middle = counts[6:10]
    assert middle.sum() == counts.sum()
    assert middle.min() > 0.95 * middle.mean()


def test_first_layer_meets_a_surface_at_its_own_distance():
    """Between flat ends the first layer touches at its own distance, so all of it at once; the layers behind at half a
    cell."""
    seeds = seed(scene("block", mirror=False))
    first = seeds.x[:, 2] < seeds.spacing
    np.testing.assert_allclose(seeds.board_gap[first], seeds.x[first, 2])
    assert (seeds.board_gap[~first] == seeds.spacing / 2).all()
    beside = seeds.beside
    np.testing.assert_allclose(seeds.blade_gap[beside], np.abs(seeds.x[beside, 1]))
    assert (seeds.blade_gap[~beside] == seeds.spacing / 2).all()


def test_mirrors_follow_the_grid():
    """Mirrors are used where they mirror the grid, along the blade also between nodes; not by the nodal rule across the
    blade."""
    assert scene("block").mirrors == (True, True)
    assert scene("block", grid_shift=(0.0, 0.5, 0.3)).mirrors == (True, False)
    assert scene("block", grid_shift=(0.25, 0.0, 0.0)).mirrors == (False, True)
    assert scene("block", grid_shift=(0.5, 0.0, 0.0)).mirrors == (True, True)
    assert scene("block", grid_shift=(-1.5, 0.0, 0.0)).mirrored_between and not scene("block").mirrored_between
    assert scene("block", contact="nodal").mirrors == (True, False)
    assert scene("block", mirror=False).mirrors == (False, False)


def test_skin_path_is_the_thickness_on_top_and_longer_on_the_flanks():
    """In the middle the edge crosses the skin's thickness; at the flank of a circle the chord of the ring; outside
    none."""
    circle, t = Shape("cylinder", 0.06, 0.04, 0.04), 1e-3
    x = np.array([0.0, 0.015, 0.0195, 0.03])
    outer, inner = np.sqrt(0.02**2 - np.minimum(x, 0.02) ** 2), np.sqrt(np.maximum(0.019**2 - x**2, 0))
    expected = np.where(x < 0.019, outer - inner, 2 * outer)
    np.testing.assert_allclose(skin_path(circle, x, t), np.where(x > 0.02, 0, expected), atol=1e-12)
    np.testing.assert_allclose(skin_path(Shape("block", 0.06, 0.04, 0.03), np.array([0.0]), t), [t])


def test_moving_mean_removes_a_ripple_of_its_width():
    """A ripple of exactly one cell vanishes, a constant and a straight line stay, also at the end of a cut under
    load."""
    s = np.arange(1, 401) * 1e-4
    ripple = np.sin(2 * np.pi * s / 3e-3)
    inner = slice(40, None)
    np.testing.assert_allclose(_moving_mean(s, 5 + ripple, 3e-3)[inner], 5, atol=0.01)
    np.testing.assert_allclose(_moving_mean(s, 100 * s, 3e-3)[inner], 100 * s[inner], atol=0.01)
    short = s[:50]  # under two cells nothing is known of the ripple
    assert np.isfinite(_moving_mean(short, 5 + ripple[:50], 3e-3)).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"nu": 0.5}, "nu"),
        ({"E": -1.0}, "E = -1.0"),
        ({"rho": math.nan}, "rho"),
        ({"fracture_energy": 20.0}, "give both"),
        ({"tensile_strength": 0.0}, "tensile_strength"),
        ({"skin_thickness": 1e-3}, "R_skin"),
    ],
)
def test_impossible_materials_are_refused(change, says):
    """A material that cannot be is refused by the name and value of the property."""
    with pytest.raises(SceneError, match=says):
        replace(MATERIAL, **change)


def test_unknown_kinds_are_refused_with_the_list():
    """Unknown shape, contact and precision name the ones there are."""
    with pytest.raises(SceneError, match="cylinder"):
        Shape("cube", 0.1, 0.1, 0.1)
    with pytest.raises(SceneError, match="cohesive"):
        Numerics(contact="sticky")
    with pytest.raises(SceneError, match="f64"):
        Numerics(precision="f16")


def test_one_particle_a_cell_is_refused():
    """Where a cut starts it makes energy from nothing, a quarter of the work so far; two each way do not."""
    with pytest.raises(SceneError, match="one particle a cell"):
        Numerics(ppc=1)
    assert Numerics(ppc=2).ppc == 2


@pytest.mark.parametrize("kind", ["block", "cylinder", "sphere"])
@pytest.mark.parametrize("cells", [8, 9])
def test_the_last_bit_of_a_cell_does_not_change_the_outline(kind: str, cells: int) -> None:
    """A food as wide as whole cells, rim on a node or half-way between two: cells longer or shorter by 1e-12 see the
    same slices."""
    shape = Shape(kind, 0.04, 0.024, 0.024)
    found = []
    for error in (-1e-12, 0.0, 1e-12):
        dx = 0.024 / cells * (1 + error)
        found.append(slices(shape, dx * np.arange(-6, 7), dx))
    for other in (found[0], found[2]):
        for exact, moved in zip(found[1], other, strict=True):
            np.testing.assert_allclose(moved, exact, atol=1e-9)


def test_a_limit_of_zero_is_written_as_zero():
    """Zero is a value of an adhesion, and the message says so in numbers that people write."""
    for value in (-1.0, 1e6):
        with pytest.raises(SceneError, match="must be a number from 0 to less than 1e\\+06 Pa"):
            Material(1e6, 0.3, 1000.0, adhesion=value, adhesion_energy=1.0)
    with pytest.raises(SceneError, match="must be a number between 0 and 1e"):
        Material(1e6, 0.3, 1000.0, tensile_strength=-1.0)
