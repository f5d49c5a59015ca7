"""Cuts through fruits with rind and core: new surface takes what the layers take, wherever grid and mirrors are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.layers import mean_toughness
from mpm.scene.material import Material
from mpm.scene.shapes import Shape, section_area
from tests.mpm.scenes import cut

BLADE = Knife("thin", 0.2e-3, np.deg2rad(1.0), 0.06, 0.4)
FLESH = Material(
    E=1e6, nu=0.35, rho=1000, R=80.0, R_initiation=80.0, initiation_depth=2e-4, tensile_strength=1e5, loss_factor=0.02
)
RIND = {"R_rind": 500.0, "rind_thickness": 2.5e-3}
FRUIT = replace(FLESH, **RIND, R_core=30.0, core_ratio=0.5, R_initiation=500.0)


def scene(kind: str, material: Material = FRUIT, *, shift=(0.0, 0.0, 0.0), mirror: bool = True, seed: int = 0) -> Scene:
    """A fruit 36 mm wide on a board, cut through by a thin smooth blade; a cylinder is 30 mm long."""
    height = 0.018 if kind in ("half_cylinder", "hemisphere") else 0.036
    length = 0.03 if kind == "cylinder" else 0.036
    return Scene(
        Food(Shape(kind, length, 0.036, height), material),
        BLADE,
        Motion(height, 0.01),
        Board(0.5),
        EdgeLaw(zone=3e-3),
        Numerics(dx=2.5e-3, gravity=0.0, grid_shift=shift, mirror=mirror, seed=seed),
    )


def joules(of: Scene) -> float:
    """Integral of the toughness over the section [J]."""
    return mean_toughness(of.food.shape, of.food.material) * section_area(of.food.shape)


@pytest.mark.parametrize("kind", ["sphere", "half_cylinder"])
@pytest.mark.parametrize("where", [{}, {"shift": (0.5, 0.0, 0.57), "seed": 1}])
def test_new_surface_takes_the_integral_of_the_layers(kind, where):
    """Whole and half fruits with rind and core, the grid here and elsewhere."""
    of = scene(kind, **where)
    record = cut(of)
    assert record.surface[-1] == pytest.approx(joules(of), rel=0.02)
    assert record.parted == pytest.approx(1.0, abs=0.02)


def test_the_lower_rind_is_where_the_edge_comes_out():
    """A rind all round makes the force rise again above the board; what a core saves, it saves in the middle."""
    plain, whole = cut(scene("cylinder", FLESH)), cut(scene("cylinder"))
    middle, low = ((r.stroke > a) & (r.stroke < b) for r, a, b in ((whole, 16e-3, 20e-3), (whole, 31e-3, 34e-3)))
    assert whole.resolved[low].mean() > 1.3 * whole.resolved[middle].mean()
    late = (plain.stroke > 31e-3) & (plain.stroke < 34e-3)
    assert plain.resolved[late].mean() < 0.7 * plain.resolved[(plain.stroke > 16e-3) & (plain.stroke < 20e-3)].mean()
    assert whole.pieces is not None and whole.pieces.complete


def test_a_rind_of_flesh_is_no_rind():
    """Layers as tough as the flesh leave the work as it is, but for the outline, which is followed more closely."""
    same = replace(FLESH, R_rind=FLESH.R, rind_thickness=2.5e-3, R_core=FLESH.R, core_ratio=0.5)
    assert cut(scene("half_cylinder", same)).work == pytest.approx(cut(scene("half_cylinder", FLESH)).work, rel=0.02)


def test_a_cut_that_has_started_takes_the_resistance_of_its_layer():
    """The threshold starts the cut; from there on the edge is on the rind, and not on flesh."""
    shallow = replace(scene("half_cylinder"), motion=Motion(1.5e-3, 0.01))
    tough = replace(shallow, food=replace(shallow.food, material=replace(FLESH, **RIND, initiation_depth=1e-3)))
    flesh = replace(shallow, food=replace(shallow.food, material=replace(FLESH, initiation_depth=1e-3)))
    assert cut(tough).peak > 2.5 * cut(flesh).peak


@pytest.mark.parametrize("band", [0.25, 1.0])
def test_the_edge_pays_the_layer_that_it_is_in(band):
    """A rind thinner than a cell is a step of the force at its lower side, whatever band of ties the edge cuts."""
    stiff = replace(FLESH, E=5e6, tensile_strength=1e6, loss_factor=0.05, R_rind=800.0, rind_thickness=2e-3)
    block = Food(Shape("block", 0.024, 0.024, 0.02), stiff)
    edge = EdgeLaw(zone=3e-3, slip=0.3e-3)
    of = replace(scene("sphere"), food=block, motion=Motion(5e-3, 0.01), edge=edge)
    record = cut(replace(of, numerics=replace(of.numerics, edge_band=band)))
    force = np.interp([1e-3, 1.7e-3, 2.6e-3, 4e-3], record.stroke, record.resolved)
    flesh = 80 * 0.02 + 800 * 0.004  # the flanks are rind, too
    assert force[:2] == pytest.approx(800 * 0.024, rel=0.03)
    assert force[2:] == pytest.approx(flesh, rel=0.12)
