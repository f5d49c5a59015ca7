"""A wedge pressed into a block by elements that are small where it touches."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fem_reference.indentation import Mesh, indent
from fem_reference.meshes import MeshError
from fem_reference.press import Elements, press
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

BLOCK = Shape("block", 0.03, 0.016, 0.02)
FOOD = Material(E=1e5, nu=0.35, rho=1000.0)
BLUNT = math.radians(70)


def test_the_wedge_pushes_as_in_the_press():
    """Elastic, 140 degrees: at 3 mm, where enough nodes touch, the press's force; the board carries it."""
    found = indent(BLOCK, FOOD, BLUNT, [2e-3, 3e-3], Mesh(2e-3, layers=2))
    other = press(BLOCK, FOOD, [2e-3, 3e-3], half_angle=BLUNT, elements=Elements(cells=3, order=2))
    assert found.force[-1] == pytest.approx(other.force[-1], rel=0.01)
    np.testing.assert_allclose(found.board, found.force, rtol=1e-4)
    assert found.penetration.max() < 0.05 * 2e-3


def test_without_lateral_contraction_a_section_is_enough():
    """nu = 0 and no flow: the force of the block is that of its section times its width."""
    food = replace(FOOD, nu=0.0)
    block = indent(BLOCK, food, BLUNT, [2e-3], Mesh(2e-3, layers=1))
    section = indent(BLOCK, food, BLUNT, [2e-3], Mesh(2e-3, layers=0))
    assert block.force[0] == pytest.approx(section.force[0] * BLOCK.width, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("angle", [90, pytest.param(140, marks=pytest.mark.long)])
def test_a_flowing_block_under_a_wedge(angle: int):
    """J2 flow: the force grows with the way, without the steps of contact by nodes, and hardly follows the elements."""
    soft, ways = replace(FOOD, yield_stress=8e3), [0.5e-3, 1e-3, 1.5e-3, 2e-3]
    coarse, fine = (indent(BLOCK, soft, math.radians(angle / 2), ways, Mesh(size, layers=2)) for size in (2e-3, 1.5e-3))
    np.testing.assert_allclose(coarse.force, fine.force, rtol=0.08)
    assert coarse.force[-1] == pytest.approx(fine.force[-1], rel=0.03)
    assert (np.diff(fine.force, 2) > -0.1 * fine.force[-1]).all()
    assert fine.force[-1] < 0.95 * indent(BLOCK, FOOD, math.radians(angle / 2), ways, Mesh(2e-3, layers=2)).force[-1]


def test_only_a_block_is_indented():
    """One line says what to use for another shape."""
    with pytest.raises(MeshError, match="not a sphere; use press"):
        indent(Shape("sphere", 0.03, 0.03, 0.03), FOOD, BLUNT, [1e-3], Mesh(2e-3))
