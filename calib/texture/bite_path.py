"""The way of the plate in two bites: down, standing, up, waiting, and again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.io.type_schema import NotNegative, Positive
from calib.texture.bites import find_bites, plate_descent
from calib.texture.plate_record import PlateRecord
from calib.texture.texture_profile import dwell, run_on
from mpm.arrays import FloatArray

STEPS = 24
"""Steps of each straight part of a path."""


SHORTEST = 1e-6
"""Least time of a part of a path, part of the descent [-]: a plate that does not stand has as many samples as one that
does."""


@dataclass(frozen=True)
class BitePath:
    """Two bites of a plate that moves at constant speed.

    Attributes:
        descent_s: Time in which the plate goes down, and up [s].
        dwell_s: Time for which it stands at the bottom [s].
        apart_s: Time between the two peaks [s].
        strain: Strain at the bottom [-].
    """

    descent_s: Positive
    dwell_s: NotNegative
    apart_s: Positive
    strain: Positive

    def history(self) -> tuple[FloatArray, FloatArray]:
        """Times from the first peak [s], shape (n,), and strains at them [-], shape (n,)."""
        down, apart = self.descent_s, self.apart_s
        stand = max(self.dwell_s, SHORTEST * down)
        corners = [-down, 0.0, stand, stand + down, max(apart - down, stand + 1.01 * down), apart, apart + stand]
        corners.append(apart + stand + down)
        strains = [0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0]
        parts = [np.linspace(a, b, STEPS + 1)[1:] for a, b in zip(corners, corners[1:], strict=False)]
        time = np.concatenate([corners[:1], *parts])
        return time, self.strain * np.interp(time, corners, strains)


def path_of(records: Sequence[PlateRecord], heights: Sequence[float]) -> BitePath:
    """The path that repeats of one speed have in common: medians of theirs.

    A way that is recorded late is put right: its standing begins with the peak of the load.

    Args:
        records: The records, each of two bites.
        heights: Height of each specimen [m].

    Returns:
        The path.
    """
    standing, apart, strains, descents = [], [], [], []
    for record, height in zip(records, heights, strict=True):
        first, second = find_bites(record)
        speed = float(record.way.max()) / plate_descent(record)
        standing.append(max(dwell(record, first) - run_on(record, first) / speed, 0.0))
        apart.append(second.peak - first.peak)
        strains.append(float(record.way.max()) / height)
        descents.append(plate_descent(record))
    return BitePath(*(float(np.median(each)) for each in (descents, standing, apart, strains)))
