"""Profile likelihoods on the surrogate: intervals that follow chi-square, and what the trace alone bounds.

Along each parameter the others are fitted anew, each step from the last one's optimum:

    P_i(v) = min over the others of  chi2_data(z) / s + chi2_prior(z),   z_i = v

The 95 % interval is where P_i has risen by 3.84 (Venzon & Moolgavkar 1988, Appl. Statist. 37:87), more where the size
of the errors is estimated. The same profile without the parameter's own prior says what the *trace* bounds: both sides,
one, or none (Raue et al. 2009, Bioinformatics 25:1923: identifiable, practically non-identifiable). What the noise of
the runs feigns of the rise is taken off: near the best values its curvature, as in the normal approximation's Jacobian,
and further away no more than one noisy run would feign.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.fit.surrogate import JACOBIAN_STEP, Surrogate
from calib.problem.parameters import Z95, Parameter, ParameterSet
from calib.uncertainty.intervals import IDENTIFIED, NOT_SEEN, Identifiability, Interval, Uncertainty
from calib.uncertainty.posterior import Posterior
from mpm.arrays import FloatArray

RISE = Z95**2
"""Rise of chi-square at the ends of a 95 % interval: 3.84."""
STEPS = 4
"""Steps to a half width of the normal approximation."""
LONGEST = 6
"""Half widths of the normal approximation after which a profile that has not risen is flat."""
KNOWN = 0.10
"""Largest relative standard deviation of an identified parameter [-]: its median error is then below 7 %
(docs/theory.md, "Measured choices")."""


@dataclass(frozen=True, eq=False)
class Profile:
    """One parameter's profile.

    Attributes:
        name: The parameter.
        z: Internal coordinates along it (k,), rising.
        rise: Rise of the whole chi-square above its least (k,).
        data: Rise without the parameter's own prior (k,).
        points: Internal coordinates of all parameters along it (k, p).
        index: Place of the parameter among them.
    """

    name: str
    z: FloatArray
    rise: FloatArray
    data: FloatArray
    points: FloatArray
    index: int

    def end_points(self, alone: bool = False) -> list[FloatArray]:
        """Points (p,) where the trace alone is claimed to end the parameter, on both sides.

        Args:
            alone: Whether the other parameters stay at their best values, and a profile that met no end counts with
                where it stopped; else they are at their optimum, as the surrogate sees it, and an open side stays open.
        """
        best = int(np.argmin(np.abs(self.z - self.best)))
        found: list[FloatArray] = []
        for side in (range(best, -1, -1), range(best, len(self.z))):
            within = [place for place, k in enumerate(side) if self.data[k] < RISE]
            last = within[-1] if within else 0
            k = side[last + 1] if last + 1 < len(side) else side[-1] if alone else best
            if k != best:
                z = self.points[best if alone else k].copy()
                z[self.index] = self.z[k]
                found.append(z)
        return found

    def end(self, side: int, rise: FloatArray) -> float | None:
        """Internal coordinate from which on ``rise`` (k,) stays above :data:`RISE`, below (``side`` -1) or above (+1)
        the best value: behind the last of several valleys. None where it does not."""
        best = int(np.argmin(np.abs(self.z - self.best)))
        order = list(range(best, -1, -1) if side < 0 else range(best, len(self.z)))
        last = max((place for place, k in enumerate(order) if rise[k] < RISE), default=0)
        if last == len(order) - 1:
            return None
        inner, outer = order[last], order[last + 1]
        part = (math.sqrt(RISE) - _root(rise[inner])) / (_root(rise[outer]) - _root(rise[inner]))
        return float(self.z[inner] + min(max(part, 0.0), 1.0) * (self.z[outer] - self.z[inner]))

    @property
    def best(self) -> float:
        """Internal coordinate of the best value."""
        return float(self.z[int(np.argmin(self.rise))])


def _root(rise: float) -> float:
    """Root of a rise, in which a parabola is a straight line."""
    return math.sqrt(max(rise, 0.0))


def profile_likelihoods(surrogate: Surrogate, parameters: ParameterSet, found: Uncertainty) -> tuple[Profile, ...]:
    """Profile of each parameter about the best values.

    Args:
        surrogate: The process of the fit.
        parameters: The parameters with their best values.
        found: Their normal approximation: size of the errors, step of the profile.

    Returns:
        A profile for each parameter, in their order.
    """
    return tuple(_Profiler(surrogate, parameters, found, i).profile() for i in range(len(parameters)))


class _Profiler:
    """Computes the profile of one parameter, step by step, with the others fitted anew at each step."""

    def __init__(self, surrogate: Surrogate, parameters: ParameterSet, found: Uncertainty, i: int) -> None:
        self.surrogate, self.parameters, self.found, self.i = surrogate, parameters, found, i
        self.p = len(parameters)
        self.low, self.high = parameters.lower, parameters.upper
        self.posterior = Posterior(surrogate, parameters, found)

    def profile(self) -> Profile:
        """Both sides from the best values."""
        start = self.posterior.optimum(self.parameters.start, self.i)
        points, costs = [start], [self.cost(start)]
        sd = math.sqrt(self.found.covariance[self.i, self.i])
        for side in (-1.0, 1.0):
            z = start
            for k in range(1, LONGEST * STEPS + 1):
                v = float(start[self.i] + side * k * Z95 * sd / STEPS)
                v = min(max(v, float(self.low[self.i])), float(self.high[self.i]))
                if v == z[self.i]:
                    break
                z = z.copy()
                z[self.i] = v
                z = self.posterior.optimum(z, self.i)
                points.append(z)
                costs.append(self.cost(z))
                # a prior may pull the other way: the interval ends where both together have risen
                if min(np.subtract(costs[-1], costs[0])) > 2.0 * RISE:
                    break
        order = np.argsort([z[self.i] for z in points])
        along = np.array([points[k][self.i] for k in order])
        whole, alone = (np.array([costs[k][j] for k in order]) for j in (0, 1))
        feigned = np.minimum(self.feigned() * (along - start[self.i]) ** 2, self.one_run())
        alone = np.maximum(alone - alone.min() - feigned, 0.0)
        whole = alone + self.own(along)
        whole = np.maximum(whole - whole.min(), 0.0)
        return Profile(self.parameters.names[self.i], along, whole, alone, np.array([points[k] for k in order]), self.i)

    def cost(self, z: FloatArray) -> tuple[float, float]:
        """Chi-square with all priors, and without this parameter's own."""
        rows = self.posterior.rows(z)
        whole = float(rows @ rows)
        return whole, whole - float(self.own(z[self.i]))

    def own(self, along: FloatArray | float) -> FloatArray:
        """Chi-square of this parameter's own prior at some of its values."""
        return np.asarray(((along - self.parameters.prior_mean[self.i]) / self.parameters.prior_sd[self.i]) ** 2)

    def feigned(self) -> float:
        """Curvature of the data's rise that the noise of the runs feigns: what the normal approximation leaves out."""
        ahead, back = self.parameters.start + self.steps, self.parameters.start - self.steps
        beside = self.posterior.rows_all(np.concatenate([ahead, back]))
        raw = (beside[: self.p] - beside[self.p :]).T / (2.0 * np.diag(self.steps))
        naive = 1.0 / np.linalg.inv(raw.T @ raw)[self.i, self.i]
        return max(naive - 1.0 / float(self.found.covariance[self.i, self.i]), 0.0)

    def one_run(self) -> float:
        """Chi-square of the difference that the noise of one simulated curve makes [-]."""
        parts = zip(self.surrogate.each, self.found.data.lengths, strict=True)
        return math.fsum(process.noise_misfit / (length * self.found.widened) for process, length in parts)

    @property
    def steps(self) -> FloatArray:
        """Small steps along each parameter (p, p), diagonal."""
        return np.diag(JACOBIAN_STEP * self.surrogate.unit)


def with_profile_intervals(
    found: Uncertainty, profiles: Sequence[Profile], beside: Sequence[FloatArray] = ()
) -> Uncertainty:
    """The same uncertainty with the intervals and verdicts of the profiles.

    A side is bounded by the trace where the trace alone ends it within the literature's range. A parameter is
    ``identified`` where both sides are, its interval is narrower than half the prior's, it is known to 10 % (one
    standard deviation), and the curve is explained; ``weak`` where one of these is not so; ``one_sided`` where the
    trace bounds one side and leaves the other to the prior or to what is possible; ``not_seen`` where it bounds
    neither.

    Args:
        found: The normal approximation.
        profiles: The profiles.
        beside: Internal coordinates [-], each (p,), of runs whose chi-square is within :data:`RISE` of the best. An
            interval reaches to each of them, whatever the profile, which starts from the best one alone, has seen.

    Returns:
        The uncertainty.
    """
    intervals = (
        _interval(i, p, found.explained, [float(z[p.index]) for z in beside])
        for i, p in zip(found.intervals, profiles, strict=True)
    )
    return replace(found, intervals=tuple(intervals))


def _interval(interval: Interval, profile: Profile, explained: bool, beside: Sequence[float]) -> Interval:
    """The interval of a profile: what is not worse than the best run's value by more than the limit.

    It ends at a hard bound where nothing has ended it before (:func:`_end`).

    The surrogate may put the optimum beside that value, and so may the unknown width and gain, which the search leaves
    alone. An interval about the optimum would end at the value that is reported, or before it.
    """
    parameter = interval.parameter
    low, high = parameter.to_internal(parameter.low), parameter.to_internal(parameter.high)
    at = parameter.to_internal(parameter.value)
    above = np.maximum(profile.rise - float(np.interp(at, profile.z, profile.rise)), 0.0)
    ends = [_end(profile, side, above, parameter) for side in (-1, 1)]
    bottom = min(max(ends[0], low), at, *beside)
    top = max(min(ends[1], high), at, *beside)
    bounded = [_bounds(profile.end(side, profile.data), side, parameter) for side in (-1, 1)]
    width = (top - bottom) / (2.0 * Z95 * parameter.prior_sd)
    verdict: Identifiability = "not_seen"
    if all(bounded) and width <= NOT_SEEN:
        sd = width * parameter.prior_sd / (1.0 if parameter.log else max(abs(parameter.value), 1e-12))
        verdict = "identified" if width < IDENTIFIED and sd <= KNOWN and explained else "weak"
    elif any(bounded):
        verdict = "one_sided"
    if interval.verdict == "at_bound":
        verdict = "at_bound"
    return replace(
        interval,
        low95=parameter.from_internal(bottom),
        high95=parameter.from_internal(top),
        clipped=ends[0] < low or ends[1] > high,
        width=width,
        verdict=verdict,
    )


def _end(profile: Profile, side: int, above: FloatArray, parameter: Parameter) -> float:
    """Internal coordinate at which a side of the interval ends, beyond the hard bound where nothing ends it before.

    Where the profile was not walked that far the trace counts as flat from its last point on: the chi-square rises by
    the parameter's own prior alone, which is a parabola about the prior's mean.
    """
    end = profile.end(side, above)
    if end is not None:
        return end
    last = 0 if side < 0 else -1
    mean, sd = parameter.prior_mean, parameter.prior_sd
    own = ((float(profile.z[last]) - mean) / sd) ** 2
    return mean + side * sd * math.sqrt(own + max(RISE - float(above[last]), 0.0))


def _bounds(end: float | None, side: int, parameter: Parameter) -> bool:
    """Whether the end that the trace alone sets lies within the literature's range, so that it says something new."""
    return end is not None and side * (end - parameter.prior_mean) < Z95 * parameter.prior_sd
