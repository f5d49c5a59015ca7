"""Intervals of the fitted parameters from the curvature of chi-square at the optimum: the normal approximation.

:func:`uncertainty` gives 95 % intervals in internal coordinates (so those of log parameters are asymmetric in SI), with
J_d the rows of the data and J_p those of the priors:

    covariance = (J_d^T J_d / s + J_p^T J_p)^-1,   s = max(1, reduced chi-square of the data)

Where the model misses the curve by more than the stated errors, s widens what the data say, with Student's factor
because it is estimated. It does not touch the literature, so no parameter ends up known less than before. A band of
forces takes the size of the errors from what is stated of it and from what is seen, both: few data alone would allow
any size. The rows of the data are weighted by the correlation length that the residuals show. What the measurement
leaves open without the search being free to use it (gain, width) is integrated out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2
from scipy.stats import t as student

from calib.problem.joint_objective import JointObjective
from calib.problem.nuisance import Whitening
from calib.problem.objective import EXPLAINED, Objective
from calib.problem.parameters import Z95, Parameter, ParameterSet
from calib.problem.scored_run import ScoredRun
from mpm.arrays import FloatArray

Identifiability = Literal["identified", "weak", "one_sided", "not_seen", "at_bound"]
"""What the trace says of a parameter; docs/theory.md, "Intervals and verdicts", has the conditions of each."""

IDENTIFIED, NOT_SEEN = 0.5, 0.9
"""A parameter is identified when its posterior is narrower than the first part of its prior, and not seen when it is
wider than the second: below one half the cut says more than the literature, above 0.9 next to nothing."""
ON_BOUND = 0.1
"""An estimate this close to a hard bound, in posterior standard deviations, lies on it."""
TIED = 0.95
"""Two parameters whose correlation is larger, of either sign, are only known together."""
CREDIBLE_LEVEL = 0.95
"""Part of the posterior within an interval [-]."""
LARGEST_CORRELATION = 0.5
"""Residuals that keep their sign over more than this part of the stroke are a wrong model, not noise."""
STATED_WORTH = 2.0
"""How many independent data the stated size of the errors is worth, where a band of forces is predicted: with it bands
hold 95 % of another measurement whose errors are 0.6 to 2.9 times the stated (docs/theory.md, "Measured choices")."""
ASSUMED_SPREAD, SEEN_SPREAD = 0.5, 0.4
"""Standard deviations of the logarithm of the correlation length: of what is assumed before the residuals are seen (a
factor of 2.7 either way), and of what one curve shows (docs/theory.md, "Measured choices")."""


@dataclass(frozen=True)
class Interval:
    """A fitted parameter with its 95 % interval.

    Attributes:
        parameter: The parameter with its best value.
        low95: Lower end [unit], not below the hard bound.
        high95: Upper end [unit], not above the hard bound.
        clipped: Whether a hard bound cut the interval off.
        width: Posterior over prior standard deviation in the internal coordinate [-].
        verdict: Its identifiability. ``at_bound``: the best value lies on a hard bound; else by width ``identified``
            (below 0.5), ``weak``, or ``not_seen`` (above 0.9: the interval is the literature's). Profiles refine it.
    """

    parameter: Parameter
    low95: float
    high95: float
    clipped: bool
    width: float
    verdict: Identifiability

    def as_dict(self) -> dict[str, float | str]:
        """Entry of ``summary.json``: value, unit, low95, high95, prior_low, prior_high, verdict."""
        p = self.parameter
        return {
            "value": p.value,
            "unit": p.unit,
            "low95": self.low95,
            "high95": self.high95,
            "prior_low": p.prior_range[0],
            "prior_high": p.prior_range[1],
            "verdict": self.verdict,
        }


@dataclass(frozen=True)
class Tie:
    """Two parameters that the cut determines only together.

    Attributes:
        combination: What is known better than either of them: ``a * b`` (correlation -1) or ``a / b`` (+1).
        correlation: Posterior correlation [-].
    """

    combination: str
    correlation: float


@dataclass(frozen=True, eq=False)
class LinearisedLikelihood:
    """Residuals of a fit and their slopes at the best values: independent rows of unit variance if the stated errors
    are right.

    Attributes:
        jacobian: Derivative of the residuals by internal coordinates (k, p).
        residual: Residuals at the best values (k,).
        unsearched: Residuals by one prior standard deviation of what the measurement leaves open and the search may not
            use (k, m).
        rows: Effective number of independent ones among them [-].
        weights: What the rows of the objective were multiplied by for the correlation that their residuals show (k,).
        lengths: Correlation length of each trace's residuals, part of its stroke [-].
        met: Whether the right material would leave as large a chi-square with the correlation that was assumed, too. A
            wrong curve is off for long stretches, which looks like few independent rows, and so like a chi-square that
            is nothing odd.
    """

    jacobian: FloatArray
    residual: FloatArray
    unsearched: FloatArray
    rows: float
    weights: FloatArray
    lengths: tuple[float, ...] = ()
    met: bool = True


@dataclass(frozen=True)
class Uncertainty:
    """Posterior about the best point, in the normal approximation.

    Attributes:
        intervals: One per parameter.
        covariance: In internal coordinates (p, p).
        correlation: Its correlation matrix (p, p).
        only_as_product: Pairs with a correlation beyond 0.95 either way.
        reduced_chi2: Chi-square of the data per degree of freedom [-].
        freedom: Degrees of freedom [-].
        widened: Factor on the variance of the data's errors [-]: ``reduced_chi2`` but at least 1, times Student's where
            it is more.
        error_variance: Variance of another measurement's errors over the stated one [-], at least 1: expected from what
            is stated and what is seen, times Student's factor where it is more.
        data: The likelihood at the best values.
        alone: The covariance if gain and width were known (p, p).
        unsearched: Posterior mean and standard deviation of each nuisance that the search may not use, in prior
            standard deviations.
    """

    intervals: tuple[Interval, ...]
    covariance: FloatArray
    correlation: FloatArray
    only_as_product: tuple[Tie, ...]
    reduced_chi2: float
    freedom: float
    widened: float
    error_variance: float
    data: LinearisedLikelihood
    alone: FloatArray
    unsearched: tuple[tuple[float, float], ...] = ()

    @property
    def explained(self) -> bool:
        """Whether the best curve follows the data as the right one would."""
        return self.data.met and self.probability >= 1.0 - EXPLAINED

    @property
    def probability(self) -> float:
        """Probability that the right material would leave a larger chi-square [-]."""
        return float(chi2.sf(self.reduced_chi2 * self.freedom, self.freedom))

    def rows(self, residuals: FloatArray) -> FloatArray:
        """Residual vectors (q, k + p) of runs as the intervals see them: errors of the data widened, weighted,
        marginal."""
        size = math.sqrt(self.widened)
        k = len(self.data.weights)
        data = Whitening(self.data.unsearched / size)((self.data.weights / size * residuals[:, :k]).T).T
        return np.concatenate([data, residuals[:, k:]], axis=1)

    def known_width(self) -> dict[str, float]:
        """Width of each parameter's interval if gain and width were known, over what it is [-], by name."""
        part = np.sqrt(np.diag(self.alone) / np.diag(self.covariance))
        return {i.parameter.name: float(x) for i, x in zip(self.intervals, part, strict=True)}


def correlation_length(residual: FloatArray, determined: float, assumed: float) -> float:
    """Correlation length of the residuals along a curve, part of its length [-].

    It is the integral of their autocorrelation up to the first pair of lags with a negative sum (Geyer 1992, Statist.
    Sci. 7:473). A fit takes part of the correlation away: with p parameters that the curve determines, a length l is
    seen as l / (1 + p l), which is undone (docs/theory.md, "Measured choices"). One curve tells the length to a factor
    of 1.5, so that the assumed one still counts, as a lognormal prior.

    Args:
        residual: Residuals on a uniform grid, in standard deviations [-], (n,).
        determined: Number of parameters that the curve determines [-].
        assumed: Correlation length before the residuals were seen, part of the length [-].

    Returns:
        The correlation length, part of the length [-]; ``assumed`` where all residuals are zero.
    """
    n = len(residual)
    power = float(residual @ residual)
    if not power > 0.0:
        return assumed
    acf = np.correlate(residual, residual, "full")[n - 1 :] / power
    pairs = acf[: n // 2 * 2 : 2] + acf[1 : n // 2 * 2 : 2]
    ends = np.flatnonzero(pairs <= 0.0)
    last = int(ends[0]) if len(ends) else len(pairs)
    seen = min(max((2.0 * float(pairs[:last].sum()) - 1.0) / n, 1.0 / n), LARGEST_CORRELATION)
    alone = min(seen / max(1.0 - determined * seen, seen), LARGEST_CORRELATION)
    trust = ASSUMED_SPREAD**2 / (ASSUMED_SPREAD**2 + SEEN_SPREAD**2)
    return float(assumed ** (1.0 - trust) * alone**trust)


def linearised_likelihood(
    objective: Objective | JointObjective, best: ScoredRun, jacobian: FloatArray
) -> LinearisedLikelihood:
    """The data rows of a fit, weighted by the correlation length that their residuals show.

    Args:
        objective: The objective.
        best: The best run.
        jacobian: Derivative of its residual vector by internal coordinates [-], (k + p, p), prior rows last.

    Returns:
        The rows of the data at the best run, and their slopes.
    """
    first, rows, lengths = 0, 0.0, []
    weights, open_ended = [], []
    prior = objective.parameters.prior_jacobian()
    for trial, case in zip(best.each, objective.terms, strict=True):
        goal = case.objective
        part = slice(first, first + goal.data_rows)
        first = part.stop
        slope = jacobian[part]
        information = slope.T @ slope
        determined = float(np.trace(np.linalg.solve(information + prior.T @ prior, information)))
        points = goal.target.stroke.size
        length = correlation_length(goal.curve_residual(trial.curve), determined, goal.errors.correlation)
        weight = math.sqrt(1.0 / (length * goal.effective_points))
        weights.append(np.append(np.full(goal.data_rows - 1, weight), 0.0))  # a failure is no measurement
        open_ended.append(weight * goal.unsearched())
        rows += min(1.0 / length, points) + 1.0
        lengths.append(length)
    scale = np.concatenate(weights)
    slopes = scale[:, None] * jacobian[: len(scale)]
    met = bool(best.misfit <= chi2.ppf(EXPLAINED, objective.effective_rows))
    left = scale * best.residual[: len(scale)]
    return LinearisedLikelihood(slopes, left, block_diag(*open_ended), rows, scale, tuple(lengths), met)


def uncertainty(parameters: ParameterSet, data: LinearisedLikelihood) -> Uncertainty:
    """95 % intervals, correlations and a verdict per parameter from the curvature at the optimum.

    Args:
        parameters: The parameters with their best values.
        data: The likelihood there.

    Returns:
        The posterior in the normal approximation.
    """
    prior = parameters.prior_jacobian()
    own = prior.T @ prior
    information = data.jacobian.T @ data.jacobian
    first = np.linalg.inv(information + own)
    freedom = max(data.rows - float(np.trace(first @ information)), 1.0)
    misfit = float(data.residual @ data.residual)
    reduced = misfit / freedom
    size = max(1.0, reduced)
    widened, error_variance = 1.0, 1.0
    if reduced > 1.0:
        worth = STATED_WORTH + freedom
        widened = size * _student(freedom) ** 2
        error_variance = (STATED_WORTH + misfit) / worth * _student(worth) ** 2
    marginal = marginal_information(data.jacobian, data.unsearched, widened)
    covariance: FloatArray = np.asarray(np.linalg.inv(marginal + own), dtype=np.float64)
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    intervals = tuple(_interval(q, z, s) for q, z, s in zip(parameters, parameters.start, sd, strict=True))
    beside = _beside(data, own, prior.T @ parameters.prior_residual(parameters.start), size)
    ties = _ties(parameters.names, correlation)
    alone: FloatArray = np.asarray(np.linalg.inv(information / widened + own), dtype=np.float64)
    return Uncertainty(
        intervals, covariance, correlation, ties, reduced, freedom, widened, error_variance, data, alone, beside
    )


def _student(freedom: float) -> float:
    """Half width of Student's 95 % interval of so many degrees of freedom, over the normal one's [-]."""
    return float(student.ppf(0.5 + 0.5 * CREDIBLE_LEVEL, freedom)) / Z95


def _beside(
    data: LinearisedLikelihood, own: FloatArray, pull: FloatArray, size: float
) -> tuple[tuple[float, float], ...]:
    """Mean and standard deviation of each unsearched nuisance, in prior ones, with the parameters free beside it.

    Args:
        data: The likelihood at the best values.
        own: Information of the parameters' priors (p, p).
        pull: Gradient of half their chi-square (p,).
        size: Factor on the variance of the errors.
    """
    count = data.unsearched.shape[1]
    slopes = np.hstack([data.jacobian, data.unsearched]) / math.sqrt(size)
    information = slopes.T @ slopes + block_diag(own, np.eye(count))
    gradient = slopes.T @ data.residual / math.sqrt(size) + np.append(pull, np.zeros(count))
    inverse = np.linalg.inv(information)
    mean, sd = -inverse @ gradient, np.sqrt(np.diag(inverse))
    return tuple((float(m), float(d)) for m, d in zip(mean[len(pull) :], sd[len(pull) :], strict=True))


def marginal_information(jacobian: FloatArray, unsearched: FloatArray, size: float) -> FloatArray:
    """Information of rows where some nuisances are integrated out.

    Args:
        jacobian: Slopes of the rows by internal coordinates [-], (k, p).
        unsearched: Rows by one prior standard deviation of each nuisance [-], (k, m).
        size: Factor on the stated variance of the rows [-].

    Returns:
        The information in internal coordinates (p, p).
    """
    cross = unsearched.T @ jacobian / size
    inner = unsearched.T @ unsearched / size + np.eye(unsearched.shape[1])
    out: FloatArray = jacobian.T @ jacobian / size - cross.T @ np.linalg.solve(inner, cross)
    return out


def _interval(parameter: Parameter, z: float, sd: float) -> Interval:
    """Interval and verdict of one parameter with posterior standard deviation ``sd`` about ``z``."""
    low, high = parameter.to_internal(parameter.low), parameter.to_internal(parameter.high)
    ends = z - Z95 * sd, z + Z95 * sd
    width = sd / parameter.prior_sd
    verdict: Identifiability = "identified" if width < IDENTIFIED else "not_seen" if width > NOT_SEEN else "weak"
    if min(z - low, high - z) < ON_BOUND * sd:
        verdict = "at_bound"
    return Interval(
        parameter,
        parameter.from_internal(ends[0]),
        parameter.from_internal(ends[1]),
        ends[0] < low or ends[1] > high,
        width,
        verdict,
    )


def _ties(names: Sequence[str], correlation: FloatArray) -> tuple[Tie, ...]:
    """Pairs of names with a correlation beyond :data:`TIED`."""
    pairs = [(i, j) for j in range(len(names)) for i in range(j) if abs(correlation[i, j]) > TIED]
    sign = {True: "/", False: "*"}
    return tuple(
        Tie(f"{names[i]} {sign[correlation[i, j] > 0.0]} {names[j]}", float(correlation[i, j])) for i, j in pairs
    )
