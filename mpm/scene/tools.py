"""What touches the food: knife, press and board, all rigid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpm.scene.errors import SceneError, check_number

if TYPE_CHECKING:
    from mpm.scene.shapes import Shape


@dataclass(frozen=True)
class Knife:
    """A straight blade: a wedge of the included angle up to the spine's thickness, parallel above it.

    Attributes: name; spine thickness [m]; included angle of the wedge [rad]; blade height [m]; length along x [m];
    radius of the tip [m], 0 = sharp. A wire is a blade as thick and half as high as its diameter.
    """

    name: str
    spine: float
    angle: float
    height: float
    length: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        w = f"knife {self.name}"
        check_number(w, "spine", self.spine, 1e-5, 0.1, "m")
        check_number(w, "angle", self.angle, 1e-3, math.pi / 2, "rad")
        check_number(w, "height", self.height, 1e-4, 1.0, "m")
        check_number(w, "length", self.length, 1e-3, 1.0, "m")
        check_number(w, "radius", self.radius, -1e-300, 0.05, "m")
        if 2 * self.radius > self.spine * (1 + 1e-9):
            raise SceneError(
                f"{w}: a tip of radius {self.radius * 1e3:g} mm is wider than the spine of {self.spine * 1e3:g} mm"
            )


@dataclass(frozen=True)
class Press:
    """A rigid plate, or a wedge with its edge along x, that presses on the food from above and cuts nothing.

    It reaches over the whole food. With a Scene's ``stroke`` it makes the compression and indentation tests that have
    closed forms and finite-element references.

    Attributes: name; half_angle between the faces and the vertical [rad], pi/2 for a plate; mu, Coulomb friction [-].
    """

    name: str = "plate"
    half_angle: float = math.pi / 2
    mu: float = 0.0

    def __post_init__(self) -> None:
        w = f"press {self.name}"
        check_number(w, "half_angle", self.half_angle, 0.1, math.pi / 2 * (1 + 1e-9), "rad")
        check_number(w, "mu", self.mu, -1e-300, 10.0, "")


@dataclass(frozen=True)
class Board:
    """The board under the food.

    Attributes:
        mu: Coulomb friction coefficient [-].
        suction: Largest tension between the board and a food that stands on a flat face [Pa]: the air presses a wet
            face to the board as long as none gets under it. A food that touches the board in a line or a point is not
            held, whatever this says.
        bow: Rise of the middle of the food's underside over its ends [m], along a parabola: such a food rests on its
            ends. Negative: it rests on its middle, and its ends are up. It is simulated as a board that is hollow, or
            lower at its ends, by as much under a straight food.
    """

    mu: float = 0.5
    suction: float = 0.0
    bow: float = 0.0

    def __post_init__(self) -> None:
        check_number("board", "mu", self.mu, -1e-300, 10.0, "")
        check_number("board", "suction", self.suction, -1e-300, 1e6, "Pa")
        check_number("board", "bow", self.bow, -0.1, 0.1, "m")

    def height(self, shape: Shape, y: float = 0.0) -> float:
        """Height of the board: what the bow of a food leaves between the two.

        Args:
            shape: Outline of the food.
            y: Place across the blade [m].

        Returns:
            The height [m], 0 where the food rests on the board.
        """
        off = min(abs(y + shape.cut) / (shape.length / 2), 1.0)
        return -self.bow * (1.0 - off**2) if self.bow > 0 else self.bow * off**2
