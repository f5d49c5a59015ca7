"""The food's surface: closed, as large as the food, and moving with its particles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.discretisation.particles import seed
from mpm.output.snapshot import Snapshot, SnapshotRecorder
from mpm.output.surface import Surface, half_of
from mpm.runtime import Runtime
from mpm.scene import Numerics, Scene
from mpm.scene.shapes import SHAPE_KINDS, Shape, volume
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM


def enclosed(points: np.ndarray, triangles: np.ndarray) -> float:
    """Volume within triangles that are seen from outside against the clock, by the divergence theorem."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def moved(scene: Scene, f: np.ndarray, shift: np.ndarray) -> tuple[Surface, np.ndarray, np.ndarray]:
    """A scene's surface, and its vertices after the affine motion ``f x + shift`` of the particles: found and exact."""
    seeds = seed(scene)
    surface = Surface(scene.food.shape, seeds, scene.mirrors)
    blank = np.zeros(len(seeds.x))
    found = surface.points(Snapshot(0.0, 0.0, 0.0, seeds.x @ f.T + shift, blank, blank > 0))
    return surface, found, surface.rest @ f.T + shift


@pytest.mark.parametrize("kind", SHAPE_KINDS)
def test_halves_are_closed_and_have_the_volume(kind: str) -> None:
    """Each edge belongs to two triangles that pass it in opposite directions; the rings inscribed into the outline hold
    0.3 % less."""
    shape = Shape(kind, 0.06, 0.03, 0.024)
    held = 0.0
    for side in (1.0, -1.0):
        half = half_of(shape, 1.5e-3, side)
        edges = np.concatenate([half.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        assert len(np.unique(edges, axis=0)) == len(edges)
        assert {tuple(e) for e in edges} == {(b, a) for a, b in edges}
        held += enclosed(half.points, half.triangles)
        y = half.points[:, 1] * side
        assert y.min() == 0.0 and y.max() == pytest.approx(0.03)
    assert held == pytest.approx(volume(shape), rel=3e-3)


@pytest.mark.parametrize("kind", SHAPE_KINDS)
def test_parts_of_different_length_make_the_whole_food(kind: str) -> None:
    """Cut off its middle the food has a closed surface around its whole volume, to 1 % (coarser rings than above)."""
    shape = Shape(kind, 0.06, 0.03, 0.024, 0.012)
    scene = replace(PRISM, food=replace(PRISM.food, shape=shape))
    surface = Surface(shape, seed(scene), scene.mirrors)
    assert enclosed(surface.rest, surface.triangles) == pytest.approx(volume(shape), rel=1e-2)
    assert (surface.rest[:, 1].min(), surface.rest[:, 1].max()) == pytest.approx(shape.ends)


@pytest.mark.parametrize("mirror", [True, False])
def test_vertices_follow_an_affine_motion_exactly(mirror: bool) -> None:
    """Stretched, and of the whole food sheared and shifted too, every vertex is where the motion takes it, with thinned
    particles too."""
    scene = replace(PRISM, numerics=Numerics(dx=3e-3, mirror=mirror, far=4.5e-3))
    f, shift = np.diag([1.1, 0.9, 0.8]), np.array([0.0, 0.0, 2e-3])
    if not mirror:
        f = f + np.array([[0.0, 0.1, 0.0], [0.0, 0.0, 0.2], [0.05, 0.0, 0.0]])
        shift = np.array([1e-3, -2e-3, 2e-3])
    surface, found, exact = moved(scene, f, shift)
    np.testing.assert_allclose(found, exact, atol=1e-8)
    shape = scene.food.shape
    assert enclosed(surface.rest, surface.triangles) == pytest.approx(volume(shape), rel=1e-6)


def test_halves_part_where_their_particles_do() -> None:
    """A shift of one half moves its vertices alone: what lies beside the cut does not drag the other side along."""
    scene = replace(PRISM, numerics=Numerics(dx=3e-3, mirror=False))
    seeds = seed(scene)
    surface = Surface(scene.food.shape, seeds, scene.mirrors)
    right = seeds.x[:, 1] > 0
    blank = np.zeros(len(right))
    found = surface.points(Snapshot(0.0, 0.0, 0.0, seeds.x + np.outer(right, [0.0, 2e-3, 0.0]), blank, right))
    half = len(found) // 2
    np.testing.assert_allclose(found[:half], surface.rest[:half], atol=1e-9)
    np.testing.assert_allclose(found[half:] - surface.rest[half:], np.tile([0.0, 2e-3, 0.0], (half, 1)), atol=1e-8)


def test_stress_of_the_surface_lies_within_that_of_the_particles() -> None:
    """A weighted mean: nothing is overshot, and what is uniform stays so."""
    seeds = seed(PRISM)
    surface = Surface(PRISM.food.shape, seeds, PRISM.mirrors)
    values = np.random.default_rng(0).uniform(1.0, 2.0, len(seeds.x))
    found = surface.values(values)
    assert len(found) == len(surface.rest) and 1.0 < found.min() < found.max() < 2.0
    np.testing.assert_allclose(surface.values(np.full(len(seeds.x), 3.0)), 3.0)


def test_a_watch_looks_at_even_parts_of_a_run_and_sees_the_cut() -> None:
    """Time and stroke rise evenly up to the end, particles are severed behind the edge, and the surface stays above the
    board."""
    simulation, watch = Simulation(PRISM, Runtime(threads=1)), SnapshotRecorder(5)
    record = simulation.run(snapshots=watch)
    looks = watch.taken
    np.testing.assert_allclose([look.time for look in looks], record.time[-1] * np.arange(1, 6) / 5, rtol=0.05)
    assert looks[-1].stroke == record.stroke[-1]
    assert [look.severed.sum() for look in looks] == sorted(look.severed.sum() for look in looks)
    assert looks[0].severed.sum() < looks[-1].severed.sum() < len(looks[-1].x)
    surface = Surface(PRISM.food.shape, simulation.setup.seeds, PRISM.mirrors)
    end = surface.points(looks[-1])
    assert end[:, 2].min() > -0.5e-3
    assert enclosed(end, surface.triangles) == pytest.approx(volume(PRISM.food.shape), rel=0.02)


@pytest.mark.parametrize(("kind", "ends"), [("cylinder", 2), ("ellipsoid", 0)])
def test_flesh_is_seen_on_flat_ends_and_where_the_cut_has_reached(kind: str, ends: int) -> None:
    """A food with parallel sides is a piece of a longer one: its ends are flesh before anything is cut. Of the faces a
    whole food shows nothing, one cut down to half its height the upper half, and one cut through all."""
    scene = replace(PRISM, food=replace(PRISM.food, shape=Shape(kind, 0.03, 0.024, 0.024)))
    seeds = seed(scene)
    surface = Surface(scene.food.shape, seeds, scene.mirrors)
    flesh, blank = surface.parts[1], np.zeros(len(seeds.x))
    y, z = (surface.rest[flesh][:, :, k].mean(axis=1) for k in (1, 2))
    for depth in (0.0, 0.012, 0.024):
        look = Snapshot(0.0, depth, 0.0, seeds.x, blank, seeds.x[:, 2] > 0.024 - depth)
        seen = surface.bare(look)
        assert seen[np.abs(y) > 1e-3].all() and len(np.unique(np.sign(y[np.abs(y) > 1e-3]))) == ends
        on_face = np.abs(y) < 1e-3
        assert seen[on_face & (z > 0.027 - depth)].all() and not seen[on_face & (z < 0.021 - depth)].any()
    left, right = surface.rest[surface.rims].transpose(1, 0, 2)
    np.testing.assert_allclose(left, right, atol=1e-12)
