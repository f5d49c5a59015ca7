"""Samples of the posterior by nested sampling, which finds every valley that holds probability and the evidence.

Nested sampling: Skilling (2006), Bayesian Analysis 1:833; by dynesty, Speagle (2020), Mon. Not. R. Astron. Soc.
493:3132.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from scipy.special import ndtri

from calib.errors import CurveError
from calib.posterior.likelihood import SIZE_SD, Likelihood
from calib.problem.parameters import ParameterSet
from mpm.arrays import FloatArray


@dataclass(frozen=True)
class Effort:
    """How much nested sampling.

    Attributes:
        live: Live points: more make the result more repeatable, and the time goes with them.
        walks: Steps of a random walk to a new live point.
        left: Logarithm of the evidence that may be left in the live points.
    """

    live: int
    walks: int
    left: float


SCOUTING, FINAL = Effort(120, 20, 1.0), Effort(400, 25, 0.1)
"""That between waves, which only says where to simulate next, and that of the result."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Weighted draws from prior to posterior.

    Attributes:
        z: Internal coordinates [-] (k, p).
        log_size: Logarithm of the size of the errors over what is stated [-] (k,).
        log_likelihood: Logarithm of the likelihood (k,).
        log_volume: Logarithm of the prior's mass that each stands for (k,).
        evidence: Logarithm of the evidence.
        evidence_sd: Its standard deviation.
        calls: Evaluations of the likelihood.
    """

    z: FloatArray
    log_size: FloatArray
    log_likelihood: FloatArray
    log_volume: FloatArray
    evidence: float
    evidence_sd: float
    calls: int

    def weights(self, temperature: float = 1.0) -> FloatArray:
        """Weights (k,) of the draws, of sum one, for the likelihood to the power 1/temperature."""
        log = self.log_likelihood / temperature + self.log_volume
        out = np.exp(log - log.max())
        result: FloatArray = out / out.sum()
        return result

    def drawn(self, count: int, seed: int, temperature: float = 1.0) -> FloatArray:
        """Draws of equal weight, systematically resampled.

        Args:
            count: How many.
            seed: Seed of where the first one is.
            temperature: As of :meth:`weights`.

        Returns:
            Their places (count,).
        """
        start = np.random.default_rng(seed).random()
        at = (start + np.arange(count)) / count
        return np.searchsorted(np.cumsum(self.weights(temperature)), at).clip(max=len(self.z) - 1)


class Prior:
    """The literature's prior within the hard bounds, and that of the size of the errors, as a map from the unit cube.

    Args:
        parameters: The fitted parameters.
    """

    def __init__(self, parameters: ParameterSet) -> None:
        self.parameters = parameters

    def __call__(self, cube: FloatArray) -> FloatArray:
        """Internal coordinates, and the logarithm of the size last (p + 1,), of a point of the unit cube."""
        return np.append(self.parameters.from_cube(cube[:-1]), SIZE_SD * ndtri(0.5 + 0.5 * cube[-1]))


def check_installed() -> None:
    """Refuse to begin what needs dynesty where it is not installed.

    Raises:
        CurveError: It is not.
    """
    if find_spec("dynesty") is None:
        raise CurveError("--sample needs dynesty: pip install 'cutcal[sample]', or leave the option out")


def sample(likelihood: Likelihood, effort: Effort, seed: int) -> Sample:
    """Nested sampling of a posterior.

    Args:
        likelihood: The likelihood.
        effort: How much of it.
        seed: Seed.

    Returns:
        The draws.
    """
    import dynesty

    prior = Prior(likelihood.objective.parameters)

    def log(point: FloatArray) -> float:
        return float(likelihood.log(point[None, :-1], point[-1:])[0])

    sampler = dynesty.NestedSampler(
        log,
        prior,
        len(prior.parameters) + 1,
        nlive=effort.live,
        bound="multi",
        sample="rwalk",
        walks=effort.walks,
        rstate=np.random.default_rng(seed),
    )
    sampler.run_nested(dlogz=effort.left, print_progress=False)
    found = sampler.results
    volume = found.logwt - found.logl
    return Sample(
        found.samples[:, :-1],
        found.samples[:, -1],
        found.logl,
        volume,
        float(found.logz[-1]),
        float(found.logzerr[-1]),
        int(np.sum(found.ncall)),
    )
