"""Foods under a knife on an arm that yields: what is cut, what it costs, and what is passed on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_food
from intsim.sim.coupling import MAX_CELLS, READY_CLEARANCE, Coupling
from intsim.sim.severing import MIN_CELLS, cut_scene_at
from intsim.task.planner import BladeDescent, plan_cut
from intsim.task.targets import CutSpec, Item, target
from mpm.live import LiveCut
from mpm.scene.outline import ACROSS, ALONG, Outline, Sections, places
from mpm.scene.shapes import Shape

FOODS = {"strawberry": load_food("strawberry")}
BERRY = Item("strawberry", Shape("ellipsoid", 0.04, 0.032, 0.032), x=0.03, y=-0.02, yaw=1.2)
GRAPES = {"grape": load_food("grape")}
GRAPE = Item("grape", Shape("ellipsoid", 0.022, 0.02, 0.02))
STIFF, LAG, SPAN = 1754.0, 0.1, 0.01


def follow(coupling: Coupling, poses: np.ndarray) -> tuple[float, float]:
    """Move along commanded poses behind an arm that yields downwards; the largest force and the lowest place of the
    edge."""
    pose, force, most, low = poses[0].copy(), np.zeros(3), 0.0, np.inf
    before = poses[0]
    for command in poses:
        for part in np.arange(1, 6) / 5:
            wanted = before + part * (command - before)
            wanted[2] += force[2] / STIFF
            pose = pose + (wanted - pose) * (1 - np.exp(-SPAN / LAG))
            pose[2] = max(pose[2], 0.0)
            force = coupling.move(pose, SPAN)
            most, low = max(most, float(force[2])), min(low, float(pose[2]))
        before = command
    return most, low


def test_a_plan_to_the_board_stops_short_and_a_deeper_one_cuts_through():
    """Behind the arm of ManiSkill's Panda; the cut ends with the food in two and its pieces apart, and the impulse is
    upwards."""
    short = Coupling([BERRY], FOODS)
    most, low = follow(short, plan_cut(BERRY, 0.004).pose)
    assert low > 1e-3 and len(short.done) == 1
    through = Coupling([BERRY], FOODS)
    peak, bottom = follow(through, plan_cut(BERRY, 0.004, BladeDescent(depth=-0.03, hold=0.5)).pose)
    assert bottom < 1e-3 and through.severed and through.uncut() == 0
    assert peak == pytest.approx(most, rel=0.1)
    (done,) = through.done
    assert done.along == pytest.approx(0.004, abs=5e-4) and done.record is not None
    assert done.record.momentum_residual < 1e-9
    assert through.impulse[2] > 0 and abs(through.impulse[0]) < 0.05 * through.impulse[2]
    assert len(through.items[0].pieces) == 2 and through.live is None


def test_a_cut_ends_where_the_knife_stands_and_nothing_holds():
    """Not while it comes down, and not where it stands in food that holds: with the food in two it need not reach the
    board."""
    coupling = Coupling([BERRY], FOODS)
    pose = np.array([BERRY.x, BERRY.y, 0.045, BERRY.yaw - np.pi / 2, 0.0])
    while coupling.uncut() > 0:
        pose[2] -= 5e-4
        coupling.move(pose, SPAN)
        if 0.4 < coupling.uncut() < 0.5:
            coupling.move(pose, SPAN)
            assert coupling.live is not None
    assert pose[2] > 2e-4 and coupling.live is not None and not coupling.severed
    coupling.move(pose, SPAN)
    assert coupling.live is None and coupling.severed and len(coupling.items[0].pieces) == 2


def test_a_knife_that_misses_feels_nothing():
    """Beside the food there is no cut, and above it nothing is simulated."""
    coupling = Coupling([BERRY], FOODS)
    most, _ = follow(coupling, plan_cut(BERRY, 0.1).pose)
    assert most == 0 and not coupling.done and coupling.live is None
    coupling.move(
        np.array([BERRY.x, BERRY.y, BERRY.shape.height + 2 * READY_CLEARANCE, BERRY.yaw - np.pi / 2, 0.0]), SPAN
    )
    assert coupling.live is None


def test_a_cut_begins_from_above_alone():
    """A knife that saws on in the gap, or comes from the side, begins no cut; lifted over the food it does."""
    coupling = Coupling([BERRY], FOODS)
    poses = plan_cut(BERRY, 0.0, BladeDescent(depth=-0.03, hold=0.5)).pose
    low = int(np.argmin(poses[:, 2]))
    follow(coupling, poses[: low + 10])
    assert coupling.severed
    on_the_board = np.array([BERRY.x, BERRY.y, 1e-3, BERRY.yaw - np.pi / 2, 0.0])
    for way in np.linspace(0, 0.015, 30):
        coupling.move(on_the_board + [*(way * BERRY.axis), 0, 0, 0], SPAN)
    assert len(coupling.done) == 1 and coupling.live is None
    start = on_the_board + [0, 0, 0.1, 0, 0]
    second = plan_cut(BERRY, 0.012, BladeDescent(depth=-0.03, hold=0.5), start=start).pose
    follow(coupling, second)
    assert len(coupling.done) == 2 and len(coupling.items[0].pieces) == 3


def test_a_slice_too_thin_is_said_once():
    """Where the solver would need cells that take too long, the cut is not simulated, and nothing else is tried until
    the knife is up."""
    coupling = Coupling([BERRY], FOODS)
    most, _ = follow(coupling, plan_cut(BERRY, -0.0198).pose)
    assert most == 0
    (done,) = coupling.done
    assert done.severed is None and "take too long" in done.why and not coupling.severed


def test_a_cut_that_breaks_down_is_said_and_not_begun_again(monkeypatch):
    """The force ends, the reason is kept, and the food stays in one piece."""
    move, calls = LiveCut.move, [0]

    def broken(self, height, slide, span):
        calls[0] += 1
        if calls[0] == 40:
            self._held.state.x.fill(1.0)
        return move(self, height, slide, span)

    monkeypatch.setattr(LiveCut, "move", broken)
    coupling = Coupling([BERRY], FOODS)
    follow(coupling, plan_cut(BERRY, 0.0).pose)
    (done,) = coupling.done
    assert done.severed is None and "stopped" in done.why
    assert len(coupling.items[0].pieces) == 1


def test_the_draw_along_the_edge_is_passed_on_only_where_it_is_asked_for():
    """A slice needs less force than a press where the solver sees the draw; the way across the blade is noted, not
    simulated."""
    path = plan_cut(BERRY, 0.0, BladeDescent(style="slice", depth=-0.03)).pose
    pressed, drawn = Coupling([BERRY], FOODS), Coupling([BERRY], FOODS, draws=True)
    hard, _ = follow(pressed, path)
    easy, _ = follow(drawn, path)
    assert 0 < easy < 0.9 * hard
    aside = Coupling([replace(BERRY, yaw=np.pi / 2)], FOODS)
    poses = plan_cut(aside.items[0], 0.0, BladeDescent(depth=-0.03)).pose
    poses[:, 1] += np.where(poses[:, 2] < 0.02, 2e-3, 0.0)
    follow(aside, poses)
    assert aside.aside == pytest.approx(2e-3, rel=0.2)


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_a_rock_is_followed_at_the_end_that_is_down(flip):
    """The lower end cuts first: there the food opens, and there its force pushes, which turns the knife back, whichever
    direction of the edge its angle is counted in. The edge comes down level and the berry is in two.
    """
    coupling = Coupling([BERRY], FOODS, draws=True)
    path = plan_cut(BERRY, 0.0, BladeDescent(style="rock", depth=0.0)).pose
    if flip < 0:
        path[:, 3:] = path[:, 3:] + [np.pi, 0.0]
        path[:, 4] *= -1.0
    edge = np.array([np.cos(path[-1, 3]), np.sin(path[-1, 3])])
    half = int(np.argmax(path[:, 2] < 0.6 * BERRY.shape.height))
    for pose in path[:half]:
        coupling.move(pose, 0.05)
    tilt = float(path[half - 1, 4])
    up = np.array([0.0, 0.0, 1.0])
    turning = coupling.torque @ np.cross([*edge, 0.0], up)  # raises the end in the direction of the edge
    assert coupling.force[2] > 0 and turning * tilt < 0
    assert coupling.point(path[half - 1]) == pytest.approx([*BERRY.at(0.0), path[half - 1, 2]], abs=5e-4)
    mesh = coupling.mesh()
    assert mesh is not None
    _, points, _, flesh = mesh
    face, along = points[flesh], (points[flesh][:, :2] - BERRY.at(0.0)) @ edge
    opened = np.abs((face[:, :2] - BERRY.at(0.0)) @ BERRY.axis) > 0.2e-3
    assert np.mean(along[opened]) * tilt < 0
    for pose in path[half:]:
        coupling.move(pose, 0.05)
    assert coupling.severed and coupling.pitch > np.radians(3.0)


def test_a_rock_off_the_foods_middle_is_the_same_cut():
    """The knife's middle beside the food's axis: what counts is the point of the edge above it; the same largest force
    to 3 %, and the torque is about that point."""
    found = []
    for off in (0.0, 0.03):
        coupling = Coupling([BERRY], FOODS, draws=True)
        path = plan_cut(BERRY, 0.0, BladeDescent(style="rock", depth=0.0)).pose
        edge = np.column_stack([np.cos(path[:, 3]), np.sin(path[:, 3]), np.tan(path[:, 4])])
        path[:, :3] -= off * edge
        rows = [(coupling.move(pose, 0.05)[2], np.linalg.norm(coupling.torque)) for pose in path]
        found.append(np.max(rows, axis=0))
        assert coupling.severed
    assert found[1] == pytest.approx(found[0], rel=0.03)


def cap(low: float, high: float) -> Shape:
    """What lies between two places of the grape, by the closed form of an ellipsoid, lying on the board."""
    y = low + (places(ALONG) + 1) / 2 * (high - low)
    radius = np.sqrt(np.maximum(1 - (2 * y / GRAPE.shape.length) ** 2, 0.0))
    most, across = radius.max(), np.sqrt(1 - places(ACROSS) ** 2)
    rise = np.outer(radius / most, across)
    table = Sections(-radius / most, radius / most, (1 - rise) / 2, (1 + rise) / 2)
    outline = Outline("cap", "0" * 64, "closed form", table)
    return Shape("outline", high - low, most * GRAPE.shape.width, most * GRAPE.shape.height, 0.0, outline)


def press(coupling: Coupling, along: float) -> float:
    """Press the edge straight through the food there and lift it: the largest force at heights that are the same for
    every piece of a grape, as a sharp peak between two of them is missed."""
    item, most = coupling.items[0], 0.0
    for height in [*np.arange(GRAPE.shape.height + 0.012, 0, -5e-4), 0.0, 0.0, 0.04]:
        pose = np.array([*item.at(along), height, item.yaw - np.pi / 2, 0.0])
        most = max(most, float(coupling.move(pose, 0.0125)[2]))
    return most


@pytest.mark.slow  # each outline is another size of the solver's fields, compiled
def test_each_cut_of_five_is_that_of_a_food_with_the_piece_s_shape():
    """A grape in five: five pieces, and each later cut takes the force, to 0.1 %, of a food whose outline is the closed
    form of the piece that is left, lying alone on the board; the last differ from the first by more.
    """
    coupling, spec, found = Coupling([GRAPE], GRAPES), CutSpec("grape", pieces=5), []
    for k in range(4):
        item = coupling.items[0]
        along = target(spec, item)
        found.append(press(coupling, along))
        assert coupling.done[-1].severed and len(coupling.items[0].pieces) == k + 2
        if k:
            left = item.pieces[-1]
            alone = Coupling([Item("grape", cap(left.low, left.high))], GRAPES)
            want = press(alone, along - left.shift - (left.low + left.high) / 2)
            assert alone.severed and found[-1] == pytest.approx(want, rel=1e-3)
    assert max(found) > 1.1 * min(found) and coupling.severed


def test_its_mesh_lies_on_the_table():
    """Vertices in the world, around the food's place."""
    coupling = Coupling([BERRY], FOODS)
    poses = plan_cut(BERRY, 0.0).pose
    assert coupling.mesh() is None
    for pose in poses[: int(np.argmax(poses[:, 2] < 0.01))]:
        coupling.move(pose, 0.05)
    found = coupling.mesh()
    assert found is not None
    _, points, _, _ = found
    assert np.allclose(points[:, :2].mean(axis=0), [BERRY.x, BERRY.y], atol=3e-3)
    assert points[:, 2].min() > -1e-3 and points[:, 2].max() < 0.04


def test_a_large_food_has_larger_cells_and_a_small_one_those_of_a_screening_run():
    """A melon 14 over its height, with an edge that is not narrower than one; a plum's as in an evaluation; a thin
    slice finer ones all the same."""
    found = {}
    for name, along in (("melon", 0.0), ("plum", 0.0), ("melon", 0.045)):
        food = load_food(name)
        item = Item(name, food.to_scene_food().shape)
        found[name, along] = cut_scene_at(item, along, food, cells=MAX_CELLS), cut_scene_at(item, along, food)
    large, usual = found["melon", 0.0]
    assert (
        large.numerics.dx == pytest.approx(0.1 / MAX_CELLS) and large.edge.zone >= large.numerics.dx > usual.numerics.dx
    )
    small, same = found["plum", 0.0]
    assert small == same
    slice_, _ = found["melon", 0.045]
    assert slice_.numerics.dx == pytest.approx(0.005 / MIN_CELLS)
