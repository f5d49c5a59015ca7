"""A policy in closed loop with the food: episodes in IntSim, in worker processes; needs the extra ``[robot]``."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib.material.food import FoodSpec
from intsim.data.demonstrate import OPEN
from intsim.policy.oracles import Policy
from intsim.sim.severing import Severed
from intsim.task.kinematic_table import Rollout, guard
from intsim.task.planner import RATE
from intsim.task.suites import draw
from mpm.scene.errors import CutcalError

ENV = "CutFood-v1"
STEPS = 400  # of an episode, at most: 20 s
STILL, MOVED = 30, 1e-3  # steps within which an edge that has not moved so far [m] is stuck, and the episode over
FASTEST_JOINTS = np.array([2.175] * 4 + [2.61] * 3)
"""Speeds of a Franka arm's joints at most [rad/s] (Franka control interface)."""
_kept: dict[str, Any] = {}


@dataclass(frozen=True)
class World:
    """Where a policy is evaluated.

    Attributes:
        coupled: Whether the food resists.
        stiffness: Of the arm's joints [N m/rad]; ManiSkill's own (1000) without it.
        knife: Name of the knife.
        pixels: Width and height of the pictures that a policy is given; 0 for none, which needs no renderer.
    """

    coupled: bool = True
    stiffness: float | None = None
    knife: str = "kitchen"
    pixels: int = 0


def environment(world: World) -> Any:
    """The environment of a world; a process keeps the last one.

    Raises:
        CutcalError: Pictures are asked for and there is no renderer.
    """
    import gymnasium

    import intsim.sim.environment  # noqa: F401

    key = repr(world)
    if key not in _kept:
        _kept.clear()
        seen = {"render_backend": "cpu", "obs_mode": "rgb", "pixels": world.pixels}
        blind = {"render_backend": "none", "obs_mode": "state"}
        try:
            made = gymnasium.make(
                ENV,
                sim_backend="physx_cpu",
                control_mode="pd_joint_pos",
                knife=world.knife,
                coupled=world.coupled,
                stiffness=world.stiffness,
                **(seen if world.pixels else blind),
            )
        except RuntimeError as e:
            if not world.pixels:
                raise
            raise CutcalError(f"no pictures without a renderer ({e}); cutcal doctor says what is missing") from None
        _kept[key] = made.unwrapped
    return _kept[key]


def episode_of(
    policy: Policy, suite: str, seed: int, foods: dict[str, FoodSpec], world: World, arch: str, threads: int
) -> tuple[Rollout, Any, Severed]:
    """One episode, in a worker.

    Args:
        policy: The policy.
        suite, seed: Of the episode.
        foods: Foods that may be asked for, by name.
        world: Where.
        arch, threads: Device of the solver; only CPUs are used.

    Returns:
        The rollout, the food in plain geometry at its end, and what the solver has found.
    """
    del arch, threads
    env = environment(world)
    env.foods = foods
    episode = draw(suite, seed, foods)
    env.reset(seed=seed, options={"episode": episode})
    found = follow(env, policy, zlib.crc32(f"{suite} {seed}".encode()))
    return env.table.rollout, env.table.items[0], found


def follow(env: Any, policy: Policy, seed: int) -> Severed:
    """Let a policy act until it has done what it was told, or the edge has been stuck for a second and a half.

    Its changes of pose (7 numbers) are taken from where the edge is, as in ``pd_ee_delta_pose`` in metres, and what is commanded keeps within the
    arm's limits; the joints for it are found by inverse kinematics. Joint targets (8 numbers) are commanded as they are, each joint within its speed.
    It is given the edge's ``pose``, the ``joints``, the ``items``, and ``images`` by camera where there are any.

    Args:
        env: A :class:`intsim.sim.environment.CutFoodEnv` that was reset, in joint positions.
        policy: The policy.
        seed: Its own.
    """
    policy.reset(seed)
    command, velocity = env.pose, np.zeros(3)
    way: list[np.ndarray] = []
    joints, peak, short = env.agent.robot.get_qpos()[0].numpy().astype(float), 0.0, 0.0
    for _ in range(STEPS):
        food = env.coupling if env.coupled else env.table
        own = env.agent.robot.get_qpos()[0].numpy().astype(float)
        obs = {"pose": env.pose, "joints": own, "items": tuple(food.items), "images": _images(env)}
        action = policy.act(obs, env.instruction)
        if action is None:
            break
        if len(action) == len(FASTEST_JOINTS) + 1:
            turn = np.asarray(action[:-1], float) - joints[:7]
            slow = np.clip(turn, -FASTEST_JOINTS / RATE, FASTEST_JOINTS / RATE)
            joints, clipped = np.array([*(joints[:7] + slow), 0.0, 0.0]), ("joint",) * bool((slow != turn).any())
            command = env.kinematics.pose(joints)
        else:
            x, y, z, _, pitch, yaw = np.asarray(action, float)[:6]
            change = env.pose + [x, y, z, yaw, pitch] - command
            kept = guard(np.array([*change[:3], 0.0, change[4], change[3]]), velocity)
            velocity, clipped = kept.delta[:3] * RATE, kept.clipped
            command = command + [*kept.delta[:3], kept.delta[5], kept.delta[4]]
            joints, _ = env.kinematics.joints(command, np.array([*joints[:7], 0.0, 0.0]))
        env.step(np.array([*joints[:7], OPEN], np.float32))
        env.table.rollout.clipped[-1] = clipped
        peak = max(peak, float(env.forces[:, 2].max()))
        way.append(env.pose[:3])
        if way[-1][2] == min(there[2] for there in way):
            short = float(way[-1][2] - command[2])
        if len(way) > STILL and np.linalg.norm(np.array(way[-STILL:]) - way[-1], axis=1).max() < MOVED:
            break
    env.coupling.end()
    done = env.coupling.done
    broken = [d.why for d in done if d.severed is None]
    if broken or not env.coupled:
        return Severed(None, peak=peak, short=short, why=broken[0] if broken else "the food does not resist here")
    severed = len(env.coupling.items[0].pieces) > env.episode.spec.cuts
    return Severed(
        severed, env.coupling.uncut(), peak, short, done[-1].why if done else "the edge does not reach the food"
    )


def _images(env: Any) -> dict[str, np.ndarray]:
    """What the cameras see now (h, w, 3), by name; empty without a renderer."""
    if env.obs_mode != "rgb":
        return {}
    return {name: seen["rgb"][0].numpy() for name, seen in env.get_obs()["sensor_data"].items()}
