"""The branches that the load of a hold needs: how many, their times and stiffnesses.

Relaxation times are searched; stiffnesses follow from them by least squares without negative ones (variable
projection, Golub and Pereyra 1973, SIAM J. Numer. Anal. 10:413-432). The ramp before the hold counts by the way that
was recorded. The number of branches is that of the smallest Bayesian information criterion (Schwarz 1978, Ann. Stat.
6:461-464), whose number of samples is that of independent ones where residuals follow each other.

Samples of the hold are means of one load or of many, so each counts by its own noise. To that the variance is added
that the largest number of branches leaves unexplained.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq, least_squares, nnls

from calib.errors import CurveError
from calib.relaxation.hold import Hold
from calib.texture.prony_series import branch
from mpm.arrays import FloatArray

MOST_BRANCHES = 4
"""Most branches that are tried unasked."""
SEPARATE = 1.5
"""Least ratio of neighbouring relaxation times: closer ones are one branch."""
BEYOND = 3.0
"""How much longer than the hold, or shorter than its first sample, a relaxation time may be."""
FAINT = 3.0
"""Stiffness of a branch that is faster than the ramp over its standard uncertainty [-], below which its part of the
load is within the noise: of many times that are tried, some fit noise at two."""
DOUBT = 20.0
"""By how much the criterion of a hold must be lower to take a branch within the noise [-]: twice what is very strong
evidence (Kass and Raftery 1995, J. Am. Stat. Assoc. 90:773-795). A branch that lowers it by more is in the load, and is
called not told."""
SEEN = 5.0
"""Load of a branch over the noise of all samples [-] from which on it is seen: its time is searched, too."""


@dataclass(frozen=True, eq=False)
class BranchSearch:
    """The best series of a hold with each number of branches.

    Attributes:
        hold: The hold, with the noise by which its samples count.
        fits: Relaxation times [s], stiffnesses of spring and branches [N/m], and residuals over noise [-], by number of
            branches, from 0.
        correlated: Correlation of a residual with the one before it [-].
        bic: Bayesian information criterion by number of branches, from 0.
        faint: Whether the series of that number has a branch within the noise, by number of branches.
    """

    hold: Hold
    fits: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]
    correlated: float
    bic: tuple[float, ...]
    faint: tuple[bool, ...]


def most_branches(hold: Hold) -> int:
    """Largest number of branches that a hold can tell [-]: about one a decade from its first step to its duration, with
    one at both ends."""
    return 1 + round(math.log10(hold.duration / hold.first_step))


def search_branches(hold: Hold, most: int) -> BranchSearch:
    """The best series of each number of branches.

    Args:
        hold: Load and way of the ramp and of the hold.
        most: Largest number of branches that is tried.

    Returns:
        The series.
    """
    hold = replace(hold, noise=_whole_noise(hold, fit_branches(hold, most)[2]))
    fits = tuple(fit_branches(hold, count) for count in range(most + 1))
    correlated = _correlation(fits[-1][2])
    bic = tuple(_bic(residual, 2 * count + 2, correlated) for count, (_, _, residual) in enumerate(fits))
    faint = tuple(any(faint_branches(hold, *fit[:2], covariance_of(hold, *fit, correlated))) for fit in fits)
    return BranchSearch(hold, fits, correlated, bic, faint)


def common_branches(searches: Sequence[BranchSearch]) -> int:
    """Number of branches that several holds need together: that of the smallest sum of their criteria.

    A branch that is within the noise of a hold must lower the sum by more.

    Args:
        searches: The series of each hold, of the same numbers of branches.

    Returns:
        The number.
    """
    sums = np.sum([one.bic for one in searches], axis=0)
    faint = np.sum([one.faint for one in searches], axis=0)
    return int(np.argmin(sums + DOUBT * faint))


def tried_branches(holds: Sequence[Hold], branches: int | None) -> int:
    """Largest number of branches that is tried, the same for several holds.

    Args:
        holds: The holds.
        branches: Number of branches that is asked for; None where it is to be chosen.

    Returns:
        The number.

    Raises:
        CurveError: A hold cannot tell so many branches.
    """
    hold = min(holds, key=most_branches)
    limit = most_branches(hold)
    if branches is not None and branches > limit:
        raise CurveError(
            f"{hold.name}: {branches} branches; a hold of {hold.duration:.3g} s after a first step of "
            f"{hold.first_step:.2g} s tells about one a decade; give at most {limit} with --branches"
        )
    return max(min(MOST_BRANCHES, limit), branches or 0)


def fastest_seen(hold: Hold, stiffness: float, share: float) -> float:
    """Relaxation time below which a branch of a share would be within the noise of the hold [s].

    Args:
        hold: The hold.
        stiffness: Instantaneous load over way [N/m].
        share: The share [-].

    Returns:
        The time; at least a part of the first step, at most the time of the ramp.
    """
    least = hold.first_step / BEYOND
    times = np.geomspace(least, max(float(hold.time[hold.start]), least), 40)
    loads = share * stiffness * branch_loads(hold, times)[:, 1:] / hold.noise[:, None]
    hidden = times[np.sqrt((loads**2).sum(axis=0)) < SEEN]
    return float(hidden[-1]) if len(hidden) else least


def _whole_noise(hold: Hold, residual: FloatArray) -> FloatArray:
    """Noise of the samples of the hold, with what a series leaves unexplained [N].

    Args:
        hold: The hold.
        residual: Residuals of the series over the noise alone [-], shape (n,).

    Returns:
        Root of the variance of the noise and of one that all samples have, shape (n,); with it the squares of the
        residuals are one in the mean.
    """
    square, variance = (residual * hold.noise) ** 2, hold.noise**2

    def excess(more: float) -> float:
        return float(np.mean(square / (variance + more))) - 1.0

    more = brentq(excess, 0.0, float(square.sum())) if excess(0.0) > 0.0 else 0.0
    return np.asarray(np.sqrt(variance + more))


def faint_branches(hold: Hold, times: FloatArray, stiffness: FloatArray, covariance: FloatArray) -> list[bool]:
    """Whether each branch is faster than the ramp and its load is within the noise of the hold.

    The load of such a branch is its stiffness times its time over that of the ramp. So little noise in the load makes
    a large stiffness.

    Args:
        hold: The hold.
        times: Relaxation times [s], shape (branches,).
        stiffness: Of the spring and of the branches [N/m], shape (1 + branches,).
        covariance: Covariance of stiffnesses [N/m] and logarithms of times [-], shape (1 + 2 branches, 1 + 2 branches).

    Returns:
        One for each branch.
    """
    ramp = float(hold.time[hold.start])
    sds = np.sqrt(np.diag(covariance))[1:]
    return [bool(tau < ramp and one <= FAINT * sd) for tau, one, sd in zip(times, stiffness[1:], sds, strict=False)]


def fit_branches(hold: Hold, count: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Relaxation times [s], stiffnesses of spring and branches [N/m], and residuals over noise [-] with this many
    branches."""
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


def branch_loads(hold: Hold, times: FloatArray) -> FloatArray:
    """Load of a spring and of each branch of stiffness 1 N/m in the hold [m], shape (n, 1 + branches)."""
    parts = [hold.way, *(branch(hold.time, hold.way, float(tau)) for tau in times)]
    return np.stack([part[hold.held] for part in parts], axis=1)


def _projected(hold: Hold, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Best stiffnesses without negative ones [N/m], and residuals of the hold over its noise [-]."""
    columns, load = branch_loads(hold, times) / hold.noise[:, None], hold.load[hold.held] / hold.noise
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


def covariance_of(
    hold: Hold, times: FloatArray, stiffness: FloatArray, residual: FloatArray, correlated: float
) -> FloatArray:
    """Covariance of stiffnesses [N/m] and logarithms of times, widened where residuals follow each other.

    Args:
        hold: The hold.
        times: Relaxation times [s], shape (branches,).
        stiffness: Of the spring and of the branches [N/m], shape (1 + branches,).
        residual: Residuals over noise [-], shape (n,).
        correlated: Correlation of a residual with the one before it [-].

    Returns:
        Covariance, shape (1 + 2 branches, 1 + 2 branches).
    """
    step = 1e-4
    columns = branch_loads(hold, times)
    slopes = []
    for k, tau in enumerate(times):
        up, down = (branch(hold.time, hold.way, float(tau * math.exp(s)))[hold.held] for s in (step, -step))
        slopes.append(stiffness[k + 1] * (up - down) / (2 * step))
    jacobian = np.concatenate([columns, np.stack(slopes, axis=1)], axis=1) if slopes else columns
    jacobian = jacobian / hold.noise[:, None]
    free = max(len(residual) - jacobian.shape[1], 1)
    variance = float(residual @ residual) / free * (1.0 + correlated) / (1.0 - correlated)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    alike = np.linalg.pinv((jacobian / size).T @ (jacobian / size), rcond=1e-14, hermitian=True)
    return np.asarray(variance * alike / np.outer(size, size))
