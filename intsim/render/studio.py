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
    """

    def __init__(self, drawn: Drawn) -> None:
        self.points = np.ascontiguousarray(drawn.points, np.float32)
        self._triangles = np.ascontiguousarray(drawn.triangles, np.int32)
        self._paint_of = np.ascontiguousarray(drawn.paint_of, np.int32)
        self._paints = np.array([paint.row for paint in drawn.paints], np.float32)
        self._ref = np.ascontiguousarray(drawn.ref, np.float32)
        self._normals = np.zeros_like(self.points)
        self._there = np.zeros_like(self.points)
        self.turned()

    def turned(self) -> None:
        """Find the normals anew: the points have changed."""
        raster.turn_normals(self.points, self._triangles, self._normals)

    def draw(self, view: View, near: np.ndarray, which: np.ndarray) -> None:
        """Find what is seen, over what is there already."""
        raster.draw(self.points, self._triangles, view.row, self._there, near, which)

    def see(self, view: View, buffer: Buffer, before: np.ndarray | None = None) -> None:
        """Find what is seen and how it looks; ``before`` it is what is that near already (h, w)."""
        buffer.near[:] = 0.0 if before is None else before
        buffer.which.fill(-1)
        self.draw(view, buffer.near, buffer.which)
        raster.resolve(
            buffer.which,
            buffer.near,
            view.row,
            self._there,
            self._triangles,
            self._paint_of,
            self._normals,
            self._ref,
            self._paints,
            buffer.seen_as,
        )


class Buffer:
    """What is seen in each pixel.

    Args:
        pixels: Width and height.

    Attributes:
        near: One over the distance [1/m], 0 for nothing, shape (h, w).
        which: Number of the triangle, -1 for none, shape (h, w).
        seen_as: Colour, normal and gloss, shape (h, w, 7).
    """

    def __init__(self, pixels: int) -> None:
        self.near = np.zeros((pixels, pixels), np.float32)
        self.which = np.full((pixels, pixels), -1, np.int32)
        self.seen_as = np.zeros((pixels, pixels, 7), np.float32)


class Room:
    """A kitchen as cameras and lamp see it; what does not move is seen once.

    Args:
        number: Of the background.
        pixels: Width and height of the pictures.
    """

    def __init__(self, number: int, pixels: int) -> None:
        kitchen = Kitchen.of(number)
        casting, self._geometry = Geometry(kitchen.drawn), Geometry(Drawn.all([kitchen.drawn, kitchen.around]))
        self._kept: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._moving = Buffer(pixels)
        wide = min(LAMP_PIXELS * pixels, MOST_LAMP_PIXELS)
        self.lamp = View.lamp(kitchen.lamp, LAMP_REACH, wide)
        self.lamps = np.array([*kitchen.lamps, SHADOW_TOLERANCE * 2 * LAMP_REACH / wide], np.float32)
        self._cast = np.full((wide, wide), FAR, np.float32)
        self._which = np.full(self._cast.shape, -1, np.int32)
        casting.draw(self.lamp, self._cast, self._which)
        self._shadow = np.empty_like(self._cast)

    def seen(self, camera: str, view: View, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How near a camera sees it behind what is ``before`` it, and how; of one that stands with the light on it."""
        if camera not in STANDING:
            self._geometry.see(view, self._moving, before)
            return self._moving.near, self._moving.seen_as
        if camera not in self._kept:
            found, settled = Buffer(view.pixels), np.zeros((view.pixels, view.pixels, 9), np.float32)
            self._geometry.see(view, found)
            raster.settle(view.row, found.near, found.seen_as, self.lamp.row, self.lamps, settled)
            self._kept[camera] = found.near, settled
        return self._kept[camera]

    def shadow(self, scene: Geometry) -> np.ndarray:
        """How near to the lamp is what it sees, of room and scene."""
        np.copyto(self._shadow, self._cast)
        scene.draw(self.lamp, self._shadow, self._which)
        return self._shadow


class Studio:
    """Cameras around the robot.

    Args:
        arm: The arm with its knife.
        cameras: Names of the cameras.
        pixels: Width and height of the pictures.
    """

    def __init__(self, arm: Arm, cameras: Sequence[str], pixels: int) -> None:
        self._arm, self._pixels = arm, pixels
        self._views = {name: View.standing(name, pixels) for name in cameras if name in STANDING}
        self._views |= {name: View(np.zeros(3), np.eye(3), 1.0, pixels) for name in cameras if name not in STANDING}
        self._buffers = {name: Buffer(pixels) for name in cameras}
        self._rooms: dict[int, Room] = {}
        self._out = np.zeros((pixels, pixels, 3), np.uint8)
        self._scene = Geometry(arm.drawn)

    def serve(self, foods: Sequence[Drawn]) -> None:
        """Put foods on the board, in place of those before."""
        self._scene = Geometry(Drawn.all([self._arm.drawn, *foods]))

    def place(self, qpos: np.ndarray, foods: Sequence[Drawn]) -> None:
        """Bring arm and foods to where they are now, and find what each camera sees of them.

        Args:
            qpos: Joints [rad, m], shape (9,).
            foods: The foods that were served, their vertices where they are.
        """
        links = self._arm.links(qpos)
        first = len(self._arm.drawn.points)
        self._scene.points[:first] = self._arm.points(links)
        for food in foods:
            self._scene.points[first : first + len(food.points)] = food.points
            first += len(food.points)
        self._scene.turned()
        for name in self._views:
            if name not in STANDING:
                self._views[name] = View.wrist(links[HAND], self._pixels)
            self._scene.see(self._views[name], self._buffers[name])

    def pictures(self, background: int) -> dict[str, np.ndarray]:
        """What each camera sees before a background, 8 bits, shape (pixels, pixels, 3) each.

        Raises:
            TaskError: There is no such background.
        """
        if background not in self._rooms:
            self._rooms[background] = Room(background, self._pixels)
        room = self._rooms[background]
        shadow, out = room.shadow(self._scene), {}
        for name, view in self._views.items():
            seen = self._buffers[name]
            near, around = room.seen(name, view, seen.near)
            standing = int(name in STANDING)
            raster.light(
                view.row,
                seen.near,
                seen.seen_as,
                near,
                around,
                room.lamp.row,
                shadow,
                room.lamps,
                standing,
                self._out,
            )
            out[name] = self._out.copy()
        return out
