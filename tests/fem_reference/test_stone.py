"""The reference of a stone in a cube: limits that are known, and convergence."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fem_reference.stone import StoneInCube
from mpm.scene.material import Material

FLESH = Material(E=1e6, nu=0.35, rho=1000.0)
CUBE = StoneInCube(0.048, 0.012, FLESH, 4)


def test_a_tiny_stone_changes_nothing():
    """The cube is a bar between plates, whose stiffness is E times its edge."""
    assert replace(CUBE, radius=1e-3).pressing() == pytest.approx(FLESH.E * CUBE.size, rel=2e-3)


def test_a_stone_in_much_flesh_sinks_as_in_an_infinite_solid():
    """24 pi mu (1 - nu) a / (5 - 6 nu) (a bonded rigid sphere in an infinite solid; Stokes' law at nu = 1/2): the free
    sides and the board, each some radii off, are of the order of a radius over that."""
    infinite = 24 * math.pi * FLESH.shear * (1 - FLESH.nu) / (5 - 6 * FLESH.nu)
    small = replace(CUBE, radius=0.006, cells=8)
    assert small.sinking() == pytest.approx(infinite * 0.006, rel=0.15)
    assert small.sinking(open_above=0.006) < small.sinking()


def test_the_mesh_converges():
    """Twice as many elements each way change the stiffness by one per cent and the sinking by three."""
    fine = replace(CUBE, cells=8)
    assert CUBE.pressing() == pytest.approx(fine.pressing(), rel=0.015)
    assert CUBE.sinking() == pytest.approx(fine.sinking(), rel=0.04)
