"""From the cells of an emulator to finer ones: what they change of size and shape, from pairs of runs.

Source: a fine code as a coarse one plus a process of their difference, Kennedy & O'Hagan (2000), Biometrika 87:1.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calib.posterior.emulator import CurveEmulator, Expected
from calib.posterior.process import Process
from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

FEWEST_PAIRS = 4
"""Runs on finer cells without which nothing is corrected."""
UNSEEN_SIZE, UNSEEN_SHAPE = 0.1, 0.3
"""What finer cells may change of the size, and of each component of a shape, before any run has shown it [-]: the
size of apples changes by 5 % and their components by 0.9 of whole cells, those of bananas by 2 % and 0.25."""


class Correction:
    """Emulated curves on finer cells.

    Args:
        emulator: The emulator of the coarser cells.
        runs: Whole runs on the finer ones; with fewer than :data:`FEWEST_PAIRS` nothing is corrected.
        finer: Whether finer cells are meant at all; if so, and there are too few runs, that is doubt.
    """

    def __init__(self, emulator: CurveEmulator, runs: Sequence[ScoredRun] = (), *, finer: bool = False) -> None:
        self.emulator = emulator
        self.shape = emulator.shape
        """Mean shape on the finer cells [-] (n,)."""
        self.sizes: Process | None = None
        self.shapes: Process | None = None
        self._unseen = (UNSEEN_SIZE, UNSEEN_SHAPE) if finer else (0.0, 0.0)
        if len(runs) < FEWEST_PAIRS:
            return
        found = emulator(np.array([run.z for run in runs]))
        curves = np.array([run.curve for run in runs])
        means = curves.mean(axis=1)
        shapes = curves / means[:, None] - found.shape @ emulator.components
        self.shape = shapes.mean(axis=0)
        self.sizes = Process(found.x, np.log(means / found.size)[:, None])
        self.shapes = Process(found.x, (shapes - self.shape) @ emulator.components.T)

    def __call__(self, z: FloatArray) -> Expected:
        """What is expected on the finer cells at internal coordinates (q, p)."""
        found = self.emulator(z)
        if self.sizes is None or self.shapes is None:
            size_sd, shape_sd = (
                np.hypot(own, more) for own, more in zip((found.size_sd, found.shape_sd), self._unseen, strict=True)
            )
            return Expected(found.size, size_sd, found.shape, shape_sd, found.completed, found.x)
        size, size_sd = self.sizes(found.x)
        shape, shape_sd = self.shapes(found.x)
        return Expected(
            found.size * np.exp(size[:, 0]),
            np.hypot(found.size_sd, size_sd),
            found.shape + shape,
            np.hypot(found.shape_sd, shape_sd),
            found.completed,
            found.x,
        )

    def curves(self, z: FloatArray) -> FloatArray:
        """Expected curves on the finer cells [N] (q, n) at internal coordinates (q, p)."""
        found = self(z)
        out: FloatArray = found.size[:, None] * (self.shape + found.shape @ self.emulator.components)
        return out
