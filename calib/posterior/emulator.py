"""The curve of a cut between the simulated ones: scale times mean times shape, each from a process of its own.

    curve(z) = k(z) e^l(x) (c + sum_j a_j(x) p_j)

k is the scale of stress, l the logarithm of the mean force over it, c the mean of all shapes (curves over their own
mean) and p_j their principal components. A third process has the part of the food that was parted: a run that pressed
the food away is no curve to learn from, but says where not to go.

Source: principal components of simulated curves with a process each, Higdon et al. (2008), J. Am. Stat. Assoc. 103:570.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from calib.posterior.coordinates import Coordinates
from calib.posterior.process import Process
from calib.problem.scored_run import ScoredRun
from calib.simulation.evaluation import FULLY_PARTED, NOT_PARTED
from mpm.arrays import FloatArray

LEARNT_PARTED = 0.6
"""Energy of the edge over R times the new area from which on a curve is learnt from [-]."""
UNLEARNT = 0.003
"""Root mean square of shapes which the components leave out at most [-]."""
MOST_COMPONENTS = 10
"""Principal components at most."""
FEWEST = 24
"""Whole curves without which there is no emulator."""


@dataclass(frozen=True, eq=False)
class Expected:
    """Curves as an emulator expects them.

    Attributes:
        size: Factor of scale and mean on the shape [N] (q,).
        size_sd: Relative standard deviation of the factor [-] (q,).
        shape: Components of the shape [-] (q, k).
        shape_sd: Standard deviation of each of them [-] (q,).
        completed: Part of the stroke that was completed as a cut [-] (q,).
        x: Coordinates, each axis of about unit variance [-] (q, d).
    """

    size: FloatArray
    size_sd: FloatArray
    shape: FloatArray
    shape_sd: FloatArray
    completed: FloatArray
    x: FloatArray


class CurveEmulator:
    """Emulator of the curves of one scene.

    Args:
        coordinates: Where the processes live.
        runs: The runs so far, of one fidelity.
        learnt: Which of them are near enough to the trace to be learnt from (m,); None for all that were cut.
        earlier: An emulator of fewer runs, whose hyperparameters this one starts from.

    Raises:
        ValueError: Fewer whole curves than :data:`FEWEST`.
    """

    sizes: Process
    shapes: Process
    parted: Process

    def __init__(
        self,
        coordinates: Coordinates,
        runs: Sequence[ScoredRun],
        learnt: npt.NDArray[np.bool_] | None = None,
        earlier: CurveEmulator | None = None,
    ) -> None:
        self.coordinates = coordinates
        whole = np.array([was_cut(run) for run in runs]) & (True if learnt is None else learnt)
        if whole.sum() < FEWEST:
            raise ValueError(f"{whole.sum()} whole curves are too few to learn from; {FEWEST} are needed")
        z = np.array([run.z for run in runs])
        raw = coordinates(z)
        self._centre, self._spread = raw[whole].mean(axis=0), np.maximum(raw[whole].std(axis=0), 1e-9)
        x = self._standard(raw)
        curves = np.array([run.curve for run, use in zip(runs, whole, strict=True) if use])
        means = curves.mean(axis=1)
        sizes = np.log(means) - coordinates.scale(z[whole])
        shapes = curves / means[:, None]
        self.shape = shapes.mean(axis=0)
        """Mean shape [-] (n,)."""
        self.components = _components(shapes - self.shape)
        """Principal components of the shapes, orthonormal (k, n)."""
        scores = (shapes - self.shape) @ self.components.T
        self.sizes = Process(x[whole], sizes[:, None], None if earlier is None else earlier.sizes.hyper)
        self.shapes = Process(x[whole], scores, None if earlier is None else earlier.shapes.hyper)
        parted = np.array([parted_of(run) for run in runs])
        self.parted = Process(x, parted[:, None], None if earlier is None else earlier.parted.hyper)
        self.learnt = int(whole.sum())
        """Number of curves that were learnt from."""

    def _standard(self, raw: FloatArray) -> FloatArray:
        out: FloatArray = (raw - self._centre) / self._spread
        return out

    def __call__(self, z: FloatArray) -> Expected:
        """What is expected at internal coordinates (q, p)."""
        x = self._standard(self.coordinates(z))
        sizes, size_sd = self.sizes(x)
        shape, shape_sd = self.shapes(x)
        parted = self.parted.expected(x)[:, 0]
        completed = np.clip((parted - NOT_PARTED) / (FULLY_PARTED - NOT_PARTED), 0.0, 1.0)
        size = np.exp(np.clip(sizes[:, 0] + self.coordinates.scale(z), -30.0, 30.0))
        return Expected(size, size_sd, shape, shape_sd, completed, x)

    def curves(self, z: FloatArray) -> FloatArray:
        """Expected curves [N] (q, n) at internal coordinates (q, p)."""
        found = self(z)
        out: FloatArray = found.size[:, None] * (self.shape + found.shape @ self.components)
        return out

    def axes(self, z: FloatArray) -> FloatArray:
        """Coordinates over the lengths of the process of the shapes (q, d): distances that matter."""
        return self._standard(self.coordinates(z)) / np.exp(self.shapes.hyper[3:])


def parted_of(run: ScoredRun) -> float:
    """Energy of new surface over R times its area [-], 1 at most; below :data:`NOT_PARTED` where a run broke down."""
    evaluation = run.evaluation
    if not evaluation.ok:
        return NOT_PARTED * evaluation.fraction
    return 1.0 if math.isnan(evaluation.parted) else float(np.clip(evaluation.parted, 0.0, 1.0))


def was_cut(run: ScoredRun) -> bool:
    """Whether the curve of a run may be learnt from."""
    return run.ok and parted_of(run) > LEARNT_PARTED and float(run.curve.mean()) > 0.0


def _components(shapes: FloatArray) -> FloatArray:
    """Principal components (k, n) of centred shapes (m, n) that leave out no more than :data:`UNLEARNT`."""
    _, size, basis = np.linalg.svd(shapes, full_matrices=False)
    left = np.sqrt(np.maximum(np.sum(size**2) - np.cumsum(size**2), 0.0) / shapes.size)
    count = min(int(np.searchsorted(-left, -UNLEARNT)) + 1, MOST_COMPONENTS, len(size))
    out: FloatArray = basis[:count]
    return out
