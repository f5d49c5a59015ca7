"""Pictures of stored trajectories before another background, without running any physics again; needs the extra ``[robot]`` and Vulkan."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

import intsim.sim.environment  # noqa: F401
from intsim.data.pictures import VIEWS
from intsim.data.shards import Stored, item_of
from intsim.sim.closed_loop import ENV
from intsim.sim.scenery import COLOURS
from intsim.task.suites import Episode
from intsim.task.targets import CutSpec
from mpm.scene.errors import CutcalError


class Renderer:
    """Cameras before one background.

    Args:
        scene: Which background.
        pixels: Width and height of the pictures.

    Raises:
        CutcalError: There is no renderer.
    """

    def __init__(self, scene: int, pixels: int) -> None:
        try:
            made = gymnasium.make(
                ENV,
                sim_backend="physx_cpu",
                render_backend="cpu",
                obs_mode="rgb",
                control_mode="pd_joint_pos",
                coupled=False,
                scenery=scene,
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

    def pictures(self, stored: Stored) -> dict[str, np.ndarray]:
        """What each camera sees before every step, shape (T, pixels, pixels, 3), 8 bits."""
        env, about, group = self._env, stored.about, stored.group
        items = [item_of(one) for one in about["items"]]
        spec = CutSpec(items[0].name, about["task"]["ratio"], about["task"]["side"], about["task"]["camera"])
        episode = Episode(about["suite"], about["episode_seed"], spec, items[0], tuple(items[1:]), about["instruction"])
        env.reset(seed=about["episode_seed"], options={"episode": episode})
        qpos = group["obs/agent/qpos"][()]
        meshes: dict[int, tuple[Any, ...]] = {}
        for cut in group.get("mpm/surface", {}).values():
            parts = (
                cut["vertices"],
                cut.attrs["origin"],
                cut["triangles"][()],
                cut["flesh"][()],
                int(cut.attrs["food"]),
            )
            meshes |= {int(step): (k, *parts) for k, step in enumerate(cut["step"][()])}
        steps = len(qpos) - 1
        out = {view: np.empty((steps, env.pixels, env.pixels, 3), np.uint8) for view in VIEWS}
        for t in range(steps):
            env.agent.robot.set_qpos(qpos[t])
            if t in meshes:
                k, vertices, origin, triangles, flesh, which = meshes[t]
                name = items[which].name if items[which].name in COLOURS else ""
                env.scenery.show(which, vertices[k].astype(float) + origin, triangles, flesh, name)
            seen = env.get_obs()["sensor_data"]
            for view in VIEWS:
                out[view][t] = seen[view]["rgb"][0].numpy()
        return out
