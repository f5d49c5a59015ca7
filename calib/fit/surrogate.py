"""The curve between the simulated ones: a Gaussian process through all runs of a fit, which expects the chi-square of a
point and gives the Jacobian.

Sources: Rasmussen & Williams (2006), Gaussian Processes for Machine Learning, MIT Press, chapters 2 and 5; coarse runs
as fine ones plus a process of their own, Kennedy & O'Hagan (2000), Biometrika 87:1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh
from scipy.optimize import least_squares, minimize

from calib.problem.joint_objective import JointObjective, residuals
from calib.problem.objective import LARGEST_DIFFERENCE, Objective
from calib.problem.parameters import LINEAR_STEP, ParameterSet
from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

#: Standard deviations in the process, parts of the peak: what a broken-down and a coarse run say about the curve of a
#: whole, fine one; the offset common to all coarse curves; the offset of the best curve by its own noise.
BROKEN_SD, COARSE_SD, COARSE_OFFSET, OFFSET = 0.3, 0.02, 0.2, 0.05
#: Log-normal priors (mean, sd) and ranges of the process's hyperparameters: amplitude of its curved and its linear
#: part and its noise (parts of the peak), and the length scale of each parameter (coordinate units).
AMPLITUDE_PRIOR = (math.log(0.4), 1.0, math.log(0.08), math.log(2.0))
LENGTH_PRIOR = (math.log(1.5), 0.7, math.log(0.3), math.log(8.0))
NOISE_PRIOR = (math.log(0.012), 0.4, math.log(0.004), math.log(0.04))
#: The same for how much the difference between coarse and fine curves changes with the parameters, beside its common
#: offset.
DIFFERENCE_PRIOR = (math.log(0.007), 1.2, math.log(0.003), math.log(0.5))

#: 95 % point of chi-square with 20 degrees of freedom over 20: how much more than its mean the information that noise
#: makes along one direction may be in 20 independent points of a curve.
NOISE_MARGIN = 1.57
#: Information that noise is taken to make in every direction at least, over its mean along the parameters [-].
LEAST_NOISE = 1e-9

#: Width of the differences of expected curves in a Jacobian [coordinate units].
JACOBIAN_STEP = 1e-3
#: The same where a fit follows them downhill.
GRADIENT_STEP = 1e-6

#: An expected missing part of the stroke up to this is not held against a point [-]: the process is smooth, the limit
#: of what can be simulated is not, so that whole runs beside it would be shunned.
OVERSHOOT = 0.1


def coordinate_unit(parameters: ParameterSet) -> FloatArray:
    """Unit of the internal coordinates (p,): 1 for a log parameter, the prior's 95 % range for another."""
    return np.array([1.0 if p.log else p.step / LINEAR_STEP for p in parameters])


def slopes(rows: Callable[[FloatArray], FloatArray], z: FloatArray, unit: FloatArray) -> FloatArray:
    """Forward differences of a vector function of many points at once.

    Args:
        rows: The function: of points [-] (q, p) the values [-] (q, rows).
        z: Internal coordinates of the point [-] (p,).
        unit: Unit of each coordinate [-] (p,).

    Returns:
        The derivative [-] (rows, p).
    """
    steps = GRADIENT_STEP * unit
    found = rows(np.concatenate([z[None], z + np.diag(steps)]))
    out: FloatArray = (found[1:] - found[0]).T / steps
    return out


class CurveProcess:
    """Gaussian process through the smoothed curves of one trace, with the scaling of force by stress built in.

        curve(z) = e^s (c + q g(x)),   x = (z - z_best) / unit

    s is the mean of z - z_best over the stress-like parameters, c and q are the best run's curve and peak; g has mean
    zero and the covariance :meth:`_kernel`, the same for each point of the curve. One more output is the part of the
    stroke that is missing.

    Args:
        objective: That of the trace.
        runs: Its runs so far.
        best: The run about which the process is written.
        guess: Hyperparameters of an earlier process to start from (p + 4,).
    """

    def __init__(
        self, objective: Objective, runs: Sequence[ScoredRun], best: ScoredRun, guess: FloatArray | None = None
    ) -> None:
        self.objective, self.best = objective, best
        law = objective.parameters.stress_like()
        self._law = law / max(float(law.sum()), 1.0)
        self.unit = coordinate_unit(objective.parameters)
        self.peak = float(np.abs(best.curve).max())
        """Largest force of the best run [N]."""
        used = [run for run in runs if run.evaluation.stroke.size > 1]
        self._x = np.array([(run.z - best.z) / self.unit for run in used])
        self._coarse = np.array([float(run.coarse) for run in used])
        self._extra = np.array([run.coarse * COARSE_SD**2 + (not run.ok) * BROKEN_SD**2 for run in used])
        curves = np.array([run.curve * math.exp(-self._scale(run.z)) for run in used])
        missing = np.array([1.0 - run.evaluation.completed for run in used])
        y = np.clip((curves - best.curve) / self.peak, -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE)
        self.hyper = self._learn(y, guess)
        self._inverse = cho_solve(cho_factor(self._covariance(self.hyper)), np.eye(len(used)))
        exact = self._kernel(self._x, self._x, self.hyper) + self.noise**2 * np.eye(len(used))
        self._weights = np.column_stack([self._inverse @ y, np.linalg.solve(exact, missing)])

    @property
    def noise(self) -> float:
        """Standard deviation of one simulated curve about the process, part of the peak [-]."""
        return math.exp(self.hyper[-1])

    @property
    def noise_misfit(self) -> float:
        """Chi-square that the noise of one simulated curve makes in an independent point [-]."""
        goal = self.objective
        return (goal.factor(self.best.curve) * self.noise * self.peak / goal.sigma) ** 2

    def _scale(self, z: FloatArray) -> float:
        return float(self._law @ (z - self.best.z))

    def _kernel(self, a: FloatArray, b: FloatArray, h: FloatArray) -> FloatArray:
        """Covariance (k, l) of g between points (k, p) and (l, p): offset + linear + squared exponential."""
        gap = ((a[:, None] - b[None]) / np.exp(h[2:-2])) ** 2
        out: FloatArray = OFFSET**2 + np.exp(2.0 * h[1]) * (a @ b.T) + np.exp(2.0 * h[0] - 0.5 * gap.sum(axis=2))
        return out

    def _covariance(self, h: FloatArray) -> FloatArray:
        """Covariance (m, m) of the runs with their noise; coarse ones share the process of their difference."""
        own = self._kernel(self._x, self._x, h) + np.diag(self._extra + math.exp(2.0 * h[-1]))
        gap = ((self._x[:, None] - self._x[None]) / np.exp(h[2:-2])) ** 2
        difference = COARSE_OFFSET**2 + self._change(gap, h)
        out: FloatArray = own + difference * np.outer(self._coarse, self._coarse)
        return out

    def _change(self, gap: FloatArray, h: FloatArray) -> FloatArray:
        """Covariance (m, m) of that difference beside its common offset: linear + curved."""
        out: FloatArray = math.exp(2.0 * h[-2]) * (self._x @ self._x.T + np.exp(-0.5 * gap.sum(axis=2)))
        return out

    def _learn(self, y: FloatArray, guess: FloatArray | None) -> FloatArray:
        """Hyperparameters (p + 4,), logarithms, of largest posterior."""
        priors = [AMPLITUDE_PRIOR, AMPLITUDE_PRIOR, *[LENGTH_PRIOR] * len(self.unit), DIFFERENCE_PRIOR, NOISE_PRIOR]
        mean, sd, low, high = np.array(priors).T
        count = self.objective.effective_points
        gram = y @ y.T * (count / y.shape[1])

        def cost(h: FloatArray) -> tuple[float, FloatArray]:
            """Minus the logarithm of the posterior, and its gradient (Rasmussen & Williams, eq. 5.9)."""
            factor = cho_factor(self._covariance(h), lower=True)
            inverse = cho_solve(factor, np.eye(len(y)))
            pull = (h - mean) / sd
            value = 0.5 * float(np.sum(inverse * gram)) + count * float(np.log(np.diag(factor[0])).sum())
            inner = 0.5 * (count * inverse - inverse @ gram @ inverse)
            slope = [float(np.sum(inner * d)) for d in self._derivatives(h)]
            return value + 0.5 * float(pull @ pull), np.array(slope) + pull / sd

        start = mean if guess is None else guess
        bounds = np.column_stack([low, high])
        found = minimize(cost, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 15})
        return np.asarray(found.x)

    def _derivatives(self, h: FloatArray) -> list[FloatArray]:
        """Derivatives of the covariance of the runs (m, m) by each hyperparameter."""
        gap = ((self._x[:, None] - self._x[None]) / np.exp(h[2:-2])) ** 2
        shape, both = np.exp(-0.5 * gap.sum(axis=2)), np.outer(self._coarse, self._coarse)
        curved = math.exp(2.0 * h[0]) * shape
        linear = math.exp(2.0 * h[1]) * (self._x @ self._x.T)
        stretched = curved + math.exp(2.0 * h[-2]) * shape * both
        noise = math.exp(2.0 * h[-1]) * np.eye(len(self._x))
        lengths = (stretched * g for g in np.moveaxis(gap, 2, 0))
        return [2.0 * curved, 2.0 * linear, *lengths, 2.0 * self._change(gap, h) * both, 2.0 * noise]

    def predict(self, z: FloatArray) -> tuple[FloatArray, float, float]:
        """Expected curve [N] (n,), its standard deviation [N] and the completed part of the stroke [-] at z (p,)."""
        curves, sds, fractions = self.predict_all(z[None])
        return curves[0], float(sds[0]), float(fractions[0])

    def predict_all(self, z: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same at many points.

        Args:
            z: Internal coordinates [-] (q, p).

        Returns:
            Expected curves [N] (q, n), their standard deviations [N] (q,) and completed parts of the stroke [-] (q,).
        """
        x = (z - self.best.z) / self.unit
        k = self._kernel(x, self._x, self.hyper)
        own = OFFSET**2 + math.exp(2.0 * self.hyper[1]) * np.sum(x**2, axis=1) + math.exp(2.0 * self.hyper[0])
        variance = own - np.sum((k @ self._inverse) * k, axis=1)
        out = k @ self._weights
        size = np.exp((z - self.best.z) @ self._law)
        curves = size[:, None] * (self.best.curve + self.peak * out[:, :-1])
        sds = size * self.peak * np.sqrt(np.maximum(variance, 0.0))
        return curves, sds, 1.0 - np.clip(out[:, -1] - OVERSHOOT, 0.0, 1.0)

    def unknown_residual(self, curves: FloatArray, sds: FloatArray) -> FloatArray:
        """What not knowing the expected curves adds to the residual.

        Args:
            curves: Expected curves [N] (q, n).
            sds: Their standard deviations [N] (q,).

        Returns:
            Square root of the chi-square that it adds [-] (q,).
        """
        goal = self.objective
        return goal.factors(curves) * sds * math.sqrt(goal.effective_points) / goal.sigma

    def noise_information(self, z: FloatArray) -> FloatArray:
        """Information (p, p) that the noise of the runs alone makes in differences of expected curves at z (p,).

        A noisy Jacobian J + D has the information (J + D)^T (J + D), on average J^T J + E[D^T D]. E[D^T D] follows
        from the weights that the process gives to each run.
        """
        objective, p = self.objective, len(self.unit)
        steps = JACOBIAN_STEP * self.unit
        moves = np.diag(steps)
        x = np.array([z + d for d in moves] + [z - d for d in moves])
        k = self._kernel((x - self.best.z) / self.unit, self._x, self.hyper)
        weights = self._inverse @ ((k[:p] - k[p:]) / (2.0 * steps[:, None])).T
        noise = (weights.T * (self._extra + self.noise**2)) @ weights
        per_row = objective.effective_points / objective.sigma**2 + 1.0 / objective.sigma_peak**2
        per_row *= objective.factor(self.predict(z)[0]) ** 2
        out: FloatArray = noise * self.peak**2 * per_row
        # of fewer runs than parameters it has no rank in some directions
        out += LEAST_NOISE * float(np.trace(out)) / p * np.eye(p)
        return out


class Surrogate:
    """The processes of all traces of an objective, and the chi-square that they expect.

    Args:
        objective: Turns curves into residuals.
        runs: Runs so far.
        best: The run about which the processes are written.
        guess: Hyperparameters of an earlier one to start from, by trace.
    """

    def __init__(
        self,
        objective: Objective | JointObjective,
        runs: Sequence[ScoredRun],
        best: ScoredRun,
        guess: Sequence[FloatArray] | None = None,
    ) -> None:
        self.objective, self.best = objective, best
        self.unit = coordinate_unit(objective.parameters)
        guesses: Sequence[FloatArray | None] = guess or [None] * len(objective.terms)
        self.each = [
            CurveProcess(c.objective, [run.each[k] for run in runs], best.each[k], g)
            for k, (c, g) in enumerate(zip(objective.terms, guesses, strict=True))
        ]

    @property
    def hyper(self) -> list[FloatArray]:
        """Hyperparameters by trace."""
        return [process.hyper for process in self.each]

    @property
    def noise(self) -> float:
        """Largest standard deviation of one simulated curve about its process, part of the peak [-]."""
        return max(process.noise for process in self.each)

    @property
    def noise_misfit(self) -> float:
        """Chi-square of the difference that the noise of one simulated curve makes, all traces together [-]."""
        return math.fsum(p.noise_misfit * p.objective.effective_points for p in self.each)

    def residuals(self, z: FloatArray, weight: float | None = None) -> FloatArray:
        """Residual vectors of the expected curves.

        Args:
            z: Internal coordinates [-] (q, p).
            weight: Weight of not knowing the curves [-], a row more for each trace; None: no such rows.

        Returns:
            The residuals [-] (q, rows).
        """
        terms = self.objective.terms
        found = [process.predict_all(z[:, term.index]) for process, term in zip(self.each, terms, strict=True)]
        curves, sds, fractions = zip(*found, strict=True)
        rows = residuals(self.objective, curves, np.array(fractions), z)
        if weight is None:
            return rows
        unknown = [process.unknown_residual(c, sd) for process, c, sd in zip(self.each, curves, sds, strict=True)]
        return np.column_stack([rows, *(math.sqrt(weight) * row for row in unknown)])

    def residual(self, z: FloatArray) -> FloatArray:
        """Residual vector of the expected curves at z (p,)."""
        return self.residuals(z[None])[0]

    def expected(self, z: FloatArray, weight: float) -> float:
        """Expected chi-square of a point [-].

        Args:
            z: Its internal coordinates [-] (p,).
            weight: Weight of the part from not knowing the curves [-]: 1 is the expectation.

        Returns:
            The chi-square of the expected curves and, weighted, what not knowing them adds.
        """
        return float(self.expected_all(z[None], weight)[0])

    def expected_all(self, z: FloatArray, weight: float) -> FloatArray:
        """The same of many points (q, p): (q,)."""
        out: FloatArray = np.sum(self.residuals(z, weight) ** 2, axis=1)
        return out

    def least(self, start: FloatArray, radius: float, weight: float) -> FloatArray:
        """Point of least expected chi-square within the hard bounds and about the best run.

        Args:
            start: Where the descent begins [-] (p,).
            radius: Distance from the best run within which the point lies [coordinate units].
            weight: Weight of the part from not knowing the curves [-].

        Returns:
            Internal coordinates of the point (p,).
        """
        parameters = self.objective.parameters
        edge = 1e-9 * self.unit
        low = np.maximum(parameters.lower, self.best.z - radius * self.unit) - edge
        high = np.minimum(parameters.upper, self.best.z + radius * self.unit) + edge
        inside = np.clip(start, low + 0.5 * edge, high - 0.5 * edge)
        found = least_squares(
            lambda z: self.residuals(z[None], weight)[0],
            inside,
            jac=lambda z: slopes(lambda points: self.residuals(points, weight), z, self.unit),
            bounds=(low, high),
            x_scale=self.unit,
            max_nfev=15,
        )
        return parameters.clip(np.asarray(found.x))

    def jacobian(self, z: FloatArray) -> FloatArray:
        """Derivative of ``residual`` at z by internal coordinates, less what is only the noise of the runs.

        The directions of each trace's Jacobian are shrunk until its information is without what the noise makes, to
        zero where there is nothing else; a parameter without influence would look identified otherwise.

        Args:
            z: Internal coordinates [-] (p,).

        Returns:
            The derivative [-] (rows, p).
        """
        steps = JACOBIAN_STEP * self.unit
        moves = np.diag(steps)
        beside = self.residuals(np.concatenate([z + moves, z - moves]))
        rows = (beside[: len(z)] - beside[len(z) :]).T / (2.0 * steps)
        first = 0
        for process, term in zip(self.each, self.objective.terms, strict=True):
            part = slice(first, first + term.objective.data_rows)
            data = rows[part]
            data[-1] = 0.0  # the penalty of a failure is no measurement
            own = data[:, term.index]
            ratio, basis = eigh(own.T @ own, process.noise_information(z[term.index]))
            kept = np.sqrt(np.maximum(ratio - NOISE_MARGIN, 0.0) / np.maximum(ratio, NOISE_MARGIN))
            data[:, term.index] = own @ (basis * kept) @ np.linalg.inv(basis)
            first = part.stop
        return rows
