"""Prony series of a hold, and how far the record tells its branches."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calib.errors import CurveError
from calib.relaxation.branch_search import (
    BranchSearch,
    branch_loads,
    common_branches,
    covariance_of,
    faint_branches,
    fit_branches,
    search_branches,
    tried_branches,
)
from calib.relaxation.hold import Hold
from calib.texture.prony_series import PronySeries
from mpm.arrays import FloatArray

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
        hold: The hold, from the contact that the series has.
        branches: The branches, the fastest first.
        stiffness: Instantaneous load over way [N/m].
        equilibrium: Share that remains [-].
        equilibrium_sd: Its standard uncertainty [-].
        load: Fitted load at the samples of the hold [N], shape (n,).
        nrmse: Root mean square residual over the load with which the hold begins [-].
        bic: Bayesian information criterion by number of branches, from 0.
    """

    hold: Hold
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


def fit_relaxation(hold: Hold, branches: int | None = None) -> RelaxationFit:
    """The Prony series of a hold.

    Args:
        hold: Load and way of the ramp and of the hold.
        branches: Number of branches; None to choose it by the information criterion.

    Returns:
        The fit.

    Raises:
        CurveError: The load does not relax as a solid, there is nothing to fit, or the hold cannot tell so many
            branches.
    """
    search = search_branches(hold, tried_branches([hold], branches))
    return fit_searched(search, common_branches([search]) if branches is None else branches)


def fit_searched(search: BranchSearch, count: int) -> RelaxationFit:
    """The series of this many branches, from its own contact.

    Args:
        search: The best series of each number of branches.
        count: The number.

    Returns:
        The fit.

    Raises:
        CurveError: There is nothing to fit.
    """
    times, stiffness, _ = search.fits[count]
    whole = float(stiffness.sum())
    if not whole > 0.0:
        raise CurveError(f"{search.hold.name}: no load to fit in the hold")
    series = PronySeries(tuple((stiffness[1:] / whole).tolist()), tuple(times.tolist()))
    hold = search.hold.touched(series)
    times, stiffness, residual = fit_branches(hold, count)
    return _estimate(hold, times, stiffness, residual, search.correlated, search.bic)


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
        residual: Residuals over noise [-], shape (n,).
        correlated: Correlation of a residual with the one before it [-].
        bic: Information criterion by number of branches.

    Returns:
        The fit.
    """
    whole = float(stiffness.sum())
    covariance = covariance_of(hold, times, stiffness, residual, correlated)
    count = len(times)
    to_share = (np.eye(count + 1) - np.outer(stiffness / whole, np.ones(count + 1))) / whole
    share_sd = np.sqrt(np.diag(to_share @ covariance[: count + 1, : count + 1] @ to_share.T))
    time_sd = np.sqrt(np.diag(covariance)[count + 1 :])
    shares = stiffness / whole
    within = faint_branches(hold, times, stiffness, covariance)
    branches = tuple(
        _branch(hold, float(tau), float(sd), float(share), float(spread), faint)
        for tau, sd, share, spread, faint in zip(times, time_sd, shares[1:], share_sd[1:], within, strict=True)
    )
    fitted = branch_loads(hold, times) @ stiffness
    nrmse = float(np.sqrt(np.mean((fitted - hold.load[hold.held]) ** 2))) / float(hold.load[hold.start])
    return RelaxationFit(hold, branches, whole, float(shares[0]), float(share_sd[0]), fitted, nrmse, bic)


def _branch(hold: Hold, tau: float, sd: float, share: float, share_sd: float, faint: bool) -> BranchEstimate:
    """A branch and whether the record tells it.

    Args:
        hold: The hold.
        tau: Relaxation time [s].
        sd: Standard uncertainty of its logarithm [-].
        share: Share [-].
        share_sd: Its standard uncertainty [-].
        faint: Whether it is faster than the ramp and its load is within the noise.

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
    elif faint:
        why = f"it is faster than the ramp of {hold.time[hold.start]:.2g} s, and its load is within the noise"
    elif half > TOLD:
        why = "its time is not told to a factor of 3"
    return BranchEstimate(tau, tau * math.exp(-half), tau * math.exp(half), share, share_sd, not why, why)
