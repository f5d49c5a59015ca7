"""What SAPIEN shows a person beside the robot: board, table, light, and the deformed food; needs the extra ``[robot]``.

Pictures of the cameras are not made by it (:mod:`intsim.sim.stage`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import sapien

from intsim.render.background import Background
from intsim.render.food import FOOD_LOOKS, OTHER_LOOKS
from intsim.sim.coupling import Coupling
from intsim.sim.piece_mesh import standing_mesh
from intsim.task.targets import BOARD_SIZE, Item
from intsim.task.targets import BOARD_THICKNESS as THICKNESS

TABLE_SIZE = (0.8, 1.2)  # along x and y [m]
WALL_DISTANCE = 3.0  # of the walls from the board [m]


class Scenery:
    """What is around the robot before one background.

    Args:
        background: Colours and light.
    """

    def __init__(self, background: Background) -> None:
        self.background = background
        self._foods: list[sapien.Entity] = []
        self._shown: list[Any] = []

    def build(self, scene: Any) -> None:
        """Board, its top at z = 0, and table."""
        for name, size, top, colour in (
            ("board", (*BOARD_SIZE, THICKNESS), 0.0, self.background.board),
            ("table", (*TABLE_SIZE, THICKNESS), -THICKNESS, self.background.table),
        ):
            builder = scene.create_actor_builder()
            half = [s / 2 for s in size]
            builder.add_box_collision(half_size=half)
            if scene.can_render():
                builder.add_box_visual(half_size=half, material=dull_material(colour))
            builder.initial_pose = sapien.Pose(p=[0.0, 0.0, top - THICKNESS / 2])
            builder.build_kinematic(name=name)
        if scene.can_render():
            for axis in (0, 1):
                for side in (-1.0, 1.0):
                    self._wall(scene, axis, side)

    def _wall(self, scene: Any, axis: int, side: float) -> None:
        """A wall of the room, for the eye only."""
        builder = scene.create_actor_builder()
        half, place = [WALL_DISTANCE, WALL_DISTANCE, WALL_DISTANCE], [0.0, 0.0, 0.0]
        half[axis], place[axis] = THICKNESS, side * WALL_DISTANCE
        builder.add_box_visual(half_size=half, material=dull_material(self.background.wall))
        builder.initial_pose = sapien.Pose(p=place)
        builder.build_kinematic(name=f"wall {axis} {side:+.0f}")

    def light(self, scene: Any) -> None:
        """Light of this background."""
        own = self.background
        scene.set_ambient_light([own.ambient] * 3)
        scene.add_directional_light(own.direction.tolist(), [own.strength] * 3)
        scene.add_directional_light([0.0, 0.0, -1.0], [0.6] * 3)

    def serve(self, scene: Any, items: Sequence[Item]) -> None:
        """Put the foods of an episode on the board, in place of those of the last one."""
        if not scene.can_render():
            return
        own = scene.sub_scenes[0]
        for old in self._foods:
            own.remove_entity(old)
        self._foods, self._shown = [], []
        for item in items:
            entity = sapien.Entity()
            entity.name = f"food {item.name}"
            mesh = standing_mesh(item)
            body = _body(mesh.points, mesh.triangles, mesh.flesh, item.name)
            entity.add_component(body)
            own.add_entity(entity)
            self._foods.append(entity)
            self._shown.append(body)

    def follow(self, scene: Any, coupling: Coupling) -> None:
        """Show the food under the knife as it is now."""
        if not scene.can_render():
            return
        mesh = coupling.mesh()
        if mesh is None:
            return
        which, points, triangles, flesh = mesh
        self.show(which, points, triangles, flesh, coupling.items[which].name)

    def show(self, which: int, points: np.ndarray, triangles: np.ndarray, flesh: np.ndarray, name: str) -> None:
        """Show a food as a mesh.

        Args:
            which: Its place among the foods of the episode.
            points: Vertices in the world [m], shape (m, 3).
            triangles: Vertices of each triangle, indices [-], shape (t, 3).
            flesh: Which vertices lie on the face of the cut, truth values [-], shape (m,).
            name: Food whose colours it has.
        """
        entity = self._foods[which]
        entity.remove_component(self._shown[which])
        self._shown[which] = _body(points, triangles, flesh, name)
        entity.add_component(self._shown[which])


def dull_material(colour: np.ndarray) -> sapien.render.RenderMaterial:
    """A dull material of a colour."""
    return sapien.render.RenderMaterial(base_color=[*map(float, colour), 1.0], roughness=0.9, specular=0.1)


def _body(points: np.ndarray, triangles: np.ndarray, flesh: np.ndarray, name: str) -> sapien.render.RenderBodyComponent:
    """What SAPIEN shows of a mesh: a palette of two colours, skin and flesh."""
    looks = FOOD_LOOKS.get(name, OTHER_LOOKS)
    skin, inner = looks.skin.first, looks.flesh.first
    palette = np.zeros((2, 4, 4), np.uint8)
    palette[:, :2] = [*(round(255 * c) for c in skin), 255]
    palette[:, 2:] = [*(round(255 * c) for c in inner), 255]
    paint = sapien.render.RenderMaterial(roughness=0.8, specular=0.2)
    paint.base_color_texture = sapien.render.RenderTexture2D(palette, "R8G8B8A8Unorm")
    uv = np.stack([np.where(flesh, 0.875, 0.125), np.full(len(points), 0.5)], axis=1)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    faces = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    for k in range(3):
        np.add.at(normals, triangles[:, k], faces)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    shape = sapien.render.RenderShapeTriangleMesh(
        points.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32), uv.astype(np.float32), paint
    )
    body = sapien.render.RenderBodyComponent()
    body.attach(shape)
    return body
