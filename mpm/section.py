"""What a picture of the cut shows: the food across the blade's middle, at some strokes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mpm.seeding import Seeds


@dataclass(frozen=True, eq=False)
class Section:
    """The food across the blade's middle, at some strokes: what a picture of the cut shows.

    Attributes:
        stroke: Way of the edge below the food's top [m], shape (k,).
        y: Places across the blade [m], shape (k, m).
        z: Heights above the board [m], shape (k, m).
        mises: Von Mises stress [Pa], shape (k, m).
        size: Width across the blade and height of the piece of food that each particle stands for, undeformed [m], shape (2, m).
        mirrored: Whether there is a mirror image of it on the other side of the blade.
    """

    stroke: np.ndarray
    y: np.ndarray
    z: np.ndarray
    mises: np.ndarray
    size: np.ndarray
    mirrored: bool


class Looks:
    """Looks at the section of a run as it goes on.

    Args:
        seeds: Particles of the run.
        mirrors: Whether x = 0 and y = 0 are mirrors.
    """

    def __init__(self, seeds: Seeds, mirrors: tuple[bool, bool]) -> None:
        self._seeds, self._mirrors = seeds, mirrors
        self._taken: list[tuple[float, np.ndarray]] = []
        self._which: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self._taken)

    def take(self, stroke: float, fields: Any, x: np.ndarray) -> None:
        """Look now.

        Args:
            stroke: Way of the edge below the food's top [m].
            fields: The fields of the run.
            x: Places of its particles in the scene's axes [m], shape (n, 3).
        """
        if self._which is None:
            self._which, self._size = self._pieces()
        which = self._which
        tau = fields.stresses()[which] / np.linalg.det(fields.deformation()[which])[:, None]
        xx, yy, zz, yz, xz, xy = tau.T
        mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (yz**2 + xz**2 + xy**2))
        self._taken.append((stroke, np.stack([x[which, 1], x[which, 2], mises])))

    def section(self) -> Section | None:
        """All looks; None where there was none."""
        if not self._taken:
            return None
        y, z, mises = np.stack([look for _, look in self._taken], axis=1)
        return Section(np.array([stroke for stroke, _ in self._taken]), y, z, mises, self._size, self._mirrors[1])

    def _pieces(self) -> tuple[np.ndarray, np.ndarray]:
        """Particles that stand for food beside the plane across the blade's middle, and how much of it each stands for."""
        cells, owner = self._seeds.cells, self._seeds.owner
        on = cells[:, 0] == (0 if self._mirrors[0] else (cells[:, 0].max() + 1) // 2)
        which, first = np.unique(owner[on], return_inverse=True)
        low, high = np.full((2, len(which)), np.iinfo(int).max), np.full((2, len(which)), np.iinfo(int).min)
        for axis in (0, 1):
            np.minimum.at(low[axis], first, cells[on, 1 + axis])
            np.maximum.at(high[axis], first, cells[on, 1 + axis])
        return which, self._seeds.spacing * (high - low + 1)
