"""Elements that do not lock, sections in plane strain, and the disc between plates that stick to it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import skfem as sk

from fem_reference.bonded import apparent_modulus, gent_lindley, linear_in_radius, ritz
from fem_reference.laws import Corotated, Law, Linear, NeoHookean, Plastic
from fem_reference.press import Elements, press
from fem_reference.solid import Solid
from mpm.scene.material import Material
from mpm.scene.shapes import Shape

SQUARE = sk.MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 4))
CUBE = sk.MeshHex.init_tensor(*[np.linspace(0, 1, 2)] * 3)
DISC = Shape("upright_cylinder", 0.05, 0.05, 0.03)
FOOD = Material(E=1e5, nu=0.49, rho=1000.0)


def shaken(solid: Solid, size: float) -> np.ndarray:
    """Random displacements that no axis is free of but x in a section."""
    u = size * np.random.default_rng(0).uniform(-1, 1, solid.u.shape)
    u[:, 0] *= not solid.plane
    return u


@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize("mesh", [SQUARE, CUBE], ids=["section", "cube"])
@pytest.mark.parametrize("law", [Linear(1.0, 2.0), Corotated(1.0, 2.0), NeoHookean(1.0, 2.0), Plastic(1.0, 2.0, 0.1)])
def test_the_tangent_is_the_derivative_of_the_forces(law: Law, mesh: sk.Mesh, mixed: bool):
    """Forces are the derivative of the energy, and the stiffness that of the forces, by central differences."""
    solid = Solid(mesh, law, 2, mixed)
    u, way, h = shaken(solid, 0.04), shaken(solid, 1.0)[::-1], 1e-6
    before, after = solid.forces(u - h * way)[0], solid.forces(u + h * way)[0]
    stiffness = solid.stiffness(u)
    on = slice(1, 3) if solid.plane else slice(3)
    change = ((after - before) / (2 * h))[:, on]
    np.testing.assert_allclose(
        (stiffness @ way.ravel()).reshape(-1, 3)[:, on], change, atol=1e-8 * np.abs(change).max()
    )
    if law.symmetric:
        work = (solid.energy(u + h * way) - solid.energy(u - h * way)) / (2 * h)
        assert work == pytest.approx(float((solid.forces(u)[0] * way).sum()), rel=1e-7)
        assert abs(stiffness - stiffness.T).max() < 1e-12


@pytest.mark.parametrize("mesh", [SQUARE, CUBE], ids=["section", "cube"])
def test_a_homogeneous_deformation_is_exact_in_mixed_elements(mesh: sk.Mesh):
    """Patch test: the projection of a constant change of volume is that change."""
    plain, mixed = (Solid(mesh, NeoHookean(1.0, 2.0), 2, on) for on in (False, True))
    slope = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.2], [0.0, -0.05, -0.15]])
    u = plain.nodes @ slope.T
    np.testing.assert_allclose(mixed.forces(u)[0], plain.forces(u)[0], atol=1e-13)


@pytest.mark.parametrize("mixed", [False, True])
def test_a_section_is_a_slab_that_is_held_along_x(mixed: bool):
    """Forces per width of a section are those of a slab of hexahedra whose displacements do not depend on x."""
    section = Solid(SQUARE, Corotated(1.0, 2.0), 2)
    width = 0.7
    slab = Solid(
        sk.MeshHex.init_tensor(np.array([0, width]), np.linspace(0, 1, 3), np.linspace(0, 1, 4)), section.law, 2
    )
    u = shaken(section, 0.05)
    places = {tuple(np.round(p[1:], 6)): k for k, p in enumerate(section.nodes)}
    same = np.array([places[tuple(np.round(p[1:], 6))] for p in slab.nodes])
    force = np.zeros_like(section.u)
    np.add.at(force, same, slab.forces(u[same])[0] / width)
    np.testing.assert_allclose(force[:, 1:], section.forces(u)[0][:, 1:], atol=1e-12)
    assert slab.energy(u[same]) / width == pytest.approx(section.energy(u))


def test_formulas_of_a_bonded_disc_in_their_regimes():
    """A slender bar has Young's modulus, a thin disc that of confined compression; formulas bracket what is between."""
    for nu in (0.3, 0.49):
        confined = (1 - nu) / ((1 + nu) * (1 - 2 * nu))
        assert apparent_modulus(0.02, nu) == pytest.approx(1.0, rel=0.01)
        assert apparent_modulus(100.0, nu) == pytest.approx(confined, rel=0.05)
        assert linear_in_radius(0.02, nu) == pytest.approx(1.0, rel=0.01)
        assert linear_in_radius(1000.0, nu) == pytest.approx(confined, rel=0.02)
    assert gent_lindley(2.5, 0.4999) == pytest.approx(apparent_modulus(2.5, 0.4999), rel=0.05)
    assert gent_lindley(25 / 30, 0.45) < 0.8 * apparent_modulus(25 / 30, 0.45)
    for ratio in (0.25, 0.83, 2.5):  # bounds: fewer functions are stiffer
        assert (
            linear_in_radius(ratio, 0.49) > ritz(ratio, 0.49, 6) > ritz(ratio, 0.49, 12) > apparent_modulus(ratio, 0.49)
        )


@pytest.mark.parametrize("nu", [0.3, 0.45, 0.49])
def test_a_bonded_disc_of_mixed_elements_does_not_lock(nu: float):
    """Within 0.7 % of the limit on two elements over half the height, nearer on finer ones, at any Poisson's ratio."""
    strain = 1e-4
    want = apparent_modulus(25 / 30, nu) * FOOD.E * math.pi * 0.025**2 * strain
    food = replace(FOOD, nu=nu)

    def error(cells: int, mixed: bool = True) -> float:
        elements = Elements(cells=cells, order=2, mixed=mixed)
        return float(press(DISC, food, [strain * DISC.height], bonded=True, elements=elements).force[0]) / want - 1

    coarse, fine = error(1), error(2)
    assert 0 < fine < 0.5 * coarse
    assert fine < 7e-3
    if nu == 0.49:
        assert error(2, mixed=False) > 0.05


@pytest.mark.slow
def test_a_punch_on_mixed_elements_sinks_at_prandtls_load():
    """Flat punch of half width 1 on a block of 3 by 3 in plane strain: mean pressure (2 + pi) k within 3 %."""
    n, wide, depth, steps = 3, 3.0, 0.02, 4
    shrink = np.linspace(0, 1, 2 * n + 1) ** 2  # elements become small at the punch's edge
    across = np.concatenate([1 - np.linspace(1, 0, n + 1) ** 2, 1 + (wide - 1) * shrink[1:]])
    mesh = sk.MeshQuad.init_tensor(across, -wide * shrink[::-1])
    solid = Solid(mesh, Plastic(385.0, 577.0, 1.0), 2, mixed=True)
    _, y, z = solid.nodes.T
    solid.hold(np.flatnonzero((y < 1e-9) | (y > wide - 1e-9)), [1])
    solid.hold(np.flatnonzero(z < 1e-9 - wide), [2])
    under = np.flatnonzero((z > -1e-9) & (y < 1 + 1e-9))
    for k in range(1, steps + 1):
        solid.hold(under, [2], -depth * k / steps)
        solid.solve()
    assert -solid.reaction(under)[2] == pytest.approx((2 + math.pi) / math.sqrt(3), rel=0.03)
