"""A rigid ball that clings in the middle of an elastic cube: how stiff the cube is, and how the ball sinks in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import skfem as sk

from fem_reference.laws import Linear
from fem_reference.meshes import box
from fem_reference.solid import Solid
from mpm.scene.material import Material

NEAR = 1e-9  # distance at which a node lies on a plane [m]
SMALL = 1e-3  # displacement over the size of the cube; the law is linear


@dataclass(frozen=True)
class StoneInCube:
    """A rigid ball in the middle of a cube on a smooth board.

    Attributes:
        size: Edge of the cube [m].
        radius: Of the ball [m].
        material: Constants of the cube.
        cells: Elements along half the edge.
    """

    size: float
    radius: float
    material: Material
    cells: int = 8

    def pressing(self) -> float:
        """Force over stroke of a smooth plate that presses on the whole cube [N/m]."""
        half = self.size / 2
        solid = self._solid(0.0)
        top = solid.nodes[:, 2] > half - NEAR
        solid.hold(np.flatnonzero(solid.nodes[:, 2] < NEAR), [2])
        self._hold_ball(solid, 0.0)
        solid.hold(np.flatnonzero(top), [2], -SMALL * half)
        solid.solve()
        return -4 * float(solid.reaction(np.flatnonzero(top))[2]) / (SMALL * self.size)

    def sinking(self, open_above: float | None = None) -> float:
        """Force over way of the ball, which sinks towards the board [N/m].

        Args:
            open_above: Height over the ball's middle above which the middle plane y = 0 is cut [m]; None: nowhere.
        """
        half = self.size / 2
        solid = self._solid(-half, open_above)
        solid.hold(np.flatnonzero(solid.nodes[:, 2] < -half + NEAR), [2])
        way = SMALL * self.size
        ball = self._hold_ball(solid, -way)
        solid.solve()
        return -4 * float(solid.reaction(ball)[2]) / way

    def _solid(self, bottom: float, open_above: float | None = None) -> Solid:
        """The quarter at x, y >= 0, from a height [m] over the ball's middle upwards, whose elements fit the ball."""
        half = self.size / 2
        side, layers = np.linspace(0, half, self.cells + 1), round(self.cells * (1 - bottom / half))
        cube = box(side, side, np.linspace(bottom, half, layers + 1))
        p = cube.p
        reach, far = np.abs(p).max(axis=0), np.maximum(np.linalg.norm(p, axis=0), NEAR)
        blend = np.clip((reach - self.radius) / (half - self.radius), 0.0, 1.0)
        solid = Solid(
            sk.MeshHex(p * ((1 - blend) * np.where(reach > 0, reach / far, 1.0) + blend), cube.t), self._law()
        )
        x, y, z = solid.nodes.T
        solid.hold(np.flatnonzero(x < NEAR), [0])
        solid.hold(np.flatnonzero((y < NEAR) & (z <= (half if open_above is None else open_above) + NEAR)), [1])
        return solid

    def _law(self) -> Linear:
        return Linear(self.material.shear, self.material.lame)

    def _hold_ball(self, solid: Solid, down: float) -> np.ndarray:
        """Hold the nodes of the ball, moved upwards [m]; returns them."""
        ball = np.flatnonzero(np.linalg.norm(solid.nodes, axis=1) < self.radius + NEAR)
        solid.hold(ball, [0, 1])
        solid.hold(ball, [2], down)
        return ball
