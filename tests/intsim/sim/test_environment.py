"""The robot simulator with the food in it, without a renderer; only where the extra ``[robot]`` is installed."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mani_skill", reason="the extra [robot] is not installed")

import gymnasium as gym
import h5py
import sapien

from calib.errors import OutputError
from calib.material.food import load_food
from intsim.data.demonstrate import LEVELLING_GAIN, MAX_COMMAND_DEPTH, demonstrate
from intsim.data.generate import make_episode
from intsim.data.manifest import Manifest
from intsim.data.shards import StoredTrajectory
from intsim.evaluate import PolicyEvaluation, evaluate
from intsim.policy.oracles import make_policy
from intsim.render.arm import BASE_POSITION
from intsim.render.view import PICTURE_CAMERAS
from intsim.sim import environment as robot_environment
from intsim.sim.closed_loop import make_environment, roll_out_closed_loop
from intsim.sim.panda import JOINT_IMPEDANCE, edge_pose
from intsim.sim.world import World
from intsim.task.gym_action import GRIPPER_CLOSED, to_gym_action
from intsim.task.motion import MotionEnd
from intsim.task.planner import PHASES, BladeDescent, plan_cut
from intsim.task.suites import sample_episode
from intsim.task.targets import target
from mpm.scene.errors import CutcalError
from tests.calib.documents import valid
from tests.intsim.painter import Here

FOODS = {name: load_food(name) for name in ("strawberry", "banana")}
QUIET = {"sim_backend": "physx_cpu", "render_backend": "none", "obs_mode": "state", "foods": FOODS}
SEED = 2  # a banana


def made(**how):
    """An environment."""
    return gym.make("CutFood-v1", **{"control_mode": "pd_joint_pos", **QUIET, **how}).unwrapped


def cut(env, seed: int, depth: float = 0.0, hold: float = 0.0) -> dict[str, float]:
    """One planned cut by joint targets: what came of it; nothing succeeds before the motion is over."""
    env.reset(seed=seed)
    episode = env.episode
    path = plan_cut(
        episode.item, target(episode.spec, episode.item), BladeDescent(depth=depth, hold=hold), start=env.pose
    )
    joints, worst, peak, low = env.agent.robot.get_qpos()[0].numpy().astype(float), 0.0, 0.0, np.inf
    info = {}
    for pose in path.pose:
        joints, off = env.kinematics.joints(pose, joints)
        _, _, over, _, info = env.step(np.array([*joints[:7], GRIPPER_CLOSED], np.float32))
        assert bool(over) == bool(info["success"]) <= bool(info["over"])
        worst, peak = max(worst, off), max(peak, float(env.forces[:, 2].max()))
        low = min(low, float(env.pose[2]))
    flags = {name: float(info[name].item()) for name in ("success", "published", "severed", "uncut")}
    return {"off": worst, "peak": peak, "low": low, **flags}


def test_it_resets_to_the_same_episode_and_to_a_given_one():
    """A seed is an episode of the suite; the edge begins at home, level."""
    env = made()
    env.reset(seed=SEED)
    assert env.episode == sample_episode("seeds", SEED, FOODS) and env.instruction == env.episode.instruction
    assert env.pose == pytest.approx([-0.25, 0.0, 0.25, 0.0, 0.0], abs=1e-3)
    other = sample_episode("flips", 5, FOODS)
    env.reset(seed=1, options={"episode": other})
    assert env.episode is other
    env.close()


def test_the_food_stops_the_arm_and_geometry_does_not_see_it():
    """A plan to the board: without the food's force the knife gets there; with it the criteria are met and the food
    holds. Commanded deeper the food parts. Inverse kinematics to a tenth of a millimetre.
    """
    env = made(stiffness=1000.0)
    short = cut(env, SEED)
    deep = cut(env, SEED, depth=-0.05, hold=1.0)
    env.close()
    free = made(coupled=False, stiffness=1000.0)
    alone = cut(free, SEED)
    free.close()
    assert max(short["off"], alone["off"]) < 1e-4
    assert alone["peak"] == 0 and alone["low"] < short["low"] - 1e-3
    assert short["published"] and not short["success"] and alone["success"] and deep["success"]
    assert not short["severed"] and short["uncut"] > 0
    assert deep["severed"] and deep["uncut"] < 0.02 < short["uncut"]
    assert deep["peak"] == pytest.approx(short["peak"], rel=0.1)


@pytest.mark.parametrize("criterion", ["severed", "published"])
def test_nothing_succeeds_before_contact(criterion):
    """A grape 22 mm high, the edge in the right place 43 mm above the board and a millimetre above the grape, until the
    time is out: no success, no reward of one, and the episode goes on to its end.
    """
    env = made(foods={"grape": load_food("grape")}, criterion=criterion, coupled=criterion == "severed")
    env.reset(seed=SEED)
    item = env.episode.item
    assert item.shape.height < 0.025
    goal = np.array([*item.at(target(env.episode.spec, item)), 0.0431, item.yaw - np.pi / 2, 0.0])
    env.motion = MotionEnd(50)
    joints = env.agent.robot.get_qpos()[0].numpy().astype(float)
    for step in range(50):
        if step == 30:
            goal[2] = item.shape.height + 1e-3
        joints, _ = env.kinematics.joints(goal, joints)
        _, reward, over, _, info = env.step(np.array([*joints[:7], GRIPPER_CLOSED], np.float32))
        assert not over and not info["success"] and not info["published"] and reward == 0
    env.close()
    assert abs(env.pose[2] - goal[2]) < 1e-3 and np.linalg.norm(env.pose[:2] - goal[:2]) < 2e-3
    assert env.motion.why == "time" and bool(info["over"])


def test_states_have_the_food_and_the_dense_reward_sees_the_cut():
    """Eleven numbers of the food beside the edge's five; the reward grows to 1 at the release, and the guardrail has
    nothing to log of a plan."""
    env = made(foods={"grape": load_food("grape")}, reward_mode="normalized_dense", obs_mode="state_dict")
    obs, _ = env.reset(seed=SEED)
    item = env.episode.item
    assert obs["extra"]["food"].shape == (1, 11)
    assert obs["extra"]["food"][0, [0, 1, 4, 9]].numpy() == pytest.approx(
        [item.x, item.y, item.shape.length, item.at(target(env.episode.spec, item))[0]], abs=1e-6
    )
    path = plan_cut(item, target(env.episode.spec, item), BladeDescent(depth=-0.03, hold=0.5), start=env.pose).pose
    joints, rewards = env.agent.robot.get_qpos()[0].numpy().astype(float), []
    for pose in path:
        joints, _ = env.kinematics.joints(pose, joints)
        obs, reward, over, _, _ = env.step(np.array([*joints[:7], GRIPPER_CLOSED], np.float32))
        rewards.append(float(reward))
        if over:
            break
    env.close()
    assert rewards[-1] == 1.0 and max(rewards[:-1]) <= 0.91 and rewards[0] < 0.3
    assert float(obs["extra"]["food"][0, 7]) == 2 and env.motion.why == "released"
    assert env.guardrail.log == []


def test_the_guardrail_is_in_the_environment_and_logged():
    """A joint sent a radian away goes at its speed, in info and in the log; without the guardrail it is sent there."""
    for guardrail in (True, False):
        env = made(guardrail=guardrail)
        env.reset(seed=SEED)
        goal = env.agent.robot.get_qpos()[0, :7].numpy() + [1.0, 0, 0, 0, 0, 0, 0]
        info = env.step(np.array([*goal, GRIPPER_CLOSED], np.float32))[4]
        sent = float(env.agent.controller.controllers["arm"]._target_qpos[0, 0])
        env.close()
        assert bool(info["clipped"]) == guardrail == bool(env.guardrail.log)
        assert sent == pytest.approx(goal[0] - 1 + 2.175 / 20 if guardrail else goal[0], abs=1e-5)


def test_a_stiffer_arm_comes_nearer_to_the_board():
    """Ten times the stiffness of the joints, a tenth of what is missing, within a millimetre of the lag; the agent's
    class is left alone."""
    weak, stiff = made(stiffness=1e3), made(stiffness=1e4, damping=1e3)
    a, b = cut(weak, SEED), cut(stiff, SEED)
    weak.close()
    stiff.close()
    assert b["low"] < a["low"] / 2
    assert robot_environment.PandaKnife.arm_stiffness == JOINT_IMPEDANCE.tolist()


def test_the_arm_has_the_gains_and_torques_of_a_real_one():
    """libfranka's example gains and the torque limits, joint by joint, in every control mode; one number is for all
    joints, with ManiSkill's damping."""
    for mode in ("pd_joint_pos", "pd_ee_delta_pose"):
        env = made(control_mode=mode)
        env.reset(seed=0)
        joints = env.agent.robot._objs[0].active_joints[:7]
        assert [j.stiffness for j in joints] == [3000.0, 3000.0, 3000.0, 2500.0, 2500.0, 2000.0, 2000.0]
        assert [j.force_limit for j in joints] == [87.0] * 4 + [12.0] * 3
        assert [j.damping for j in joints] == pytest.approx((2 * np.sqrt(JOINT_IMPEDANCE)).tolist(), rel=1e-6)
        env.close()
    env = made(stiffness=1000.0)
    env.reset(seed=0)
    joints = env.agent.robot._objs[0].active_joints[:7]
    assert [(j.stiffness, j.damping, j.force_limit) for j in joints[3:5]] == [(1e3, 1e2, 87.0), (1e3, 1e2, 12.0)]
    env.close()


@pytest.mark.slow
def test_the_sides_of_the_cut_hold_the_blade_in_its_plane(monkeypatch):
    """A banana pressed behind the softer arm: the blade leaves its plane by less than a third of the way that it does
    where nothing holds it."""
    env, aside = made(stiffness=1000.0), []
    for held in (True, False):
        if not held:
            monkeypatch.setattr("intsim.sim.coupling.lateral_force", lambda *given: 0.0)
        cut(env, SEED)
        aside.append(env.coupling.aside)
    env.close()
    assert aside[0] < aside[1] / 3 and aside[1] > 4e-3


@pytest.mark.parametrize("mode", ["pd_joint_pos", "pd_ee_delta_pose", "pd_ee_target_delta_pose", "pd_ee_pose"])
def test_every_control_mode_takes_a_step(mode):
    """The shapes of actions and states that the published harnesses assume: 8 or 7 numbers, 9 joints."""
    env = made(control_mode=mode)
    obs, _ = env.reset(seed=0)
    size = 8 if mode == "pd_joint_pos" else 7
    assert env.single_action_space.shape == (size,)
    action = (
        np.array([*env.agent.robot.get_qpos()[0, :7].numpy(), GRIPPER_CLOSED], np.float32)
        if size == 8
        else np.zeros(7, np.float32)
    )
    obs, reward, _, _, info = env.step(action)
    assert obs.shape[1] >= 9 + 9 + 5 and info["success"].shape == (1,) and float(reward) == 0
    assert info["force"].abs().sum() == 0
    env.close()


def test_an_exported_action_moves_the_edge_as_it_says():
    """A change of 20 mm and -10 mm, a turn of 0.04 rad and a lift of one end by 0.03 rad, as the action that exports
    have: the controller's own target is that pose of the edge."""
    env = made(control_mode="pd_ee_delta_pose", guardrail=False)
    env.reset(seed=SEED)
    before = env.pose
    action = to_gym_action(np.array([0.02, -0.01, 0.0, 0.0, 0.03, 0.04, GRIPPER_CLOSED]), before[3])
    env.step(action.astype(np.float32))
    there = env.agent.controller.controllers["arm"]._target_pose.raw_pose[0].numpy()
    pose = sapien.Pose(there[:3], there[3:])
    env.close()
    after = edge_pose(pose.p + BASE_POSITION, pose.to_transformation_matrix()[:3, 0].astype(float))
    assert after - before == pytest.approx([0.02, -0.01, 0.0, 0.04, 0.03], abs=1e-3)


@pytest.mark.parametrize("mode", ["pd_joint_pos", "pd_ee_delta_pose"])
def test_the_gripper_stays_closed_on_the_handle(mode):
    """At what every action sends the fingers stay together; at 0 the same controller opens each by 15 mm."""
    env = made(control_mode=mode)
    for gripper, apart in ((GRIPPER_CLOSED, 0.0), (0.0, 0.015)):
        env.reset(seed=SEED)
        arm = env.agent.robot.get_qpos()[0, :7].numpy() if mode == "pd_joint_pos" else np.zeros(6)
        for _ in range(20):
            env.step(np.array([*arm, gripper], np.float32))
        assert env.agent.robot.get_qpos()[0, 7:].numpy() == pytest.approx([apart] * 2, abs=1e-4)
    env.close()


def test_the_force_is_no_observation():
    """What a policy is given does not change with the force."""
    env = made()
    env.reset(seed=SEED)
    before = env.get_obs()
    env._force = np.array([0.0, 0.0, 50.0])
    assert np.array_equal(before, env.get_obs())
    env.close()


def test_the_force_of_the_food_is_what_lifts_the_knife():
    """A constant force on the held knife: the edge rises by force over the arm's stiffness (1 / 0.57 N/mm with
    ManiSkill's gains, measured apart from this code, 5.05 N/mm with libfranka's), twice as far for twice the force.
    """
    for gains, compliance in (({"stiffness": 1000.0}, 0.57e-3), ({}, 1 / 5055.0)):
        risen = lifted(**gains)
        assert risen[1] - risen[0] == pytest.approx(compliance * 10, rel=0.1)
        assert risen[2] - risen[0] == pytest.approx(2 * (risen[1] - risen[0]), rel=0.05)


def lifted(**gains) -> list[float]:
    """Height of the held edge under 0, 10 and 20 N [m]."""
    env, risen = made(coupled=False, **gains), []
    for force in (0.0, 10.0, 20.0):
        env.reset(seed=SEED)
        pose = np.array([0.0, 0.0, 0.019, 0.0, 0.0])
        joints = env.kinematics.joints(pose, env.agent.robot.get_qpos()[0].numpy().astype(float))[0]
        env.agent.reset(joints)
        env._force = np.array([0.0, 0.0, force])
        for _ in range(40):
            env._point = env.pose[:3]
            env.step(np.array([*joints[:7], GRIPPER_CLOSED], np.float32))
        risen.append(float(env.pose[2]))
    env.close()
    return risen


def test_the_moment_of_the_food_turns_the_knife():
    """A force at the middle of the edge and a moment about it tilt the knife as the same force does 50 mm along the
    edge, towards the end where it pushes; to 3 % of the tilt, since the point moves with the edge and the moment does
    not.
    """
    env, tilts, force, off = made(coupled=False, stiffness=1000.0), [], 20.0, 0.05
    for part in (0.0, 0.5, 1.0):  # of the moment by the place of the force
        env.reset(seed=SEED)
        joints = env.kinematics.joints(
            np.array([0.0, 0.0, 0.05, 0.0, 0.0]), env.agent.robot.get_qpos()[0].numpy().astype(float)
        )[0]
        env.agent.reset(joints)
        env._force = np.array([0.0, 0.0, force])
        env.coupling.torque = np.array([0.0, -(1 - part) * off * force, 0.0])  # raises the end at +x
        for _ in range(40):
            env._point = env.pose[:3] + [part * off, 0.0, 0.0]
            env.step(np.array([*joints[:7], GRIPPER_CLOSED], np.float32))
        yaw, tilt = env.pose[3:]
        tilts.append(float(tilt if np.cos(yaw) > 0 else -tilt))
    env.close()
    assert tilts[2] > np.radians(0.05)
    assert tilts[:2] == pytest.approx([tilts[2]] * 2, rel=0.03)


def test_a_criterion_that_is_none_is_an_error():
    """And a background that does not exist."""
    with pytest.raises(CutcalError, match="criterion"):
        made(criterion="perfect")
    with pytest.raises(CutcalError, match="does not resist"):
        made(criterion="severed", coupled=False)
    with pytest.raises(CutcalError, match="scenery"):
        made(scenery=99)


def test_a_sustained_demonstration_parts_what_a_planned_one_leaves_whole():
    """The same episode: as planned the criteria are met and the food holds; sustained it is in pieces, phases in their
    order, and the force begins with the contact.
    """
    env = made(stiffness=1000.0)
    env.reset(seed=SEED)
    planned = demonstrate(env, sustained=False)
    env.reset(seed=SEED)
    sustained = demonstrate(env)
    env.close()
    assert planned.published[-1] and not planned.severed[-1]
    assert sustained.published[-1] and min(sustained.uncut) < 0.05 < min(planned.uncut)
    assert min(p[2] for p in sustained.command) < -0.005 < min(p[2] for p in planned.command)
    order = [PHASES.index(p) for p in sustained.phase]
    assert order == sorted(order) and set(order) == set(range(5))
    touched = np.flatnonzero(sustained.touching)
    assert touched[0] > order.index(PHASES.index("contact")) - 2
    assert all((np.array(f) == 0).all() for f in sustained.force[: touched[0]])
    # the food is looked at after every step in which it is touched
    assert [state for state, *_ in sustained.meshes] == [step + 1 for step in touched]
    assert len(sustained.qpos) == len(sustained.action) + 1


def test_pressing_on_levels_the_blade(monkeypatch):
    """The load turns the hand and one end of the blade rests on the board: turned back, the other end parts the rest;
    without that it hangs."""
    draw_ = Manifest(trajectories=1, foods=("banana",), suites=("seeds",), styles=("press",)).trajectory(0)
    env = make_environment(World(stiffness=1000.0))
    env.foods = {**env.foods, "banana": draw_.food}
    found = {}
    for part in (LEVELLING_GAIN, 0.0):
        monkeypatch.setattr("intsim.data.demonstrate.LEVELLING_GAIN", part)
        env.reset(seed=draw_.seed, options={"episode": draw_.episode})
        found[part] = demonstrate(env, meshes=False)
    level, hanging = found.values()
    assert level.severed[-1] and level.published[-1] and not hanging.severed[-1] and hanging.uncut[-1] > 0.01
    turned = [p[4] for p in level.command if p[4] != level.command[0][4]]
    assert 0 < len(turned) and min(p[2] for p in level.command) > -MAX_COMMAND_DEPTH / 2


def test_a_drawn_cut_ends_when_the_food_is_in_pieces():
    """With one end of the blade on the board the middle is above it and stands, and the cut ends as soon as nothing
    holds; with the way of the commanded middle in place of what the board lets it go, that took nine steps more, in
    which the pieces were dragged along.
    """
    draw_ = Manifest(trajectories=1, foods=("cucumber",), suites=("seeds",), styles=("slice",)).trajectory(0)
    env = make_environment(World(stiffness=1000.0))
    env.foods = {**env.foods, "cucumber": draw_.food}
    env.reset(seed=draw_.seed, options={"episode": draw_.episode, "draws": True})
    track = demonstrate(env, style="slice", meshes=False)
    parted, severed = np.flatnonzero(np.array(track.uncut) == 0), np.flatnonzero(track.severed)
    assert severed[0] - parted[0] <= 2 and track.published[-1]


def test_replaying_the_actions_gives_the_same_path_and_force():
    """The edge to a hundredth of a millimetre and the force to a thousandth, in an environment of its own."""
    env = made()
    env.reset(seed=1)
    first = demonstrate(env, meshes=False)
    env.close()
    other = made()
    other.reset(seed=1)
    path, peak = [], 0.0
    for action in first.action:
        other.step(action)
        path.append(other.pose)
        peak = max(peak, float(other.forces[:, 2].max()))
    other.close()
    assert np.abs(np.array(path) - np.array(first.edge[1:])).max() < 1e-5
    assert peak == pytest.approx(max(float(f[:, 2].max()) for f in first.force), rel=1e-3)


def test_a_worker_makes_an_episode_that_can_be_read(tmp_path):
    """What `dataset generate` stores of a real one: layout, task and the time that it took."""
    spec = Manifest(trajectories=1, foods=("strawberry",), suites=("seeds",)).trajectory(0)
    found = make_episode(spec, "sustained", World(), "cpu", 1)
    (tmp_path / "part.h5").write_bytes(found.content)
    with h5py.File(tmp_path / "part.h5") as file:
        n = found.entry["elapsed_steps"]
        assert file["actions"].shape == (n, 8) and file["mpm/force"].shape == (n, 5, 3)
        assert file["mpm"].attrs["contact_step"] > 0 and file["mpm"].attrs["food"] == "strawberry"
        assert file["mpm/force"][()].max() == pytest.approx(found.entry["peak_N"], rel=1e-6)
    assert found.entry["seconds"]["solver"] > 0 and len(found.entry["instructions"]) >= 5


def test_pictures_of_a_stored_trajectory_show_what_was_simulated(tmp_path):
    """Rendered from what is stored: the same view twice is the same picture, alone or beside other backgrounds, another
    background is another, and what the environment shows is what its dataset shows."""
    from intsim.data.rendering import Renderer

    spec = Manifest(trajectories=1, foods=("strawberry",), suites=("seeds",)).trajectory(0)
    found = make_episode(spec, "sustained", World(), "cpu", 1)
    (tmp_path / "part.h5").write_bytes(found.content)
    with h5py.File(tmp_path / "part.h5") as file:
        stored = StoredTrajectory(file, found.entry)
        renderer = Renderer(64)
        both, alone = list(renderer.frames(stored, [0, 5])), list(renderer.frames(stored, [0]))
    assert len(both) == len(alone) == found.entry["elapsed_steps"]
    for seen, again in zip(both, alone, strict=True):
        for view in PICTURE_CAMERAS:
            assert seen[0][view].shape == (64, 64, 3) and seen[0][view].std() > 10
            assert np.array_equal(seen[0][view], again[0][view])
            assert np.abs(seen[0][view].astype(int) - seen[5][view]).mean() > 5
    moved = [np.abs(both[k + 1][0]["work"].astype(int) - both[k][0]["work"]).sum() for k in range(len(both) - 1)]
    assert np.mean(np.array(moved) > 0) > 0.9
    env = make_environment(World(pixels=64))
    env.foods = {**env.foods, spec.food.name: spec.food}
    env.reset(seed=spec.seed, options={"episode": spec.episode})
    first = env.get_obs()["sensor_data"]
    off = [np.abs(first[view]["rgb"][0].numpy().astype(int) - both[0][0][view]).mean() for view in PICTURE_CAMERAS]
    assert max(off) < 0.5  # joints are kept in single precision


def test_a_policy_is_judged_in_closed_loop_with_the_food(tmp_path):
    """The planner's oracle in the robot: its commands are the plan's; where nothing resists the edge reaches the board;
    with food it meets the published criteria and ends higher by what the force takes; commanded deeper the food parts.
    Rows go on after a stop.
    """
    food = {"strawberry": FOODS["strawberry"]}
    found = {}
    for name, policy, world in (
        ("free", "oracle", World(coupled=False, stiffness=1000.0)),
        ("planned", "oracle", World(stiffness=1000.0)),
        ("deep", "overdrive", World(stiffness=1000.0)),
    ):
        out = tmp_path / name
        evaluate(PolicyEvaluation(make_policy(policy), policy, food, ["seeds"], 2, world=world), out, pool=Here())
        valid(json.loads((out / "evaluate.json").read_text()))
        rows = [json.loads(line) for line in (out / "evaluate.jsonl").read_text().splitlines()[1:]]
        found[name] = rows
        assert all(r["published"] for r in rows) and not any(r["clipped"] for r in rows)
    free, planned, deep = (found[name] for name in ("free", "planned", "deep"))
    for a, b, c in zip(free, planned, deep, strict=True):
        assert "severing" not in a and a["height_m"] < 2e-3
        assert b["height_m"] > a["height_m"] and b["severing"]["peak"] > 1
        assert c["severing"]["severed"] and c["height_m"] < 1e-3
    again = PolicyEvaluation(make_policy("oracle"), "oracle", food, ["seeds"], 3, world=World(False, 1000.0))
    more = evaluate(again, tmp_path / "free", pool=Here(), resume=True)
    assert more.suites["seeds"].published.trials == 3
    with pytest.raises(OutputError, match="something else"):
        evaluate(replace(again, world=World(stiffness=1000.0)), tmp_path / "free", pool=Here(), resume=True)


class Replay:
    """Joint targets one after the other."""

    def __init__(self, actions) -> None:
        self.actions, self.seen = list(actions), []

    def reset(self, seed: int) -> None:
        """Nothing to forget."""

    def act(self, obs, instruction):
        """The next one."""
        self.seen.append(obs)
        return self.actions.pop(0) if self.actions else None


def test_joint_targets_do_what_they_did_and_keep_within_their_speeds():
    """A demonstration's own actions part the food again, with the same force; a target that is far away is approached
    at the joint's speed."""
    env = make_environment(World())
    env.foods = {"strawberry": FOODS["strawberry"]}
    env.reset(seed=SEED)
    track = demonstrate(env, meshes=False)
    assert track.severed[-1]
    env.reset(seed=SEED)
    policy = Replay(track.action)
    found = roll_out_closed_loop(env, policy, 0)
    assert found.severed and found.peak == pytest.approx(max(f[:, 2].max() for f in track.force), rel=0.02)
    assert np.allclose([o["pose"] for o in policy.seen[: len(track.edge)]], track.edge[: len(policy.seen)], atol=1e-3)
    assert policy.seen[0]["joints"].shape == (9,) and policy.seen[0]["images"] == {}
    env.reset(seed=SEED)
    far = track.action[0].copy()
    far[0] += 1.0
    roll_out_closed_loop(env, Replay([far]), 0)
    assert env.table.rollout.clipped == [("joint",)]


def test_a_policy_is_given_pictures_where_it_wants_them():
    """All cameras, 8 bits, the size that was asked for; no graphics device is needed."""
    env = make_environment(World(pixels=32))
    env.reset(seed=SEED)
    policy = Replay([env.agent.robot.get_qpos()[0].numpy()[:8]])
    roll_out_closed_loop(env, policy, 0)
    images = policy.seen[0]["images"]
    assert sorted(images) == sorted(PICTURE_CAMERAS)
    assert all(i.shape == (32, 32, 3) and i.dtype == np.uint8 and i.std() > 5 for i in images.values())


def test_the_description_of_the_robot_is_removed():
    """A process keeps one for each knife, apart from the one without looks, and leaves none behind."""
    code = "from intsim.sim.panda import urdf; print(urdf('kitchen', visible=True), urdf('kitchen', visible=False))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    paths = [Path(p) for p in found.stdout.split()[-2:]]
    assert len(set(paths)) == 2 and all(p.suffix == ".urdf" for p in paths)
    assert not any(p.exists() or p.parent.exists() for p in paths)
