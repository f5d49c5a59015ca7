"""Robot and foods of an episode before the cameras; needs the extra ``[robot]`` for the arm's meshes, no renderer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.material.knife import load_knife
from intsim.render.arm import BASE_POSITION, BLADE_OFFSET, Arm, panda_description
from intsim.render.food import FoodMesh
from intsim.render.kitchen import board_clutter
from intsim.render.knife import knife_mesh
from intsim.render.mesh import Drawn
from intsim.render.studio import HAND, Studio
from intsim.sim.piece_mesh import standing_mesh
from intsim.task.targets import Item
from mpm.runtime.device import Runtime, running, start

ARM_CELL, FOOD_CELL = 0.6, 0.5  # cells in which vertices become one, over the size of a picture in pixels [m]


class Stage:
    """Robot, foods and cameras.

    Args:
        pixels: Width and height of the pictures.
        cameras: Names of the cameras.
        knife: Name of the knife.
        threads: Of the renderer, where no Taichi runs yet.

    Raises:
        CutcalError: ManiSkill, whose arm is shown, is not installed.
    """

    def __init__(self, pixels: int, cameras: Sequence[str], knife: str = "kitchen", threads: int = 1) -> None:
        if not running():
            start(Runtime("cpu", threads), "f32")
        self._cell = FOOD_CELL / pixels
        blade = {HAND: knife_mesh(load_knife(knife), BLADE_OFFSET)}
        self._studio = Studio(Arm(panda_description(), BASE_POSITION, ARM_CELL / pixels, blade), cameras, pixels)
        self._items: list[Item] = []
        self._foods: list[FoodMesh] = []
        self._shown: list[Drawn] = []

    def serve(self, items: Sequence[Item], seed: int) -> None:
        """Put the foods of an episode on the board, in place of those before.

        Args:
            items: The foods.
            seed: Of the episode: what lies beside them follows from it.
        """
        self._items, self._foods, self._shown, self._cut = list(items), [], [], -1
        self._beside = board_clutter(items, seed)
        for item in items:
            mesh = standing_mesh(item)
            self._foods.append(FoodMesh.of(item, mesh.points, mesh.triangles, mesh.flesh, self._cell))
        self._shown = [food.drawn for food in self._foods]
        self._studio.serve([*self._shown, *self._beside])

    def show(self, cut: int, which: int, points: np.ndarray, triangles: np.ndarray, flesh: np.ndarray) -> None:
        """Show a food as a mesh.

        Args:
            cut: Number of the cut: another one has another mesh, and at first it lies as the food does at rest.
            which: Its place among the foods of the episode.
            points: Vertices in the world [m], shape (m, 3).
            triangles: Numbers of the vertices of each triangle [-], shape (t, 3).
            flesh: Which vertices lie on the face of the cut [-], shape (m,).
        """
        if cut != self._cut:
            self._cut = cut
            self._change(which, FoodMesh.of(self._items[which], points, triangles, flesh, self._cell))
        self._shown[which] = self._foods[which].at(points)

    def rest(self, which: int, item: Item) -> None:
        """Show a food at rest as it has become: in pieces that have slid apart, with the faces of its cuts.

        Args:
            which: Its place among the foods of the episode.
            item: The food.
        """
        if item is self._items[which]:
            return
        mesh, self._items[which] = standing_mesh(item), item
        self._change(which, FoodMesh.of(item, mesh.points, mesh.triangles, mesh.flesh, self._cell))

    def _change(self, which: int, food: FoodMesh) -> None:
        """Another mesh for a food; the others stay as they are."""
        self._foods[which], self._shown[which] = food, food.drawn
        self._studio.serve([*self._shown, *self._beside])

    def place(self, qpos: np.ndarray) -> None:
        """Bring the arm to joints (9,) [rad, m], and find what each camera sees."""
        self._studio.place(qpos, [*self._shown, *self._beside])

    def pictures(self, background: int) -> dict[str, np.ndarray]:
        """What each camera sees before a background, 8 bits, shape (pixels, pixels, 3) each.

        Raises:
            TaskError: There is no such background.
        """
        return self._studio.pictures(background)
