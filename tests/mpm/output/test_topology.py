"""What a cut has left: bulk damage that parts, and crumbs that are no pieces."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mpm.output.topology import Topology, topology

SPACING = 1e-3


def left(cells, damage=None, swell=None, severed=None) -> Topology:
    """The pieces of a row or block of particles, the left half of which lies below y = 0."""
    cells = np.asarray(cells)
    n = len(cells)
    half = (cells[:, 1] >= 0).astype(int)
    seeds = SimpleNamespace(
        cells=cells,
        owner=np.arange(n),
        volume=np.full(n, SPACING**3),
        spacing=SPACING,
        x=(cells + 0.5) * SPACING,
        beside=(cells[:, 1] == -1) | (cells[:, 1] == 0),
    )
    none = np.zeros(n)
    return topology(
        seeds,
        (False, False),
        half,
        np.zeros(n, bool) if severed is None else severed,
        none + 1 if swell is None else swell,
        none if damage is None else damage,
    )


def row(n):
    """Cells along the food."""
    return [[0, k - n // 2, 0] for k in range(n)]


@pytest.mark.parametrize(
    ("damage", "pieces"),
    [(0.0, 1), (0.5, 1), (0.98, 1), (0.995, 3), (1.0, 3)],
)
def test_bulk_damage_parts(damage, pieces):
    """A particle that is broken holds on neither side, and one that is nearly broken on both: the edge has passed
    nothing."""
    harm = np.zeros(9)
    harm[2] = damage
    found = left(row(9), harm)
    assert len(found.volumes) == pieces and found.complete is (pieces > 1)
    assert sum(found.volumes) + found.crumbs == pytest.approx(9 * SPACING**3)
    if pieces > 1:
        assert found.volumes == pytest.approx([6 * SPACING**3, 2 * SPACING**3, SPACING**3])


def test_a_broken_sheet_severs_and_a_gap_in_it_does_not():
    """Away from the cut a sheet of broken particles parts a block; one sound particle in it holds it together."""
    cells = [[i, j - 4, k] for i in range(3) for j in range(8) for k in range(3)]
    sheet = np.array([float(c[1] == 2) for c in cells])
    assert sorted(left(cells, sheet).volumes)[-2:] == pytest.approx([9 * SPACING**3, 54 * SPACING**3])
    sheet[[c == [1, 2, 1] for c in cells].index(True)] = 0.0
    assert left(cells, sheet).volumes[0] == pytest.approx(64 * SPACING**3)


@pytest.mark.parametrize(("part", "pieces"), [(0.9e-3, 1), (1.1e-3, 2)])
def test_crumbs_are_no_pieces(part, pieces):
    """A thousandth of the food is the limit: what is smaller severs nothing, and its volume is told apart."""
    n = 20
    harm, swell = np.zeros(n), np.ones(n)
    harm[1] = 1.0  # parts the first particle from the rest, and is a crumb as well
    swell[1] = 1e-9
    swell[0] = part * (n - 2) / (1 - part)
    found = left(row(n), harm, swell)
    assert len(found.volumes) == pieces and found.complete is (pieces > 1)
    crumb = swell[1] + (swell[0] if pieces == 1 else 0.0)
    assert found.crumbs == pytest.approx(crumb * SPACING**3, rel=1e-9)


def test_the_cut_parts_where_the_edge_has_passed():
    """Neighbours across the plane hold until the edge has passed one of them."""
    passed = np.zeros(8, bool)
    assert len(left(row(8), severed=passed).volumes) == 1
    passed[3] = True
    assert left(row(8), severed=passed).volumes == pytest.approx([4 * SPACING**3] * 2)
