"""Pictures of stored trajectories before backgrounds, without physics; needs the extra ``[robot]``, and no renderer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import h5py
import numpy as np

from intsim.data.shards import StoredTrajectory, stored_item
from intsim.render.view import PICTURE_CAMERAS
from intsim.sim.stage import Stage
from intsim.sim.world import World
from intsim.task.kinematic_table import axis_crossing


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

    def frames(
        self, stored: StoredTrajectory, backgrounds: Sequence[int]
    ) -> Iterator[dict[int, dict[str, np.ndarray]]]:
        """What each camera sees before every step, before each background: the geometry is found once for all.

        Args:
            stored: The trajectory.
            backgrounds: Numbers of the backgrounds.

        Yields:
            For each step pictures by background and camera, 8 bits, shape (pixels, pixels, 3) each.

        Raises:
            TaskError: There is no such background.
        """
        group = stored.group
        stage = self._stage(str(group["mpm"].attrs.get("knife", World.knife)))
        items = [stored_item(one) for one in stored.entry["items"]]
        stage.serve(items, int(stored.entry["episode_seed"]))
        qpos, edge, pieces = (group[name][()] for name in ("obs/agent/qpos", "obs/extra/edge", "mpm/pieces"))
        cuts = {
            int(cut["step"][0]): _Cut(number, cut) for number, cut in enumerate(group.get("mpm/surface", {}).values())
        }
        cut: _Cut | None = None
        for t in range(len(qpos) - 1):
            cut = cuts.get(t, cut)
            if cut is not None and t in cut.frames:
                stage.show(cut.number, cut.which, *cut.mesh(t))
            elif cut is not None and cut.which == 0 and pieces[t - 1] > len(items[0].pieces):
                along = axis_crossing(items[0], edge[cut.first])
                items[0] = items[0] if along is None else items[0].cut_at(along)
                stage.rest(0, items[0])
            stage.place(qpos[t])
            yield {background: stage.pictures(background) for background in backgrounds}


class _Cut:
    """The food under the knife in one cut, as it was kept: which food, after which steps, and its surface."""

    def __init__(self, number: int, group: h5py.Group) -> None:
        self.number, self.which = number, int(group.attrs["food"])
        steps = group["step"][()]
        self.first, self.frames = int(steps[0]), {int(step): k for k, step in enumerate(steps)}
        self._triangles, self._flesh = group["triangles"][()], group["flesh"][()]
        self._vertices, self._origin = group["vertices"], group.attrs["origin"]

    def mesh(self, step: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertices [m], triangles and flesh before a step."""
        return self._vertices[self.frames[step]].astype(float) + self._origin, self._triangles, self._flesh
