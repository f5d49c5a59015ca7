"""What a cut has left: connected pieces with their volumes, and where the food still holds together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpm.discretisation.particles import Seeds

CRUMB = 1e-3  # a piece below this part of the whole is a crumb
BROKEN = 0.99  # bulk damage from which on a particle holds nothing


@dataclass(frozen=True)
class Topology:
    """Pieces of the food after a cut.

    Attributes:
        volumes: Volumes of the pieces as they are now, largest first, crumbs left out [m^3].
        crumbs: Volume of all crumbs [m^3].
        uncut_area: Area of the section that still holds [m^2].
        uncut_x: From where to where along the blade it holds [m], None when the cut is complete.
        uncut_height: Height above the board up to which it holds, in the uncut food [m].
        stone: Middle of the food's stone now [m], (x, y, z); None where there is none.
        stone_met: Height above the board at which the edge met the stone [m]; None where it did not.
    """

    volumes: tuple[float, ...]
    crumbs: float
    uncut_area: float
    uncut_x: tuple[float, float] | None
    uncut_height: float
    stone: tuple[float, ...] | None = None
    stone_met: float | None = None

    @property
    def complete(self) -> bool:
        """Whether the food is in two or more pieces."""
        return len(self.volumes) > 1

    def words(self) -> str:
        """The finding in a sentence."""
        if self.complete:
            sizes = ", ".join(f"{v * 1e6:.1f}" for v in self.volumes)
            return f"severed: {len(self.volumes)} pieces of {sizes} cm^3"
        if self.uncut_x is None:
            return "one piece: the food holds together although the edge has passed the whole section"
        a, b = (1e3 * x for x in self.uncut_x)
        why = "" if self.stone_met is None else f"stone at z = {self.stone_met * 1e3:.1f} mm; "
        return (
            f"not severed: {why}{self.uncut_area * 1e6:.0f} mm^2 of the section hold, from x = {a:.0f} to {b:.0f} mm "
            f"and up to {self.uncut_height * 1e3:.1f} mm above the board"
        )


def topology(
    seeds: Seeds,
    mirrors: tuple[bool, bool],
    half: np.ndarray,
    severed: np.ndarray,
    swell: np.ndarray,
    damage: np.ndarray,
    stony: np.ndarray | None = None,
) -> Topology:
    """Find the pieces.

    Two particles hold together when they were neighbours in the lattice of the uncut food, unless the cut went between
    them (both sides of the plane, one of them passed by the edge) or one of them is broken by bulk damage. A stone is
    of one half.

    Args:
        seeds: The particles at rest, n of them.
        mirrors: Whether x = 0 and y = 0 are mirrors.
        half: Half of each particle [-], 0 left, 1 right, shape (n,).
        severed: Whether the edge has passed it [-], shape (n,).
        swell: Volume over volume at rest [-], shape (n,).
        damage: Bulk damage [-], shape (n,).
        stony: Whether it is in the stone [-], shape (n,); None where there is no stone.

    Returns:
        What the cut has left.
    """
    from scipy.sparse import coo_matrix  # these take long to import
    from scipy.sparse.csgraph import connected_components

    stony = np.zeros(len(half), bool) if stony is None else stony
    cells, image, half = seeds.cells, seeds.owner, half[seeds.owner]
    if mirrors[1]:
        cells = np.concatenate([cells, cells * [1, -1, 1] - [0, 1, 0]])
        half = np.concatenate([half, np.where(stony[seeds.owner], half, 1 - half)])
        image = np.concatenate([image, image])
    if mirrors[0]:
        cells = np.concatenate([cells, cells * [-1, 1, 1] - [1, 0, 0]])
        half, image = np.concatenate([half, half]), np.concatenate([image, image])
    at = cells - cells.min(axis=0)
    index = np.full(at.max(axis=0) + 1, -1)
    index[tuple(at.T)] = np.arange(len(at))
    cut, broken = severed[image], damage[image] > BROKEN
    first, second = [], []
    for axis in range(3):
        a = np.moveaxis(index, axis, 0)[:-1].ravel()
        b = np.moveaxis(index, axis, 0)[1:].ravel()
        a, b = a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]
        holds = ((half[a] == half[b]) | ~(cut[a] | cut[b])) & ~(broken[a] | broken[b])
        first.append(a[holds])
        second.append(b[holds])
    i, j = np.concatenate(first), np.concatenate(second)
    _, label = connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(len(at), len(at))), directed=False)
    volumes = np.sort(np.bincount(label, weights=seeds.volume * swell[image]))[::-1]
    big = volumes > CRUMB * volumes.sum()
    hold = seeds.beside & ~severed & ~stony
    area = float(hold.sum()) * seeds.spacing**2 * (2 if mirrors[0] else 1) / (1 if mirrors[1] else 2)
    x = seeds.x[hold, 0]
    low, high = (float(x.min()), float(x.max())) if len(x) else (0.0, 0.0)
    return Topology(
        tuple(float(v) for v in volumes[big]),
        float(volumes[~big].sum()),
        area,
        ((-high if mirrors[0] else low, high) if len(x) else None),
        float(seeds.x[hold, 2].max()) if len(x) else 0.0,
    )
