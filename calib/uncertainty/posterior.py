"""The posterior by a fit's surrogate: chi-square of data and priors, with errors widened, weighted and marginal."""

from __future__ import annotations

import math

import numpy as np

from calib.errors import CurveError
from calib.fit.surrogate import Surrogate
from calib.problem.parameters import ParameterSet
from calib.uncertainty.intervals import CREDIBLE_LEVEL, Uncertainty
from mpm.arrays import FloatArray

WALKERS = 4
"""Walkers of the ensemble for each parameter."""
MOVES, BURNED = 600, 200
"""Moves of each walker, and how many of them are left out at the start."""


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

    def log(self, z: FloatArray) -> float:
        """Logarithm of the posterior density at internal coordinates (p,), up to a constant; minus infinity beyond the
        bounds."""
        if np.any(z < self.parameters.lower) or np.any(z > self.parameters.upper):
            return -math.inf
        rows = self.rows(z)
        return -0.5 * float(rows @ rows)


def credible_intervals(posterior: Posterior, best: FloatArray, seed: int = 0) -> dict[str, tuple[float, float]]:
    """95 % credible intervals from a sample of the posterior, which share only the surrogate with the profiles.

    The affine-invariant ensemble of Goodman & Weare (2010, Comm. App. Math. Comp. Sci. 5:65), by emcee.

    Args:
        posterior: What to sample.
        best: Internal coordinates of the best values, logarithms of SI values on a log scale [-], (p,).
        seed: Seed of the walkers.

    Returns:
        Both ends [unit of the parameter] by name.

    Raises:
        CurveError: emcee is not installed.
    """
    try:
        import emcee
    except ImportError:
        raise CurveError("--sample needs emcee: pip install 'cutcal[sample]', or leave the option out") from None
    p = len(best)
    random = np.random.default_rng(seed)
    root = np.linalg.cholesky(posterior.found.covariance)
    start = posterior.parameters.clip(best + 0.3 * random.standard_normal((WALKERS * p, p)) @ root.T)
    start += 1e-6 * random.standard_normal(start.shape) * posterior.surrogate.unit
    start = np.clip(start, posterior.parameters.lower, posterior.parameters.upper)
    sampler = emcee.EnsembleSampler(len(start), p, posterior.log)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, MOVES, skip_initial_state_check=True)
    chain = sampler.get_chain(discard=BURNED, flat=True)
    tail = 50.0 * (1.0 - CREDIBLE_LEVEL)
    low, high = np.percentile(chain, [tail, 100.0 - tail], axis=0)
    return {
        q.name: (q.from_internal(float(a)), q.from_internal(float(b)))
        for q, a, b in zip(posterior.parameters, low, high, strict=True)
    }
