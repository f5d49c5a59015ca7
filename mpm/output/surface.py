"""The food's surface, which a picture shows: triangles of either half that move with the particles.

The outline is a stack of rings around sections of the shape, closed by the face of the cut and by the far end. A vertex
goes with the particles of its own half that are nearest to it at rest: by a moving least-squares fit that is exact for
any affine motion (Lancaster and Salkauskas 1981, Math. Comp. 37:141), while a stress, which must not overshoot, is
their weighted mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.discretisation.particles import Seeds
from mpm.output.snapshot import Snapshot
from mpm.scene.shapes import Shape, span, surface

NEAR = 16  # particles that a vertex goes with
AROUND = 64  # vertices of a ring
DISCS = 12  # rings of the face of the cut and of the far end, besides their middle
ROUNDING = 1e-9  # part by which vertices on the rim of a shape are moved inwards, where it has a height
SLOPE = 1e-8  # part of the spread of the neighbours that is added to it, in case they lie in a plane
ON_FACE = 1 + DISCS * AROUND  # first vertices of either half: the face of the cut from its middle to its rim
PASSED = 0.5  # part of a vertex's particles that the cut has passed from which on it is cut


@dataclass(frozen=True, eq=False)
class Half:
    """One half of the food at rest.

    Attributes:
        points: Vertices [m], shape (m, 3).
        triangles: Vertices of each triangle, seen from outside against the clock, shape (t, 3).
    """

    points: np.ndarray
    triangles: np.ndarray


def half_of(shape: Shape, spacing: float, side: float = 1.0) -> Half:
    """The surface of the part on one side of the cut, whose cut face is y = 0.

    Args:
        shape: The outline.
        spacing: Distance of the rings beside the cut [m].
        side: 1 for the part at y > 0, -1 for the other.

    Returns:
        Its vertices and triangles.
    """
    b = shape.ends[1] if side > 0 else shape.ends[0]
    count = max(int(np.ceil(np.pi / 2 * abs(b) / spacing)), 4)
    rings = [_ring(shape, b * float(np.sin(np.pi / 2 * t))) for t in np.linspace(0.0, 1.0, count + 1)]
    middle = [_middle(ring) for ring in (rings[0], rings[-1])]
    face, end = (
        [centre + (ring - centre) * part for part in np.arange(1, DISCS) / DISCS]
        for ring, centre in zip((rings[0], rings[-1]), middle, strict=True)
    )
    # from the middle of the cut face to its rim, over the outline to the far end's rim and to its middle
    whole = [*face, *rings, *reversed(end)]
    points = np.concatenate([middle[0], *whole, middle[1]])
    first = 1 + AROUND * np.arange(len(whole))
    around, after = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    last = len(points) - 1
    triangles = [np.stack([np.zeros(AROUND, int), first[0] + after, first[0] + around], axis=1)]
    for low, high in zip(first[:-1], first[1:], strict=True):
        triangles.append(np.stack([low + around, low + after, high + after], axis=1))
        triangles.append(np.stack([low + around, high + after, high + around], axis=1))
    triangles.append(np.stack([np.full(AROUND, last), first[-1] + around, first[-1] + after], axis=1))
    return Half(points, np.concatenate(triangles)[:, :: -1 if side > 0 else 1])


def _middle(ring: np.ndarray) -> np.ndarray:
    """The middle of a ring, half-way between its flanks, shape (1, 3)."""
    x = ring[:, 0]
    return np.array([[(x.min() + x.max()) / 2, ring[0, 1], ring[:, 2].mean()]])


def _ring(shape: Shape, y: float) -> np.ndarray:
    """Vertices (AROUND, 3) around the section at y: over its top towards -x, down, below it towards +x, and up."""
    left, right = span(shape, y)
    middle, w = (left + right) / 2, (right - left) / 2
    upright = AROUND // 4 if shape.walled else 0  # vertices of each side, where there are sides
    part = np.arange(AROUND // 2 - upright) / (AROUND // 2 - upright)
    up = np.arange(upright) / max(upright, 1)
    x, inner = w * np.cos(np.pi * part), 1 - ROUNDING
    floor, roof = surface(shape, middle + inner * x, np.full_like(x, inner * y))
    low, high = np.nan_to_num([floor[0], roof[0]], nan=shape.height / 2)
    below, above = surface(shape, middle - inner * x, np.full_like(x, inner * y))
    base, crest = np.nan_to_num([below[0], above[0]], nan=shape.height / 2)
    parts = [
        (middle + x, np.nan_to_num(roof, nan=low)),
        (np.full_like(up, middle - w), crest + (base - crest) * up),
        (middle - x, np.nan_to_num(below, nan=base)),
        (np.full_like(up, middle + w), low + (high - low) * up),
    ]
    return np.concatenate([np.stack([a, np.full_like(a, y), z], axis=1) for a, z in parts])


class Surface:
    """Both halves of the food, at rest and as the particles have moved.

    Args:
        shape: The outline.
        seeds: The particles at rest.
        mirrors: Whether x = 0 and y = 0 are mirrors of them.

    Attributes:
        rest: Vertices at rest [m], shape (m, 3).
        triangles: Vertices of each triangle, seen from outside against the clock, shape (t, 3).
        second: The first vertex of the half at y > 0.
    """

    def __init__(self, shape: Shape, seeds: Seeds, mirrors: tuple[bool, bool]) -> None:
        left, right = (half_of(shape, seeds.spacing, side) for side in (-1.0, 1.0))
        places = {-1.0: left.points, 1.0: right.points}
        self.second = len(left.points)
        self._starts = (0, self.second)
        self._mirrored = mirrors[1]
        self._flat_ends = shape.prism
        sides = (-1.0,) if self._mirrored else (-1.0, 1.0)
        self._carried = [_Carried(places[side], seeds.x, side, mirrors[0]) for side in sides]
        self.triangles = np.concatenate([left.triangles, right.triangles + len(left.points)])
        self.rest = np.concatenate(list(places.values()))

    @property
    def face(self) -> np.ndarray:
        """Whether a vertex lies on the face of the cut, its rim among them, shape (m,)."""
        return self._on_faces(np.ones(ON_FACE, bool))

    @property
    def parts(self) -> tuple[np.ndarray, np.ndarray]:
        """Triangles of the skin and of the flesh, shapes (t, 3).

        The flesh shows on the faces of the cut and on the flat ends of a food with parallel sides, which is a piece of
        a longer one.
        """
        inside = self._inside(self._ends if self._flat_ends else np.zeros_like(self._ends)) | self._inside(self.face)
        return self.triangles[~inside], self.triangles[inside]

    @property
    def rims(self) -> np.ndarray:
        """Vertices of the rims of both faces, those of one place side by side, shape (AROUND, 2)."""
        return np.add.outer(np.arange(ON_FACE - AROUND, ON_FACE), self._starts)

    def bare(self, now: Snapshot) -> np.ndarray:
        """Which triangles of the flesh are seen, shape (t,): all of an end, of the faces those the cut has reached.

        The faces of a food that is whole lie within it, and their rims along its skin, where they would show as a line.
        """
        flesh = self.parts[1]
        out: np.ndarray = self.cut(now)[flesh].any(axis=1) | ~self.face[flesh].all(axis=1)
        return out

    def points(self, now: Snapshot) -> np.ndarray:
        """Places of the vertices [m], shape (m, 3): both halves are one where the cut has not passed."""
        halves = [half.points(now.x) for half in self._carried]
        if self._mirrored:
            halves.append(halves[0] * [1.0, -1.0, 1.0])
        left, right = halves
        whole = ~self.cut(now)[:ON_FACE]
        left[:ON_FACE][whole] = right[:ON_FACE][whole] = (left[:ON_FACE] + right[:ON_FACE])[whole] / 2
        return np.concatenate(halves)

    def cut(self, now: Snapshot) -> np.ndarray:
        """Whether the cut has passed a vertex of its face on either side, shape (m,); False for all others."""
        passed = self.values(now.severed.astype(float)) >= PASSED
        left, right = (passed[start : start + ON_FACE] for start in self._starts)
        return self._on_faces(left | right)

    @property
    def _ends(self) -> np.ndarray:
        """Whether a vertex lies on a far end, its rim among them, shape (m,)."""
        out = np.zeros(len(self.rest), bool)
        for end in (self.second, len(self.rest)):
            out[end - ON_FACE : end] = True
        return out

    def _inside(self, vertices: np.ndarray) -> np.ndarray:
        """Which triangles have all their corners among some vertices, a truth value (m,) each; shape (t,)."""
        out: np.ndarray = vertices[self.triangles].all(axis=1)
        return out

    def _on_faces(self, values: np.ndarray) -> np.ndarray:
        """Truth values (ON_FACE,) of both faces among those of all vertices (m,)."""
        out = np.zeros(len(self.rest), bool)
        for start in self._starts:
            out[start : start + ON_FACE] = values
        return out

    def values(self, of_particles: np.ndarray) -> np.ndarray:
        """What the particles have, shape (n,), at the vertices, shape (m,)."""
        halves = [half.values(of_particles) for half in self._carried]
        return np.concatenate(halves * 2 if self._mirrored else halves)


class _Carried:
    """Vertices of one half and the particles they go with."""

    def __init__(self, points: np.ndarray, x: np.ndarray, side: float, mirrored: bool) -> None:
        from scipy.spatial import cKDTree  # takes long to import

        own = np.flatnonzero(x[:, 1] * side > 0)
        near, flip = x[own], np.ones(len(own))
        if mirrored:  # the images of the particles across x = 0
            near = np.concatenate([near, near * [-1.0, 1.0, 1.0]])
            own, flip = np.concatenate([own, own]), np.concatenate([flip, -flip])
        distance, which = cKDTree(near).query(points, k=min(NEAR, len(near)))
        self._points, self._own = points, own[which]
        self._flip = np.stack([flip[which], np.ones_like(distance), np.ones_like(distance)], axis=2)
        self._rest = x[self._own] * self._flip
        weight = np.exp(-((1.5 * distance / distance[:, -1:]) ** 2))
        self._mean = weight / weight.sum(axis=1, keepdims=True)
        self._fit = self._least_squares()

    def _least_squares(self) -> np.ndarray:
        """Weights (m, k) of the neighbours' displacements in that of each vertex: those of a weighted linear fit."""
        arm = self._rest - self._points[:, None]
        basis = np.concatenate([np.ones((*arm.shape[:2], 1)), arm], axis=2)
        gram = np.einsum("mki,mk,mkj->mij", basis, self._mean, basis)
        spread = np.trace(gram[:, 1:, 1:], axis1=1, axis2=2)
        gram[:, 1:, 1:] += SLOPE * spread[:, None, None] * np.eye(3)
        first = np.zeros((len(arm), 4, 1))
        first[:, 0] = 1.0
        chosen = np.linalg.solve(gram, first)[:, :, 0]
        out: np.ndarray = np.einsum("mi,mki,mk->mk", chosen, basis, self._mean)
        return out

    def points(self, x: np.ndarray) -> np.ndarray:
        """Places of the vertices (m, 3) where the particles are at x (n, 3)."""
        moved = x[self._own] * self._flip - self._rest
        out: np.ndarray = self._points + np.einsum("mk,mkd->md", self._fit, moved)
        return out

    def values(self, of_particles: np.ndarray) -> np.ndarray:
        """What the particles have (n,) at the vertices (m,)."""
        out: np.ndarray = (self._mean * of_particles[self._own]).sum(axis=1)
        return out
