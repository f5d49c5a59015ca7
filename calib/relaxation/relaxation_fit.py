"""Prony series of a hold: how many branches its load needs, what they are, and how far the record tells them.

Relaxation times are searched; stiffnesses follow from them by least squares without negative ones (variable
projection, Golub and Pereyra 1973, SIAM J. Numer. Anal. 10:413-432). The ramp before the hold counts by the way that
was recorded. The number of branches is that of the smallest Bayesian information criterion (Schwarz 1978, Ann. Stat.
6:461-464), whose number of samples is that of independent ones where residuals follow each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares, nnls

from calib.errors import CurveError
from calib.relaxation.hold import Hold
from calib.texture.prony_series import PronySeries, branch
from mpm.arrays import FloatArray

MOST_BRANCHES = 4
"""Branches that are tried unasked: beyond one a decade of the hold they are not told apart."""
SEPARATE = 1.5
"""Least ratio of neighbouring relaxation times: closer ones are one branch."""
BEYOND = 3.0
"""How much longer than the hold, or shorter than its first sample, a relaxation time may be."""
TOLD = math.log(3.0)
"""Half width of the 95 % interval of the logarithm of a relaxation time up to which it counts as told: a factor of
3."""
NORMAL = 1.959964
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class BranchEstimate:
    """A branch of a Prony series, fitted.

    Attributes:
        time_s: Relaxation time [s].
        time_low_s: Lower end of its 95 % interval [s].
        time_high_s: Upper end [s].
        share: Share in the instantaneous stiffness [-].
        share_sd: Its standard uncertainty [-].
        identified: Whether the record tells it.
        why: Why not; empty where it does.
    """

    time_s: float
    time_low_s: float
    time_high_s: float
    share: float
    share_sd: float
    identified: bool
    why: str


@dataclass(frozen=True, eq=False)
class RelaxationFit:
    """The Prony series of one hold.

    Attributes:
        branches: The branches, the fastest first.
        stiffness: Instantaneous load over way [N/m].
        equilibrium: Share that remains [-].
        equilibrium_sd: Its standard uncertainty [-].
        load: Fitted load at the samples of the hold [N], shape (n,).
        nrmse: Root mean square residual over the load with which the hold begins [-].
        bic: Bayesian information criterion by number of branches, from 0.
    """

    branches: tuple[BranchEstimate, ...]
    stiffness: float
    equilibrium: float
    equilibrium_sd: float
    load: FloatArray
    nrmse: float
    bic: tuple[float, ...]

    @property
    def series(self) -> PronySeries:
        """The series alone."""
        return PronySeries(tuple(b.share for b in self.branches), tuple(b.time_s for b in self.branches))


def fit_relaxation(hold: Hold, most: int = MOST_BRANCHES, branches: int | None = None) -> RelaxationFit:
    """The Prony series of a hold.

    Args:
        hold: Load and way of the ramp and of the hold.
        most: Largest number of branches that is tried.
        branches: Number of branches; None to choose it by the information criterion.

    Returns:
        The fit.

    Raises:
        CurveError: The load does not relax as a solid, or there is nothing to fit.
    """
    fits = [_fit(hold, count) for count in range(max(most, branches or 0) + 1)]
    correlated = _correlation(fits[-1][2])
    bic = tuple(_bic(residual, 2 * count + 2, correlated) for count, (_, _, residual) in enumerate(fits))
    count = branches if branches is not None else int(np.argmin(bic))
    times, stiffness, residual = fits[count]
    if not stiffness.sum() > 0.0:
        raise CurveError(f"{hold.name}: no load to fit in the hold")
    return _estimate(hold, times, stiffness, residual, correlated, bic)


def _fit(hold: Hold, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Relaxation times [s], stiffnesses of spring and branches [N/m], and residuals [N] with this many branches."""
    low, high = math.log(hold.first_step / BEYOND), math.log(BEYOND * hold.duration)
    if count == 0:
        stiffness, residual = _projected(hold, np.empty(0))
        return np.empty(0), stiffness, residual
    starts = [np.linspace(low, high, count + 2)[1:-1]]
    starts.append(starts[0] + 0.5 * (high - starts[0]) * 0.5)
    gap = math.log(SEPARATE)

    def spread(x: FloatArray) -> FloatArray:
        """Logarithms of times that are apart: the first, and the steps between them."""
        return np.cumsum(np.concatenate([[x[0]], gap + np.abs(x[1:])]))

    def residual_of(x: FloatArray) -> FloatArray:
        return _projected(hold, np.exp(spread(x)))[1]

    found = []
    for start in starts:
        x0 = np.concatenate([[start[0]], np.maximum(np.diff(start) - gap, 0.05)])
        bounds = (np.r_[low, np.zeros(count - 1)], np.r_[high, np.full(count - 1, high - low)])
        begin = np.clip(x0, bounds[0] + 1e-9, bounds[1] - 1e-9)
        found.append(least_squares(residual_of, begin, bounds=bounds, xtol=1e-10))
    best = min(found, key=lambda one: float(one.cost))
    times = np.exp(spread(best.x))
    stiffness, residual = _projected(hold, times)
    return times, stiffness, residual


def _columns(hold: Hold, times: FloatArray) -> FloatArray:
    """Load of a spring and of each branch of stiffness 1 N/m in the hold [m], shape (n, 1 + branches)."""
    parts = [hold.way, *(branch(hold.time, hold.way, float(tau)) for tau in times)]
    return np.stack([part[hold.held] for part in parts], axis=1)


def _projected(hold: Hold, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best stiffnesses without negative ones [N/m], and residuals [N] of the hold."""
    columns, load = _columns(hold, times), hold.load[hold.held]
    stiffness, _ = nnls(columns, load)
    return stiffness, columns @ stiffness - load


def _correlation(residual: FloatArray) -> float:
    """Correlation of a residual with the one before it, none below zero [-]."""
    centred = residual - residual.mean()
    square = float(centred @ centred)
    return float(np.clip(centred[1:] @ centred[:-1] / square, 0.0, 0.99)) if square > 0.0 else 0.0


def _bic(residual: FloatArray, parameters: int, correlated: float) -> float:
    """Bayesian information criterion with as many samples as are independent."""
    n = max(len(residual) * (1.0 - correlated) / (1.0 + correlated), 2.0)
    return n * math.log(max(float(residual @ residual) / len(residual), 1e-300)) + parameters * math.log(n)


def _estimate(
    hold: Hold,
    times: FloatArray,
    stiffness: FloatArray,
    residual: FloatArray,
    correlated: float,
    bic: tuple[float, ...],
) -> RelaxationFit:
    """The fit with what the record tells of it.

    Args:
        hold: The hold.
        times: Relaxation times [s], shape (branches,).
        stiffness: Of the spring and of the branches [N/m], shape (1 + branches,).
        residual: Residuals [N], shape (n,).
        correlated: Correlation of a residual with the one before it [-].
        bic: Information criterion by number of branches.

    Returns:
        The fit.
    """
    whole = float(stiffness.sum())
    covariance = _covariance(hold, times, stiffness, residual, correlated)
    count = len(times)
    to_share = (np.eye(count + 1) - np.outer(stiffness / whole, np.ones(count + 1))) / whole
    share_sd = np.sqrt(np.diag(to_share @ covariance[: count + 1, : count + 1] @ to_share.T))
    time_sd = np.sqrt(np.diag(covariance)[count + 1 :])
    shares = stiffness / whole
    branches = tuple(
        _branch(hold, float(tau), float(sd), float(share), float(spread))
        for tau, sd, share, spread in zip(times, time_sd, shares[1:], share_sd[1:], strict=True)
    )
    nrmse = float(np.sqrt(np.mean(residual**2))) / float(hold.load[hold.start])
    fitted = _columns(hold, times) @ stiffness
    return RelaxationFit(branches, whole, float(shares[0]), float(share_sd[0]), fitted, nrmse, bic)


def _covariance(
    hold: Hold, times: FloatArray, stiffness: FloatArray, residual: FloatArray, correlated: float
) -> FloatArray:
    """Covariance of stiffnesses [N/m] and logarithms of times, widened where residuals follow each other.

    Args:
        hold: The hold.
        times: Relaxation times [s], shape (branches,).
        stiffness: Of the spring and of the branches [N/m], shape (1 + branches,).
        residual: Residuals [N], shape (n,).
        correlated: Correlation of a residual with the one before it [-].

    Returns:
        Covariance, shape (1 + 2 branches, 1 + 2 branches).
    """
    step = 1e-4
    columns = _columns(hold, times)
    slopes = []
    for k, tau in enumerate(times):
        up, down = (branch(hold.time, hold.way, float(tau * math.exp(s)))[hold.held] for s in (step, -step))
        slopes.append(stiffness[k + 1] * (up - down) / (2 * step))
    jacobian = np.concatenate([columns, np.stack(slopes, axis=1)], axis=1) if slopes else columns
    free = max(len(residual) - jacobian.shape[1], 1)
    variance = float(residual @ residual) / free * (1.0 + correlated) / (1.0 - correlated)
    return np.asarray(variance * np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14))


def _branch(hold: Hold, tau: float, sd: float, share: float, share_sd: float) -> BranchEstimate:
    """A branch and whether the record tells it.

    Args:
        hold: The hold.
        tau: Relaxation time [s].
        sd: Standard uncertainty of its logarithm [-].
        share: Share [-].
        share_sd: Its standard uncertainty [-].

    Returns:
        The estimate.
    """
    half = min(NORMAL * sd, 50.0)
    why = ""
    if share < NORMAL * share_sd:
        why = "its share is not told from zero"
    elif tau > hold.duration:
        why = f"it is longer than the hold of {hold.duration:.3g} s: its share is not told from what remains in the end"
    elif tau < hold.first_step:
        why = f"it is shorter than the first step of {hold.first_step:.2g} s behind the ramp"
    elif half > TOLD:
        why = "its time is not told to a factor of 3"
    return BranchEstimate(tau, tau * math.exp(-half), tau * math.exp(half), share, share_sd, not why, why)


def common_branches(holds: Sequence[Hold], most: int = MOST_BRANCHES) -> int:
    """Number of branches that several holds need together: that of the smallest sum of their criteria.

    Args:
        holds: The holds.
        most: Largest number that is tried.

    Returns:
        The number.
    """
    sums = np.sum([fit_relaxation(hold, most).bic for hold in holds], axis=0)
    return int(np.argmin(sums))
