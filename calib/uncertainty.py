"""What a fit does not know of its parameters.

:func:`uncertainty` gives 95 % intervals from the curvature of chi-square at the optimum, in internal
coordinates (so those of log parameters are asymmetric in SI), with J_d the rows of the data and J_p those of
the priors:

    covariance = (J_d^T J_d / s + J_p^T J_p)^-1,   s = max(1, reduced chi-square of the data)

Where the model misses the curve by more than the stated errors, s widens what the data say; it does not touch
the literature, so no parameter ends up known less than before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from calib.parameters import Z95, Parameter, ParameterSet

FloatArray = npt.NDArray[np.float64]
Verdict = Literal["identified", "weak", "not_seen", "at_bound"]

#: A parameter is identified when its posterior is narrower than this part of its prior, and not seen when it
#: is wider than the other: below one half the cut says more than the literature, above 0.9 next to nothing.
IDENTIFIED, NOT_SEEN = 0.5, 0.9
#: An estimate this close to a hard bound, in posterior standard deviations, lies on it.
ON_BOUND = 0.1
#: Two parameters that correlate more are only known together.
TIED = 0.95


@dataclass(frozen=True)
class Interval:
    """A fitted parameter with its 95 % interval.

    Attributes:
        parameter: The parameter with its best value.
        low95: Lower end [unit], not below the hard bound.
        high95: Upper end [unit], not above the hard bound.
        clipped: Whether a hard bound cut the interval off.
        width: Posterior over prior standard deviation in the internal coordinate [-].
        verdict: ``at_bound``: the best value lies on a hard bound; else by width ``identified`` (below 0.5),
            ``weak``, or ``not_seen`` (above 0.9: the interval is the literature's).
    """

    parameter: Parameter
    low95: float
    high95: float
    clipped: bool
    width: float
    verdict: Verdict

    def as_dict(self) -> dict[str, float | str]:
        """Entry of ``summary.json``: value, unit, low95, high95, prior_low, prior_high, verdict."""
        p = self.parameter
        return {
            "value": p.value,
            "unit": p.unit,
            "low95": self.low95,
            "high95": self.high95,
            "prior_low": p.prior_low,
            "prior_high": p.prior_high,
            "verdict": self.verdict,
        }


@dataclass(frozen=True)
class Direction:
    """A principal direction of the posterior, measured in prior standard deviations.

    Attributes:
        width: Posterior over prior standard deviation along it [-]: 0 = set by the cut, 1 = by the
            literature.
        weights: Components by parameter name, of unit length together.
    """

    width: float
    weights: dict[str, float]


@dataclass(frozen=True)
class Tie:
    """Two parameters that the cut determines only together.

    Attributes:
        combination: What is known better than either of them: ``a * b`` (correlation -1) or ``a / b`` (+1).
        correlation: Posterior correlation [-].
    """

    combination: str
    correlation: float


@dataclass(frozen=True)
class Uncertainty:
    """Posterior about the best point, in the normal approximation.

    Attributes:
        intervals: One per parameter.
        covariance: In internal coordinates (p, p).
        correlation: Its correlation matrix (p, p).
        directions: Principal directions, best known first.
        only_as_product: Pairs with a correlation beyond 0.95 either way.
        reduced_chi2: Chi-square of the data per degree of freedom [-]; above 1 the data's part was widened by
            it.
    """

    intervals: tuple[Interval, ...]
    covariance: FloatArray
    correlation: FloatArray
    directions: tuple[Direction, ...]
    only_as_product: tuple[Tie, ...]
    reduced_chi2: float


def uncertainty(
    parameters: ParameterSet, jacobian: FloatArray, residual: FloatArray, *, effective_rows: float
) -> Uncertainty:
    """95 % intervals, correlations and a verdict per parameter from the curvature at the optimum.

    Args:
        parameters: The parameters with their best values.
        jacobian: Derivative of the residual vector by internal coordinates (k + p, p), prior rows last.
        residual: Residual vector (k + p,) at the best values.
        effective_rows: Effective number of independent rows among the k rows of data.
    """
    p = len(parameters)
    data, prior = jacobian[:-p], parameters.prior_jacobian()
    information, own = data.T @ data, prior.T @ prior
    first = np.linalg.inv(information + own)
    freedom = max(effective_rows - float(np.trace(first @ information)), 1.0)
    reduced = float(residual[:-p] @ residual[:-p]) / freedom
    covariance: FloatArray = np.asarray(np.linalg.inv(information / max(1.0, reduced) + own), dtype=np.float64)
    sd = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(sd, sd)
    intervals = tuple(_interval(q, z, s) for q, z, s in zip(parameters, parameters.start, sd, strict=True))
    return Uncertainty(
        intervals,
        covariance,
        correlation,
        _directions(parameters, covariance),
        _ties(parameters.names, correlation),
        reduced,
    )


def _interval(parameter: Parameter, z: float, sd: float) -> Interval:
    """Interval and verdict of one parameter with posterior standard deviation ``sd`` about ``z``."""
    low, high = parameter.to_internal(parameter.low), parameter.to_internal(parameter.high)
    ends = z - Z95 * sd, z + Z95 * sd
    width = sd / parameter.prior_sd
    verdict: Verdict = "identified" if width < IDENTIFIED else "not_seen" if width > NOT_SEEN else "weak"
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


def _directions(parameters: ParameterSet, covariance: FloatArray) -> tuple[Direction, ...]:
    """Eigenvectors of the covariance in units of the prior standard deviations, best known first."""
    variance, vectors = np.linalg.eigh(covariance / np.outer(parameters.prior_sd, parameters.prior_sd))
    return tuple(
        Direction(math.sqrt(max(v, 0.0)), dict(zip(parameters.names, map(float, w), strict=True)))
        for v, w in zip(variance, vectors.T, strict=True)
    )


def _ties(names: Sequence[str], correlation: FloatArray) -> tuple[Tie, ...]:
    """Pairs of names with a correlation beyond :data:`TIED`."""
    pairs = [(i, j) for j in range(len(names)) for i in range(j) if abs(correlation[i, j]) > TIED]
    sign = {True: "/", False: "*"}
    return tuple(
        Tie(f"{names[i]} {sign[correlation[i, j] > 0.0]} {names[j]}", float(correlation[i, j])) for i, j in pairs
    )
