"""The force that starts a cut: it is the food's, and not that of the method's lengths."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mpm.output.record import ForceRecord
from mpm.scene import EdgeLaw, Motion
from tests.mpm.scenes import FLESH, PRISM, cut

SKINNED = replace(
    FLESH,
    E=3e5,
    yield_stress=2e4,
    R=100.0,
    R_initiation=150.0,
    R_skin=600.0,
    skin_thickness=5e-4,
    initiation_depth=2e-3,
)


def indented(material, edge: EdgeLaw, numerics=PRISM.numerics) -> ForceRecord:
    """The prism with this material, cut half through."""
    food = replace(PRISM.food, material=material)
    return cut(replace(PRISM, food=food, motion=Motion(0.012, 0.01), edge=edge, numerics=numerics))


def test_a_dent_in_a_soft_food_is_not_as_deep_as_the_zone_is_narrow():
    """A food that yields at 20 kPa bears 600 N/m over 13 mm. The skin hands the force to that width, so twice the
    smallest zone leaves peak and work (5 %); spread over the zone alone the edge sank until it had a wedge's force."""
    narrow, wide = (indented(SKINNED, EdgeLaw(zone=z)) for z in (3e-3, 6e-3))
    assert wide.peak == pytest.approx(narrow.peak, rel=0.05)
    assert wide.work == pytest.approx(narrow.work, rel=0.05)
    assert abs(narrow.unbooked[-1]) < 0.05 * narrow.work


@pytest.mark.parametrize("skin", [0.0, 5e-4])
def test_what_a_start_takes_beyond_the_resistance_is_spent_in_the_skin(skin):
    """A stiff block needs 900 N/m to start and 300 after: the excess goes over the skin's way, in bare flesh at once,
    so the edge's elastic slip, a number of the method, has no part in the work (0.5 %)."""
    stiff = replace(FLESH, E=5e6, yield_stress=1e6, R_initiation=900.0, initiation_depth=1e-3)
    if skin:
        stiff = replace(stiff, R_skin=900.0, skin_thickness=skin)
    short, long = (indented(stiff, EdgeLaw(zone=3e-3, slip=s)) for s in (0.5e-3, 2e-3))
    assert long.work == pytest.approx(short.work, rel=0.005)
    assert long.peak == pytest.approx(short.peak, rel=0.005)


def start_of(record: ForceRecord) -> float:
    """Stroke of the largest force on the knife [m]."""
    return float(record.stroke[np.argmax(np.abs(record.knife[:, 2]))])


def test_a_line_force_sinks_less_on_a_wider_strip():
    """Elastic flesh on cells of half the zone: where an edge has pressed 240 N/m into twice the zone it has sunk less,
    by 2 (1 - nu^2) / (pi E) F ln 2 on a half-space of small strains (Johnson 1985, section 2.4), and by up to twice of
    that in a block of 24 mm."""
    line, numerics = 240.0, replace(PRISM.numerics, dx=1.5e-3)
    elastic = replace(SKINNED, yield_stress=math.inf, initiation_depth=2e-4)
    sunk = []
    for zone in (3e-3, 6e-3):
        record = indented(elastic, EdgeLaw(zone=zone), numerics)
        force = np.abs(record.knife[:, 2])
        rise = slice(0, int(np.argmax(force)) + 1)
        sunk.append(float(np.interp(line * PRISM.food.shape.width, force[rise], record.stroke[rise])))
    less = 2 * (1 - elastic.nu**2) / (math.pi * elastic.E) * line * math.log(2)
    assert 1.0 < (sunk[0] - sunk[1]) / less < 2.0


@pytest.mark.parametrize("yields", [4e4, 1.2e5])
def test_where_a_cut_starts_does_not_hang_on_the_width_that_bears_the_edge(yields):
    """What a wider zone hides of the food's own dent the edge sinks into it: with four times the width the cut starts
    at the same stroke (10 %) for the same work (3 %). Without that it starts a quarter earlier, for 5 and 15 % less."""
    flesh = replace(SKINNED, yield_stress=yields)
    usual, wider = (indented(flesh, EdgeLaw(zone=3e-3, bearing=b)) for b in (1.25, 5.0))
    assert start_of(wider) == pytest.approx(start_of(usual), rel=0.1)
    assert wider.work == pytest.approx(usual.work, rel=0.03)
    assert max(usual.momentum_residual, wider.momentum_residual) < 1e-9


@pytest.mark.parametrize("wide", [6e-3, 8e-3], ids=["seen from twice the zone", "from half of it"])
def test_the_indentation_is_that_of_its_strip_whatever_the_zone(wide):
    """A wider zone over a strip of 3 mm: the cut starts at the same stroke (8 %). It starts 17 % earlier where the
    strip is as wide as the zone, as the food has sunk less by then."""
    numerics, elastic = replace(PRISM.numerics, dx=1.5e-3), replace(SKINNED, yield_stress=math.inf)
    laws = (EdgeLaw(zone=3e-3), EdgeLaw(zone=wide, dent_width=3e-3), EdgeLaw(zone=wide))
    records = [indented(elastic, law, numerics) for law in laws]
    usual, told, untold = (start_of(record) for record in records)
    assert told == pytest.approx(usual, rel=0.08)
    assert untold < 0.9 * usual
    assert records[1].unbooked[-1] > -0.01 * records[1].work  # nothing comes from nothing


def test_a_strip_that_is_wider_than_the_zone_starts_the_cut_earlier():
    """Under a wider strip a dent is the shallower, so the same indentation is reached at a smaller stroke."""
    elastic = replace(SKINNED, yield_stress=math.inf)
    narrow, wide = (start_of(indented(elastic, EdgeLaw(zone=3e-3, dent_width=w))) for w in (3e-3, 6e-3))
    assert wide < narrow
