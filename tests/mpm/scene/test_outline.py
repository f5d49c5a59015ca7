"""Tabulated outlines: those of closed forms agree with them, mirrors are used where they are, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.discretisation.particles import seed
from mpm.scene import EdgeLaw, Food, Motion, Numerics, Scene, layers
from mpm.scene.errors import SceneError
from mpm.scene.layers import mean_toughness, toughness
from mpm.scene.material import Material
from mpm.scene.outline import ALONG, SYMMETRY, Outline, Sections, bent, extruded, places, revolved
from mpm.scene.profiles import profile, spread
from mpm.scene.shapes import OUTLINE, Shape, depth, inside, section_area, skin_path, span, surface, volume
from tests.mpm.scenes import THIN, cut

ROUND = np.sqrt(1 - places(ALONG) ** 2)
HALF_DISC = np.sqrt(1 - places(97) ** 2)
FLESH = Material(E=1e6, nu=0.35, rho=1000, R=80.0, tensile_strength=1e5)
FRUIT = replace(FLESH, R_rind=500.0, rind_thickness=2e-3, R_core=30.0, core_ratio=0.5)
TWINS = {
    "ellipsoid": revolved(ROUND),
    "hemisphere": revolved(ROUND, halved=True),
    "half_cylinder": extruded(0 * HALF_DISC, HALF_DISC),
    "block": extruded(0 * HALF_DISC, 0 * HALF_DISC + 1),
    "cylinder": revolved(0 * ROUND + 1),
}
"""Tables of foods that have a closed form."""


def measured(sections: Sections, *size: float) -> Shape:
    """A shape of a measured outline: length, width, height and place of the cut [m]."""
    return Shape(OUTLINE, *size, outline=Outline("photo.png", "0" * 64, "revolved", sections))


@pytest.mark.parametrize("cut_at", [0.0, 0.013])
@pytest.mark.parametrize("kind", TWINS)
def test_a_table_is_the_closed_form(kind, cut_at):
    """Volume and section to 0.05 %, surfaces to 0.03 mm, the way through the skin to a tenth of it."""
    known, table = Shape(kind, 0.08, 0.06, 0.04, cut_at), measured(TWINS[kind], 0.08, 0.06, 0.04, cut_at)
    assert volume(table) == pytest.approx(volume(known), rel=5e-4)
    assert section_area(table) == pytest.approx(section_area(known), rel=5e-4)
    x = np.linspace(-0.031, 0.031, 41)
    np.testing.assert_allclose(surface(table, x, 0 * x), surface(known, x, 0 * x), atol=3e-5)
    np.testing.assert_allclose(span(table, 0.01), span(known, 0.01), atol=1e-5)
    middle = np.abs(x) < 0.02
    np.testing.assert_allclose(skin_path(table, x[middle], 1e-3), skin_path(known, x[middle], 1e-3), atol=1e-4)
    assert table.symmetric == known.symmetric == (True, cut_at == 0)
    assert (table.prism, table.walled) == (known.prism, known.walled)


@pytest.mark.parametrize("kind", ["ellipsoid", "hemisphere", "half_cylinder", "cylinder"])
def test_layers_of_a_table_are_those_of_the_closed_form(kind):
    """Rind and core of a section take the same; the rind of a half fruit ends at the board."""
    known, table = (f(0.012) for f in (lambda c: Shape(kind, 0.08, 0.05, 0.04, c),
                                      lambda c: measured(TWINS[kind], 0.08, 0.05, 0.04, c)))  # fmt: skip
    assert mean_toughness(table, FRUIT) == pytest.approx(mean_toughness(known, FRUIT), rel=0.02)
    floor = toughness(table, FRUIT, np.array([[0.0, 0.0, 1e-4], [0.016, 0.0, 1e-4]]))
    assert floor[0] == (30.0 if "h" in kind[:2] else 500.0)


def test_depth_is_the_distance_from_the_surface():
    """In a ball it is what is left of the radius, also near pole and rim."""
    ball = measured(TWINS["ellipsoid"], 0.04, 0.04, 0.04)
    direction = np.random.default_rng(0).normal(size=(300, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    for deep in (2e-4, 2e-3, 1e-2):
        points = (0.02 - deep) * direction + [0, 0, 0.02]
        np.testing.assert_allclose(depth(ball, points), deep, rtol=0.05)
        found = depth(ball, points, 1e-3)
        assert (found[np.isfinite(found)] <= 1.05 * deep).all() and np.isinf(found).any() == (deep > 1e-3)


def test_depth_counts_from_cut_ends_and_upright_flanks():
    """A slab with the rind of a block: ends and flanks have it, the face on the board has none."""
    slab = measured(TWINS["block"], 0.06, 0.05, 0.04)
    at = np.array([[0, 0.028, 0.02], [0.022, 0, 0.02], [0, 0, 0.035], [0, 0, 0.002]])
    np.testing.assert_allclose(depth(slab, at)[:3], [2e-3, 3e-3, 5e-3], rtol=1e-6)
    assert depth(slab, at)[3] > 0.02


def test_mirrors_are_used_only_where_the_outline_has_them():
    """A bump of less than the tolerance is evened out, a larger one ends the mirror, each plane for itself."""
    v = places(ALONG)
    for bump, along in ((0.4 * SYMMETRY, True), (3 * SYMMETRY, False)):
        aside = measured(bent(-ROUND, ROUND + bump * (1 - v**2)), 0.06, 0.06, 0.06)
        assert aside.symmetric == (along, True)
        ahead = measured(revolved(ROUND * (1 + bump * v * ROUND)), 0.06, 0.06, 0.06)
        assert ahead.symmetric == (True, along)
        left, right = (surface(aside, np.array([x]), np.zeros(1))[1] for x in (-0.02, 0.02))
        assert (left == right).all() == along
    scene = Scene(Food(ahead, FRUIT), THIN, Motion(0.02), edge=EdgeLaw(3e-3), numerics=Numerics(dx=3e-3))
    assert scene.mirrors == (True, False)


def test_a_bent_food_has_its_middle_aside_and_its_core_with_it():
    """The section of a banana lies where the arc does, its core about its own middle, its width over all is more."""
    banana = Shape("bent", 0.18, 0.03 * spread("bent"), 0.03)
    left, right = span(banana, 0.0)
    assert right - left == pytest.approx(0.03, rel=1e-3) and right == pytest.approx(banana.width / 2, rel=1e-3)
    tip = span(banana, 0.085)
    middle = (left + right) / 2
    assert tip[0] < left and tip[1] < middle < right
    core = toughness(banana, FRUIT, np.array([[middle, 0, 0.015], [middle + 0.01, 0, 0.015], [middle, 0, 0.0295]]))
    assert core.tolist() == [30.0, 80.0, 500.0]
    beside = np.array([[middle + x, 0, 0.015] for x in (-0.0085, -0.0065, 0.0065, 0.0085)])
    assert toughness(banana, FRUIT, beside).tolist() == [80.0, 30.0, 30.0, 80.0]
    assert not inside(banana, np.array([[left - 1e-3, 0, 0.015]]))[0]


def test_pear_and_strawberry_are_thick_at_one_end():
    """A pear's neck is under half as thick as its body, a strawberry's tip runs out."""
    for kind, thin in (("pear", 0.5), ("cone", 0.4)):
        radius = profile(kind).right
        assert radius.argmax() < ALONG / 2 and radius[-20] < thin < 0.9 < radius[40]


def test_outlines_are_told_apart_by_their_numbers():
    """The plain data of a scene names the file and stands for its numbers; without an outline it has no word of it."""
    one, other = (measured(revolved(ROUND**p), 0.06, 0.06, 0.06) for p in (1.0, 1.1))
    scene = Scene(Food(one, FRUIT), THIN, Motion(0.02), edge=EdgeLaw(3e-3), numerics=Numerics(dx=3e-3))
    told = scene.as_dict()["food"]["shape"]["outline"]
    assert told["source"] == "photo.png" and one != other and one == measured(revolved(ROUND), 0.06, 0.06, 0.06)
    assert told != replace(scene, food=Food(other, FRUIT)).as_dict()["food"]["shape"]["outline"]
    plain = replace(scene, food=Food(Shape("sphere", 0.06, 0.06, 0.06), FRUIT))
    assert "outline" not in plain.as_dict()["food"]["shape"]


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Shape("outline", 0.1, 0.1, 0.1), "measured outline"),
        (lambda: replace(measured(TWINS["block"], 0.1, 0.1, 0.1), kind="block"), "measured outline"),
        (lambda: volume(Shape("outline", 0.1, 0.1, 0.1, outline=Outline("a.png", "", "half"))), "a.png"),
        (lambda: replace(TWINS["ellipsoid"], left=ROUND, right=-ROUND), "ends before it begins"),
        (lambda: replace(TWINS["block"], bottom=TWINS["block"].top, top=TWINS["block"].bottom), "below the upper one"),
        (lambda: extruded(0 * HALF_DISC, HALF_DISC * np.nan), "finite"),
        (lambda: extruded(0 * HALF_DISC, 2 * HALF_DISC), "food's box"),
    ],
)
def test_impossible_outlines_are_refused(make, said):
    """A kind without its table, a table that is turned, has no number or leaves the box."""
    with pytest.raises(SceneError, match=said):
        make()


def test_a_table_is_cut_with_the_force_of_the_closed_form():
    """Peak and work of half a ball, cut half-way, are within 1 % (from its own particles: the last digits differ)."""
    known = Shape("hemisphere", 0.03, 0.03, 0.015)
    flesh = replace(FLESH, yield_stress=2e5, R_initiation=80.0)
    scene = Scene(Food(known, flesh), THIN, Motion(0.008, 0.02), edge=EdgeLaw(3e-3), numerics=Numerics(dx=3e-3))
    table = measured(TWINS["hemisphere"], 0.03, 0.03, 0.015)
    one, other = cut(scene), cut(replace(scene, food=Food(table, flesh)))
    assert other.peak == pytest.approx(one.peak, rel=0.01) and other.work == pytest.approx(one.work, rel=0.01)
    assert other.peak != one.peak  # it is another way to the same


def test_particles_fill_a_banana():
    """None lies outside, and together they have its volume, though a straight line leaves it."""
    shape = Shape("bent", 0.12, 0.05, 0.03)
    scene = Scene(Food(shape, FRUIT), THIN, Motion(0.02), edge=EdgeLaw(3e-3), numerics=Numerics(dx=3e-3))
    seeds = seed(scene)
    assert inside(shape, seeds.x).all() and 2 * seeds.total == pytest.approx(volume(shape), rel=1e-12)


def test_the_core_of_a_bent_food_is_looked_up_at_few_places(monkeypatch):
    """The middle of its sections is interpolated: of 2000 points no more than 2 lie in another layer than in a section
    of their own, and a food of ten thousand particles does not look at ten thousand sections."""
    shape, random = Shape("bent", 0.03, 0.12, 0.03), np.random.default_rng(0)
    points = np.column_stack(
        [random.uniform(-0.02, 0.02, 2000), random.uniform(-0.05, 0.05, 2000), 0.03 * random.random(2000)]
    )
    points = points[inside(shape, points)]
    alone = np.concatenate([toughness(shape, FRUIT, point[None]) for point in points])
    looked = []
    monkeypatch.setattr(layers, "span", lambda *at: looked.append(at) or span(*at))
    together = toughness(shape, FRUIT, points)
    assert {30.0, 80.0, 500.0} == set(alone) and (alone != together).sum() <= 2
    assert 1 < len(looked) <= layers.STATIONS
