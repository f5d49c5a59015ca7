"""A Gaussian process with several outputs that share one covariance: a Matern part with a length for every axis, and a
linear part.

Source: Rasmussen & Williams (2006), Gaussian Processes for Machine Learning, MIT Press, chapters 2, 4 and 5; the
errors of leaving one run out are their equations 5.10 to 5.12.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from mpm.arrays import FloatArray

AMPLITUDE_PRIOR = (0.0, 1.5, -3.0, 3.0)
"""Mean, sd and range of the logarithm of the amplitude of the curved and the linear part, in standard deviations of the
outputs."""
LENGTH_PRIOR = (math.log(3.0), 0.8, math.log(0.3), math.log(30.0))
"""The same of a length, in standard deviations of its axis."""
NOISE_PRIOR = (math.log(0.03), 1.0, math.log(1e-3), math.log(0.5))
"""The same of the noise, in standard deviations of the outputs."""
LEARNT_FROM = 256
"""Runs from which hyperparameters are learnt at most: they change little beyond, and the time grows with the cube."""
ITERATIONS = 30
"""Iterations of the descent to them at most."""
ROOT5 = math.sqrt(5.0)


class Process:
    """A process through values at some points.

    Args:
        x: The points [-] (m, d), each axis of about unit variance.
        y: Values of the outputs (m, k).
        guess: Hyperparameters of an earlier process to start from (d + 3,).
    """

    def __init__(self, x: FloatArray, y: FloatArray, guess: FloatArray | None = None) -> None:
        self.mean = y.mean(axis=0)
        self.size = max(float(np.sqrt(np.mean((y - self.mean) ** 2))), 1e-12)
        """Standard deviation of the outputs, all together."""
        target = (y - self.mean) / self.size
        some = np.linspace(0, len(x) - 1, min(len(x), LEARNT_FROM)).round().astype(int)
        self.hyper = self._learn(x[some], target[some], guess)
        amplitude, linear, noise = np.exp(self.hyper[:3])
        self._lengths, self._amplitude, self._linear, self.noise = np.exp(self.hyper[3:]), amplitude, linear, noise
        factor = cho_factor(self._covariance(x, x) + noise**2 * np.eye(len(x)), lower=True)
        self._inverse = cho_solve(factor, np.eye(len(x)))
        self._weights = self._inverse @ target
        self._x = x
        self._scaled = x / self._lengths
        self._squares = np.sum(self._scaled**2, axis=1)
        errors, sds = self.left_out()
        self.widened = max(float(np.sqrt(np.mean((errors / sds[:, None]) ** 2))), 1.0)
        """Errors of runs that are left out, over what the process expects of them; 1 at least [-]."""

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean (q, k) and standard deviation of a run (q,), the same for every output, at points (q, d)."""
        cross = self._covariance(x, None)
        own = self._amplitude**2 + self._linear**2 * np.sum(x**2, axis=1)
        variance = np.maximum(own - np.einsum("qm,qm->q", cross @ self._inverse, cross), 0.0) + self.noise**2
        return self.mean + self.size * (cross @ self._weights), self.widened * self.size * np.sqrt(variance)

    def expected(self, x: FloatArray) -> FloatArray:
        """Mean (q, k) alone."""
        out: FloatArray = self.mean + self.size * (self._covariance(x, None) @ self._weights)
        return out

    def left_out(self) -> tuple[FloatArray, FloatArray]:
        """Error of each run if it is left out (m, k), and the standard deviation that the process expects of it (m,),
        noise included."""
        precision = np.diag(self._inverse)
        errors: FloatArray = -self.size * self._weights / precision[:, None]
        return errors, self.size / np.sqrt(precision)

    def _covariance(self, a: FloatArray, b: FloatArray | None) -> FloatArray:
        """Covariance (k, l) between points (k, d) and (l, d), the runs where None."""
        if b is None:
            left, right, squares, other = a / self._lengths, self._scaled, self._squares, self._x
        else:
            right, other = b / self._lengths, b
            left, squares = a / self._lengths, np.sum(right**2, axis=1)
        gap = np.sum(left**2, axis=1)[:, None] + squares - 2.0 * (left @ right.T)
        r = ROOT5 * np.sqrt(np.maximum(gap, 0.0))
        out: FloatArray = self._amplitude**2 * (1.0 + r + r * r / 3.0) * np.exp(-r) + self._linear**2 * (a @ other.T)
        return out

    def _learn(self, x: FloatArray, y: FloatArray, guess: FloatArray | None) -> FloatArray:
        """Hyperparameters, logarithms (d + 3,), of largest posterior: amplitudes, noise, lengths."""
        d, count = x.shape[1], y.shape[1]
        priors = [AMPLITUDE_PRIOR, AMPLITUDE_PRIOR, NOISE_PRIOR, *[LENGTH_PRIOR] * d]
        mean, sd, low, high = np.array(priors).T
        squares = np.moveaxis((x[:, None] - x[None]) ** 2, 2, 0)
        line, unit, gram = x @ x.T, np.eye(len(x)), y @ y.T

        def cost(h: FloatArray) -> tuple[float, FloatArray]:
            amplitude, linear, noise = np.exp(2.0 * h[:3])
            scaled = np.exp(-2.0 * h[3:])
            r = ROOT5 * np.sqrt(np.tensordot(scaled, squares, 1))
            decay = np.exp(-r)
            curved = amplitude * (1.0 + r + r * r / 3.0) * decay
            factor = cho_factor(curved + linear * line + noise * unit, lower=True)
            inverse = cho_solve(factor, unit)
            pull = (h - mean) / sd
            value = 0.5 * float(np.sum(inverse * gram)) + count * float(np.log(np.diag(factor[0])).sum())
            inner = 0.5 * (count * inverse - inverse @ gram @ inverse)
            steep = inner * (5.0 / 3.0) * amplitude * (1.0 + r) * decay  # d matern/d log length = steep * gap^2
            slopes = [2.0 * np.sum(inner * curved), 2.0 * linear * np.sum(inner * line)]
            slopes += [2.0 * noise * np.trace(inner)]
            lengths = np.tensordot(squares, steep, ([1, 2], [0, 1])) * scaled
            return value + 0.5 * float(pull @ pull), np.concatenate([slopes, lengths]) + pull / sd

        start = np.clip(mean if guess is None else guess, low, high)
        bounds = np.column_stack([low, high])
        found = minimize(cost, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": ITERATIONS})
        return np.asarray(found.x)
