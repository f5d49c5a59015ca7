"""The modes of a posterior: maxima of its density, where a valley parts them, each with the probability about it.

Every draw climbs to the maximum above it. Two maxima belong to one mode where the density does not fall on the way
from one to the other by more than bounds a 95 % interval of one parameter: small ripples of an emulator are no modes.
A bent ridge is one mode, since its draws climb along it to the same maximum.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mpm.arrays import FloatArray

Places = npt.NDArray[np.intp]

DIP = 1.92
"""Fall of the logarithm of the density between two maxima that parts them: half of chi-square's 95 % point."""
CLIMBERS = 96
"""Draws that climb."""
STEPS = 60
"""Steps of a climb at most."""
LONGEST, SHORTEST = 0.5, 0.01
"""Length of a step at first, and of the one that is not worth it any more [posterior standard deviations]."""
SLOPE = 1e-3
"""Width of the differences of a slope [posterior standard deviations]."""
ALONG = 12
"""Points at which the density is seen between two maxima."""
LEAST_WEIGHT = 0.02
"""Probability from which on a mode is one: less is within the error of a sample."""

Density = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode.

    Attributes:
        weight: Part of the posterior's probability [-].
        top: Its point of largest density (p,).
        members: Which of the draws belong to it, places (k,).
    """

    weight: float
    top: FloatArray
    members: Places


def modes(points: FloatArray, density: Density) -> tuple[Mode, ...]:
    """The modes of draws of equal weight, the heaviest first.

    Args:
        points: Draws from the posterior (k, p).
        density: Logarithm of the density (q,) at points (q, p).

    Returns:
        The modes; there is one at least.
    """
    middle, spread = points.mean(axis=0), np.maximum(points.std(axis=0), 1e-12)
    standard = (points - middle) / spread

    def log(x: FloatArray) -> FloatArray:
        return density(middle + spread * x)

    some = np.unique(np.linspace(0, len(points) - 1, min(CLIMBERS, len(points))).round().astype(int))
    tops, heights = climbed(standard[some], log)
    order = np.argsort(-heights, kind="stable")
    label = _joined(tops, heights, order, log)
    nearest = np.argmin(np.sum((standard[:, None] - standard[some][None]) ** 2, axis=2), axis=1)
    of_all = label[nearest]
    found = []
    for one in np.unique(of_all):
        members = np.flatnonzero(of_all == one)
        best = max(np.flatnonzero(label == one), key=lambda k: heights[k])
        found.append(Mode(len(members) / len(points), middle + spread * tops[best], members))
    kept = [m for m in found if m.weight >= LEAST_WEIGHT] or found
    return tuple(sorted(kept, key=lambda m: -m.weight))


def climbed(start: FloatArray, log: Density) -> tuple[FloatArray, FloatArray]:
    """Points to which a steepest ascent with steps of its own length leads (q, p), and the density there (q,)."""
    x, height = start.copy(), log(start)
    step = np.full(len(x), LONGEST)
    moves = SLOPE * np.eye(x.shape[1])
    for _ in range(STEPS):
        going = np.flatnonzero(step > SHORTEST)
        if not len(going):
            break
        beside = (x[going][:, None] + moves[None]).reshape(-1, x.shape[1])
        slope = log(beside).reshape(len(going), -1) - height[going][:, None]
        length = np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-300)
        tried = x[going] + step[going][:, None] * slope / length
        reached = log(tried)
        better = reached > height[going]
        x[going[better]], height[going[better]] = tried[better], reached[better]
        step[going] *= np.where(better, 1.3, 0.4)
    return x, height


def _joined(tops: FloatArray, heights: FloatArray, order: Places, log: Density) -> Places:
    """Number of the mode of each maximum (q,): those joined between which the density does not dip."""
    pairs = [(a, b) for k, a in enumerate(order) for b in order[:k]]
    if not pairs:
        return np.zeros(len(tops), dtype=int)
    one, other = np.array(pairs).T
    parts = np.linspace(0.0, 1.0, ALONG + 2)[1:-1]
    way = tops[one][:, None] + parts[None, :, None] * (tops[other] - tops[one])[:, None]
    lowest = log(way.reshape(-1, tops.shape[1])).reshape(len(pairs), -1).min(axis=1)
    joined = lowest > np.minimum(heights[one], heights[other]) - DIP
    links = coo_array((np.ones(joined.sum()), (one[joined], other[joined])), shape=(len(tops), len(tops)))
    _, label = connected_components(links, directed=False)
    out: Places = label
    return out
