"""Where cuts have to go, with closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intsim.task.targets import APART, CAMERAS, CutSpec, Item, TaskError, boxed_target, spread, target
from mpm.scene.shapes import Shape, volume

BANANA = Item("banana", Shape("cylinder", 0.16, 0.033, 0.033), 0.02, -0.03, math.radians(80))
ratios = st.floats(0.1, 0.9)
yaws = st.floats(-math.pi, math.pi).filter(lambda a: abs(math.sin(a)) > 0.3)


@given(ratios, yaws)
def test_left_of_a_part_is_right_of_the_rest(ratio, yaw):
    """A cut at r from the left is the one at 1 - r from the right, and a camera from behind exchanges the two."""
    item = replace(BANANA, yaw=yaw)
    left = target(CutSpec("banana", ratio, "left"), item)
    assert left == pytest.approx(target(CutSpec("banana", 1 - ratio, "right"), item), abs=1e-12)
    assert left == pytest.approx(target(CutSpec("banana", ratio, "right", "robot"), item), abs=1e-12)
    seen = CAMERAS["front"].right @ (item.at(left) - [item.x, item.y])
    across = abs(item.axis @ CAMERAS["front"].right)
    assert seen == pytest.approx((ratio - 0.5) * item.shape.length * across, abs=1e-12)


@given(yaws)
def test_a_half_has_no_side(yaw):
    """In the middle, however the food lies and whichever end it is measured from."""
    item = replace(BANANA, yaw=yaw)
    for side in ("left", "right", "centre"):
        assert target(CutSpec("banana", Fraction(1, 2), side), item) == 0.0


def test_a_food_that_points_to_the_camera_has_no_left_end():
    """It is refused, with the angle and what to do; the side camera sees it."""
    item = replace(BANANA, yaw=math.radians(4))
    with pytest.raises(TaskError, match="4 degrees across its view.*another camera"):
        target(CutSpec("banana", Fraction(1, 4), "left"), item)
    assert target(CutSpec("banana", Fraction(1, 4), "left", "side"), item) == pytest.approx(-0.04)


@given(yaws)
def test_a_bounding_box_is_not_the_food(yaw):
    """The planner that knows the box alone measures l |sin| + w |cos| in place of l, along the table's axis that the camera sees across."""
    item = replace(BANANA, x=0.0, y=0.0, yaw=yaw)
    c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
    length, width = item.shape.length, item.shape.width
    assert item.box == pytest.approx((length * c + width * s, length * s + width * c))
    point, edge = boxed_target(CutSpec("banana", Fraction(1, 4), "left"), item)
    np.testing.assert_allclose(point, [0.0, -item.box[1] / 4], atol=1e-12)
    assert edge == 0.0
    point, edge = boxed_target(CutSpec("banana", Fraction(1, 4), "left", "side"), item)
    np.testing.assert_allclose(point, [-item.box[0] / 4, 0.0], atol=1e-12)
    assert edge == math.pi / 2


@pytest.mark.parametrize("count", [2, 3, 4, 6])
@pytest.mark.parametrize("kind", ["cylinder", "ellipsoid"])
def test_equal_pieces_are_cut_from_what_is_left(count, kind):
    """Each cut is planned from the pieces as they have slid apart, and all come out as long; the volumes add up to the food's."""
    item = Item("cucumber", Shape(kind, 0.2, 0.045, 0.045))
    spec = CutSpec("cucumber", pieces=count)
    for _ in range(spec.cuts):
        item = item.cut_at(target(spec, item))
    assert len(item.pieces) == count
    assert spread([p.length for p in item.pieces]) < 1e-12
    assert sum(item.volumes()) == pytest.approx(volume(item.shape), rel=2e-3)
    assert (spread(item.volumes()) < 1e-9) == (kind == "cylinder" or count == 2)
    with pytest.raises(TaskError, match=f"in {count} pieces already"):
        target(spec, item)


def test_cuts_that_are_planned_for_the_whole_food_miss():
    """Pieces slide apart by 4 mm a cut, so a plan from the first extent cuts the last pieces unequal."""
    item = Item("cucumber", Shape("cylinder", 0.2, 0.045, 0.045))
    for k in range(1, 6):
        item = item.cut_at(-0.1 + 0.2 * k / 6)
    lengths = [p.length for p in item.pieces]
    assert len(lengths) == 6 and max(lengths) - min(lengths) > APART
    assert item.cut_at(0.5) is item and item.piece_at(0.5) is None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"ratio": 1.0}, "between 0 and 1"),
        ({"side": "top"}, "none of left, right, centre"),
        ({"ratio": Fraction(1, 4), "side": "centre"}, "say left or right"),
        ({"camera": "roof"}, "no camera 'roof'"),
        ({"pieces": 1}, "give 2 or more"),
    ],
)
def test_impossible_tasks_are_refused(change, says):
    """With what was wrong and what may be given."""
    with pytest.raises(TaskError, match=says):
        CutSpec("banana", **change)
