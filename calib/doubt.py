"""All that a finished fit does not know, found in one place: intervals, profiles, nuisances, predictive bands."""

from __future__ import annotations

from dataclasses import dataclass, replace

from threadpoolctl import threadpool_limits

from calib.fit import FitResult
from calib.joint import JointObjective
from calib.nuisance import NuisanceEstimate
from calib.objective import Objective
from calib.predictive import Band, bands
from calib.profiles import Profile, profiles, with_profiles
from calib.uncertainty import Uncertainty, evidence, uncertainty


@dataclass(frozen=True, eq=False)
class Doubt:
    """What a fit does not know.

    Attributes:
        uncertainty: Intervals, correlations and verdicts.
        profiles: Profile likelihood of each parameter.
        nuisances: What the best curves say of the measurement, trace by trace.
        bands: Posterior predictive band of each trace.
    """

    uncertainty: Uncertainty
    profiles: tuple[Profile, ...]
    nuisances: tuple[NuisanceEstimate, ...]
    bands: tuple[Band, ...]


def doubt_of(objective: Objective | JointObjective, result: FitResult, seed: int = 0) -> Doubt | None:
    """What a fit does not know; None where it ended before there were runs enough to tell.

    Args:
        objective: What was fitted.
        result: How.
        seed: Seed of the predictive draws.
    """
    if result.jacobian is None or result.surrogate is None:
        return None
    with threadpool_limits(1, "blas"):
        found = uncertainty(result.parameters, evidence(objective, result.best, result.jacobian))
        walked = profiles(result.surrogate, result.parameters, found)
        drawn = bands(result.surrogate, result.best.z, found, seed)
    return Doubt(with_profiles(found, walked), walked, _nuisances(objective, result, found), drawn)


def _nuisances(
    objective: Objective | JointObjective, result: FitResult, found: Uncertainty
) -> tuple[NuisanceEstimate, ...]:
    """Searched ones given the best curves, the others with the parameters free beside them."""
    out: list[NuisanceEstimate] = []
    beside = iter(found.unsearched)
    for case, trial in zip(objective.cases, result.best.each, strict=True):
        for e, n in zip(case.objective.nuisance_estimates(trial.curve), case.objective.nuisances, strict=True):
            if not n.searched:
                mean, sd = next(beside)
                e = replace(e, value=mean * n.sd, sd=sd * n.sd)
            out.append(e)
    return tuple(out)
