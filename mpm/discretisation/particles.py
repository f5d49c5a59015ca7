"""Particles from a shape: one in each cell of a cubic lattice, at a random place in its middle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpm.scene import Numerics, Scene
from mpm.scene.errors import SceneError
from mpm.scene.shapes import surface

MAX_PARTICLES = 20_000_000
JITTER = 0.25
"""Part of its lattice cell in which a particle may lie. The noise of the sum over particles makes a solid softer and
damps it (docs/theory.md, "Measured choices"). On a lattice, planes of particles would touch a plate or pass the crack
front all at once."""


@dataclass(frozen=True)
class Seeds:
    """Particles at rest.

    Attributes:
        x: Positions [m], shape (n, 3); only the modelled half or quarter when mirrors are on.
        volume: Volume of a lattice cell [m^3]; the particles of all mirror images add up to the shape's volume.
        spacing: Lattice spacing [m].
        volume_ratio: Lattice cells that each particle stands for, shape (n,): 1 but far from the cut.
        board_gap: Distance at which each particle meets the board [m], shape (n,): its own from the lower surface in
            the first layer, half a spacing behind it.
        top_gap: The same from the upper surface.
        bottom: Whether a particle is in the first layer above the lower surface, shape (n,).
        top: The same below the upper surface.
        cells: Lattice cells, counted from the cut plane along y (-1, 0 on either side of it), shape (m, 3).
        owner: The particle that stands for each of them, shape (m,).
    """

    x: np.ndarray
    volume: float
    spacing: float
    volume_ratio: np.ndarray
    board_gap: np.ndarray
    top_gap: np.ndarray
    bottom: np.ndarray
    top: np.ndarray
    cells: np.ndarray
    owner: np.ndarray

    @property
    def total(self) -> float:
        """Volume of all particles [m^3], mirror images not counted."""
        return self.volume * float(self.volume_ratio.sum())

    @property
    def areas(self) -> np.ndarray:
        """Area of each particle of the outer layers from above [m^2], shape (n,); several cells lie along y."""
        return self.spacing**2 * self.volume_ratio

    @property
    def blade_gap(self) -> np.ndarray:
        """Distance at which each particle meets the blade [m], shape (n,): as ``board_gap``, from the cut plane."""
        return _depth(np.abs(self.x[:, 1]), self.spacing)

    def ties(self, mirrored: bool) -> np.ndarray:
        """Particles that face each other across the cut plane.

        At the rim of a food whose outline is not the same on both sides some may face none.

        Args:
            mirrored: Whether the cut plane is a mirror, where each faces its own image.

        Returns:
            Left and right particle, shape (k, 2), -1 for an image.
        """
        left, right = (np.flatnonzero(self.cells[:, 1] == layer) for layer in (-1, 0))
        if mirrored:
            return np.stack([self.owner[left], np.full(len(left), -1)], axis=1)
        low, width = self.cells.min(axis=0), np.ptp(self.cells[:, 0]) + 1
        place = (self.cells[:, 2] - low[2]) * width + self.cells[:, 0] - low[0]
        _, a, b = np.intersect1d(place[left], place[right], return_indices=True)
        return np.stack([self.owner[left[a]], self.owner[right[b]]], axis=1)

    @property
    def beside(self) -> np.ndarray:
        """Whether a particle is in the first layer beside the cut plane, shape (n,)."""
        out = np.zeros(len(self.x), bool)
        out[self.owner[np.isin(self.cells[:, 1], (-1, 0))]] = True
        return out


@dataclass(frozen=True, eq=False)
class Particles:
    """Particles of a cut after some steps.

    Attributes:
        x: Places in the grid's axes [m], shape (n, 3).
        side: 0 where the cut has not passed, else 1 or 2 for the half.
        F: Deformation gradients, shape (n, 3, 3).
        tau: Kirchhoff stresses [Pa], xx, yy, zz, yz, xz, xy, shape (n, 6).
        kappa: Largest equivalent strain that has acted on bulk damage so far; 0 without it.
    """

    x: np.ndarray
    side: np.ndarray
    F: np.ndarray
    tau: np.ndarray
    kappa: np.ndarray


def seed(scene: Scene) -> Seeds:
    """Fill the food with particles.

    Stratified (jittered) sampling: little of the quadrature noise of random points without the alignment of a lattice.

    Raises:
        SceneError: More particles than fit into memory.
    """
    shape, num = scene.food.shape, scene.numerics
    h = num.dx / num.ppc
    mirror_x, mirror_y = scene.mirrors
    near, far = shape.ends
    low = np.array([0.0 if mirror_x else -shape.width / 2, near, 0.0])
    high = np.array([shape.width / 2, 0.0 if mirror_y else far, shape.height])
    counts = np.ceil((high - low) / h - 1e-9).astype(int)
    right = 0 if mirror_y else math.ceil(far / h - 1e-9)
    counts[1] = math.ceil(-near / h - 1e-9) + right  # the cut plane lies between two layers
    if counts.prod() > MAX_PARTICLES:
        raise SceneError(f"numerics: dx = {num.dx * 1e3:g} mm makes {counts.prod():,} particles; use a larger dx")
    # the lattice starts on the mirror planes (x = 0 below, y = 0 above) and on the board
    origin = np.array([low[0], (right - counts[1]) * h, 0.0])
    cells = np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), -1).reshape(-1, 3)
    rng = np.random.default_rng(num.seed)
    offsets = JITTER * rng.uniform(-0.5, 0.5, cells.shape)
    if scene.tied and not mirror_y:  # across the cut plane each faces one of the other half
        first = counts[1] - right
        offsets[cells[:, 1] == first] = offsets[cells[:, 1] == first - 1] * [1, -1, 1]
    points = origin + (cells + 0.5 + offsets) * h
    there = scene.food.filled(points)
    points, cells = points[there], cells[there] - [0, counts[1] - right, 0]
    lattice = scene.food.volume / (2 if mirror_x else 1) / (2 if mirror_y else 1) / len(points)
    owner, bulk = _thin(cells, num, mirror_x)
    points = np.stack([np.bincount(owner, axis) for axis in points.T], axis=1) / bulk[:, None]
    floor, roof = surface(shape, points[:, 0], points[:, 1])
    below, above = points[:, 2] - floor, roof - points[:, 2]
    foot, head = _depth(below, h), _depth(above, h)
    return Seeds(points, lattice, h, bulk, foot, head, below < h, above < h, cells, owner)


def _thin(cells: np.ndarray, num: Numerics, mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
    """The particle that stands for each lattice cell (m, 3), and how many each stands for.

    Beyond ``num.far`` the lattice cells of a grid cell that lie side by side across the blade share one, and all of
    them where it and all grid cells around it are full: nothing touches the food there, and its outline stays as fine
    as elsewhere.
    """
    if num.far is None:
        return np.arange(len(cells)), np.ones(len(cells))
    near = num.ppc * max(1, round(num.far / num.dx))
    layer = np.where(cells[:, 1] >= 0, cells[:, 1], -1 - cells[:, 1])
    depth = np.where(layer < near, layer, near + (layer - near) // num.ppc)
    depth = np.where(cells[:, 1] >= 0, depth, -1 - depth)
    block = np.stack([cells[:, 0] // num.ppc, depth, cells[:, 2] // num.ppc], axis=1)
    margin = np.array([0 if mirrored else 1, 1, 1])  # the food goes on beyond a mirror plane
    at = tuple((block - block.min(axis=0) + margin).T)
    count = np.zeros([a.max() + 2 for a in at], int)
    np.add.at(count, at, 1)
    full = np.pad(count == num.ppc**3, 1, mode="edge")
    inner = np.lib.stride_tricks.sliding_window_view(full, (3, 3, 3))[at].all(axis=(1, 2, 3))
    key = np.stack([cells[:, 0], depth, cells[:, 2]], axis=1)
    key[inner] = [-1, 0, -1] + block[inner] * [-1, 1, -1]  # apart from those of single cells, which are not negative
    _, first, owner, bulk = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    order = np.argsort(np.argsort(first))  # particles keep the order of the lattice
    out = np.empty(len(bulk))
    out[order] = bulk
    return order[owner.ravel()], out


def _depth(distance: np.ndarray, spacing: float) -> np.ndarray:
    """Distance at which particles meet a surface [m]: their own in the first layer, half a spacing behind it."""
    return np.where(distance < spacing, distance, spacing / 2)
