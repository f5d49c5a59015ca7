"""What a picture of the cut shows: the food across the blade's middle, at some strokes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mpm.discretisation.particles import Seeds
from mpm.output.snapshot import Snapshot, SnapshotRecorder


@dataclass(frozen=True, eq=False)
class Section:
    """The food across the blade's middle, at some strokes: what a picture of the cut shows.

    Attributes:
        stroke: Way of the edge below the food's top [m], shape (k,).
        y: Places across the blade [m], shape (k, m).
        z: Heights above the board [m], shape (k, m).
        mises: Von Mises stress [Pa], shape (k, m).
        size: Width across the blade and height of the piece of food that each particle stands for, undeformed [m],
            shape (2, m).
        mirrored: Whether there is a mirror image of it on the other side of the blade.
    """

    stroke: np.ndarray
    y: np.ndarray
    z: np.ndarray
    mises: np.ndarray
    size: np.ndarray
    mirrored: bool


class SectionRecorder(SnapshotRecorder):
    """Keeps the section of a run at even parts of it and at its end.

    Args:
        seeds: Particles of the run.
        mirrors: Whether x = 0 and y = 0 are mirrors.
        times: How often.
    """

    def __init__(self, seeds: Seeds, mirrors: tuple[bool, bool], times: int) -> None:
        super().__init__(times)
        self._mirrored = mirrors[1]
        self._which, self._size = _pieces(seeds, mirrors[0])

    def take(self, now: Snapshot) -> None:
        """Keep what is in the section."""
        which = self._which
        super().take(replace(now, x=now.x[which], mises=now.mises[which], severed=now.severed[which]))

    def section(self) -> Section | None:
        """All that was kept; None where nothing was."""
        if not self.taken:
            return None
        y, z, mises = np.stack([(*kept.x.T[1:], kept.mises) for kept in self.taken], axis=1)
        return Section(np.array([kept.stroke for kept in self.taken]), y, z, mises, self._size, self._mirrored)


def section_of(looks: Sequence[Snapshot], seeds: Seeds, mirrors: tuple[bool, bool]) -> Section:
    """The section of looks that were kept whole.

    Args:
        looks: The particles at some moments, one at least.
        seeds: Particles of the run at rest.
        mirrors: Whether x = 0 and y = 0 are mirrors.

    Returns:
        The food across the blade's middle at each of them.
    """
    recorder = SectionRecorder(seeds, mirrors, len(looks))
    for look in looks:
        recorder.take(look)
    section = recorder.section()
    assert section is not None  # because something was kept
    return section


def _pieces(seeds: Seeds, mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
    """Particles that stand for food beside the plane across the blade's middle, and how much of it each stands for."""
    cells, owner = seeds.cells, seeds.owner
    on = cells[:, 0] == (0 if mirrored else (cells[:, 0].max() + 1) // 2)
    which, first = np.unique(owner[on], return_inverse=True)
    low, high = np.full((2, len(which)), np.iinfo(int).max), np.full((2, len(which)), np.iinfo(int).min)
    for axis in (0, 1):
        np.minimum.at(low[axis], first, cells[on, 1 + axis])
        np.maximum.at(high[axis], first, cells[on, 1 + axis])
    return which, seeds.spacing * (high - low + 1)
