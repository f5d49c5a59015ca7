"""The likelihood of a trace by emulated curves: errors of model, measurement and emulator in one covariance.

    r - m(z) ~ N(0, t^2 S + N N^T + C(z))

S holds the stated errors of model and noise along the curve, correlated over the assumed length; t, their size over
what is stated, is inferred with the material. N holds what the measurement leaves open (tare, drift, lag, gain, width,
:mod:`calib.problem.nuisance`), and C what the emulator does not know. The peak is a point of the curve and has no row
of its own. All vectors live in the span of a few: mean shape, components, trace and nuisances. So the algebra is done
there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.posterior.emulator import CurveEmulator, Expected
from calib.problem.objective import Objective
from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

SIZE_SD = 0.5
"""Standard deviation of the logarithm of t, which is not negative: up to 2.7 times what is stated is expected of a
model, and no less than that."""
OVERSHOOT = 0.1
"""An expected missing part of the stroke up to this is not held against a food [-]: the process is smooth, the limit of
what can be cut is not."""
NO_CURVE = 1e12
"""Chi-square of a food whose expected curve is no number."""


@dataclass(frozen=True, eq=False)
class Correction:
    """What finer cells change of emulated curves, the same for all foods.

    Attributes:
        log_size: Added to the logarithm of the size.
        shape: Mean shape with it [-] (n,).
        unknown: Covariance, between foods, of the changes of size and components (1 + k, 1 + k).
    """

    log_size: float
    shape: FloatArray
    unknown: FloatArray

    @classmethod
    def none(cls, emulator: CurveEmulator) -> Correction:
        """No change."""
        k = 1 + len(emulator.components)
        return cls(0.0, emulator.shape, np.zeros((k, k)))

    @classmethod
    def of(cls, emulator: CurveEmulator, runs: Sequence[ScoredRun]) -> Correction:
        """The mean change and its scatter.

        Args:
            emulator: The emulator.
            runs: Whole runs on the finer cells, two at least.

        Returns:
            The correction.
        """
        found = emulator(np.array([run.z for run in runs]))
        curves = np.array([run.curve for run in runs])
        means = curves.mean(axis=1)
        sizes = np.log(means / found.size)
        shapes = curves / means[:, None] - found.shape @ emulator.components
        scores = (shapes - emulator.shape) @ emulator.components.T
        unknown = np.cov(np.column_stack([sizes, scores]), rowvar=False)
        return cls(float(sizes.mean()), shapes.mean(axis=0), unknown)

    def curves(self, emulator: CurveEmulator, z: FloatArray) -> FloatArray:
        """Expected curves on the finer cells [N] (q, n) at internal coordinates (q, p)."""
        found = emulator(z)
        size = found.size[:, None] * math.exp(self.log_size)
        out: FloatArray = size * (self.shape + found.shape @ emulator.components)
        return out


class Likelihood:
    """The likelihood of one trace by an emulator.

    Args:
        objective: The trace with its error model and nuisances.
        emulator: The emulator.
        correction: From the emulator's cells to finer ones; None for nothing.
        searched: Whether gain and width are at their likely values, as where one best food is sought.
    """

    def __init__(
        self,
        objective: Objective,
        emulator: CurveEmulator,
        correction: Correction | None = None,
        *,
        searched: bool = False,
    ) -> None:
        self.objective, self.emulator = objective, emulator
        self.correction = correction or Correction.none(emulator)
        self.rows = objective.effective_points
        """Effective number of independent points of the curve [-]."""
        weights = math.sqrt(self.rows / objective.target.stroke.size) / objective.sigmas
        columns = [weights * n.sd * n.shape for n in objective.nuisances if n.searched or not searched]
        span = np.array(
            [weights * self.correction.shape, *(weights * emulator.components), weights * objective.target.curve]
        )
        basis, _ = np.linalg.qr(np.array([*span, *columns]).T)
        self._mean, self._components = basis.T @ span[0], basis.T @ span[1:-1].T
        self._trace = basis.T @ span[-1]
        open_ended = basis.T @ np.array(columns).T if columns else np.zeros((basis.shape[1], 1))
        self._open = open_ended @ open_ended.T
        self._unit = np.eye(basis.shape[1])

    def log(self, z: FloatArray, log_size: FloatArray) -> FloatArray:
        """Logarithm of the likelihood (q,), up to a constant.

        Args:
            z: Internal coordinates [-] (q, p).
            log_size: Logarithm of t [-] (q,).

        Returns:
            The logarithm of the likelihood.
        """
        found = self.emulator(z)
        ratio, inverse, _ = self._solved(found, np.exp(2.0 * log_size))
        chi2 = np.einsum("qi,qij,qj->q", ratio, inverse[0], ratio)
        missing = np.maximum(1.0 - OVERSHOOT - found.completed, 0.0) * self.objective.failure_weight
        value = -0.5 * (chi2 + inverse[1] + missing**2) - self.rows * log_size
        return np.where(np.isfinite(value), value, -NO_CURVE)

    def _solved(
        self, found: Expected, size: FloatArray
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray], FloatArray]:
        """Residuals (q, r), inverse covariances (q, r, r) with the logarithms of their determinants less those of the
        errors alone (q,), and the covariances."""
        factor = found.size[:, None] * math.exp(self.correction.log_size)
        shapes = self._mean + found.shape @ self._components.T
        residual = factor * shapes - self._trace
        slopes = factor[:, :, None] * np.concatenate(
            [shapes[:, :, None], np.broadcast_to(self._components, (len(factor), *self._components.shape))], axis=2
        )
        own = np.broadcast_to(self.correction.unknown, (len(factor), *self.correction.unknown.shape)).copy()
        own[:, 0, 0] += found.size_sd**2
        places = np.arange(1, own.shape[1])
        own[:, places, places] += (found.shape_sd**2)[:, None]
        covariance = size[:, None, None] * self._unit + self._open + slopes @ own @ np.swapaxes(slopes, 1, 2)
        inverse = np.linalg.inv(covariance)
        _, log = np.linalg.slogdet(covariance)
        return residual, (inverse, log - len(self._unit) * np.log(size)), covariance

    def chi2(self, curves: FloatArray, log_size: FloatArray) -> FloatArray:
        """Chi-square (q,) of simulated curves [N] (q, n), nuisances integrated out and without the emulator's doubt."""
        objective = self.objective
        weights = math.sqrt(self.rows / objective.target.stroke.size) / objective.sigmas
        rows = weights * (curves - objective.target.curve)
        columns = np.array([weights * n.sd * n.shape for n in objective.nuisances]).reshape(-1, rows.shape[1])
        out = []
        for row, size in zip(rows, np.exp(2.0 * log_size), strict=True):
            inner = np.eye(len(columns)) + columns @ columns.T / size
            cross = columns @ row / size
            out.append(float(row @ row) / size - float(cross @ np.linalg.solve(inner, cross)))
        return np.array(out)
