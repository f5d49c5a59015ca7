"""The outline of a piece: what closed forms say of it, and what it keeps of its skin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_food
from intsim.sim.piece_mesh import item_mesh, rigid_motion
from intsim.sim.severing import cut_scene_at
from intsim.task.pieces import cut_ends, piece_shape
from intsim.task.targets import CutSpec, Item, coefficient_of_variation, target
from mpm.scene.shapes import Shape, depth, section_area, surface, volume

GRAPE = Item("grape", Shape("ellipsoid", 0.022, 0.02, 0.018))
BANANA = Item("banana", Shape("cylinder", 0.165, 0.032, 0.032))


def split(item: Item, pieces: int, cuts: int) -> Item:
    """A food after some of the cuts of a split."""
    for _ in range(cuts):
        item = item.cut_at(target(CutSpec(item.name, pieces=pieces), item))
    return item


def test_a_piece_of_an_ellipsoid_is_what_its_closed_form_says():
    """The middle fifth and an end: volume by integration of the sections to a thousandth, the height of the largest
    section, and its foot on the board; all five together are the whole.
    """
    five = split(GRAPE, 5, 4)
    shapes = [piece_shape(five, k) for k in range(5)]
    assert [s.length for s in shapes] == pytest.approx([0.0044] * 5)
    assert sum(map(volume, shapes)) == pytest.approx(volume(GRAPE.shape), rel=1e-3)
    low, high = -0.011, -0.0066  # the end: its sections grow to the face of the cut
    radius = np.sqrt(1 - (high / 0.011) ** 2)
    end = shapes[0]
    cap = np.pi / 4 * 0.02 * 0.018 * ((high - low) - (high**3 - low**3) / (3 * 0.011**2))
    assert volume(end) == pytest.approx(cap, rel=1e-3)
    assert (end.width, end.height) == pytest.approx((0.02 * radius, 0.018 * radius), rel=1e-6)
    bottom, top = surface(replace(end, cut=end.length / 2 - 1e-6), np.zeros(1), np.zeros(1))
    assert (bottom[0], top[0]) == pytest.approx((0.0, end.height), abs=2e-6)
    there = replace(shapes[2], cut=0.001)
    assert section_area(there) == pytest.approx(np.pi / 4 * 0.02 * 0.018 * (1 - (0.001 / 0.011) ** 2), rel=1e-3)


def test_the_face_of_a_cut_has_no_skin():
    """A point near the face of a cut is as deep as its outline is away, one near the food's own end by that end."""
    two = split(GRAPE, 2, 1)
    half = piece_shape(two, 1)
    assert cut_ends(two, 1) == (True, False)
    near_face, near_end = np.array([[0.0, -0.0055 + 1e-4, 0.009], [0.0, 0.0055 - 1e-4, 0.009]])
    assert depth(half, near_face[None])[0] == pytest.approx(0.009, rel=0.02)
    assert depth(half, near_end[None])[0] == pytest.approx(1e-4, rel=0.05)
    whole = replace(half.table, bare=(False, False))
    assert half.table.digest != whole.digest and half.symmetric == (True, False)


def test_a_piece_with_parallel_sides_is_a_shorter_food():
    """The scene of each later cut of a banana in five is that of a fresh one of the remaining length, ends and all."""
    food = load_food("banana")
    for k in range(1, 4):
        item = split(BANANA, 5, k)
        along = target(CutSpec("banana", pieces=5), item)
        left = 0.165 * (5 - k) / 5
        fresh = Item("banana", Shape("cylinder", left, 0.032, 0.032))
        want = cut_scene_at(fresh, -left / 2 + 0.033, food)
        got = cut_scene_at(item, along, food)
        assert got.food.shape.ends == pytest.approx((-0.033, min(left - 0.033, 0.064)))
        if left / 2 > 0.033:
            assert got.as_dict()["numerics"] == want.as_dict()["numerics"]
        assert got.food.shape.kind == "cylinder" and got.edge == want.edge


def test_a_food_in_pieces_is_shown_at_its_whole_length():
    """Closed surfaces whose volume is the food's, over its length and the openings of the cuts; faces of cuts are
    flesh."""
    for item in (GRAPE, BANANA):
        five = split(item, 5, 4)
        shown = item_mesh(five)
        a, b, c = (shown.points[shown.triangles[:, k]] for k in range(3))
        assert np.einsum("ti,ti->", a, np.cross(b, c)) / 6 == pytest.approx(volume(item.shape), rel=0.02)
        along = (shown.points[:, :2] - [item.x, item.y]) @ item.axis
        assert np.ptp(along) == pytest.approx(item.shape.length + 4 * 0.004, rel=1e-6)
        faces = np.unique(np.round(along[shown.flesh], 6))
        assert len(faces) == 8 and not item_mesh(item).flesh.any()
        assert len(item_mesh(five, without=2).points) < len(shown.points)


def test_pieces_of_a_split_are_even_where_they_are_as_large():
    """A split of an ellipsoid by length leaves pieces of unequal volume, one of a cylinder equal ones: closed form."""
    assert coefficient_of_variation(split(BANANA, 5, 4).volumes()) == pytest.approx(0, abs=1e-9)
    edges = np.linspace(-1, 1, 6)
    parts = np.diff(edges - edges**3 / 3)
    assert coefficient_of_variation(split(GRAPE, 5, 4).volumes()) == pytest.approx(parts.std() / parts.mean(), rel=1e-3)


def test_the_rigid_motion_of_a_face_is_found():
    """A disc turned and shifted."""
    angle = 2 * np.pi * np.arange(12) / 12
    disc = np.column_stack([np.cos(angle), np.zeros(12), np.sin(angle)])
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    found, shift = rigid_motion(disc, disc @ turn.T + [0.1, 0.2, 0.3])
    assert found == pytest.approx(turn, abs=1e-12) and shift == pytest.approx([0.1, 0.2, 0.3])
