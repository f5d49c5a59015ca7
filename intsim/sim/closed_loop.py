"""A policy in closed loop with the food: episodes in IntSim, in worker processes; needs the extra ``[robot]``."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from calib.material.food import FoodSpec
from intsim.sim.severing import SeveringOutcome
from intsim.sim.world import ENV_ID, EPISODE_STEPS, World
from intsim.task.guardrail import MAX_JOINT_SPEEDS, Guardrail
from intsim.task.gym_action import GRIPPER_CLOSED
from intsim.task.kinematic_table import limit_command
from intsim.task.motion import at_rest
from intsim.task.planner import CONTROL_RATE
from intsim.task.rollout import Policy, Rollout
from intsim.task.suites import Episode

_environments: dict[str, Any] = {}


def make_environment(world: World) -> Any:
    """The environment of a world; a process keeps the last one."""
    import gymnasium

    from intsim.sim.environment import PIXELS

    key = repr(world)
    if key not in _environments:
        _environments.clear()
        made = gymnasium.make(
            ENV_ID,
            sim_backend="physx_cpu",
            render_backend="none",
            obs_mode="rgb" if world.pixels else "state",
            control_mode="pd_joint_pos",
            knife=world.knife,
            coupled=world.coupled,
            stiffness=world.stiffness,
            pixels=world.pixels or PIXELS,
        )
        _environments[key] = made.unwrapped
    return _environments[key]


def closed_loop_episode(
    policy: Policy, episode: Episode, foods: dict[str, FoodSpec], world: World, arch: str, threads: int
) -> tuple[Rollout, Any, SeveringOutcome]:
    """One episode, in a worker.

    Args:
        policy: The policy.
        episode: What is on the table, and what is asked for.
        foods: Foods that may be asked for, by name.
        world: Where.
        arch, threads: Device of the solver; only CPUs are used.

    Returns:
        The rollout, the food in plain geometry at its end, and what the solver has found.
    """
    del arch, threads
    env = make_environment(world)
    env.foods = foods
    env.reset(seed=episode.seed, options={"episode": episode})
    found = roll_out_closed_loop(env, policy, zlib.crc32(f"{episode.suite} {episode.seed}".encode()))
    return env.table.rollout, env.table.items[0], found


class _ArmCommand:
    """What the arm is commanded, from one action to the next.

    Args:
        env: The environment, reset.

    Attributes:
        pose: Commanded pose of the edge x, y, z [m], yaw and tilt [rad], shape (5,).
        joints: Commanded joints [rad, m], shape (9,).
    """

    def __init__(self, env: Any) -> None:
        self._env, self._velocity = env, np.zeros(3)
        self.pose, self.joints = env.pose, _joints(env)

    def update(self, action: np.ndarray) -> tuple[str, ...]:
        """Take in a change of pose (7,), within the arm's limits, or joint targets (8,); returns the limits met.

        Those of the joints are the environment's guardrail's.
        """
        if len(action) == len(MAX_JOINT_SPEEDS) + 1:
            self._be_at(np.asarray(action[:-1], float))
            return ()
        x, y, z, _, pitch, yaw = np.asarray(action, float)[:6]
        change = self._env.pose + [x, y, z, yaw, pitch] - self.pose
        kept = limit_command(np.array([*change[:3], 0.0, change[4], change[3]]), self._velocity)
        self._velocity = kept.delta[:3] * CONTROL_RATE
        self.pose = self.pose + [*kept.delta[:3], kept.delta[5], kept.delta[4]]
        self.joints, _ = self._env.kinematics.joints(self.pose, np.array([*self.joints[:7], 0.0, 0.0]))
        return kept.clipped

    def follow(self, guardrail: Guardrail) -> tuple[str, ...]:
        """Take in what the environment made of the last command; returns the limits that it met."""
        if guardrail.last:
            self._be_at(guardrail.joints)
        return guardrail.last

    def _be_at(self, joints: np.ndarray) -> None:
        """Command joints (7,) [rad]."""
        self.joints = np.array([*joints, 0.0, 0.0])
        self.pose = self._env.kinematics.pose(self.joints)


def roll_out_closed_loop(env: Any, policy: Policy, seed: int) -> SeveringOutcome:
    """Let a policy act until it has done what it was told, or the edge has been stuck for a second and a half.

    Its changes of pose (7 numbers) are taken from where the edge is, as in ``pd_ee_delta_pose`` in metres, and what is
    commanded keeps within the arm's limits; the joints for it are found by inverse kinematics. Joint targets (8
    numbers) are commanded as they are, each joint within its speed. The gripper stays closed, whatever the policy
    sends. It is given the edge's ``pose``, the ``joints``, the ``items``, and ``images`` by camera where there are any.

    Args:
        env: A :class:`intsim.sim.environment.CutFoodEnv` that was reset, in joint positions.
        policy: The policy.
        seed: Of the policy.

    Returns:
        What the solver has found.
    """
    policy.reset(seed)
    command, way, peak, short = _ArmCommand(env), [], 0.0, 0.0
    for _ in range(EPISODE_STEPS):
        food = env.coupling if env.coupled else env.table
        obs = {"pose": env.pose, "joints": _joints(env), "items": tuple(food.items), "images": _images(env)}
        action = policy.act(obs, env.instruction)
        if action is None:
            break
        clipped = command.update(action)
        env.step(np.array([*command.joints[:7], GRIPPER_CLOSED], np.float32))
        env.table.rollout.clipped[-1] = clipped + command.follow(env.guardrail)
        peak = max(peak, float(env.forces[:, 2].max()))
        way.append(env.pose[:3])
        if way[-1][2] == min(there[2] for there in way):
            short = float(way[-1][2] - command.pose[2])
        if at_rest(way):
            break
    env.coupling.end()
    return _outcome(env, peak, short)


def _joints(env: Any) -> np.ndarray:
    """Joints of the arm and its fingers as they are [rad, m], shape (9,)."""
    own: np.ndarray = env.agent.robot.get_qpos()[0].numpy().astype(float)
    return own


def _outcome(env: Any, peak: float, short: float) -> SeveringOutcome:
    """What the solver has found of an episode that is over."""
    done = env.coupling.done
    broken = env.coupling.broken
    if broken or not env.coupled:
        why = broken or "the food does not resist here"
        return SeveringOutcome(None, peak=peak, short=short, why=why)
    severed = len(env.coupling.items[0].pieces) > env.episode.spec.cuts
    why = done[-1].why if done else "the edge does not reach the food"
    return SeveringOutcome(severed, env.coupling.uncut(), peak, short, why)


def _images(env: Any) -> dict[str, np.ndarray]:
    """What the cameras see now (h, w, 3), by name; empty where no pictures are asked for."""
    return dict(env.pictures()) if env.obs_mode == "rgb" else {}
