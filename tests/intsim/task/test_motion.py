"""When a motion is over, what it is worth on the way, and what the guardrail lets through."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from intsim.task.guardrail import MAX_JOINT_SPEEDS, Guardrail
from intsim.task.gym_action import PLACE_SCALE, from_gym_action, to_gym_action
from intsim.task.kinematic_table import MAX_SPEED
from intsim.task.motion import RELEASE_CLEARANCE, STALL_STEPS, MotionEnd
from intsim.task.planner import CONTROL_RATE, plan_cut
from intsim.task.reward import dense_reward
from intsim.task.targets import CutSpec, Item, target
from mpm.scene.shapes import Shape

GRAPE = Item("grape", Shape("ellipsoid", 0.026, 0.0217, 0.0217), x=0.02, y=0.01)
ACROSS = GRAPE.yaw - np.pi / 2


def at(height: float, off: float = 0.0) -> np.ndarray:
    """An edge across the grape."""
    return np.array([GRAPE.x, GRAPE.y + off, height, ACROSS, 0.0])


def test_a_motion_is_over_when_the_knife_is_above_the_food_again():
    """Down and up: not on the way down, not in the food, not in the last centimetre; and again in the next cut."""
    end, top = MotionEnd(100), GRAPE.shape.height
    for height in (0.1, 0.0431, top + 1e-6, 0.015, 0.0, 0.015, top + RELEASE_CLEARANCE - 1e-6):
        assert end.step(at(height), [GRAPE]) == ""
        assert end.met == (height < top or end.met)
    assert end.step(at(top + RELEASE_CLEARANCE + 1e-6), [GRAPE]) == "released"
    assert end.step(at(0.01), [GRAPE]) == "" and end.step(at(0.05), [GRAPE]) == "released"


def test_a_knife_at_rest_has_to_have_met_the_food():
    """Above it or beside it no rest is an end, in it is; the time is out for all."""
    for height, off, why in ((0.0431, 0.0, ""), (0.0, 0.1, ""), (0.01, 0.0, "rest")):
        end = MotionEnd(STALL_STEPS + 20)
        found = [end.step(at(height, off), [GRAPE]) for _ in range(STALL_STEPS + 20)]
        assert found[:STALL_STEPS] == [""] * STALL_STEPS and found[-2] == why
        assert found[-1] == (why or "time")


def test_the_dense_reward_rises_along_a_plan_and_pays_no_cut_elsewhere():
    """Towards the place it rises without a fall; what is parted counts there alone; the second of two cuts is worth as
    much as the first."""
    spec = CutSpec("grape", Fraction(1, 4), "left")
    path = plan_cut(GRAPE, target(spec, GRAPE)).pose
    down = path[: int(np.argmin(path[:, 2]))]
    uncut = np.clip(down[:, 2] / GRAPE.shape.height, 0, 1)
    found = [dense_reward(spec, GRAPE, pose, part, 0) for pose, part in zip(down, uncut, strict=True)]
    assert np.all(np.diff(found) > -1e-3) and 0 < found[0] < 0.2 and 0.85 < found[-1] < 0.9
    wrong = down[-1] + [0, 0.015, 0, 0, 0]
    assert dense_reward(spec, GRAPE, wrong, 0.0, 0) == dense_reward(spec, GRAPE, wrong, 1.0, 0)
    both = CutSpec("grape", pieces=3)
    once = GRAPE.cut_at(target(both, GRAPE))
    first = dense_reward(both, GRAPE, [*GRAPE.at(target(both, GRAPE)), 0, ACROSS, 0], 0.0, 0)
    second = dense_reward(both, once, [*GRAPE.at(target(both, once)), 0, ACROSS, 0], 0.0, 1)
    assert second == pytest.approx(2 * first, rel=1e-6)
    assert dense_reward(both, once.cut_at(target(both, once)), down[0], 1.0, 2) == pytest.approx(0.9)


def test_the_guardrail_passes_what_is_within_the_limits_bit_for_bit():
    """And logs nothing of it."""
    joints, place = np.zeros(7), np.zeros(6)
    for mode, size in (("pd_joint_pos", 8), ("pd_ee_delta_pose", 7), ("pd_ee_target_delta_pose", 7), ("pd_ee_pose", 7)):
        rail = Guardrail(mode, joints, place)
        for k in range(5):
            asked = np.full(size, 0.003 * (k + 1), np.float32)
            assert np.array_equal(rail.clip(asked), asked) and rail.last == ()
        assert rail.log == []


def test_the_guardrail_clips_and_logs_what_is_beyond_them():
    """Joints to their speeds, step after step towards the target; a change of pose to the arm's speed in the long run;
    each with what was asked and given."""
    rail, goal = Guardrail("pd_joint_pos", np.zeros(7), np.zeros(6)), np.array([1.0] * 7 + [-1.0], np.float32)
    for k in range(1, 4):
        assert rail.clip(goal)[:7] == pytest.approx(k * MAX_JOINT_SPEEDS / CONTROL_RATE, rel=1e-6)
        assert rail.last == ("joint",)
    assert [c.step for c in rail.log] == [0, 1, 2] and np.array_equal(rail.log[0].asked, goal)
    rail = Guardrail("pd_ee_delta_pose", np.zeros(7), np.zeros(6))
    way = [rail.clip(np.array([1.0, 0, 0, 0, 0, 0, -1.0])) for _ in range(10)]
    assert rail.log[0].limits == ("speed", "acceleration") and way[0][6] == -1.0
    assert way[-1][0] * PLACE_SCALE * CONTROL_RATE == pytest.approx(MAX_SPEED)
    rail = Guardrail("pd_ee_pose", np.zeros(7), np.array([0.4, 0, 0.3, np.pi - 0.01, 0, 0]))
    assert rail.clip(np.array([0.4, 0, 0.3, -np.pi + 0.01, 0, 0, -1.0]))[3] == -np.pi + 0.01 and not rail.log
    rail.clip(np.array([0.9, 0, 0.3, -np.pi + 0.01, 0, 0, -1.0]))
    assert "acceleration" in rail.last


def test_a_gym_action_and_back():
    """A tenth of a metre is 1; raising the end of an edge along x turns it about -y, of one along y about x."""
    lift = np.array([0.1, -0.05, 0.02, 0.0, 0.03, 0.0, -1.0])
    assert to_gym_action(lift, 0.0) == pytest.approx([1.0, -0.5, 0.2, 0.0, 0.3, 0.0, -1.0])
    assert to_gym_action(lift, np.pi / 2) == pytest.approx([1.0, -0.5, 0.2, -0.3, 0.0, 0.0, -1.0])
    some, yaw = np.random.default_rng(0).uniform(-0.05, 0.05, (5, 7)), np.linspace(-1.5, 1.5, 5)
    assert from_gym_action(to_gym_action(some, yaw), yaw) == pytest.approx(some)
