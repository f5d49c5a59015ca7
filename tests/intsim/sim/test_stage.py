"""Pictures of robot and food: what they show, and that geometry, light and looks belong together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_foods
from intsim.render.food import FOOD_LOOKS
from intsim.render.kitchen import FLOOR, THICKNESS, Kitchen, board_clutter
from intsim.render.view import PICTURE_CAMERAS, View
from intsim.task.suites import FOODS, sample_episode
from intsim.task.targets import BOARD_SIZE, BOARD_THICKNESS, Item
from mpm.scene.shapes import Shape

pytest.importorskip("mani_skill", reason="the extra [robot] is not installed")

PIXELS = 96
AWAY = np.array([0.0, -0.6, 0.0, -2.0, 0.0, 1.9, 0.78, 0.0, 0.0])  # joints whose hand is high above the board [rad]
LOW = np.array([0.0, 0.55, 0.0, -2.15, 0.0, 2.7, 0.78, 0.0, 0.0])  # joints whose hand is low over the board [rad]
CUCUMBER = Item("cucumber", Shape("cylinder", 0.12, 0.05, 0.05), 0.0, 0.0, np.pi / 2)


@pytest.fixture(scope="module")
def stage():
    """A stage with small pictures."""
    from intsim.sim.stage import Stage

    return Stage(PIXELS, PICTURE_CAMERAS)


def shown(stage, items, qpos=AWAY, background=0):
    """What the cameras see of foods."""
    stage.serve(items, 0)
    stage.place(qpos)
    return stage.pictures(background)


def like(pictures, colour) -> int:
    """Pixels of all views whose hue is nearer to a colour than a tenth."""
    seen = np.concatenate([p.reshape(-1, 3) for p in pictures.values()]).astype(float)
    seen /= np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-9)
    own = np.array(colour) / np.linalg.norm(colour)
    return int((seen @ own > np.cos(0.1)).sum())


def test_a_cut_face_is_seen_when_the_food_has_parted(stage):
    """The flesh of a cucumber is paler than its skin: it comes into view with a cut, and more of it with another."""
    flesh = FOOD_LOOKS["cucumber"].flesh
    counts = []
    wide = replace(CUCUMBER, pieces=())
    for cuts in ((), (0.0,), (-0.03, 0.03)):
        item = wide
        for along in cuts:
            item = item.cut_at(along)
        # shifted further apart than a cut leaves them, so that small pictures show the faces
        item = replace(item, pieces=tuple(replace(p, shift=8 * p.shift) for p in item.pieces))
        counts.append(like(shown(stage, [item]), flesh.first))
    assert counts[0] + 10 < counts[1] < counts[2]


def test_the_same_state_gives_the_same_bytes_and_another_kitchen_others(stage):
    """Whatever was shown in between; every kitchen is told apart from every other."""
    first = shown(stage, [CUCUMBER])
    others = [shown(stage, [CUCUMBER], background=k)["front"].astype(int) for k in (1, 7, 14)]
    shown(stage, [replace(CUCUMBER, x=0.05)], LOW, 3)
    again = shown(stage, [CUCUMBER])
    assert all(np.array_equal(first[name], again[name]) for name in PICTURE_CAMERAS)
    every = [first["front"].astype(int), *others]
    for k, one in enumerate(every):
        assert all(np.abs(one - other).mean() > 8 for other in every[k + 1 :])


def test_a_food_is_where_a_camera_sees_it(stage):
    """The middle of what changes when a food comes is where the view puts that food."""
    small = Item("tomato", Shape("ellipsoid", 0.05, 0.05, 0.05), 0.06, -0.05)
    far = replace(small, x=-0.1, y=0.12)
    for name in ("front", "side", "work"):
        a, b = (shown(stage, [item], AWAY)[name].astype(int) for item in (small, far))
        red = (a[..., 0] > 2 * a[..., 1]) & (np.abs(a - b).sum(axis=2) > 60)
        row, column = (np.median(axis) for axis in np.nonzero(red))
        view = View.standing(name, PIXELS)
        d = view.turn @ (np.array([small.x, small.y, 0.025]) - view.eye)
        wanted = view.focal * d[:2] / d[2] + PIXELS / 2
        assert abs(column + 0.5 - wanted[0]) < 2 and abs(row + 0.5 - wanted[1]) < 2.5


def test_the_hand_throws_a_shadow(stage):
    """Of the board and what is around it a part is darker with the hand low above than with the arm away."""
    small = Item("cherry", Shape("ellipsoid", 0.02, 0.02, 0.02), -0.15, 0.2)
    high, low = (shown(stage, [small], q)["work"].astype(float).mean(axis=2) for q in (AWAY, LOW))
    darker = low < 0.8 * high
    kept = np.abs(low - high) < 2
    assert darker.sum() > 50 and kept.sum() > 500


def test_the_knife_has_a_blade_and_a_dark_handle_beyond_it():
    """The edge is straight, as long as the knife's and at its height; the handle begins where the blade ends."""
    from calib.material.knife import load_knife
    from intsim.render.knife import WOOD, knife_mesh

    knife = load_knife("kitchen")
    mesh = knife_mesh(knife, 0.1)
    bottom = mesh.points[np.isclose(mesh.points[:, 2], 0.1 + knife.height)]
    assert np.ptp(bottom[:, 0]) == pytest.approx(knife.length) and mesh.points[:, 2].max() <= 0.1 + knife.height
    wood = mesh.triangles[mesh.paint_of == mesh.paints.index(WOOD)]
    assert (
        mesh.points[np.unique(wood)][:, 0].max() < -knife.length / 2 + 0.01 and np.ptp(mesh.points[wood][..., 0]) > 0.1
    )


@pytest.mark.parametrize("number", range(15))
def test_a_kitchen_stands_on_its_worktop_and_leaves_the_board_free(number):
    """Every kitchen has a lamp from above and furniture; nothing beside the board hangs in the air or is in the way."""
    kitchen = Kitchen.of(number)
    assert kitchen.lamp[2] < -0.3 and (kitchen.lamps > 0).all() and len(kitchen.around.triangles) > 300
    for x, y, r in kitchen.standing:
        near = np.hypot(*(kitchen.drawn.points[:, :2] - [x, y]).T) <= r + 1e-9
        own = kitchen.drawn.points[near]
        own = own[own[:, 2] > -THICKNESS - 1e-9]
        assert own[:, 2].min() == pytest.approx(-THICKNESS)
        assert abs(x) - r > BOARD_SIZE[0] / 2 or abs(y) - r > BOARD_SIZE[1] / 2
    assert kitchen.drawn.points[:, 2].min() >= FLOOR - 0.1


def test_nothing_on_the_table_hangs_in_the_air():
    """Of 200 tables with other foods each food lies on the board or on the table beside it, never across the rim; what
    lies about on the board is on the board, and apart from every food."""
    from intsim.sim.piece_mesh import standing_mesh

    foods = {name: food for name, food in load_foods().items() if name in FOODS}
    beside = 0
    for seed in range(200):
        episode = sample_episode("objects", seed, foods)
        for item in episode.others:
            assert item.base in (0.0, -BOARD_THICKNESS)
            beside += item.base != 0
        items = [episode.item, *episode.others]
        if seed < 20:
            for item in episode.others:
                assert standing_mesh(item).points[:, 2].min() == pytest.approx(item.base, abs=1e-6)
        for thing in board_clutter(items, seed):
            middle = (thing.points.min(axis=0) + thing.points.max(axis=0)) / 2
            assert (
                thing.points[:, 2].min() == 0 and (np.abs(thing.points[:, :2]) <= np.array(BOARD_SIZE) / 2 + 1e-9).all()
            )
            for item in items:
                off = middle[:2] - [item.x, item.y]
                inside = abs(off @ item.axis) < item.shape.length / 2 and abs(off @ item.across) < item.shape.width / 2
                assert not inside
    assert beside > 20
