"""Plans of the blade and the limits of the arm."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from intsim.task.kinematic_table import FASTEST, PUSHING, TURNING, Table, crossing, guard
from intsim.task.planner import HOME, PHASES, RATE, ROCKED, STROKE, STYLES, minimum_jerk, plan
from intsim.task.targets import Item, TaskError
from mpm.scene.shapes import Shape

APPLE = Item("apple", Shape("ellipsoid", 0.075, 0.075, 0.07), 0.03, 0.05, math.radians(70))


@pytest.mark.parametrize("style", STYLES)
def test_every_style_reaches_the_place_within_the_arms_limits(style):
    """Phases follow one another; the edge ends at the depth across the food; speeds and accelerations are those of an arm."""
    path = plan(APPLE, 0.01, style=style, depth=-0.01, hold=0.4)
    seen = [p for k, p in enumerate(path.phase) if k == 0 or path.phase[k - 1] != p]
    assert seen == list(PHASES)
    low = path.pose[np.argmin(path.pose[:, 2])]
    assert low[2] == pytest.approx(-0.01) and low[4] == pytest.approx(0.0, abs=1e-12)
    assert crossing(APPLE, low) == pytest.approx(0.01, abs=1e-9)
    assert abs(math.cos(low[3] - APPLE.yaw)) < 1e-12
    contact = int(np.argmax(path.phase == "contact"))
    assert path.pose[contact, 2] <= APPLE.shape.height < path.pose[contact - 1, 2]
    assert (path.phase == "hold").sum() == round(0.4 * RATE)
    poses = np.vstack([[*HOME, path.pose[0, 3], 0.0], path.pose])
    before = np.zeros(3)
    for change in np.diff(poses, axis=0):
        kept = guard(np.array([*change[:3], 0.0, change[4], change[3]]), before)
        assert kept.clipped == ()
        before = change[:3] * RATE


def test_styles_differ_along_the_edge():
    """A press comes straight down; a slice draws, a saw goes to and fro, a rock begins with one end raised."""
    ways = {style: plan(APPLE, 0.0, style=style) for style in STYLES}
    cut = {style: path.pose[np.isin(path.phase, ["contact", "cut"])] for style, path in ways.items()}
    edge = np.array([math.cos(cut["press"][0, 3]), math.sin(cut["press"][0, 3])])
    along = {style: (pose[:, :2] - APPLE.at(0.0)) @ edge for style, pose in cut.items()}
    assert np.ptp(along["press"]) < 1e-12
    assert np.ptp(along["slice"]) == pytest.approx(cut["slice"][0, 2] - cut["slice"][-1, 2])
    assert 1.5 * STROKE < np.ptp(along["saw"]) <= 2 * STROKE + 1e-12
    assert 0 < cut["rock"][0, 4] < ROCKED and cut["rock"][-1, 4] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(TaskError, match="none of press"):
        plan(APPLE, 0.0, style="chop")
    with pytest.raises(TaskError, match="positive speed"):
        plan(APPLE, 0.0, speed=0.0)


def test_minimum_jerk_starts_and_ends_at_rest():
    """Half of the way after half of the time; the first and last steps are small."""
    part = minimum_jerk(40)
    assert part[-1] == 1.0 and part[19] == pytest.approx(0.5)
    assert part[0] < 2e-4 and 1 - part[-2] < 2e-4


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6), st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3))
def test_the_guard_keeps_direction_and_limits(delta, before):
    """Within the limits a command is unchanged bit for bit; beyond, it is at the limit; twice guarded is once guarded."""
    delta, before = np.array(delta), np.array(before) / 2
    kept = guard(delta, before)
    if not kept.clipped:
        assert (kept.delta == delta).all()
    speed, push = np.linalg.norm(kept.delta[:3]) * RATE, np.linalg.norm(kept.delta[:3] * RATE - before) * RATE
    assert speed <= FASTEST * (1 + 1e-9) and push <= PUSHING * (1 + 1e-9)
    assert np.linalg.norm(kept.delta[3:]) * RATE <= TURNING * (1 + 1e-9)
    if kept.clipped == ("speed",):
        assert speed == pytest.approx(FASTEST)
        np.testing.assert_allclose(np.cross(kept.delta[:3], delta[:3]), 0.0, atol=1e-12)
    again = guard(kept.delta, before)
    np.testing.assert_allclose(again.delta, kept.delta, rtol=1e-9, atol=1e-15)


def test_the_table_stops_the_edge_and_logs_what_was_clipped():
    """A command through the board is kept as a command; the edge stays on it, and too fast a jump is clipped and logged."""
    table = Table([APPLE])
    for _ in range(200):
        table.step(np.array([0.0, 0.0, -0.02, 0.0, 0.0, 0.0, 0.0]))
    assert table.rollout.command[-1][2] < 0 and table.rollout.pose[-1][2] == 0.0
    table.step(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert table.rollout.clipped[-1] == ("speed", "acceleration")
