"""Where a force stands: a sensor that is clipped at its end, or frozen, and the steps in which it counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.trace.mending import noise_of

FEWEST = 6
"""Equal samples on end from which on a force stands."""
FEWEST_AT_TOP = 4
"""The same for the largest value of a record."""
CHANCE = 1e-3
"""Chance that a force which repeats itself as often as this one does stands anywhere in the record that long."""
TOP_NOISE = 0.1
"""Part of the noise within which values at the top are one value: an end of the range that flickers by a digit."""
QUIET, QUIET_SAMPLES = 0.2, 12
"""Part of the noise that an amplifier's end of the range has at most, and samples from which on that is told."""


@dataclass(frozen=True)
class Standing:
    """Samples on end that are one value.

    Attributes:
        first: Index of the first.
        last: Index of the last.
        value: The force [N].
        top: Whether it is the largest of the record.
    """

    first: int
    last: int
    value: float
    top: bool


def standing(force: np.ndarray, noise: float) -> list[Standing]:
    """Where the force stands longer than noise and counting in steps explain.

    Args:
        force: Force [N], shape (n,).
        noise: Its noise before contact [N].

    Returns:
        The places, in order.
    """
    runs = _runs(force, 0.0)
    short = [last - first for first, last in runs if last - first + 1 < FEWEST]
    share = min(max(sum(short) / max(len(force) - 1, 1), 0.02), 0.98)
    chance = int(np.ceil(np.log(CHANCE / len(force)) / np.log(share)))
    longest = [last - first for first, last in runs if last - first + 1 >= FEWEST]
    if len(longest) > 0.02 * len(force):  # it counts in steps: most of the record stands
        share = min(max((sum(short) + sum(longest)) / max(len(force) - 1, 1), 0.02), 0.995)
        chance = max(chance, int(np.ceil(np.log(CHANCE / len(force)) / np.log(share))))
    least, least_at_top = max(FEWEST, chance), max(FEWEST_AT_TOP, chance)
    high = float(force.max())
    near = max(TOP_NOISE * noise, 1e-9 * abs(high))
    found = [Standing(a, b, float(force[a]), force[a] >= high - near) for a, b in runs if b - a + 1 >= least_at_top]
    found = [place for place in found if place.top or place.last - place.first + 1 >= least]
    if not any(place.top for place in found):
        top = [(a, b) for a, b in _runs((force >= high - near).astype(float), 0.0) if force[a] >= high - near]
        found += [Standing(a, b, high, True) for a, b in top if b - a + 1 >= least + 2]
    if not any(place.top for place in found):
        found += _quiet_top(force, noise)
    return sorted(found, key=lambda place: place.first)


def _quiet_top(force: np.ndarray, noise: float) -> list[Standing]:
    """Where the force stays at its top with much less noise than before contact, as where an amplifier ends."""
    high = float(np.sort(force)[-3:].mean())
    near = [(a, b) for a, b in _runs((force >= high - noise).astype(float), 0.0) if force[a] >= high - noise]
    near = [(a, b) for a, b in near if b - a + 1 >= QUIET_SAMPLES and a > QUIET_SAMPLES]
    near = [(a, b) for a, b in near if np.std(force[a : b + 1]) < QUIET * min(noise, noise_of(force[:a]))]
    return [Standing(a, b, high, True) for a, b in near]


def _runs(force: np.ndarray, tolerance: float) -> list[tuple[int, int]]:
    """First and last index of each stretch of equal values."""
    change = np.flatnonzero(np.abs(np.diff(force)) > tolerance)
    starts, ends = np.r_[0, change + 1], np.r_[change, len(force) - 1]
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b > a]
