"""Half a block in plane strain with a blade on its plane of symmetry and a board under it."""

from __future__ import annotations

import numpy as np
import skfem as sk

from fem_reference.contact import Plane, Wedge
from fem_reference.crack.cut_case import Blade, Block, Grid
from fem_reference.meshes import graded
from fem_reference.solid import Solid
from fem_reference.surface import SlidingContact, SurfacePoints, nodal, sampled

PENALTY = 10.0  # stiffness of contact over the P-wave modulus and the elements' size: with more the force ripples
SAMPLES = 8  # points of contact along the edge of an element
BALANCE = 1e-6  # forces out of balance that are small enough, over those in the solid


class Halves:
    """The half y > 0 of a block that a blade parts at y = 0.

    Attributes:
        solid: Its finite elements.
        wedge: The blade.
        points: Nodes on the plane of symmetry.
        height: Their heights in the undeformed block [m], shape (n,).
        faces: Contact of the plane with the blade.
    """

    def __init__(self, block: Block, blade: Blade, grid: Grid) -> None:
        h, rows = block.height, round(block.height / grid.size)
        across = graded(block.length / 2, grid.size, grid.growth)
        mesh = sk.MeshQuad.init_tensor(across, np.linspace(0, h, rows + 1))
        self.solid = Solid(mesh, block.law, 2, grid.mixed, BALANCE)
        near = 1e-6 * h
        plane = mesh.facets_satisfying(lambda p: p[0] < near, boundaries_only=True)
        under = mesh.facets_satisfying(lambda p: p[1] < near, boundaries_only=True)
        self.modulus = (block.law.lam + 2 * block.law.mu) / grid.size  # that all penalties are measured by [Pa/m]
        self.wedge = Wedge(h, blade.angle / 2, blade.thickness, blade.rounding, single=True)
        self.points: SurfacePoints = nodal(self.solid, plane)
        self.height = self.points.at(self.solid.nodes)[:, 2]
        penalty = PENALTY * self.modulus
        self.faces = SlidingContact(sampled(self.solid, plane, SAMPLES), self.wedge, penalty, blade.friction)
        self._floor = SlidingContact(nodal(self.solid, under), Plane((0, 0, 0), (0, 0, 1)), penalty)
        self._base = np.flatnonzero(self.solid.nodes[:, 2] < near)
        self._held = block.held
        self.solid.surfaces.append(self.faces)
        if block.held:
            self.solid.hold(self._base, [2])
        else:
            self.solid.surfaces.append(self._floor)

    @property
    def x(self) -> np.ndarray:
        """Places of the nodes [m], shape (n, 3)."""
        return self.solid.nodes + self.solid.u

    @property
    def springs(self) -> float:
        """Energy in the penalty of the contacts of both halves [J/m]."""
        return 2 * (self.faces.energy(self.x) + (0.0 if self._held else self._floor.energy(self.x)))

    @property
    def board(self) -> float:
        """Force of both halves down on the board [N/m]."""
        if self._held:
            return 2 * float(self.solid.reaction(self._base)[2])
        return 2 * float(self._floor.tractions(self.x)[:, 2].sum())

    def now(self, height: float) -> float:
        """Where a point of the plane is that was at a height [m] of the undeformed block [m]."""
        order = np.argsort(self.height)
        return float(np.interp(height, self.height[order], self.points.at(self.x)[order, 2]))
