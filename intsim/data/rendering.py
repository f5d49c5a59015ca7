"""Pictures of stored trajectories before a background, without physics; needs the extra ``[robot]`` and Vulkan."""

from __future__ import annotations

from typing import Any

import gymnasium
import h5py
import numpy as np

import intsim.sim.environment  # noqa: F401
from intsim.data.cameras import CAMERA_NAMES
from intsim.data.shards import StoredTrajectory, stored_item
from intsim.sim.scenery import FOOD_COLOURS
from intsim.sim.world import ENV_ID
from intsim.task.suites import Episode
from intsim.task.targets import CutSpec
from mpm.scene.errors import CutcalError


class Renderer:
    """Cameras before one background.

    Args:
        background: Number of the background.
        pixels: Width and height of the pictures.

    Raises:
        CutcalError: There is no renderer.
    """

    def __init__(self, background: int, pixels: int) -> None:
        try:
            made = gymnasium.make(
                ENV_ID,
                sim_backend="physx_cpu",
                render_backend="cpu",
                obs_mode="rgb",
                control_mode="pd_joint_pos",
                coupled=False,
                scenery=background,
                pixels=pixels,
            )
        except RuntimeError as e:
            raise CutcalError(
                f"dataset: no pictures without a renderer ({e}); cutcal doctor says what is missing"
            ) from None
        self._env: Any = made.unwrapped

    def close(self) -> None:
        """Give the renderer back."""
        self._env.close()

    def pictures(self, stored: StoredTrajectory) -> dict[str, np.ndarray]:
        """What each camera sees before every step, 8 bits, shape (T, pixels, pixels, 3)."""
        env, entry = self._env, stored.entry
        items = [stored_item(one) for one in entry["items"]]
        spec = CutSpec(items[0].name, entry["task"]["ratio"], entry["task"]["side"], entry["task"]["camera"])
        episode = Episode(entry["suite"], entry["episode_seed"], spec, items[0], tuple(items[1:]), entry["instruction"])
        env.reset(seed=entry["episode_seed"], options={"episode": episode})
        qpos = stored.group["obs/agent/qpos"][()]
        meshes = _meshes(stored.group)
        steps = len(qpos) - 1
        out = {camera: np.empty((steps, env.pixels, env.pixels, 3), np.uint8) for camera in CAMERA_NAMES}
        for t in range(steps):
            env.agent.robot.set_qpos(qpos[t])
            if t in meshes:
                which, points, triangles, flesh = meshes[t]
                name = items[which].name if items[which].name in FOOD_COLOURS else ""
                env.scenery.show(which, points, triangles, flesh, name)
            seen = env.get_obs()["sensor_data"]
            for camera in CAMERA_NAMES:
                out[camera][t] = seen[camera]["rgb"][0].numpy()
        return out


def _meshes(group: h5py.Group) -> dict[int, tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
    """The food under the knife before each step in which it was kept: which food, vertices [m], triangles, flesh."""
    out: dict[int, tuple[int, np.ndarray, np.ndarray, np.ndarray]] = {}
    for cut in group.get("mpm/surface", {}).values():
        which, triangles, flesh = int(cut.attrs["food"]), cut["triangles"][()], cut["flesh"][()]
        points = cut["vertices"][()].astype(float) + cut.attrs["origin"]
        out |= {int(step): (which, points[k], triangles, flesh) for k, step in enumerate(cut["step"][()])}
    return out
