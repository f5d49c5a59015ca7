"""The misfit of a simulated cut against the conditioned real curve, as a vector of residuals.

Rows of the vector (n grid points, p parameters; all without dimension, one standard deviation each):

    0 .. n-1   w (m_i - r_i) / sigma     m: simulated, r: real force, both smoothed alike, on the trace's
    stroke grid n          (max m - max r) / s_peak  the headline figure, which n correlated points would
    otherwise outvote n+1        P (1 - fraction)          zero for a run that cut the food to the end of the stroke
    n+2 ..     (z_j - mean_j) / sd_j     literature priors in internal coordinates

Where a study has several specimens, m is k times the simulated force; k is the factor of width and sensor, the best one for
each curve, with a lognormal prior whose row ln k / sd_k stands before that of the failure.

    sigma^2  = noise_sd^2 + (discrepancy * max r)^2 + u_num^2
    s_peak^2 = peak_sd^2 + (peak * max r)^2 + what the drift may do to it
    w        = sqrt(n_eff / n),   n_eff = stroke length / correlation length

What the tare, the drift and the lag of the measurement leave open correlates the first n rows; they are whitened with
that covariance (:mod:`calib.problem.nuisance`).

A run that broke down gives a vector of the same length: where it computed nothing, its last mean difference
to the real curve is held.  The vector is finite, continuous in ``fraction``, and passes into that of a
finished run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from calib.errors import TraceError
from calib.problem.nuisance import Nuisance, NuisanceEstimate, Whitening, estimate
from calib.problem.parameters import ParameterSet
from calib.simulation.evaluation import Evaluation
from mpm.arrays import FloatArray

#: Smooths a raw record like the real one was: (grid [m] (n,), stroke [m] (k,), force [N] (k,)) -> force [N]
#: (n,).
Smoother = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]

#: Model discrepancy as a part of the peak.  Seven-parameter curves fitted to single cuts of apple, cucumber
#: and potato leave 2-7 % of the peak; a simulator with five constants is not credited with more than the
#: better half.
DISCREPANCY = 0.03

#: Correlation length of that discrepancy as a part of the stroke: structural misfit (a skin peak, a slope, a
#: plateau) extends over about a twentieth of a cut, so at most 20 of the grid points count as independent.
CORRELATION = 0.05

#: Tolerance of the peak, as a part of it, so that an error of 5 % (the limit of a passed calibration) costs
#: 2.5 sd.
PEAK = 0.02

#: Samples further than this many real peaks from the real curve count as that far: a spike of a run that
#: blows up must not overflow the sum of squares.
LARGEST_DIFFERENCE = 10.0

#: Steps of Newton's method for the factor; from the least squares without prior, four reach rounding.
NEWTON = 6

#: A run that broke down is continued at the mean difference over this last part of the stroke: over less, the
#: spike with which it broke down would be held.
TAIL = 0.05


@dataclass(frozen=True)
class ErrorModel:
    """How far a right model may be from the trace; see the constants of this module for the reasons.

    Attributes:
        discrepancy: Model discrepancy along the curve, part of the real peak [-].
        correlation: Correlation length of the residuals, part of the stroke [-], at most 1.
        peak: Tolerance of the peak force, part of the real peak [-].
    """

    discrepancy: float = DISCREPANCY
    correlation: float = CORRELATION
    peak: float = PEAK

    def __post_init__(self) -> None:
        if not (self.discrepancy > 0.0 and self.peak > 0.0 and 0.0 < self.correlation <= 1.0):
            raise TraceError(
                f"error model {self} needs discrepancy > 0, peak > 0 and 0 < correlation <= 1; "
                "give parts of the peak and of the stroke, for instance 0.03."
            )


@dataclass(frozen=True)
class Target:
    """The conditioned real curve that a simulation is compared with.

    Attributes:
        stroke: Uniform stroke grid from 0 [m] (n,).
        curve: Smoothed real force [N] (n,).
        noise_sd: Standard deviation of the noise of ``curve`` [N].
        peak_sd: Standard deviation of its peak [N].
        smooth: Puts a raw simulated record on given strokes, smoothed like ``curve``.
        u_num: Numerical standard uncertainty of the simulated curve [N], one for all or (n,).

    Raises:
        TraceError: A curve that is not finite, not matching its grid, or without a positive peak.
    """

    stroke: FloatArray
    curve: FloatArray
    noise_sd: float
    peak_sd: float
    smooth: Smoother
    u_num: float | FloatArray = 0.0

    def __post_init__(self) -> None:
        if self.stroke.ndim != 1 or self.stroke.shape != self.curve.shape or self.stroke.size < 2:
            raise TraceError(
                f"target has {self.stroke.shape} strokes and {self.curve.shape} forces; give two "
                "vectors of equal length, at least 2."
            )
        if not (np.isfinite(self.curve).all() and np.all(np.diff(self.stroke) > 0.0)):
            raise TraceError("target has forces that are not finite or strokes that do not rise; condition it first.")
        if not self.peak > 0.0:
            raise TraceError(f"target has the peak {self.peak:g} N; it must be positive, check the sign of the force.")
        if not (0.0 <= self.noise_sd < math.inf and 0.0 <= self.peak_sd < math.inf):
            raise TraceError(
                f"target has noise_sd {self.noise_sd:g} N and peak_sd {self.peak_sd:g} N; "
                "give finite values that are not negative."
            )

    @property
    def peak(self) -> float:
        """Largest force of the real curve [N]."""
        return float(self.curve.max())

    @property
    def length(self) -> float:
        """Length of the stroke [m]."""
        return float(self.stroke[-1] - self.stroke[0])


@dataclass(frozen=True, eq=False)
class Trial:
    """An evaluation as the objective sees it.

    Attributes:
        z: Internal coordinates (p,).
        evaluation: The simulation.
        curve: Its smoothed force on the target's grid [N] (n,).
        residual: Its residual vector (n + 2 + p,).
        coarse: Whether it was run at the coarse resolution.
        stage: Why it was run: design, scaled, difference, round or screened.
        parts: The trial as each trace of a joint objective sees it; empty for a single one.
    """

    z: FloatArray
    evaluation: Evaluation
    curve: FloatArray
    residual: FloatArray
    coarse: bool = False
    stage: str = "design"
    parts: tuple[Trial, ...] = ()

    def as_fine(self) -> Trial:
        """The same trial, as if its resolution were the one that counts."""
        return replace(self, coarse=False, parts=tuple(t.as_fine() for t in self.parts))

    @property
    def each(self) -> tuple[Trial, ...]:
        """The trial of each trace."""
        return self.parts or (self,)

    @property
    def misfit(self) -> float:
        """Chi-square with priors [-]."""
        return float(self.residual @ self.residual)

    @property
    def ok(self) -> bool:
        """Whether the run reached the end of its stroke."""
        return self.evaluation.ok

    @property
    def cut(self) -> bool:
        """Whether it cut the food all the way, that of each trace."""
        return all(t.evaluation.completed == 1.0 for t in self.each)


@dataclass(frozen=True, eq=False)
class Case:
    """One trace of an objective.

    Attributes:
        name: Name of the trace; empty where there is only one.
        objective: Its own objective, over those parameters that its simulation takes.
        index: Places of those among the parameters of the whole (q,).
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
        scale_sd: Standard deviation of the logarithm of the factor of width and sensor [-]; 0: there is none.
    """

    target: Target
    parameters: ParameterSet
    errors: ErrorModel = field(default_factory=ErrorModel)
    nuisances: tuple[Nuisance, ...] = ()
    scale_sd: float = 0.0

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
        """Length of :meth:`data_residual`: grid points, peak, factor where there is one, failure."""
        return self.target.stroke.size + 2 + (self.scale_sd > 0.0)

    @cached_property
    def failure_weight(self) -> float:
        """Penalty P of a run that computed nothing: the misfit of predicting no force at all [-]."""
        return float(np.linalg.norm(self._whiten(self._bare(np.zeros_like(self.target.curve)))))

    def curve(self, evaluation: Evaluation) -> tuple[FloatArray, float]:
        """Smoothed force on the target's grid [N] (n,) and the part of the stroke [-] that was completed.

        Samples from the first one that is not finite on, and those that do not advance the stroke, are left
        out. Beyond the last sample the record is continued at its last mean difference to the real curve.
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
        """Rows of curve, peak, factor and failure (n + 2 or n + 3,) of a curve [N] (n,) that completed ``fraction``."""
        return self.data_residuals(curve[None], np.array([fraction]))[0]

    def data_residuals(self, curves: FloatArray, fractions: FloatArray) -> FloatArray:
        """The same of several curves [N] (q, n) that completed their ``fractions`` (q,): (q, n + 2 or n + 3)."""
        penalty = self.failure_weight * (1.0 - fractions)
        return np.column_stack([self._compare(curves), penalty])

    def residual(self, curve: FloatArray, fraction: float, z: FloatArray) -> FloatArray:
        """All rows (n + 2 + p,) of a curve [N] (n,) from a run at ``z`` (p,) that completed ``fraction``."""
        return np.concatenate([self.data_residual(curve, fraction), self.parameters.prior_residual(z)])

    @cached_property
    def cases(self) -> tuple[Case, ...]:
        """The one trace, as a joint objective has several."""
        return (Case("", self, np.arange(len(self.parameters))),)

    def trial(self, evaluation: Evaluation, *, coarse: bool = False, stage: str = "design") -> Trial:
        """Curve and residual vector of an evaluation; always finite."""
        z = self.parameters.to_vector(evaluation.parameters)
        curve, fraction = self.curve(evaluation)
        return Trial(z, evaluation, curve, self.residual(curve, fraction, z), coarse, stage)

    def nuisance_estimates(self, curve: FloatArray) -> tuple[NuisanceEstimate, ...]:
        """What a simulated curve [N] (n,) says of the nuisances, those that the search may not use included."""
        own = self.factor(curve) * curve
        return estimate(self.nuisances, self._columns(self.nuisances), self._bare(own))

    def factor(self, curve: FloatArray) -> float:
        """The factor that a specimen's width and sensor ask for on its simulated force (n,), least squares with its prior [-].

        1 where there is none.
        """
        if not self.scale_sd > 0.0:
            return 1.0
        own = self._whiten(np.append(self._weights * curve, float(curve.max()) / self.sigma_peak))
        size, cross = float(own @ own), float(own @ self._measured)
        if not (size > 0.0 and cross > 0.0):
            return 1.0
        log, pull = math.log(cross / size), self.scale_sd**-2
        for _ in range(NEWTON):  # (k^2 size - 2 k cross + (ln k / sd)^2)' = 0 by ln k; curvature positive near its root
            k = math.exp(log)
            slope, curvature = k * (k * size - cross) + pull * log, k * (2.0 * k * size - cross) + pull
            log -= min(max(slope / max(curvature, pull), -1.0), 1.0)
        return math.exp(log)

    def factors(self, curves: FloatArray) -> FloatArray:
        """The same of several curves (q, n): (q,)."""
        return np.array([self.factor(curve) for curve in curves]) if self.scale_sd > 0.0 else np.ones(len(curves))

    def unsearched(self) -> FloatArray:
        """Residual by one standard deviation of each nuisance that the search may not use (data_rows, k)."""
        columns = self._columns([n for n in self.nuisances if not n.searched])
        return np.vstack([self._whiten(columns), np.zeros((self.data_rows - len(columns), columns.shape[1]))])

    def curve_residual(self, curve: FloatArray) -> FloatArray:
        """Rows of the curve alone (n,), in standard deviations of a point, less what the nuisances explain of them."""
        own = self.factor(curve) * curve
        explained = sum(
            (e.value * n.shape for e, n in zip(self.nuisance_estimates(curve), self.nuisances, strict=True)), 0.0
        )
        out: FloatArray = (own - self.target.curve + explained) / self.sigmas
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
