"""IntSim: a ManiSkill environment in which a Panda cuts food that the cutting solver simulates; needs the extra ``[robot]``.

The robot's physics (100 Hz) and the solver take turns: the solver follows the edge to where the robot has brought it, and the mean force of that
interval acts on the knife in the next. Without a renderer it runs all the same, and gives states.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import sapien
import torch
from mani_skill.envs.sapien_env import BaseEnv
from mani_skill.sensors.camera import CameraConfig
from mani_skill.utils import sapien_utils
from mani_skill.utils.registration import register_env
from mani_skill.utils.structs.types import SimConfig

from calib.material.food import FoodSpec, load_food
from intsim.sim.coupling import Coupling
from intsim.sim.panda import BASE, BLADE, EDGE, Kinematics, PandaKnife, pose_of
from intsim.sim.scenery import Scenery
from intsim.task.kinematic_table import Table
from intsim.task.planner import HOME, RATE
from intsim.task.success import judge
from intsim.task.suites import FOODS, Episode, draw
from intsim.task.targets import CAMERAS
from mpm.scene.errors import CutcalError

PHYSICS = 100  # steps of the robot's physics a second
STEPS = 400  # of an episode, at most
PIXELS, HUMAN_PIXELS = 128, 512


@register_env("CutFood-v1", max_episode_steps=STEPS)
class CutFoodEnv(BaseEnv):
    """Cut the food that the instruction names, where it says.

    ``reset(seed=...)`` draws the task from a suite; ``reset(options={"episode": episode})`` sets one, with
    ``draws`` beside it for that episode alone. ``instruction`` is the sentence of the
    episode. The force of the food is in ``info`` and not among the observations: a real arm of this kind does not feel it.

    Args:
        suite: Name in :data:`intsim.task.suites.SUITES`.
        foods: Foods that are asked for, by name; the fifteen of the paper without it.
        knife: Name of the knife.
        coupled: Whether the food resists; without it the knife passes through, as in geometry alone.
        coarse: Cells of a screening run.
        draws: Whether the knife is drawn along its edge and tilted in the solver as well.
        stiffness, damping: Of the arm's joints [N m/rad, N m s/rad]; ManiSkill's own without it.
        criterion: What ``info["success"]`` is: ``published`` for the four published criteria, ``severed`` for pieces in the solver too.
        pixels: Width and height of the cameras' pictures.
        scenery: Which background, see :mod:`intsim.sim.scenery`.

    Attributes:
        solver_s: Time that the solver has taken so far [s].
    """

    SUPPORTED_ROBOTS = [PandaKnife.uid]
    SUPPORTED_REWARD_MODES = ("sparse", "none")
    agent: PandaKnife

    def __init__(
        self,
        *args: Any,
        suite: str = "seeds",
        foods: Mapping[str, FoodSpec] | None = None,
        knife: str = "kitchen",
        coupled: bool = True,
        coarse: bool = True,
        draws: bool = False,
        stiffness: float | None = None,
        damping: float | None = None,
        criterion: str = "published",
        pixels: int = PIXELS,
        scenery: int = 0,
        **kwargs: Any,
    ) -> None:
        if criterion not in ("published", "severed"):
            raise CutcalError(f"CutFood-v1: criterion {criterion!r} is neither 'published' nor 'severed'")
        self.suite, self.knife, self.coupled, self.coarse, self.draws = suite, knife, coupled, coarse, draws
        self.foods = dict(foods) if foods is not None else {name: load_food(name) for name in FOODS}
        self.criterion, self.pixels = criterion, pixels
        self.scenery = Scenery(scenery)
        self.solver_s = 0.0
        self._gains = {k: v for k, v in (("arm_stiffness", stiffness), ("arm_damping", damping)) if v is not None}
        self.episode: Episode | None = None
        kwargs.setdefault("robot_uids", PandaKnife.uid)
        super().__init__(*args, **kwargs)

    @property
    def _default_sim_config(self) -> SimConfig:
        return SimConfig(sim_freq=PHYSICS, control_freq=round(RATE))

    @property
    def _default_sensor_configs(self) -> list[CameraConfig]:
        """Front, side and wrist."""
        looks = {
            name: sapien_utils.look_at(list(CAMERAS[name].eye), list(CAMERAS[name].target))
            for name in ("front", "side")
        }
        size = {"width": self.pixels, "height": self.pixels, "near": 0.01, "far": 10.0}
        wrist = CameraConfig(
            uid="wrist",
            pose=sapien.Pose([0.07, 0.0, 0.0], [0.7071068, 0.0, -0.7071068, 0.0]),
            fov=1.57,
            mount=self.agent.robot.links_map["panda_hand"],
            **size,
        )
        return [*(CameraConfig(uid=name, pose=pose, fov=0.9, **size) for name, pose in looks.items()), wrist]

    @property
    def _default_human_render_camera_configs(self) -> CameraConfig:
        pose = sapien_utils.look_at([0.32, -0.28, 0.24], [0.0, 0.0, 0.03])
        return CameraConfig("render_camera", pose, HUMAN_PIXELS, HUMAN_PIXELS, 0.9, 0.01, 10.0)

    def _load_agent(self, options: dict[str, Any]) -> None:
        own = {"knife": self.knife, "visible": bool(self.scene.can_render()), **self._gains}
        before = {name: getattr(PandaKnife, name) for name in own}
        try:  # ManiSkill makes the agent itself, from its class
            for name, value in own.items():
                setattr(PandaKnife, name, value)
            super()._load_agent(options, sapien.Pose(p=list(BASE)))
        finally:
            for name, value in before.items():
                setattr(PandaKnife, name, value)
        links = self.agent.robot.links_map
        self._edge, self._blade = links[EDGE]._objs[0], links[BLADE]._objs[0]
        self.kinematics = Kinematics(self.agent.robot)

    def _load_scene(self, options: dict[str, Any]) -> None:
        self.scenery.build(self.scene)

    def _load_lighting(self, options: dict[str, Any]) -> None:
        self.scenery.light(self.scene)

    def _initialize_episode(self, env_idx: torch.Tensor, options: dict[str, Any]) -> None:
        del env_idx
        seed = int(self._episode_seed[0])
        episode = options.get("episode") or draw(self.suite, seed, self.foods)
        self.episode = episode
        items = [episode.item, *episode.others]
        self.table = Table(items)
        self.coupling = Coupling(
            items, self.foods, knife=self.knife, coarse=self.coarse, draws=options.get("draws", self.draws)
        )
        rest = self.agent.keyframes["rest"].qpos.astype(float)
        joints, _ = self.kinematics.joints(np.array([*HOME, 0.0, 0.0]), rest)
        self.agent.reset(joints)
        self.agent.robot.set_pose(sapien.Pose(p=list(BASE)))
        self._force, self._point = np.zeros(3), np.zeros(3)
        self._forces: list[np.ndarray] = []
        self.scenery.serve(self.scene, items)

    @property
    def instruction(self) -> str:
        """What is asked for, in words."""
        assert self.episode is not None
        return self.episode.instruction

    @property
    def pose(self) -> np.ndarray:
        """The edge's middle x, y, z [m], its direction and its angle to the board [rad], shape (5,)."""
        there = self._edge.entity_pose
        return pose_of(np.array(there.p, float), there.to_transformation_matrix()[:3, 0].astype(float))

    def _before_control_step(self) -> None:
        self._forces = []

    def _before_simulation_step(self) -> None:
        """The food's force of the last interval acts on the knife in this one."""
        if self._force.any():
            self._blade.add_force_at_point(self._force.astype(np.float32), self._point.astype(np.float32))
            self._blade.add_force_torque(np.zeros(3, np.float32), self.coupling.torque.astype(np.float32))

    def _after_simulation_step(self) -> None:
        pose = self.pose
        if self.coupled:
            began = time.perf_counter()
            self._force = self.coupling.move(pose, 1 / PHYSICS)
            self.solver_s += time.perf_counter() - began
            self._point = self.coupling.point(pose)
        self._forces.append(self._force)

    def _after_control_step(self) -> None:
        there = self.pose
        there[2] = max(there[2], 0.0)
        self.table.arrive(self.pose, there)
        self.scenery.follow(self.scene, self.coupling)

    def evaluate(self) -> dict[str, Any]:
        """Success, the criteria, what the solver has found, and the force of the control step [N]."""
        assert self.episode is not None
        no = torch.zeros(1, dtype=torch.bool)
        info: dict[str, Any] = {"success": no, "published": no, "severed": no}
        if self.table.rollout.pose:
            judged = judge(self.episode.spec, self.episode.item, self.table.rollout, self.table.items[0])
            severed = len(self.coupling.items[0].pieces) > max(self.episode.spec.cuts, 1)
            info["severed"] = torch.tensor([severed])
            published = (
                judged.published if not self.episode.spec.pieces else judged.published and judged.criteria["count"]
            )
            info["published"] = torch.tensor([published])
            info["success"] = torch.tensor([published and (severed or self.criterion == "published")])
        mean = np.mean(self._forces, axis=0) if self._forces else np.zeros(3)
        info["force"] = torch.tensor(mean[None], dtype=torch.float32)
        info["touching"] = torch.tensor([self.coupling.touching])
        info["uncut"] = torch.tensor([self.coupling.uncut()], dtype=torch.float32)
        return info

    def _get_obs_extra(self, info: dict[str, Any]) -> dict[str, torch.Tensor]:
        del info
        return {"edge": torch.tensor(self.pose[None], dtype=torch.float32)}

    @property
    def forces(self) -> np.ndarray:
        """Force of the food on the knife in each step of the last control step, world axes [N], shape (5, 3)."""
        return np.array(self._forces)
