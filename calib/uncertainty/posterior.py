"""The posterior by a fit's surrogate: chi-square of data and priors, with errors widened, weighted and marginal."""

from __future__ import annotations

from calib.fit.surrogate import Surrogate
from calib.problem.parameters import ParameterSet
from calib.uncertainty.intervals import Uncertainty
from mpm.arrays import FloatArray


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
