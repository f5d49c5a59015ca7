"""A plane that parts with a traction-separation law, the edge on it, and contact at sampled points."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import skfem as sk

from fem_reference.condensation import Condensation
from fem_reference.contact import Plane, Wedge
from fem_reference.cutting.cohesive import Cohesion, CutPlane
from fem_reference.laws import Linear
from fem_reference.solid import Solid
from fem_reference.surface import SlidingContact, SurfacePoints, Tie, nodal, sampled

LAW = Cohesion(toughness=80.0, strength=0.2e6, stiffness=5e9)
SOFT = Cohesion(1.0, 5.0, 100.0)


def strip() -> tuple[Solid, np.ndarray]:
    """Half a block of 1 m by 1 m in plane strain, and the facets on y = 0."""
    mesh = sk.MeshQuad.init_tensor(np.linspace(0, 1, 3), np.linspace(0, 1, 5))
    facets = mesh.facets_satisfying(lambda p: p[0] < 1e-9, boundaries_only=True)
    return Solid(mesh, Linear(1.0, 1.0), 2), facets


def test_the_area_under_the_law_is_the_toughness_whatever_the_tie():
    """Of both halves together, and all of it at the opening toughness over strength."""
    for stiffness in (2e9, 5e9, 1e11):
        law = Cohesion(80.0, 0.2e6, stiffness)
        v = np.linspace(0, law.last, 200_001)
        sigma = law.envelope(v)
        assert sigma.max() == pytest.approx(0.2e6, rel=2e-3)
        assert sigma[-1] == pytest.approx(0.0, abs=1e-6)
        area = np.concatenate([[0.0], np.cumsum((sigma[1:] + sigma[:-1]) / 2 * np.diff(v))])
        np.testing.assert_allclose(law.work(v), area, atol=1e-4 * 40)
        assert 2 * law.work(np.array([2 * law.last]))[0] == pytest.approx(80.0, rel=1e-12)


def test_unloading_goes_to_the_origin_and_gives_back_its_area():
    """Below the largest opening the traction is proportional; reloaded it meets the envelope where it had left it."""
    most = np.array([0.4 * LAW.last])
    top = LAW.envelope(most)
    for part in (0.0, 0.3, 1.0):
        sigma, slope = LAW.traction(part * most, most)
        np.testing.assert_allclose(sigma, part * top)
        if part < 1:
            np.testing.assert_allclose(slope, top / most)
        given_back = LAW.work(most) - LAW.paid(part * most, most)
        np.testing.assert_allclose(given_back, top * most / 2 * (1 - part**2))


def _surfaces() -> list[SlidingContact | Tie | CutPlane]:
    solid, facets = strip()
    dense, nodes = sampled(solid, facets, 6), nodal(solid, facets)
    wedge = Wedge(0.2, 0.3, 0.2, fillet=0.05, single=True)
    return [
        SlidingContact(dense, wedge, 3.0),
        SlidingContact(dense, wedge, 3.0, friction=0.2),
        Tie(nodes, 3.0),
        CutPlane(nodes, SOFT, wedge, band=0.6),
        CutPlane(nodes, SOFT, wedge, band=0.6, drag=4.0),
    ]


@pytest.mark.parametrize("which", range(5))
def test_the_stiffness_of_a_surface_is_the_derivative_of_its_force(which: int):
    """By central differences, at random displacements."""
    solid, _ = strip()
    surface, rng, h = _surfaces()[which], np.random.default_rng(which), 1e-7
    x = solid.nodes + 0.02 * rng.uniform(-1, 1, solid.u.shape) * [0, 1, 1]
    way = rng.uniform(-1, 1, x.shape) * [0, 1, 1]
    change = -(surface.force(x + h * way) - surface.force(x - h * way)) / (2 * h)
    assert np.abs(change).max() > 0.05
    np.testing.assert_allclose((surface.stiffness(x) @ way.ravel()).reshape(-1, 3), change, atol=1e-6)


def test_points_carry_the_surface_and_follow_it():
    """Areas add up, a linear field is met exactly, and forces on points have the resultant of those on the nodes."""
    solid, facets = strip()
    for points in (nodal(solid, facets), sampled(solid, facets, 5)):
        assert points.areas.sum() == pytest.approx(1.0)
        at = points.at(solid.nodes)
        np.testing.assert_allclose(at[:, 1], 0.0, atol=1e-12)
        np.testing.assert_allclose(points.at(solid.nodes * 3), 3 * at, atol=1e-12)
        forces = np.random.default_rng(0).normal(size=at.shape)
        np.testing.assert_allclose(points.spread(forces).sum(axis=0), forces.sum(axis=0), atol=1e-12)


def test_a_rounded_shoulder_against_its_outline():
    """Distance to the densely drawn outline of face, arc and flank; outside it is exact, its gradient of length 1."""
    half, spine, radius = 0.4, 2e-3, 6e-4
    wedge = Wedge(0.0, half, spine, fillet=radius, single=True)
    y, up = spine / 2 - radius, (spine / 2 - radius + radius / np.cos(half)) / np.tan(half)
    turn = np.linspace(0, half, 4000)
    arc = np.stack([y + radius * np.cos(turn), up - radius * np.sin(turn)])
    s = np.linspace(0, 1, 4000)
    outline = np.concatenate([arc[:, -1:] * s, arc, arc[:, :1] + np.array([[0.0], [4e-3]]) * s], axis=1)
    points = np.random.default_rng(1).uniform([0, 0, 1e-3], [0, 2.5e-3, 5e-3], (400, 3))
    d, n = wedge.distance(points)
    want = np.hypot(points[:, 1:2] - outline[0], points[:, 2:3] - outline[1]).min(axis=1)
    outside = d > 0
    assert 50 < outside.sum() < 350
    np.testing.assert_allclose(d[outside], want[outside], atol=2e-6)
    np.testing.assert_allclose(wedge.distance(points + 1e-8 * n)[0] - d, 1e-8, rtol=1e-4)


def test_a_single_face_pushes_what_is_beyond_the_plane_back():
    """Half a body whose closed faces overlap a little: the wedge's other face must not pull them further."""
    behind = np.array([[0.0, -1e-6, 0.01]])
    assert Wedge(0.0, 0.3).distance(behind)[1][0, 1] < 0
    d, n = Wedge(0.0, 0.3, single=True).distance(behind)
    assert n[0, 1] > 0 and d[0] < Wedge(0.0, 0.3).distance(behind)[0][0]


def test_every_point_costs_the_toughness_whoever_pays():
    """Random openings, closings and passes of the edge: what tie and edge take in all is R, once the point is cut."""
    rng = np.random.default_rng(3)
    points = SurfacePoints(sp.csr_matrix(np.ones((1, 1))), np.ones(1))
    shares = []
    for _ in range(5):
        wedge = Wedge(1.0, 0.3, single=True)
        plane = CutPlane(points, SOFT, wedge, band=0.5)
        x = np.array([[0.0, 0.0, 0.0]])
        work = 0.0
        steps = 2000
        openings = np.cumsum(np.append(0.0, rng.normal(size=11)))
        way = np.abs(np.interp(np.linspace(0, 11, steps), np.arange(12), openings)) * 0.02
        for k in range(steps):
            before = plane.tractions(x)[0]
            new = np.array([[0.0, way[k], 0.0]])
            wedge.height = 1.0 - 1.5 * k / (steps - 1)
            after = plane.tractions(new)[0]
            edge = 1.5 / (steps - 1) if k else 0.0
            work += 2 * (-0.5 * (before + after)[1] * (new - x)[0, 1] - 0.5 * (before + after)[2] * edge)
            plane.commit(new)
            x = new
        assert plane.cut[0] == 1.0
        shares.append(float(plane.spent(x)[0]))
        assert work == pytest.approx(SOFT.toughness, rel=5e-3)
    assert min(shares) < 0.1 and max(shares) > 0.3  # now the edge pays most, now the tie


@pytest.mark.parametrize("stiffness", [1e9, 1e11])
def test_a_strip_under_tension_follows_the_closed_form(stiffness: float):
    """Stress over displacement u of a strip of length l: u = v + l sigma / M, through softening and an unloading.

    The work is R times the area.
    """
    law = Cohesion(80.0, 0.2e6, stiffness)
    length, height, mu, lam = 0.002, 0.02, 2e6, 3e6
    mesh = sk.MeshQuad.init_tensor(np.linspace(0, length, 3), np.linspace(0, height, 5))
    solid = Solid(mesh, Linear(mu, lam), 2)
    facets = mesh.facets_satisfying(lambda p: p[0] < 1e-9, boundaries_only=True)
    solid.surfaces.append(CutPlane(nodal(solid, facets), law, None, 1e-3))
    solid.hold(np.arange(len(solid.nodes)), [2])
    end = np.flatnonzero(solid.nodes[:, 1] > length - 1e-9)
    modulus = lam + 2 * mu

    def stress(u: float) -> float:
        solid.hold(end, [1], u)
        solid.solve()
        return float(solid.reaction(end)[1]) / height

    most, work, last = 0.999 * law.last, 0.0, (0.0, 0.0)
    for u in np.linspace(0, most, 41)[1:]:
        got = stress(u)
        v = (u * modulus / length - law.slope * law.last) / (modulus / length - law.slope)
        want = law.slope * (law.last - v)
        if u < law.first + length * law.strength / modulus:
            want = u / (1 / law.stiffness + length / modulus)
        assert got == pytest.approx(want, abs=1e-5 * law.strength)
        work += (got + last[1]) / 2 * (u - last[0])
        last = u, got
        if abs(u / most - 0.5) < 0.01:
            top = stress(u)
            assert stress(0.25 * u) == pytest.approx(0.25 * top, rel=1e-6)
            assert stress(u) == pytest.approx(top, rel=1e-6)
    assert 2 * work == pytest.approx(80.0, rel=5e-3)


def test_condensation_is_exact():
    """The step of a condensed solid is that of the whole one."""
    solid, facets = strip()
    solid.hold(np.flatnonzero(solid.nodes[:, 1] > 1 - 1e-9), [1, 2])
    free = np.setdiff1d(np.arange(solid.u.size), np.fromiter(solid.fixed, int))
    k = solid.stiffness(solid.u)[free][:, free]
    kept = np.flatnonzero(np.isin(free, nodal(solid, facets).unknowns))
    small, load = Condensation(k, kept), np.random.default_rng(0).normal(size=len(free))
    rest = load[small.rest]
    step = np.linalg.solve(small.reduced, -(load[kept] + small.pull(rest)))
    np.testing.assert_allclose(k @ small.follow(step, rest), -load, atol=1e-10)
    plane = SlidingContact(nodal(solid, facets), Plane((0, 0, 0), (0, 1, 0)), 2.0)
    solid.surfaces.append(plane)
    solid.load[:, 1] = -1e-3
    solid.solve()
    residual, scale = solid.residual(solid.u)
    assert np.abs(residual[free]).max() < 1e-6 * scale
    assert plane.penetration(solid.nodes + solid.u) > 0
