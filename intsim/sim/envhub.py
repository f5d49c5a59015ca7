"""CutFood-v1 for LeRobot's evaluation, and the ``env.py`` that LeRobot's EnvHub loads; needs the extra ``[robot]``.

    hf upload USER/cutfood intsim/sim/envhub.py env.py
    envs = lerobot.envs.make_env("USER/cutfood", n_envs=2, trust_remote_code=True)

Observations are ``pixels``, a picture of each camera of an export, and ``agent_pos``, the state of an export. Actions
are those of an export (``pd_ee_delta_pose``). A policy that LeRobot has trained on an export takes and gives these.
``info["is_success"]`` is the environment's own success. A repository has this file alone: cutcal has to be installed.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from intsim.render.view import PICTURE_CAMERAS
from intsim.sim.environment import PIXELS
from intsim.sim.world import ENV_ID, EPISODE_STEPS
from intsim.task.gym_action import policy_state
from intsim.task.planner import CONTROL_RATE
from intsim.task.suites import FIRST_TEST_SEED, SUITES
from mpm.scene.errors import CutcalError

*CAMERA_NAMES, WORK_CAMERA = PICTURE_CAMERAS  # those of an export, and a close one
ACTION_SIZE, STATE_SIZE = 7, 8  # numbers of an action and of a state of the exports
FLAGS = ("published", "severed", "broken", "over", "clipped")
"""What ``info`` says beside ``is_success``, ``uncut`` and ``force`` (:meth:`CutFoodEnv.evaluate`)."""


class CutFood(gymnasium.Env[dict[str, Any], np.ndarray]):
    """CutFood-v1 with one environment's numbers in NumPy, as LeRobot's evaluation expects them.

    A seed k is the k-th task of the tests, as in ``cutcal evaluate``: LeRobot counts its seeds from 1000, and the seeds
    of training are below :data:`intsim.task.suites.FIRST_TEST_SEED`. Without a seed a task of the tests is drawn.

    Args:
        suite: Name in :data:`intsim.task.suites.SUITES`.
        pixels: Width and height of the pictures; a policy is given those of its export.
        settings: Further ones of :class:`intsim.sim.environment.CutFoodEnv`, by name.

    Attributes:
        task: Name of the suite.

    Raises:
        CutcalError: There is no such suite.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(CONTROL_RATE)}
    render_mode = "rgb_array"
    _max_episode_steps = EPISODE_STEPS  # LeRobot asks for it by this name

    def __init__(self, suite: str = "seeds", pixels: int = PIXELS, **settings: Any) -> None:
        if suite not in SUITES:
            raise CutcalError(f"CutFood-v1: suite {suite!r}: none of {', '.join(SUITES)}")
        self.task = suite
        self._env = gymnasium.make(
            ENV_ID,
            suite=suite,
            pixels=pixels,
            obs_mode="rgb",
            control_mode="pd_ee_delta_pose",
            sim_backend="physx_cpu",
            render_backend="none",
            **settings,
        )
        self._inner: Any = self._env.unwrapped
        picture = gymnasium.spaces.Box(0, 255, (pixels, pixels, 3), np.uint8)
        self.observation_space = gymnasium.spaces.Dict(
            {
                "pixels": gymnasium.spaces.Dict({name: picture for name in CAMERA_NAMES}),
                "agent_pos": gymnasium.spaces.Box(-np.inf, np.inf, (STATE_SIZE,), np.float32),
            }
        )
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (ACTION_SIZE,), np.float32)
        self._seen: dict[str, np.ndarray] = {}

    @property
    def task_description(self) -> str:
        """What is asked for, in words."""
        return str(self._inner.instruction)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Begin a task of the tests; options are LeRobot's own and are not used."""
        super().reset(seed=seed)
        del options
        k = int(self.np_random.integers(FIRST_TEST_SEED)) if seed is None else seed
        seen, _ = self._env.reset(seed=FIRST_TEST_SEED + k)
        return self._observed(seen), {"is_success": False}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Carry an action out; the reward is 1 for success, and ends the episode."""
        seen, _, over, late, info = self._env.step(np.asarray(action, np.float32))
        success = bool(info["success"])
        told = {name: bool(info[name]) for name in FLAGS}
        numbers = {"uncut": float(info["uncut"]), "force": info["force"][0].numpy()}
        return (
            self._observed(seen),
            float(success),
            bool(over),
            bool(late),
            {"is_success": success, **told, **numbers},
        )

    def render(self) -> np.ndarray:
        """What the close camera has seen last, shape (h, w, 3)."""
        return self._seen[WORK_CAMERA]

    def close(self) -> None:
        """End the simulator."""
        self._env.close()

    def _observed(self, seen: dict[str, Any]) -> dict[str, Any]:
        self._seen = {name: one["rgb"][0].numpy() for name, one in seen["sensor_data"].items()}
        return {
            "pixels": {name: self._seen[name] for name in CAMERA_NAMES},
            "agent_pos": policy_state(self._inner.pose).astype(np.float32),
        }


def make_env(
    n_envs: int = 1,
    use_async_envs: bool = False,
    cfg: Any = None,
    *,
    suite: str = "seeds",
    pixels: int = PIXELS,
    **settings: Any,
) -> dict[str, dict[int, VectorEnv]]:
    """The environments of a suite, as LeRobot's EnvHub asks for them.

    Args:
        n_envs: How many, with a task each.
        use_async_envs: Not used: all of them are in this process.
        cfg: LeRobot's configuration of an environment; its ``task`` is the suite, where it names one.
        suite: The suite without it.
        pixels: Width and height of the pictures.
        settings: See :class:`CutFood`.

    Returns:
        The environments under the suite's name, as its task 0.

    Raises:
        CutcalError: There is no such suite.
    """
    name = getattr(cfg, "task", None) or suite
    del use_async_envs
    envs = SyncVectorEnv([partial(CutFood, name, pixels, **settings)] * n_envs, autoreset_mode=AutoresetMode.SAME_STEP)
    return {name: {0: envs}}
