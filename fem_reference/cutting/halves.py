"""Half a block with a blade on its plane of symmetry and a board under it, in plane strain or in space."""

from __future__ import annotations

import numpy as np
import skfem as sk

from fem_reference.contact import Plane, Wedge
from fem_reference.cutting.case import Blade, Block, Grid
from fem_reference.meshes import box, graded
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
        levels: The heights of its rows of nodes, rising [m], shape (m,).
        scale: Whole block per metre of width over what is meshed: two halves, of half the width in space [1/m].
        faces: Contact of the plane with the blade.
    """

    def __init__(self, block: Block, blade: Blade, grid: Grid) -> None:
        h, rows = block.height, round(block.height / grid.size)
        across, up = graded(block.length / 2, grid.size, grid.growth), np.linspace(0, h, rows + 1)
        mesh: sk.Mesh = sk.MeshQuad.init_tensor(across, up)
        self.scale = 2.0
        if block.width is not None:
            mesh = box(np.linspace(0, block.width / 2, grid.layers + 1), across, up)
            self.scale = 4.0 / block.width
        self.solid = Solid(mesh, block.law, 2, grid.mixed, BALANCE)
        near = 1e-6 * h
        plane = mesh.facets_satisfying(lambda p: p[-2] < near, boundaries_only=True)
        under = mesh.facets_satisfying(lambda p: p[-1] < near, boundaries_only=True)
        self.modulus = (block.law.lam + 2 * block.law.mu) / grid.size  # that all penalties are measured by [Pa/m]
        self.wedge = Wedge(h, blade.angle / 2, blade.thickness, blade.fillet, single=True)
        self.points: SurfacePoints = nodal(self.solid, plane)
        self.height = self.points.at(self.solid.nodes)[:, 2]
        row = np.round(2 * rows * self.height / h).astype(int)
        self.levels, self._row = h * np.arange(2 * rows + 1) / (2 * rows), row
        penalty = PENALTY * self.modulus
        self.faces = SlidingContact(sampled(self.solid, plane, SAMPLES), self.wedge, penalty, blade.friction)
        self._floor = SlidingContact(nodal(self.solid, under), Plane((0, 0, 0), (0, 0, 1)), penalty)
        self._base = np.flatnonzero(self.solid.nodes[:, 2] < near)
        self._held = block.held
        if block.width is not None:
            self.solid.hold(np.flatnonzero(self.solid.nodes[:, 0] < near), [0])
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
        """Energy in the penalty of the contacts [J/m]."""
        return self.scale * (self.faces.energy(self.x) + (0.0 if self._held else self._floor.energy(self.x)))

    @property
    def board(self) -> float:
        """Force down on the board [N/m]."""
        if self._held:
            return self.scale * float(self.solid.reaction(self._base)[2])
        return self.scale * float(self._floor.tractions(self.x)[:, 2].sum())

    def rows(self, values: np.ndarray) -> np.ndarray:
        """Values at the nodes of the plane, shape (n,), as means along its rows, shape (m,)."""
        weights = self.points.areas
        return np.bincount(self._row, weights * values) / np.bincount(self._row, weights)

    def now(self, height: float) -> float:
        """Where a row of the plane is that was at a height [m] of the undeformed block [m]."""
        return float(np.interp(height, self.levels, self.rows(self.points.at(self.x)[:, 2])))
