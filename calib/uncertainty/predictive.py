"""The band in which another measurement of the same cut would lie if the fit is right.

Draws come from the normal approximation of the posterior, with the specimen's width and the sensor's gain as they were
in this cut, and are weighted by what the surrogate says of them (sampling, importance resampling: Rubin 1988, Bayesian
Statistics 3). A curve that it hardly knows could be anything, so its likelihood is small, and what it could be is drawn
given the measured curve: a normal process with the errors of the fit (Rasmussen and Williams 2006, chapter 2). To each
curve come an error of the correlation length that the residuals showed, of a size that what is stated of it and the
residuals make likely, and tare, drift, lag and bandwidth from their priors.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.fit.surrogate import CurveProcess, Surrogate
from calib.problem.objective import Objective
from calib.uncertainty.intervals import CREDIBLE_LEVEL, Uncertainty
from mpm.arrays import FloatArray

POSTERIOR_DRAWS = 400
"""Draws from the posterior: the ends of a 95 % band are then known to a tenth of their distance."""
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


def predictive_bands(surrogate: Surrogate, z: FloatArray, found: Uncertainty, seed: int = 0) -> tuple[Band, ...]:
    """Posterior predictive band of each trace.

    Args:
        surrogate: The process of the fit.
        z: Internal coordinates of the best values, logarithms of SI values on a log scale [-], (p,).
        found: Their uncertainty.
        seed: Seed of the draws.

    Returns:
        A band for each trace, in their order.
    """
    random = np.random.default_rng(seed)
    drawn = posterior_draws(surrogate, z, found, random)
    out = []
    for process, case, length in zip(surrogate.each, surrogate.objective.terms, found.data.lengths, strict=True):
        goal = case.objective
        added = error_draws(goal, length, math.sqrt(found.error_variance), len(drawn), random)
        curves = []
        for point, error in zip(drawn, added, strict=True):
            curve, sd, _ = process.predict(point[case.index])
            ratio = unknown(process, curve, sd) / found.error_variance
            seen = goal.target.curve / goal.factor(curve)
            expected = curve + ratio / (1.0 + ratio) * (seen - curve)
            drawn_curve = expected + sd / math.sqrt(1.0 + ratio) * float(random.standard_normal())
            curves.append(goal.factor(drawn_curve) * drawn_curve + error)
        out.append(pointwise_band(np.array(curves), goal.target.curve))
    return tuple(out)


def pointwise_band(curves: FloatArray, measured: FloatArray) -> Band:
    """The band of some curves (k, n) about a measured one (n,)."""
    tail = 50.0 * (1.0 - CREDIBLE_LEVEL)
    low, high = np.percentile(curves, [tail, 100.0 - tail], axis=0)
    return Band(low, high, float(np.mean((measured >= low) & (measured <= high))))


def posterior_draws(surrogate: Surrogate, z: FloatArray, found: Uncertainty, random: np.random.Generator) -> FloatArray:
    """Draws from the posterior, in random order.

    Args:
        surrogate: The process of the fit.
        z: Internal coordinates of the best values, logarithms of SI values on a log scale [-], (p,).
        found: Their uncertainty.
        random: Source of randomness.

    Returns:
        Internal coordinates (POSTERIOR_DRAWS, p).
    """
    parameters = surrogate.objective.parameters
    prior = parameters.prior_jacobian()
    information = found.data.jacobian.T @ found.data.jacobian / found.error_variance + prior.T @ prior
    root = np.linalg.cholesky(np.linalg.inv(information))
    normal = random.standard_normal((POSTERIOR_DRAWS, len(z)))
    points = parameters.clip(z + normal @ root.T)
    weights = found.data.weights / math.sqrt(found.error_variance)
    size = len(weights)

    def cost(point: FloatArray) -> float:
        rows = surrogate.residual(point)
        total, first = float(np.sum(rows[size:] ** 2)), 0
        for process, term in zip(surrogate.each, surrogate.objective.terms, strict=True):
            own = slice(first, first + term.objective.data_rows)
            curve, sd, _ = process.predict(point[term.index])
            ratio = unknown(process, curve, sd) / found.error_variance
            total += float(np.sum((weights[own] * rows[own]) ** 2)) / (1.0 + ratio)
            total += term.objective.effective_points * math.log1p(ratio)
            first = own.stop
        return total

    rise = np.array([cost(p) for p in points]) - cost(z)
    log_weight = -0.5 * (rise - np.sum(normal**2, axis=1))
    weight = np.exp(log_weight - log_weight.max())
    chosen: FloatArray = points[random.choice(POSTERIOR_DRAWS, POSTERIOR_DRAWS, p=weight / weight.sum())]
    return chosen


def unknown(process: CurveProcess, curve: FloatArray, sd: float) -> float:
    """Variance of a curve that a process expects over that of the errors of the fit [-].

    Args:
        process: The process of a trace.
        curve: The curve that it expects [N] (n,).
        sd: Its standard deviation [N].

    Returns:
        The ratio.
    """
    added = float(process.unknown_residual(curve[None], np.array([sd]))[0])
    return added**2 / process.objective.effective_points


def error_draws(goal: Objective, length: float, size: float, count: int, random: np.random.Generator) -> FloatArray:
    """Draws of the errors of the model and the measurement along a curve.

    Args:
        goal: The objective of a trace.
        length: Correlation length of the model's errors, part of the stroke [-].
        size: Their standard deviation over the stated one [-].
        count: How many.
        random: Source of randomness.

    Returns:
        Errors [N] (count, n).
    """
    n = goal.target.stroke.size
    parts = np.linspace(0.0, 1.0, n)
    kernel = np.exp(-math.pi * ((parts[:, None] - parts) / length) ** 2) + JITTER * np.eye(n)
    values, vectors = np.linalg.eigh(kernel)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    out: FloatArray = size * goal.sigmas * (random.standard_normal((count, n)) @ root.T)
    for nuisance in goal.nuisances:
        if nuisance.searched:
            out += nuisance.sd * random.standard_normal((count, 1)) * nuisance.shape
    return out
