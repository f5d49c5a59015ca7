"""The band in which another measurement of the same cut would lie, if parameters, errors and model are what the fit says.

Materials are drawn from the normal approximation of the posterior, with the specimen's width and the sensor's gain as they were
in this cut, and weighted by the chi-square that the surrogate expects of them (sampling, importance resampling: Rubin 1988,
Bayesian Statistics 3); to each curve come the doubt of the surrogate, an error of the size and correlation length that the
residuals showed, and tare, drift and lag from their priors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.fit.surrogate import Surrogate
from calib.problem.objective import Objective
from calib.uncertainty.intervals import COVERED, Uncertainty
from mpm.arrays import FloatArray

DRAWS = 400
"""Materials drawn: the ends of a 95 % band are then known to a tenth of their distance."""
JITTER = 1e-6
"""Added to the variance of correlated errors, so that their covariance has a root."""


@dataclass(frozen=True, eq=False)
class Band:
    """A pointwise 95 % band about a measured curve.

    Attributes:
        low, high: Its ends [N] (n,).
        inside: Part of the measured curve within [-].
    """

    low: FloatArray
    high: FloatArray
    inside: float


def bands(surrogate: Surrogate, z: FloatArray, found: Uncertainty, seed: int = 0) -> tuple[Band, ...]:
    """Posterior predictive band of each trace.

    Args:
        surrogate: The process of the fit.
        z: Internal coordinates of the best values (p,).
        found: Their uncertainty.
        seed: Seed of the draws.
    """
    random = np.random.default_rng(seed)
    drawn = materials(surrogate, z, found, random)
    out = []
    for process, case, length in zip(surrogate.each, surrogate.objective.cases, found.data.lengths, strict=True):
        goal = case.objective
        added = errors(goal, length, math.sqrt(found.widened), len(drawn), random)
        curves = []
        for point, error in zip(drawn, added, strict=True):
            curve, sd, _ = process.predict(point[case.index])
            drawn_curve = curve + sd * float(random.standard_normal())
            curves.append(goal.factor(drawn_curve) * drawn_curve + error)
        out.append(band_of(np.array(curves), goal.target.curve))
    return tuple(out)


def band_of(curves: FloatArray, measured: FloatArray) -> Band:
    """The band of some curves (k, n) about a measured one (n,)."""
    tail = 50.0 * (1.0 - COVERED)
    low, high = np.percentile(curves, [tail, 100.0 - tail], axis=0)
    return Band(low, high, float(np.mean((measured >= low) & (measured <= high))))


def materials(surrogate: Surrogate, z: FloatArray, found: Uncertainty, random: np.random.Generator) -> FloatArray:
    """Internal coordinates of materials from the posterior (DRAWS, p), in random order.

    Args:
        surrogate: The process of the fit.
        z: Internal coordinates of the best values (p,).
        found: Their uncertainty.
        random: Source of randomness.
    """
    parameters = surrogate.objective.parameters
    root = np.linalg.cholesky(found.alone)
    normal = random.standard_normal((DRAWS, len(z)))
    points = parameters.clip(z + normal @ root.T)
    weights = found.data.weights / math.sqrt(found.widened)
    size = len(weights)

    def cost(point: FloatArray) -> float:
        rows = surrogate.residual(point)
        return float(np.sum((weights * rows[:size]) ** 2) + np.sum(rows[size:] ** 2))

    rise = np.array([cost(p) for p in points]) - cost(z)
    log_weight = -0.5 * (rise - np.sum(normal**2, axis=1))
    weight = np.exp(log_weight - log_weight.max())
    chosen: FloatArray = points[random.choice(DRAWS, DRAWS, p=weight / weight.sum())]
    return chosen


def errors(goal: Objective, length: float, widened: float, count: int, random: np.random.Generator) -> FloatArray:
    """Errors of the model and the measurement [N] (count, n).

    Args:
        goal: The objective of a trace.
        length: Correlation length of the model's errors, part of the stroke [-].
        widened: Their standard deviation over the stated one [-].
        count: How many.
        random: Source of randomness.
    """
    n = goal.target.stroke.size
    parts = np.linspace(0.0, 1.0, n)
    kernel = np.exp(-math.pi * ((parts[:, None] - parts) / length) ** 2) + JITTER * np.eye(n)
    values, vectors = np.linalg.eigh(kernel)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    out: FloatArray = widened * goal.sigmas * (random.standard_normal((count, n)) @ root.T)
    for nuisance in goal.nuisances:
        if nuisance.name in ("tare", "drift", "lag"):
            out += nuisance.sd * random.standard_normal((count, 1)) * nuisance.shape
    return out
