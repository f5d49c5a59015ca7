"""The posterior by a fit's surrogate: chi-square of data and priors, with errors widened, weighted and marginal."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from calib.fit.surrogate import Surrogate, slopes
from calib.problem.parameters import ParameterSet
from calib.uncertainty.intervals import Uncertainty
from mpm.arrays import FloatArray

EVALUATIONS = 12
"""Evaluations of the surrogate with which parameters follow one that is held."""


class Posterior:
    """Chi-square of materials as the intervals see it.

    Args:
        surrogate: The process of the fit.
        parameters: Its parameters.
        found: Size, weight and correlation of the errors.
    """

    def __init__(self, surrogate: Surrogate, parameters: ParameterSet, found: Uncertainty) -> None:
        self.surrogate, self.parameters, self.found = surrogate, parameters, found

    def rows(self, z: FloatArray) -> FloatArray:
        """Rows of data and priors at internal coordinates (p,), the priors last."""
        return self.rows_all(z[None])[0]

    def rows_all(self, z: FloatArray) -> FloatArray:
        """The same at many points (q, p): (q, rows)."""
        return self.found.rows(self.surrogate.residuals(z))

    def optimum(self, z: FloatArray, held: int) -> FloatArray:
        """The optimum of all parameters but one.

        Args:
            z: Internal coordinates to start from (p,).
            held: Place of the one that keeps its value.

        Returns:
            Internal coordinates (p,).
        """
        others = np.arange(z.size) != held
        if not others.any():
            return z

        def rows(free: FloatArray) -> FloatArray:
            whole = np.tile(z, (len(free), 1))
            whole[:, others] = free
            return self.rows_all(whole)

        scale = self.surrogate.unit[others]
        low, high = self.parameters.lower[others], self.parameters.upper[others]
        edge = 1e-9 * scale
        solved = least_squares(
            lambda free: rows(free[None])[0],
            np.clip(z[others], low, high),
            jac=lambda free: slopes(rows, free, scale),
            bounds=(low - edge, high + edge),
            x_scale=scale,
            max_nfev=EVALUATIONS,
        )
        out = z.copy()
        out[others] = np.clip(solved.x, low, high)
        return out
