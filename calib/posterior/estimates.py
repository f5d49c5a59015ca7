"""What a sampled posterior says, as a document has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.io.type_schema import Count, Fraction, NotNegative
from calib.posterior.posterior import PosteriorMode, SampledPosterior
from mpm.arrays import FloatArray


@dataclass(frozen=True)
class WaveSummary:
    """One wave of coarse simulations.

    Attributes:
        runs: Its simulations.
        cut: Those that cut the food, which are compared.
        temperature: Temperature of the posterior it was drawn from; null for the prior.
        error: Median error of the curves as predicted before they were simulated, root mean square over the peak.
        error90: What 90 % of these errors stay below.
        moved: Largest move of a median since the wave before, part of its 95 % interval.
    """

    runs: Count
    cut: Count
    temperature: float | None = None
    error: float | None = None
    error90: float | None = None
    moved: float | None = None


@dataclass(frozen=True)
class Range:
    """A quantity of a posterior.

    Attributes:
        low95: Lower end of the central 95 % interval [unit].
        median: Median [unit].
        high95: Upper end [unit].
    """

    low95: float
    median: float
    high95: float


@dataclass(frozen=True)
class ModeSummary:
    """One mode of the posterior.

    Attributes:
        weight: Part of the probability.
        log_evidence: Logarithm of the evidence of this mode alone.
        ranges: Ranges of the parameters in the mode [SI], by name.
        best: Values [SI] of its best simulated food, by name; left out where none was cut.
        misfit: Chi-square with priors of that food.
    """

    weight: Fraction
    log_evidence: float
    ranges: Mapping[str, Range]
    best: Mapping[str, float] | None = None
    misfit: float | None = None


@dataclass(frozen=True, kw_only=True)
class PosteriorSummary:
    """A sampled posterior over all plausible foods.

    Attributes:
        converged: Whether the emulator was good enough where foods are plausible.
        waves: The waves of coarse simulations.
        judged: Median error of fine curves as predicted before, part of the peak; left out where none was cut.
        judged90: What 90 % of these errors stay below.
        explained: Posterior predictive p-value: how probably the right food would leave a larger misfit.
        log_evidence: Logarithm of the evidence, for the comparison of models of one trace.
        log_evidence_sd: Its standard deviation.
        likelihoods: Evaluations of the likelihood by the sampler.
        combinations: Ranges of the combinations that the trace sees [-], by their formula.
        modes: The modes, the heaviest first.
        alike: Names of the parameters on which all modes agree.
    """

    converged: bool
    waves: tuple[WaveSummary, ...]
    judged: float | None = None
    judged90: float | None = None
    explained: Fraction
    log_evidence: float
    log_evidence_sd: NotNegative
    likelihoods: Count
    combinations: Mapping[str, Range]
    modes: tuple[ModeSummary, ...]
    alike: tuple[str, ...]


def summarised(posterior: SampledPosterior) -> PosteriorSummary:
    """The posterior as a document has it."""
    found, names = posterior.sample, posterior.objective.parameters.names
    median, most = posterior.judged or (None, None)
    combined = posterior.likelihood.emulator.coordinates.combinations(posterior.z)
    return PosteriorSummary(
        converged=posterior.converged,
        waves=tuple(WaveSummary(**vars(w)) for w in posterior.matched.waves),
        judged=median,
        judged90=most,
        explained=posterior.explained,
        log_evidence=found.evidence,
        log_evidence_sd=found.evidence_sd,
        likelihoods=found.calls,
        combinations={formula: _range(np.exp(values)) for formula, values in combined.items()},
        modes=tuple(_mode(posterior, m) for m in posterior.modes),
        alike=tuple(n for k, n in enumerate(names) if posterior.agree(k)),
    )


def _range(values: FloatArray) -> Range:
    return Range(*(float(x) for x in np.quantile(values, (0.025, 0.5, 0.975))))


def _mode(posterior: SampledPosterior, one: PosteriorMode) -> ModeSummary:
    ranges = {}
    for k, p in enumerate(posterior.objective.parameters):
        low, middle, high = (p.from_internal(x) for x in posterior.interval(k, one.mode))
        ranges[p.name] = Range(low, middle, high)
    return ModeSummary(
        weight=one.mode.weight,
        log_evidence=posterior.sample.evidence + float(np.log(one.mode.weight)),
        ranges=ranges,
        best=None if one.best is None else dict(one.best.evaluation.parameters),
        misfit=None if one.best is None else one.best.misfit,
    )
