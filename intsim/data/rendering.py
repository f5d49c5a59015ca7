"""Pictures of stored trajectories before backgrounds, without physics; needs the extra ``[robot]``, and no renderer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import h5py
import numpy as np

from intsim.data.shards import StoredTrajectory, stored_item
from intsim.render.view import PICTURE_CAMERAS
from intsim.sim.stage import Stage
from intsim.sim.world import World


class Renderer:
    """Cameras around the robot.

    Args:
        pixels: Width and height of the pictures.
        threads: That it uses.

    Raises:
        CutcalError: ManiSkill, whose arm is shown, is not installed.
    """

    def __init__(self, pixels: int, threads: int = 1) -> None:
        self._pixels, self._threads = pixels, threads
        self._stages: dict[str, Stage] = {}
        self._stage(World.knife)

    def _stage(self, knife: str) -> Stage:
        """The stage with a knife."""
        if knife not in self._stages:
            self._stages = {knife: Stage(self._pixels, PICTURE_CAMERAS, knife, self._threads)}
        return self._stages[knife]

    def frames(self, stored: StoredTrajectory, backgrounds: Sequence[int]) -> Iterator[dict[int, dict[str, np.ndarray]]]:
        """What each camera sees before every step, before each background: the geometry is found once for all.

        Args:
            stored: The trajectory.
            backgrounds: Numbers of the backgrounds.

        Yields:
            For each step pictures by background and camera, 8 bits, shape (pixels, pixels, 3) each.

        Raises:
            TaskError: There is no such background.
        """
        stage = self._stage(str(stored.group["mpm"].attrs.get("knife", World.knife)))
        stage.serve([stored_item(one) for one in stored.entry["items"]], int(stored.entry["episode_seed"]))
        qpos, meshes = stored.group["obs/agent/qpos"][()], _meshes(stored.group)
        for t in range(len(qpos) - 1):
            if t in meshes:
                stage.show(*meshes[t])
            stage.place(qpos[t])
            yield {background: stage.pictures(background) for background in backgrounds}


def _meshes(group: h5py.Group) -> dict[int, tuple[int, int, np.ndarray, np.ndarray, np.ndarray]]:
    """The food under the knife before each step in which it was kept: number of the cut, which
    food, vertices [m], triangles, flesh."""
    out: dict[int, tuple[int, int, np.ndarray, np.ndarray, np.ndarray]] = {}
    for number, cut in enumerate(group.get("mpm/surface", {}).values()):
        which, triangles, flesh = int(cut.attrs["food"]), cut["triangles"][()], cut["flesh"][()]
        points = cut["vertices"][()].astype(float) + cut.attrs["origin"]
        out |= {int(step): (number, which, points[k], triangles, flesh) for k, step in enumerate(cut["step"][()])}
    return out
