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

import numpy as np

from calib.posterior.correction import Correction
from calib.posterior.emulator import CurveEmulator, Expected
from calib.problem.objective import LARGEST_DIFFERENCE, Objective
from mpm.arrays import FloatArray

SIZE_SD = 0.5
"""Standard deviation of the logarithm of t, which is not negative: up to 2.7 times what is stated is expected of a
model, and no less than that."""
OVERSHOOT = 0.1
"""An expected missing part of the stroke up to this is not held against a food [-]: the process is smooth, the limit of
what can be cut is not."""
NO_CURVE = 1e12
"""Chi-square of a food whose expected curve is no number."""


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
        self.correction = correction or Correction(emulator)
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
        found = self.correction(z)
        residual, covariance = self._moments(found, np.exp(2.0 * log_size))
        root = np.linalg.cholesky(covariance)
        part = np.linalg.solve(root, residual[:, :, None])[:, :, 0]
        spread = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) - len(self._unit) * log_size
        missing = np.maximum(1.0 - OVERSHOOT - found.completed, 0.0) * self.objective.failure_weight
        value = -0.5 * (np.sum(part**2, axis=1) + missing**2) - spread - self.rows * log_size
        return np.where(np.isfinite(value), value, -NO_CURVE)

    def _moments(self, found: Expected, size: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (q, r) and their covariances (q, r, r)."""
        most = LARGEST_DIFFERENCE * self.objective.target.peak
        factor = np.minimum(found.size, most)[:, None]
        shapes = self._mean + found.shape @ self._components.T
        residual = factor * shapes - self._trace
        many = np.broadcast_to(self._components, (len(factor), *self._components.shape))
        slopes = factor[:, :, None] * np.concatenate([shapes[:, :, None], many], axis=2)
        own = np.zeros((len(factor), slopes.shape[2], slopes.shape[2]))
        own[:, 0, 0] = found.size_sd**2
        places = np.arange(1, own.shape[1])
        own[:, places, places] = (found.shape_sd**2)[:, None]
        known = size[:, None, None] * self._unit + self._open
        return residual, known + slopes @ own @ np.swapaxes(slopes, 1, 2)

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
