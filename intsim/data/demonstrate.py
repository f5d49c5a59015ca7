"""A demonstration in IntSim: the planned motion, and the effort that it takes where the food resists."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calib.material.knife import load_knife
from intsim.task.gym_action import GRIPPER_CLOSED
from intsim.task.planner import CONTROL_RATE, DESCENT_SPEED, HOME, PHASES, BladeDescent, minimum_jerk, plan_cut
from intsim.task.targets import TaskError, target

BOARD_REACHED = 2e-4  # height of the edge at which it is on the board [m]
MAX_COMMAND_DEPTH = 0.08  # way below the board that is commanded at most [m]: 140 N behind the Panda's own gains
LEVELLING_GAIN = 0.2
"""Part of the edge's tilt by which a step of pressing on turns the command back, one end being on the board [-].

It levels the edge in a quarter of a second, after the arm, which lags by a tenth.
"""
MAX_LEVELLING_STEPS = 40  # steps in which it is turned at most: as many as the way down to the deepest command takes
BLADE_END_REACHED = 5e-4
"""Height of the lower end of the blade at which it is on the board [m].

It is half of what the middle hangs above the board then (docs/robot.md, "What it shows").
"""
HOLD_TIME = 0.3  # time that the edge is held on the board [s]
RETRACT_TIME = 1.5  # time of the way back up [s]
MAX_IK_ERROR = 1e-3  # error of the inverse kinematics that is too large [m]


@dataclass(eq=False)
class Demonstration:
    """What was done and seen, step by step.

    Attributes:
        qpos, qvel: Joints before the first step and after each (n + 1, 9).
        edge: Pose x, y, z, yaw, pitch of the edge, the same (n + 1, 5).
        command: Commanded pose of the edge (n, 5).
        action: Joint targets and gripper (n, 8).
        phase: Phase of each step (n,).
        force: Force of the food on the knife in each step of the robot's physics [N] (n, 5, 3).
        touching: Whether food presses on the knife (n,).
        uncut, pieces: Part of the section that holds, and pieces of the food (n,).
        published, severed: Success by the published criteria, and in pieces (n,).
        meshes: Steps after which the food under the knife was kept, which food, its vertices, triangles and flesh.
        status: ``done``, or what went wrong.
    """

    qpos: list[np.ndarray] = field(default_factory=list)
    qvel: list[np.ndarray] = field(default_factory=list)
    edge: list[np.ndarray] = field(default_factory=list)
    command: list[np.ndarray] = field(default_factory=list)
    action: list[np.ndarray] = field(default_factory=list)
    phase: list[str] = field(default_factory=list)
    force: list[np.ndarray] = field(default_factory=list)
    touching: list[bool] = field(default_factory=list)
    uncut: list[float] = field(default_factory=list)
    pieces: list[int] = field(default_factory=list)
    published: list[bool] = field(default_factory=list)
    severed: list[bool] = field(default_factory=list)
    meshes: list[tuple[int, int, np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    status: str = "done"


def demonstrate(env: Any, *, style: str = "press", sustained: bool = True, meshes: bool = True) -> Demonstration:
    """Cut what the environment's episode asks for.

    Args:
        env: A :class:`intsim.sim.environment.CutFoodEnv` that was reset, in joint positions.
        style: Of the motion, in :data:`intsim.task.planner.STYLES`.
        sustained: Whether the edge is commanded deeper until the food is in pieces or the board reached, and held
            there. The load turns the hand; where one end of the blade then rests on the board and the other hangs, the
            command turns it back. Without it the motion is the planned one, whatever the food does.
        meshes: Whether the food's surface is kept.

    Returns:
        What was done and seen, step by step; its status says whether the solver and the arm followed.
    """
    demo, episode = Demonstration(), env.episode
    _see(env, demo)
    for _ in range(episode.spec.cuts):
        item = (env.coupling if env.coupled else env.table).items[0]
        try:
            along = target(episode.spec, item)
        except TaskError:
            break
        planned = plan_cut(item, along, BladeDescent(style), start=env.pose)
        for pose, phase in zip(planned.pose, planned.phase, strict=True):
            if phase != "retract":
                _step(env, demo, pose, str(phase), meshes)
        pose = demo.command[-1].copy()
        if sustained:
            _press_on(env, demo, pose, len(item.pieces), meshes)
        up = np.array([*pose[:2], HOME[2], pose[3], 0.0])
        for part in minimum_jerk(round(RETRACT_TIME * CONTROL_RATE)):
            _step(env, demo, pose + part * (up - pose), "retract", meshes)
    return demo


def _press_on(env: Any, demo: Demonstration, pose: np.ndarray, pieces: int, meshes: bool) -> None:
    """Command the edge deeper until the food has more pieces or the board is reached, and hold it there.

    Where one end of the blade is on the board, it is levelled in place of pressed. The commanded pose (5,) is changed.
    """
    half, turned = load_knife(env.knife).length / 2, 0
    while (
        len(env.coupling.items[0].pieces) == pieces
        and env.pose[2] > BOARD_REACHED
        and pose[2] > -MAX_COMMAND_DEPTH
        and turned < MAX_LEVELLING_STEPS
    ):
        if env.pose[2] - half * abs(np.sin(env.pose[4])) < BLADE_END_REACHED:
            pose[4] -= LEVELLING_GAIN * env.pose[4]
            turned += 1
        else:
            pose[2] -= DESCENT_SPEED / CONTROL_RATE
        _step(env, demo, pose, "cut", meshes)
    for _ in range(round(HOLD_TIME * CONTROL_RATE)):
        _step(env, demo, pose, "hold", meshes)


def _see(env: Any, demo: Demonstration) -> None:
    robot = env.agent.robot
    demo.qpos.append(robot.get_qpos()[0].numpy().astype(np.float32))
    demo.qvel.append(robot.get_qvel()[0].numpy().astype(np.float32))
    demo.edge.append(env.pose)


def _step(env: Any, demo: Demonstration, pose: np.ndarray, phase: str, meshes: bool) -> None:
    """One control step towards a pose."""
    near = np.array([*demo.action[-1][:7], 0.0, 0.0]) if demo.action else demo.qpos[-1].astype(float)
    joints, off = env.kinematics.joints(pose, near)
    if off > MAX_IK_ERROR:
        demo.status = f"the arm does not reach {np.round(pose[:3], 3).tolist()}"
    action = np.array([*joints[:7], GRIPPER_CLOSED], np.float32)
    _, _, _, _, info = env.step(action)
    assert phase in PHASES
    demo.command.append(np.array(pose, float))
    demo.action.append(action)
    demo.phase.append(phase)
    demo.force.append(env.forces)
    demo.touching.append(bool(info["touching"]))
    demo.uncut.append(float(info["uncut"]))
    demo.pieces.append(len(env.coupling.items[0].pieces))
    demo.published.append(bool(info["published"]))
    demo.severed.append(bool(info["severed"]))
    _see(env, demo)
    broken = next((d.why for d in env.coupling.done if d.severed is None), "")
    if broken:
        demo.status = broken
    mesh = env.coupling.mesh() if meshes else None
    if mesh is not None:
        which, points, triangles, flesh = mesh
        demo.meshes.append((len(demo.action), which, points, triangles, flesh))
