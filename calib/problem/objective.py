"""The misfit of a simulated cut against the conditioned real curve, as a vector of residuals.

Rows of the vector for n grid points and p parameters, each without dimension, in standard deviations:

    =========  =======================  =====================================================================
    row        residual                 what it compares
    =========  =======================  =====================================================================
    0 .. n-1   w (k m_i - r_i) / s_i    the curve: m simulated, r real force, both smoothed alike, on the
                                        stroke grid of the trace; whitened
    n          (max k m - max r) / s_p  the peak: the headline figure, which n correlated points would
                                        otherwise outvote
    n+1        ln k / sd_k              the factor k on the force, in a fit of several specimens only
    next       P (1 - fraction)         the failure: zero for a run that cut the food to the end of the stroke
    last p     (z_j - mean_j) / sd_j    the literature's priors, in internal coordinates
    =========  =======================  =====================================================================

    s_i^2 = noise_sd^2 + (discrepancy * max r)^2 + u_num_i^2
    s_p^2 = peak_sd^2 + (peak * max r)^2 + (what the drift may do to the peak)^2
    w     = sqrt(n_eff / n),   n_eff = stroke length / correlation length, at most n

The factor k stands for the width of a specimen and the gain of its sensor. It is the best one for each curve, with a
lognormal prior of standard deviation sd_k. Without it, k = 1 and its row is missing. P is the root of the chi-square of
a curve without any force.

The tare, the drift and the lag of the measurement correlate the first n rows. The rows are whitened with that
covariance (:mod:`calib.problem.nuisance`).

A run that broke down gives a vector of the same length: where it computed nothing, its last mean difference to the real
curve is held. The vector is finite, continuous in ``fraction``, and passes into that of a finished run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from calib.problem.nuisance import Nuisance, NuisanceEstimate, Whitening, estimate_nuisances
from calib.problem.parameters import ParameterSet
from calib.problem.scored_run import ScoredRun
from calib.problem.target import ErrorModel, Target
from calib.simulation.evaluation import Evaluation
from mpm.arrays import FloatArray

#: A curve counts as explained when the right material would leave a larger chi-square than its own in one of a hundred
#: cuts. Where it is not, the model or the search is wrong, and nothing is called identified
#: (docs/theory.md, "Measured choices").
EXPLAINED = 0.99

#: Simulated forces, and differences between curves in the surrogate, beyond this many peaks count as that many [-]: a
#: spike of a run that blows up must not overflow the sum of squares.
LARGEST_DIFFERENCE = 10.0

#: Steps of Newton's method for the factor; from the least squares without prior, four reach rounding.
NEWTON = 6

#: A run that broke down is continued at the mean difference over this last part of the stroke [-]: over less, the spike
#: with which it broke down would be held.
TAIL = 0.05


@dataclass(frozen=True, eq=False)
class ObjectiveTerm:
    """The part of an objective that one trace has; the data rows of several stand one after the other.

    Attributes:
        name: Name of the trace; empty where there is only one.
        objective: Its own objective, over those parameters that its simulation takes.
        index: Places of those among the parameters of the whole objective (q,).
    """

    name: str
    objective: Objective
    index: npt.NDArray[np.intp]


@dataclass(frozen=True)
class Objective:
    """Residual vector and chi-square of evaluations against one target, with priors.

    Attributes:
        target: The real curve.
        parameters: The fitted parameters with their priors.
        errors: The error model.
        nuisances: What the measurement leaves open.
        scale_sd: Standard deviation of the logarithm of the factor of width and sensor [-]; 0: there is no factor.
        guesses: Points in internal coordinates that a search tries first, each (p,).
    """

    target: Target
    parameters: ParameterSet
    errors: ErrorModel = field(default_factory=ErrorModel)
    nuisances: tuple[Nuisance, ...] = ()
    scale_sd: float = 0.0
    guesses: tuple[FloatArray, ...] = ()

    @cached_property
    def sigmas(self) -> FloatArray:
        """Standard deviation of each point of the curve [N] (n,)."""
        own = math.hypot(self.target.noise_sd, self.errors.discrepancy * self.target.peak)
        return np.hypot(own, np.broadcast_to(self.target.u_num, self.target.curve.shape))

    @cached_property
    def sigma(self) -> float:
        """Standard deviation of one point of the curve, root of the mean square [N]."""
        return float(np.sqrt(np.mean(self.sigmas**2)))

    @cached_property
    def sigma_peak(self) -> float:
        """Standard deviation of the peak [N]."""
        open_ended = (n.sd * n.peak for n in self.nuisances if n.searched)
        return math.hypot(self.target.peak_sd, self.errors.peak * self.target.peak, *open_ended)

    @property
    def effective_points(self) -> float:
        """Effective number of independent points of the curve [-]."""
        return min(float(self.target.stroke.size), 1.0 / self.errors.correlation)

    @property
    def effective_rows(self) -> float:
        """Effective number of independent data: those of the curve and the peak [-]."""
        return self.effective_points + 1.0

    @property
    def data_rows(self) -> int:
        """Number of rows of :meth:`data_residual`: grid points, peak, factor where there is one, failure."""
        return self.target.stroke.size + 2 + (self.scale_sd > 0.0)

    @cached_property
    def failure_weight(self) -> float:
        """Penalty P of a run that computed nothing: the root of the chi-square of predicting no force at all [-]."""
        return float(np.linalg.norm(self._whiten(self._bare(np.zeros_like(self.target.curve)))))

    def curve(self, evaluation: Evaluation) -> tuple[FloatArray, float]:
        """Smoothed force of a simulation on the target's grid, and the part of the stroke that it completed.

        Samples from the first one that is not finite on, and those that do not advance the stroke, are left out. Beyond
        the last sample the record is continued at its last mean difference to the real curve.

        Args:
            evaluation: The simulation.

        Returns:
            Force [N] (n,), always finite, and part of the stroke [-].
        """
        target = self.target
        stroke, force, fraction = _usable(evaluation, target)
        if stroke.size < 2:
            return target.curve.copy(), fraction
        limit = LARGEST_DIFFERENCE * target.peak
        force = np.clip(force, -limit, limit)
        beyond = target.stroke > stroke[-1]
        if beyond.any():
            tail = stroke > stroke[-1] - TAIL * target.length
            held = np.mean(force[tail] - np.interp(stroke[tail], target.stroke, target.curve))
            stroke = np.append(stroke, target.stroke[beyond])
            force = np.append(force, target.curve[beyond] + held)
        return target.smooth(target.stroke, stroke, force), fraction

    def data_residual(self, curve: FloatArray, fraction: float = 1.0) -> FloatArray:
        """The rows of the data: curve, peak, factor where there is one, failure.

        Args:
            curve: Simulated force on the target's grid [N] (n,).
            fraction: Part of the stroke that was completed [-].

        Returns:
            The rows [-] (data_rows,).
        """
        return self.data_residuals(curve[None], np.array([fraction]))[0]

    def data_residuals(self, curves: FloatArray, fractions: FloatArray) -> FloatArray:
        """The rows of the data of several curves.

        Args:
            curves: Simulated forces on the target's grid [N] (q, n).
            fractions: Part of the stroke that each completed [-] (q,).

        Returns:
            The rows [-] (q, data_rows).
        """
        penalty = self.failure_weight * (1.0 - fractions)
        return np.column_stack([self._compare(curves), penalty])

    def residual(self, curve: FloatArray, fraction: float, z: FloatArray) -> FloatArray:
        """All rows of the residual: those of the data, then those of the priors.

        Args:
            curve: Simulated force on the target's grid [N] (n,).
            fraction: Part of the stroke that was completed [-].
            z: Internal coordinates of the run [-] (p,).

        Returns:
            The rows [-] (data_rows + p,).
        """
        return np.concatenate([self.data_residual(curve, fraction), self.parameters.prior_residual(z)])

    @cached_property
    def terms(self) -> tuple[ObjectiveTerm, ...]:
        """The one trace, in the form in which a joint objective has several."""
        return (ObjectiveTerm("", self, np.arange(len(self.parameters))),)

    def score(self, evaluation: Evaluation, *, coarse: bool = False, stage: str = "design") -> ScoredRun:
        """Curve and residual vector of a simulation.

        Args:
            evaluation: The simulation.
            coarse: Whether it was run at the coarse resolution.
            stage: Why it was run.

        Returns:
            The run with its residual, which is always finite.
        """
        z = self.parameters.to_vector(evaluation.parameters)
        curve, fraction = self.curve(evaluation)
        return ScoredRun(z, evaluation, curve, self.residual(curve, fraction, z), coarse, stage)

    def nuisance_estimates(self, curve: FloatArray) -> tuple[NuisanceEstimate, ...]:
        """What a simulated curve [N] (n,) says of the nuisances, those that the search may not use included."""
        scaled = self.factor(curve) * curve
        return estimate_nuisances(self.nuisances, self._columns(self.nuisances), self._bare(scaled))

    def factor(self, curve: FloatArray) -> float:
        """The factor k of width and sensor on a simulated force: least squares with its lognormal prior.

        Newton's method on f(ln k) = k^2 size - 2 k cross + (ln k / sd_k)^2, where size is the square of the simulated
        rows and cross their product with the measured ones. The curvature of f is positive near its least value.

        Args:
            curve: Simulated force on the target's grid [N] (n,).

        Returns:
            The factor [-]; 1 where there is none.
        """
        if not self.scale_sd > 0.0:
            return 1.0
        size, cross = self._products(curve)
        if not (size > 0.0 and cross > 0.0):
            return 1.0
        log, pull = math.log(cross / size), self.scale_sd**-2
        for _ in range(NEWTON):
            k = math.exp(log)
            slope, curvature = k * (k * size - cross) + pull * log, k * (2.0 * k * size - cross) + pull
            log -= min(max(slope / max(curvature, pull), -1.0), 1.0)
        return math.exp(log)

    def _products(self, curve: FloatArray) -> tuple[float, float]:
        """The square of the simulated rows, and their product with the measured ones [-]."""
        simulated = self._whiten(np.append(self._weights * curve, float(curve.max()) / self.sigma_peak))
        return float(simulated @ simulated), float(simulated @ self._measured)

    def factor_estimate(self, curve: FloatArray) -> tuple[NuisanceEstimate, ...]:
        """What a simulated curve says of the logarithm of its factor; nothing where there is no factor.

        Args:
            curve: Simulated force on the target's grid [N] (n,).

        Returns:
            The estimate called ``scale``, or none. Its standard deviation is that of Laplace's approximation: the
            curvature of the chi-square at its least value, the material held.
        """
        if not self.scale_sd > 0.0:
            return ()
        size, cross = self._products(curve)
        k = self.factor(curve)
        curvature = max(k * (2.0 * k * size - cross), 0.0) + self.scale_sd**-2
        return (NuisanceEstimate("scale", "-", self.scale_sd, math.log(k), curvature**-0.5),)

    def factors(self, curves: FloatArray) -> FloatArray:
        """The factors [-] (q,) of several simulated curves [N] (q, n)."""
        return np.array([self.factor(curve) for curve in curves]) if self.scale_sd > 0.0 else np.ones(len(curves))

    def unsearched(self) -> FloatArray:
        """Residual [-] by one standard deviation of each nuisance that the search may not use (data_rows, k)."""
        columns = self._columns([n for n in self.nuisances if not n.searched])
        return np.vstack([self._whiten(columns), np.zeros((self.data_rows - len(columns), columns.shape[1]))])

    def curve_residual(self, curve: FloatArray) -> FloatArray:
        """Residual of the curve alone, less what the nuisances explain of it.

        Args:
            curve: Simulated force on the target's grid [N] (n,).

        Returns:
            The residual in standard deviations of a point [-] (n,).
        """
        scaled = self.factor(curve) * curve
        explained = sum(
            (e.value * n.shape for e, n in zip(self.nuisance_estimates(curve), self.nuisances, strict=True)), 0.0
        )
        out: FloatArray = (scaled - self.target.curve + explained) / self.sigmas
        return out

    def _compare(self, curves: FloatArray) -> FloatArray:
        """Rows of curves and peaks (q, n + 1), whitened, and that of the factor where there is one."""
        if not self.scale_sd > 0.0:
            return self._whiten(self._bare(curves).T).T
        k = self.factors(curves)
        return np.column_stack([self._whiten(self._bare(k[:, None] * curves).T).T, np.log(k) / self.scale_sd])

    def _bare(self, curves: FloatArray) -> FloatArray:
        """Rows of curve and peak (..., n + 1) of curves (..., n), as if the measurement left nothing open."""
        peak = (curves.max(axis=-1, keepdims=True) - self.target.peak) / self.sigma_peak
        return np.concatenate([self._weights * (curves - self.target.curve), peak], axis=-1)

    @cached_property
    def _measured(self) -> FloatArray:
        """Rows of the measured curve and peak (n + 1,), whitened."""
        return self._whiten(np.append(self._weights * self.target.curve, self.target.peak / self.sigma_peak))

    @cached_property
    def _weights(self) -> FloatArray:
        """One over the standard deviation of each point, correlation counted [1/N] (n,)."""
        return math.sqrt(self.effective_points / self.target.stroke.size) / self.sigmas

    @cached_property
    def _whiten(self) -> Whitening:
        return Whitening(self._columns([n for n in self.nuisances if n.searched]))

    def _columns(self, chosen: Sequence[Nuisance]) -> FloatArray:
        """Rows of curve and peak by one prior standard deviation of each nuisance (n + 1, k).

        A searched one has none in the peak's row: its standard deviation has it.
        """
        peaks = [0.0 if n.searched else n.peak / self.sigma_peak for n in chosen]
        columns = [-n.sd * np.append(self._weights * n.shape, p) for n, p in zip(chosen, peaks, strict=True)]
        return np.array(columns).reshape(len(columns), self.target.stroke.size + 1).T


def _usable(evaluation: Evaluation, target: Target) -> tuple[FloatArray, FloatArray, float]:
    """Finite samples of a rising stroke [m] with their force [N], and the completed part of the stroke."""
    stroke, force = np.asarray(evaluation.stroke, float), np.asarray(evaluation.force, float)
    fraction = evaluation.completed
    bad = ~(np.isfinite(stroke) & np.isfinite(force))
    end = int(np.argmax(bad)) if bad.any() else stroke.size
    advance = np.diff(np.maximum.accumulate(stroke[:end]), prepend=-math.inf) > 0.0
    stroke, force = stroke[:end][advance], force[:end][advance]
    if stroke.size < 2:
        fraction = 0.0
    elif bad.any():
        fraction = min(fraction, max((float(stroke[-1]) - float(target.stroke[0])) / target.length, 0.0))
    return stroke, force, fraction
