"""IntSim: a ManiSkill environment in which a Panda cuts food of the cutting solver; needs the extra ``[robot]``.

The robot's physics (100 Hz) and the solver take turns: the solver follows the edge to where the robot has brought it,
and the mean force of that interval acts on the knife in the next. Pictures are those of a dataset
(:mod:`intsim.sim.stage`), which need no renderer of ManiSkill's.
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
from scipy.spatial.transform import Rotation

from calib.material.food import FoodSpec, load_food
from intsim.render.arm import BASE_POSITION
from intsim.render.background import Background
from intsim.render.view import PICTURE_CAMERAS
from intsim.sim.coupling import Coupling
from intsim.sim.panda import (
    BLADE_LINK,
    EDGE_LINK,
    MANISKILL_DAMPING,
    Kinematics,
    PandaKnife,
    edge_pose,
)
from intsim.sim.scenery import Scenery
from intsim.sim.stage import Stage
from intsim.sim.world import ENV_ID, EPISODE_STEPS
from intsim.task.guardrail import Guardrail
from intsim.task.kinematic_table import KinematicTable, axis_crossing
from intsim.task.motion import MotionEnd
from intsim.task.planner import CONTROL_RATE, HOME
from intsim.task.reward import dense_reward
from intsim.task.success import judge_geometry
from intsim.task.suites import FOODS, Episode, sample_episode
from intsim.task.targets import CAMERAS, Item, TaskError, target
from mpm.scene.errors import CutcalError

PHYSICS_RATE = 100  # steps of the robot's physics a second
PIXELS, HUMAN_PIXELS = 128, 512


@register_env(ENV_ID, max_episode_steps=EPISODE_STEPS)
class CutFoodEnv(BaseEnv):
    """Cut the food that the instruction names, where it says.

    ``reset(seed=...)`` draws the task from a suite; ``reset(options={"episode": episode})`` sets one, with ``draws``
    beside it for that episode alone. ``instruction`` is the sentence of the episode. The force of the food is in
    ``info`` and not among the observations: a real arm of this kind does not feel it. Observations of the ``state``
    modes have the food's place, size and pieces, and where the next cut goes; those with pictures do not.

    Nothing succeeds before the motion is over: the knife has been in a food and is above it again, or rests, or the
    time is out (:mod:`intsim.task.motion`). ``info["published"]`` and ``info["severed"]`` say how it stands meanwhile.

    Its arguments are keywords of ``gymnasium.make``, which is why they are no object.

    Args:
        suite: Name in :data:`intsim.task.suites.SUITES`.
        foods: Foods that are asked for, by name; the fifteen of the paper without it.
        knife: Name of the knife.
        coupled: Whether the food resists; without it the knife passes through, as in geometry alone.
        coarse: Cells of a screening run.
        draws: Whether the knife is drawn along its edge and tilted in the solver as well.
        stiffness, damping: Of all the arm's joints [N m/rad, N m s/rad]; without them joint impedance with libfranka's
            example gains. The torques are limited to those of the real arm. A stiffness without a damping has
            ManiSkill's, 100.
        criterion: What ``info["success"]`` is once the motion is over: ``severed`` for the published criteria and
            pieces in the solver, ``published`` for the published criteria alone. ``severed`` where the food resists.
        guardrail: Whether commands beyond the arm's speeds are clipped, as they are in every published evaluation.
        pixels: Width and height of the cameras' pictures.
        scenery: Which background, see :mod:`intsim.render.background`.

    Attributes:
        solver_s: Time that the solver has taken so far [s].
        guardrail: What clips the commands of this episode, with its log.
    """

    SUPPORTED_ROBOTS = [PandaKnife.uid]
    SUPPORTED_REWARD_MODES = ("sparse", "dense", "normalized_dense", "none")
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
        criterion: str | None = None,
        guardrail: bool = True,
        pixels: int = PIXELS,
        scenery: int = 0,
        **kwargs: Any,
    ) -> None:
        if criterion is None:
            criterion = "severed" if coupled else "published"
        if criterion not in ("published", "severed"):
            raise CutcalError(f"CutFood-v1: criterion {criterion!r} is neither 'published' nor 'severed'")
        if criterion == "severed" and not coupled:
            raise CutcalError("CutFood-v1: criterion 'severed' of food that does not resist; give coupled=True")
        self.suite, self.knife, self.coupled, self.coarse, self.draws = suite, knife, coupled, coarse, draws
        self.foods = dict(foods) if foods is not None else {name: load_food(name) for name in FOODS}
        self.criterion, self.pixels, self._guarded = criterion, pixels, guardrail
        self.scenery = Scenery(Background.of(scenery))
        self.solver_s = 0.0
        self._stage: Stage | None = None
        if stiffness is not None and damping is None:
            damping = MANISKILL_DAMPING
        self._gains = {k: v for k, v in (("arm_stiffness", stiffness), ("arm_damping", damping)) if v is not None}
        self.episode: Episode | None = None
        kwargs.setdefault("robot_uids", PandaKnife.uid)
        super().__init__(*args, **kwargs)

    @property
    def _default_sim_config(self) -> SimConfig:
        return SimConfig(sim_freq=PHYSICS_RATE, control_freq=round(CONTROL_RATE))

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
            super()._load_agent(options, sapien.Pose(p=list(BASE_POSITION)))
        finally:
            for name, value in before.items():
                setattr(PandaKnife, name, value)
        links = self.agent.robot.links_map
        self._edge, self._blade = links[EDGE_LINK]._objs[0], links[BLADE_LINK]._objs[0]
        self.kinematics = Kinematics(self.agent.robot)

    def _load_scene(self, options: dict[str, Any]) -> None:
        self.scenery.build(self.scene)

    def _load_lighting(self, options: dict[str, Any]) -> None:
        self.scenery.light(self.scene)

    def _initialize_episode(self, env_idx: torch.Tensor, options: dict[str, Any]) -> None:
        del env_idx
        seed = int(self._episode_seed[0])
        episode = options.get("episode") or sample_episode(self.suite, seed, self.foods)
        self.episode = episode
        items = [episode.item, *episode.others]
        self.table = KinematicTable(items)
        self.coupling = Coupling(
            items, self.foods, knife=self.knife, coarse=self.coarse, draws=options.get("draws", self.draws)
        )
        rest = self.agent.keyframes["rest"].qpos.astype(float)
        joints, _ = self.kinematics.joints(np.array([*HOME, 0.0, 0.0]), rest)
        self.agent.reset(joints)
        self.agent.robot.set_pose(sapien.Pose(p=list(BASE_POSITION)))
        self._force, self._point = np.zeros(3), np.zeros(3)
        self._forces: list[np.ndarray] = []
        self._clipped: tuple[str, ...] = ()
        self.motion = MotionEnd(self._steps)
        self.guardrail = Guardrail(self.agent.control_mode, joints[:7], self._hand())
        self.scenery.serve(self.scene, items)
        self._stage_serves = False

    @property
    def _steps(self) -> int:
        """Control steps of an episode."""
        return int(getattr(self.spec, "max_episode_steps", None) or EPISODE_STEPS)

    def _hand(self) -> np.ndarray:
        """The edge's frame as ``pd_ee_pose`` names it: x, y, z [m] from the base and Euler angles [rad], shape (6,)."""
        there = self._edge.entity_pose
        turn = Rotation.from_matrix(there.to_transformation_matrix()[:3, :3]).as_euler("XYZ")
        return np.array([*(np.array(there.p, float) - BASE_POSITION), *turn])

    def _step_action(self, action: Any) -> Any:
        """Clip a command to what the arm may do, and carry it out."""
        given = action["action"] if isinstance(action, dict) and "control_mode" in action else action
        self._clipped = ()
        if self._guarded and given is not None and not isinstance(given, dict):
            asked = np.asarray(given, np.float32)
            if isinstance(action, dict):
                self.guardrail.mode = action["control_mode"]
            within = self.guardrail.clip(asked.reshape(-1)).reshape(asked.shape)
            self._clipped = self.guardrail.last
            action = {**action, "action": within} if isinstance(action, dict) else within
        return super()._step_action(action)

    @property
    def instruction(self) -> str:
        """What is asked for, in words."""
        assert self.episode is not None
        return self.episode.instruction

    @property
    def pose(self) -> np.ndarray:
        """The edge's middle x, y, z [m], its direction and its angle to the board [rad], shape (5,)."""
        there = self._edge.entity_pose
        return edge_pose(np.array(there.p, float), there.to_transformation_matrix()[:3, 0].astype(float))

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
            self._force = self.coupling.move(pose, 1 / PHYSICS_RATE)
            self.solver_s += time.perf_counter() - began
            self._point = self.coupling.point(pose)
        self._forces.append(self._force)

    def _after_control_step(self) -> None:
        there = self.pose
        there[2] = max(there[2], 0.0)
        self.motion.step(there, (self.coupling if self.coupled else self.table).items)
        self.table.arrive(self.pose, there, self._clipped)
        self.scenery.follow(self.scene, self.coupling)

    def evaluate(self) -> dict[str, Any]:
        """Success, how it stands, why the motion is over, what the solver has found, and the control step's force [N].

        A cut that the solver could not follow is ``broken``, and no success.
        """
        assert self.episode is not None
        spec, published, severed, broken = self.episode.spec, False, False, False
        if self.table.rollout.pose:
            judged = judge_geometry(spec, self.episode.item, self.table.rollout, self.table.items[0])
            published = judged.published and (not spec.pieces or judged.criteria["count"])
            severed = self.coupling.count() > spec.cuts
            broken = bool(self.coupling.broken)
        over = bool(self.motion.why)
        wanted = published and (self.criterion == "published" or (severed and not broken))
        flags = {
            "success": over and wanted,
            "published": published,
            "severed": severed,
            "broken": broken,
            "over": over,
            "touching": self.coupling.touching,
            "clipped": bool(self._clipped),
        }
        mean = np.mean(self._forces, axis=0) if self._forces else np.zeros(3)
        numbers = {"force": mean, "uncut": self.coupling.uncut()}
        return {
            **{name: torch.tensor([bool(value)]) for name, value in flags.items()},
            **{name: torch.tensor(np.array([value]), dtype=torch.float32) for name, value in numbers.items()},
        }

    def _get_obs_sensor_data(self, apply_texture_transforms: bool = True) -> dict[str, Any]:
        """Pictures of the cameras, as a dataset has them; what else is asked for (depth, say) is ManiSkill's."""
        visual = vars(self.obs_mode_struct.visual)
        others = {name for name, asked in visual.items() if asked} - {"rgb"}
        if others or not visual["rgb"]:
            return dict(super()._get_obs_sensor_data(apply_texture_transforms))
        return {name: {"rgb": torch.tensor(seen[None])} for name, seen in self.pictures().items()}

    def pictures(self) -> dict[str, np.ndarray]:
        """What each camera sees now (:data:`intsim.render.view.PICTURE_CAMERAS`), 8 bits, shape (h, w, 3) each."""
        assert self.episode is not None
        if self._stage is None:
            self._stage = Stage(self.pixels, PICTURE_CAMERAS, self.knife)
        if not self._stage_serves:
            self._stage.serve([self.episode.item, *self.episode.others], self.episode.seed)
            self._stage_serves = True
        mesh = self.coupling.mesh()
        if mesh is not None:
            self._stage.show(len(self.coupling.done), *mesh)
        else:
            for which, item in enumerate((self.coupling if self.coupled else self.table).items):
                self._stage.rest(which, item)
        self._stage.place(self.agent.robot.get_qpos()[0].numpy().astype(float))
        return self._stage.pictures(self.scenery.background.number)

    def _get_obs_extra(self, info: dict[str, Any]) -> dict[str, torch.Tensor]:
        """Pose of the edge, and the food's state where states are observed."""
        del info
        seen = {"edge": self.pose}
        if self.obs_mode_struct.use_state:
            seen |= {"food": self._food_state()}
        return {name: torch.tensor(values[None], dtype=torch.float32) for name, values in seen.items()}

    @property
    def food(self) -> Item:
        """The food that is meant, as it is now."""
        item: Item = (self.coupling if self.coupled else self.table).items[0]
        return item

    def _food_state(self) -> np.ndarray:
        """The food: middle x, y [m], its axis (2,), length, width, height [m], its pieces, the part of the section that
        holds, and where on the table the next cut goes, x, y [m], shape (11,)."""
        assert self.episode is not None
        item = self.food
        try:
            place = item.at(target(self.episode.spec, item))
        except TaskError:  # in as many pieces as asked for
            place = np.array([item.x, item.y])
        shape = item.shape
        sizes = (shape.length, shape.width, shape.height)
        return np.array([item.x, item.y, *item.axis, *sizes, len(item.pieces), self.coupling.uncut(), *place])

    def compute_dense_reward(self, obs: Any, action: Any, info: dict[str, Any]) -> torch.Tensor:
        """How far the cut has got.

        Args:
            obs, action: Not used.
            info: What :meth:`evaluate` has found.

        Returns:
            :func:`intsim.task.reward.dense_reward` [-], 1 for success, shape (1,).
        """
        del obs, action
        assert self.episode is not None
        if bool(info["success"]):
            return torch.ones(1)
        spec, pose = self.episode.spec, self.pose
        if self.coupled:
            made, uncut = len(self.food.pieces) - 1, self.coupling.uncut() if self.coupling.live is not None else 1.0
        else:
            made = len(self.table.rollout.cuts)
            inside = self.motion.met and axis_crossing(self.food, pose) is not None
            uncut = float(np.clip(pose[2] / self.food.shape.height, 0.0, 1.0)) if inside else 1.0
        return torch.tensor([dense_reward(spec, self.food, pose, uncut, made)], dtype=torch.float32)

    def compute_normalized_dense_reward(self, obs: Any, action: Any, info: dict[str, Any]) -> torch.Tensor:
        """The dense reward, which is never more than 1.

        Args:
            obs, action: Not used.
            info: What :meth:`evaluate` has found.

        Returns:
            The reward [-], shape (1,).
        """
        return self.compute_dense_reward(obs, action, info)

    @property
    def forces(self) -> np.ndarray:
        """Force of the food on the knife in each step of the last control step, world axes [N], shape (5, 3)."""
        return np.array(self._forces)
