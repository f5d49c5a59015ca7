"""What lies in the flesh of a food: a stone, which is rigid, or a cavity, where there is nothing.

Both are ellipsoids, along the axes of the scene or turned about the one across the blade. Their middle is that of the
food, or lies beside it; the middle of a food that lies on its flat face is the middle of that face.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.scene.errors import SceneError, check_number
from mpm.scene.material import Material
from mpm.scene.shapes import FLAT_DOWN, Shape, inside, section_area, volume

LEAST_CELLS = 3.0  # size of the smallest stone that the grid resolves, in cells
SURFACE_POINTS = 400  # of an inclusion, at which it is checked that the food is around it


@dataclass(frozen=True)
class Inclusion:
    """An ellipsoid in the food.

    Attributes:
        length: Across the blade, along y [m].
        width: Along the blade, x [m].
        height: Upwards, z [m].
        aside: Its middle from the food's middle along the blade [m].
        beyond: The same across the blade [m].
        above: The same upwards [m].
        turn: Angle by which it is turned about the axis across the blade, from z towards x [rad].
    """

    length: float
    width: float
    height: float
    aside: float = 0.0
    beyond: float = 0.0
    above: float = 0.0
    turn: float = 0.0

    def __post_init__(self) -> None:
        for name in ("length", "width", "height"):
            check_number("inclusion", name, getattr(self, name), 1e-4, 1.0, "m")
        for name in ("aside", "beyond", "above"):
            check_number("inclusion", name, getattr(self, name), -1.0, 1.0, "m")
        check_number("inclusion", "turn", self.turn, -7.0, 7.0, "rad")

    @property
    def half_axes(self) -> np.ndarray:
        """Half of its sizes along x, y, z [m], shape (3,)."""
        return np.array([self.width, self.length, self.height]) / 2

    def middle(self, shape: Shape) -> np.ndarray:
        """Its middle in a food [m], shape (3,)."""
        low = 0.0 if shape.kind in FLAT_DOWN else shape.height / 2
        return np.array([self.aside, self.beyond - shape.cut, low + self.above])

    @property
    def rotation(self) -> np.ndarray:
        """Its axes in the scene, one a column, shape (3, 3)."""
        c, s = math.cos(self.turn), math.sin(self.turn)
        return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])

    @property
    def reach(self) -> np.ndarray:
        """How far it reaches from its middle along x, y, z [m], shape (3,)."""
        out: np.ndarray = np.sqrt((self.rotation**2) @ self.half_axes**2)
        return out

    def holds(self, shape: Shape, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) of a food [m] it holds, shape (n,)."""
        inward = (points - self.middle(shape)) @ self.rotation / self.half_axes
        held: np.ndarray = (inward**2).sum(axis=1) <= 1
        return held

    def mirrors(self, shape: Shape) -> tuple[bool, bool]:
        """Whether x = 0 and y = 0 are mirrors of it."""
        upright = self.width == self.height or abs(math.sin(2 * self.turn)) < 1e-9
        return self.aside == 0 and upright, self.middle(shape)[1] == 0

    def volume(self, shape: Shape) -> float:
        """What it takes of the food's volume [m^3]."""
        whole = math.pi / 6 * self.length * self.width * self.height
        return whole / 2 if shape.kind in FLAT_DOWN else whole

    def section_part(self, shape: Shape) -> float:
        """Size of its section in the blade's plane over that through its middle [-], 0 where the plane misses it."""
        off = float(self.middle(shape)[1]) / (self.length / 2)
        return math.sqrt(max(1.0 - off * off, 0.0))

    def section_area(self, shape: Shape) -> float:
        """What it takes of the section in the blade's plane [m^2]."""
        whole = math.pi / 4 * self.width * self.height * self.section_part(shape) ** 2
        return whole / 2 if shape.kind in FLAT_DOWN else whole

    def section_top(self, shape: Shape) -> float:
        """Height above the board of its highest point in the blade's plane [m]."""
        return float(self.middle(shape)[2] + self.section_part(shape) * self.reach[2])

    def check(self, name: str, shape: Shape) -> None:
        """Insist that it lies within a food.

        Args:
            name: What it is, for the message.
            shape: The outline.

        Raises:
            SceneError: A part of it is outside.
        """
        k = np.arange(SURFACE_POINTS) + 0.5  # evenly on a sphere, on a spiral of the golden angle
        z, turn = 1 - 2 * k / SURFACE_POINTS, math.pi * (1 + math.sqrt(5)) * k
        r = np.sqrt(1 - z * z)
        around = self.half_axes * np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
        points = self.middle(shape) + around @ self.rotation.T
        if shape.kind in FLAT_DOWN:
            if self.above != 0:
                raise SceneError(f"{name}: in a food on its flat face it has its middle on that face; leave out above")
            points = points[points[:, 2] > 0]
        if not inside(shape, points).all():
            sizes = " x ".join(f"{size * 2e3:.3g}" for size in self.half_axes[[1, 0, 2]])
            raise SceneError(
                f"{name}: {sizes} mm (length x width x height) do not lie within the food of {shape.length * 1e3:.3g} "
                f"x {shape.width * 1e3:.3g} x {shape.height * 1e3:.3g} mm; give a smaller one, or a larger food"
            )


@dataclass(frozen=True)
class Parted:
    """A part of the section in the blade's plane that an earlier cut has parted: all beyond a straight line.

    Attributes:
        turn: Direction in which it lies from the food's middle, from z towards x [rad].
        beyond: Distance of the line from the food's middle [m].
    """

    turn: float
    beyond: float

    def holds(self, shape: Shape, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) of the blade's plane [m] it holds, shape (n,)."""
        x, _, z = points.T
        out: np.ndarray = math.sin(self.turn) * x + math.cos(self.turn) * (z - shape.height / 2) > self.beyond
        return out


@dataclass(frozen=True)
class Food:
    """A shape filled with a material, with what lies in it.

    Attributes:
        shape: The outline.
        material: Constants of the flesh.
        stone: A rigid body in it, or None.
        cavity: A hollow in it, or None.
        parted: What earlier cuts have parted of the section in the blade's plane.

    Raises:
        SceneError: Stone or cavity do not lie within the food.
    """

    shape: Shape
    material: Material
    stone: Inclusion | None = None
    cavity: Inclusion | None = None
    parted: tuple[Parted, ...] = ()

    def __post_init__(self) -> None:
        for name, one in (("stone", self.stone), ("cavity", self.cavity)):
            if one is not None:
                one.check(name, self.shape)
        if self.stone is not None and self.shape.kind in FLAT_DOWN:
            raise SceneError("stone: a food that was halved has none; give a whole one, or leave out the stone")

    @property
    def inclusions(self) -> tuple[Inclusion, ...]:
        """Stone and cavity, as far as there are."""
        return tuple(one for one in (self.stone, self.cavity) if one is not None)

    @property
    def crossed(self) -> tuple[Inclusion, ...]:
        """Those of them that the blade's plane meets."""
        return tuple(one for one in self.inclusions if one.section_area(self.shape) > 0)

    @property
    def mirrors(self) -> tuple[bool, bool]:
        """Whether x = 0 and y = 0 are mirrors of the food."""
        own = [one.mirrors(self.shape) for one in self.inclusions]
        sides = {(round(-one.turn % (2 * math.pi), 9), one.beyond) for one in self.parted}
        even = sides == {(round(one.turn % (2 * math.pi), 9), one.beyond) for one in self.parted}
        return even and all(x for x, _ in own), self.shape.cut == 0 and all(y for _, y in own)

    @property
    def volume(self) -> float:
        """Volume of the flesh, and of the stone [m^3]."""
        return volume(self.shape) - (0.0 if self.cavity is None else self.cavity.volume(self.shape))

    @property
    def section_area(self) -> float:
        """Area of the flesh in the blade's plane [m^2]: what a complete cut severs."""
        return section_area(self.shape) - sum(one.section_area(self.shape) for one in self.crossed)

    def filled(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) lie in flesh or stone, shape (n,)."""
        there = inside(self.shape, points)
        return there if self.cavity is None else there & ~self.cavity.holds(self.shape, points)

    def open(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) of the blade's plane earlier cuts have parted, shape (n,)."""
        out = np.zeros(len(points), bool)
        for one in self.parted:
            out |= one.holds(self.shape, points)
        return out

    def stony(self, points: np.ndarray) -> np.ndarray:
        """Which points (n, 3) lie in the stone, shape (n,)."""
        return np.zeros(len(points), bool) if self.stone is None else self.stone.holds(self.shape, points)

    def check_cells(self, dx: float) -> None:
        """Insist that cells resolve the stone.

        Args:
            dx: Cell [m].

        Raises:
            SceneError: They do not.
        """
        if self.stone is not None and 2 * self.stone.half_axes.min() < LEAST_CELLS * dx * (1 - 1e-9):
            raise SceneError(
                f"stone: {2e3 * self.stone.half_axes.min():.3g} mm are under {LEAST_CELLS:g} cells of {dx * 1e3:.3g} "
                "mm; use a smaller dx"
            )
