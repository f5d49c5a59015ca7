"""Pictures of robot and food: geometry once for all backgrounds, then the light of each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from intsim.render import raster
from intsim.render.arm import Arm
from intsim.render.kitchen import Kitchen
from intsim.render.mesh import Drawn
from intsim.render.view import View

HAND = "panda_hand"  # link that the wrist camera is fixed to
LAMP_REACH = 0.65  # how far around the board shadows are cast [m]
LAMP_PIXELS, MOST_LAMP_PIXELS = 2, 640  # pixels of what a lamp sees over those of a picture, and at most
SHADOW_TOLERANCE = 1.0  # depth by which a surface may lie behind what the lamp sees, over the width of a pixel of that
FAR = -1e9  # how near nothing is to a lamp
STANDING = ("front", "side", "work")  # cameras that do not move


class Geometry:
    """A mesh as the kernels take it.

    Args:
        drawn: The mesh.

    Attributes:
        points: Its vertices [m], shape (n, 3).
    """

    def __init__(self, drawn: Drawn) -> None:
        self.points = np.ascontiguousarray(drawn.points, np.float32)
        self._triangles = np.ascontiguousarray(np.column_stack([drawn.triangles, drawn.paint_of]), np.int32)
        self._paints = np.array([paint.row for paint in drawn.paints], np.float32)
        self._looks = np.zeros((len(self.points), 8), np.float32)
        self._looks[:, 3:] = drawn.ref
        self._there = np.zeros_like(self.points)
        self.turned()

    def turned(self) -> None:
        """Find the normals anew: the points have changed."""
        raster.turn_normals(self.points, self._triangles, self._looks)

    def draw(self, views: np.ndarray, near: np.ndarray, which: np.ndarray) -> None:
        """Find what is seen, over what is there already.

        Args:
            views: Each view as :meth:`intsim.render.view.View.row` writes it [m, pixels], shape (c, 16).
            near: Nearness of what is seen in each pixel [1/m], shape (c, h, w); changed.
            which: Number of the triangle that is seen there [-], shape (c, h, w); changed.
        """
        raster.draw(self.points, self._triangles, views, self._there, near.reshape(-1), which.reshape(-1))

    def see(self, views: np.ndarray, near: np.ndarray, which: np.ndarray, seen_as: np.ndarray) -> None:
        """The same, and how it looks.

        Args:
            views: Each view [m, pixels], shape (c, 16).
            near: Nearness of what is seen in each pixel [1/m], shape (c, h, w); changed.
            which: Number of the triangle that is seen there [-], shape (c, h, w); changed.
            seen_as: Colour, normal and gloss there [-], shape (c, h, w, 7); changed.
        """
        which.fill(-1)
        raster.see(
            self.points,
            self._triangles,
            views,
            self._there,
            near.reshape(-1),
            which.reshape(-1),
            self._looks,
            self._paints,
            seen_as.reshape(-1, seen_as.shape[-1]),
        )


class Room:
    """A kitchen as cameras and lamp see it; what does not move is seen once.

    Args:
        number: Of the background.
        views: The cameras, those that stand first, shape (c, 16).
        pixels: Width and height of the pictures.

    Attributes:
        near: One over the distance of what each camera sees of it [1/m], shape (c, h, w).
        look: Of cameras that stand the light on it, of others its colour, normal and gloss there, shape (c, h, w, 7).
        place: Of cameras that stand its place in the lamp's view, shape (standing, h, w, 3).
        fixed: Of these the picture without a shadow of the scene, 8 bits, shape (standing, h, w, 3).
        lamp: The lamp as a view; its colours and the tolerance of shadows, shape (2, 16).
    """

    def __init__(self, number: int, views: np.ndarray, pixels: int) -> None:
        kitchen, shape = Kitchen.of(number), (len(views), pixels, pixels)
        casting, self._geometry = Geometry(kitchen.drawn), Geometry(Drawn.all([kitchen.drawn, kitchen.around]))
        wide = min(LAMP_PIXELS * pixels, MOST_LAMP_PIXELS)
        colours = np.zeros(16)
        colours[:10] = *kitchen.lamps, SHADOW_TOLERANCE * 2 * LAMP_REACH / wide
        self.lamp = np.array([View.lamp(kitchen.lamp, LAMP_REACH, wide).row, colours], np.float32)
        self._shadow = np.full((2, wide, wide), FAR, np.float32)
        self._shadow_which = np.full((1, wide, wide), -1, np.int32)
        casting.draw(self.lamp[:1], self._shadow[:1], self._shadow_which)
        self.near, self._which = np.zeros(shape, np.float32), np.zeros(shape, np.int32)
        self.look = np.zeros((*shape, 7), np.float32)
        self._standing = int(views[:, 15].sum())
        still = slice(0, self._standing)
        self._geometry.see(views[still], self.near[still], self._which[still], self.look[still])
        self.place = np.zeros((self._standing, *shape[1:], 3), np.float32)
        self.fixed = np.zeros(self.place.shape, np.uint8)
        raster.settle(
            views,
            self.near.reshape(-1),
            self.look.reshape(-1, 7),
            self.lamp,
            self._shadow.reshape(-1),
            self.place.reshape(-1, 3),
            self.fixed.reshape(-1, 3),
        )

    def follow(self, views: np.ndarray, before: np.ndarray) -> None:
        """See it anew with the cameras that move, behind what is ``before`` it (c, h, w)."""
        moving = slice(self._standing, None)
        self.near[moving] = before[moving]
        self._geometry.see(views[moving], self.near[moving], self._which[moving], self.look[moving])

    def shadow(self, scene: Geometry) -> np.ndarray:
        """How near to the lamp is what it sees of room and of scene, shape (2, ., .)."""
        self._shadow[1].fill(FAR)
        scene.draw(self.lamp[:1], self._shadow[1:], self._shadow_which)
        return self._shadow


class Studio:
    """Cameras around the robot.

    Args:
        arm: The arm with its knife.
        cameras: Names of the cameras.
        pixels: Width and height of the pictures.
    """

    def __init__(self, arm: Arm, cameras: Sequence[str], pixels: int) -> None:
        self._arm, self._pixels, self._cameras = arm, pixels, tuple(cameras)
        self._order = sorted(cameras, key=lambda name: name not in STANDING)
        self._moving = [k for k, name in enumerate(self._order) if name not in STANDING]
        hand = np.eye(4)
        self._views = np.array(
            [
                (View.standing(name, pixels) if name in STANDING else View.wrist(hand, pixels)).row
                for name in self._order
            ]
        )
        shape = len(cameras), pixels, pixels
        self._near, self._which = np.zeros(shape, np.float32), np.zeros(shape, np.int32)
        self._seen_as = np.zeros((*shape, 7), np.float32)
        self._out = np.zeros((*shape, 3), np.uint8)
        self._rooms: dict[int, Room] = {}
        self._scene = Geometry(arm.drawn)
        self._placed: list[Drawn] = []

    def serve(self, foods: Sequence[Drawn]) -> None:
        """Put foods on the board, in place of those before."""
        self._scene = Geometry(Drawn.all([self._arm.drawn, *foods]))
        self._placed = list(foods)

    def place(self, qpos: np.ndarray, foods: Sequence[Drawn]) -> None:
        """Bring arm and foods to where they are now, and find what each camera sees of them.

        Args:
            qpos: Joints [rad, m], shape (9,).
            foods: The foods that were served, their vertices where they are; one that is the same object as before has
                not moved.
        """
        links = self._arm.links(qpos)
        first = len(self._arm.drawn.points)
        self._arm.points(links, self._scene.points[:first])
        for k, food in enumerate(foods):
            if food is not self._placed[k]:
                self._scene.points[first : first + len(food.points)] = food.points
            first += len(food.points)
        self._placed = list(foods)
        self._scene.turned()
        for k in self._moving:
            self._views[k] = View.wrist(links[HAND], self._pixels).row
        self._near.fill(0.0)
        self._scene.see(self._views, self._near, self._which, self._seen_as)

    def pictures(self, background: int) -> dict[str, np.ndarray]:
        """What each camera sees before a background, 8 bits, shape (pixels, pixels, 3) each.

        Raises:
            TaskError: There is no such background.
        """
        if background not in self._rooms:
            self._rooms[background] = Room(background, self._views, self._pixels)
        room = self._rooms[background]
        room.follow(self._views, self._near)
        shadow = room.shadow(self._scene)
        raster.light(
            self._views,
            self._near.reshape(-1),
            self._seen_as.reshape(-1, 7),
            room.near.reshape(-1),
            room.look.reshape(-1, 7),
            room.place.reshape(-1, 3),
            room.fixed.reshape(-1, 3),
            room.lamp,
            shadow.reshape(-1),
            self._out.reshape(-1, 3),
        )
        seen = dict(zip(self._order, self._out.copy(), strict=True))
        return {name: seen[name] for name in self._cameras}
