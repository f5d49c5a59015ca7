"""The answer of a calibration from a sampled posterior: the best simulated food, intervals and verdicts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from calib.fit.multistart import FitResult
from calib.fit.surrogate import Surrogate
from calib.material.properties import property_of
from calib.posterior.coordinates import Coordinates
from calib.posterior.posterior import SampledPosterior, runs_near, sample_posterior
from calib.problem.objective import EXPLAINED
from calib.problem.parameters import Z95, Parameter
from calib.problem.setup import Setup
from calib.simulation.evaluation import Evaluators
from calib.uncertainty.analysis import UncertaintyAnalysis, nuisances_of
from calib.uncertainty.intervals import (
    IDENTIFIED,
    NOT_SEEN,
    ON_BOUND,
    Identifiability,
    Interval,
    Uncertainty,
    linearised_likelihood,
    uncertainty,
)
from calib.uncertainty.predictive import Band, error_draws, pointwise_band
from calib.uncertainty.profile_likelihood import KNOWN

ABOUT_BEST = 100
"""Coarse runs nearest to the trace through which, with all fine ones, the surrogate about the best food goes."""


def coordinates_of(setup: Setup) -> Coordinates:
    """The coordinates of an emulator for a trace."""
    parameters, material = setup.objective.parameters, setup.fine.food.material
    fitted = {property_of(n) for n in parameters.names}
    values = {f.name: getattr(material, f.name) for f in fields(material) if f.name not in fitted}
    unused = ("R_initiation",) if material.skin_thickness > 0.0 else ("R_skin",)  # a cut starts in skin or in flesh
    fixed = {n: value for n, value in values.items() if isinstance(value, float) and value > 0.0 and n not in unused}
    return Coordinates(parameters, fixed, setup.fine.food.shape.height)


def sampled_answer(
    setup: Setup, evaluators: Evaluators, seed: int, say: Callable[[str], None] = lambda text: None
) -> tuple[FitResult, UncertaintyAnalysis, SampledPosterior]:
    """Sample the posterior of a trace, and answer with its best simulated food.

    Args:
        setup: What was decided for the trace.
        evaluators: Coarse and fine simulations.
        seed: Seed of what is drawn.
        say: Called with a sentence for each stage.

    Returns:
        The fit, its uncertainty, and the posterior.

    Raises:
        SimulationError: Too few foods of the literature's ranges are cut to learn from.
    """
    posterior = sample_posterior(setup.objective, coordinates_of(setup), evaluators, None, seed, say)
    fit = fit_of(posterior)
    return fit, analysis_of(posterior, fit, seed), posterior


def fit_of(posterior: SampledPosterior) -> FitResult:
    """The fit that a posterior ends with: its best simulated food."""
    best, objective = posterior.best, posterior.objective
    surrogate = Surrogate(objective, runs_near(posterior, ABOUT_BEST), best)
    return FitResult(
        status="converged" if posterior.converged else "stalled",
        best=best,
        parameters=objective.parameters.with_values(best.evaluation.parameters),
        jacobian=surrogate.jacobian(best.z),
        repeatability=surrogate.noise,
        history=(*posterior.matched.runs, *posterior.fine),
        surrogate=surrogate,
    )


def analysis_of(posterior: SampledPosterior, fit: FitResult, seed: int = 0) -> UncertaintyAnalysis:
    """The uncertainty of that fit: intervals, verdicts and band are those of the posterior.

    Args:
        posterior: The posterior.
        fit: Its fit.
        seed: Seed of the errors in the band.

    Returns:
        The uncertainty, without profiles.
    """
    objective = posterior.objective
    assert fit.jacobian is not None  # fit_of has one
    found = uncertainty(fit.parameters, linearised_likelihood(objective, fit.best, fit.jacobian))
    intervals = tuple(_interval(posterior, k, p) for k, p in enumerate(fit.parameters))
    correlation = np.corrcoef(posterior.z, rowvar=False).reshape(len(intervals), len(intervals))
    found = replace(found, intervals=intervals, correlation=correlation)
    return UncertaintyAnalysis(
        fit,
        found,
        (),
        nuisances_of(objective, fit, found),
        (_band(posterior, found, seed),),
        {i.parameter.name: (i.low95, i.high95) for i in intervals},
        _remarks(posterior),
    )


def _interval(posterior: SampledPosterior, index: int, parameter: Parameter) -> Interval:
    low, _, high = posterior.interval(index)
    width = (high - low) / (2.0 * Z95 * parameter.prior_sd)
    clipped = low <= parameter.to_internal(parameter.low) or high >= parameter.to_internal(parameter.high)
    ends = parameter.from_internal(low), parameter.from_internal(high)
    return Interval(parameter, *ends, clipped, width, _verdict(posterior, index, parameter, width))


def _verdict(posterior: SampledPosterior, index: int, p: Parameter, width: float) -> Identifiability:
    """What the trace says of a parameter: which sides it bounds by itself within the literature's range, and how well;
    identified only where all modes agree and the curve is explained by a good emulator."""
    low, middle, high = posterior.interval(index)
    sd = (high - low) / (2.0 * Z95)
    bottom, top = p.to_internal(p.low), p.to_internal(p.high)
    if min(middle - bottom, top - middle) < ON_BOUND * sd:
        return "at_bound"
    alone = posterior.alone(index)
    below, above = alone[0] > p.to_internal(p.prior_low), alone[1] < p.to_internal(p.prior_high)
    if not (below or above) or width > NOT_SEEN:
        return "not_seen"
    if not (below and above):
        return "one_sided"
    relative = sd if p.log else sd / max(abs(p.from_internal(middle)), 1e-12)
    sure = posterior.agree(index) and posterior.converged and posterior.explained >= 1.0 - EXPLAINED
    return "identified" if width < IDENTIFIED and relative <= KNOWN and sure else "weak"


def _band(posterior: SampledPosterior, found: Uncertainty, seed: int) -> Band:
    """The band of another measurement of the same cut."""
    random = np.random.default_rng(seed)
    curves = posterior.curves
    size = float(np.exp(np.median(posterior.sample.log_size[posterior.draws])))
    errors = error_draws(posterior.objective, found.data.lengths[0], size, len(curves), random)
    return pointwise_band(curves + errors, posterior.objective.target.curve)


def _remarks(posterior: SampledPosterior) -> tuple[str, ...]:
    """What the posterior shows beyond its intervals, in sentences."""
    said = []
    if len(posterior.modes) > 1:
        weights = ", ".join(f"{m.mode.weight:.0%}" for m in posterior.modes)
        differ = [p.name for k, p in enumerate(posterior.objective.parameters) if not posterior.agree(k)]
        of = f", which differ in {', '.join(differ)}" if differ else ""
        said.append(f"The posterior has {len(posterior.modes)} modes ({weights} of its probability){of}.")
    last = posterior.matched.waves[-1]
    if not posterior.matched.converged:
        error, moved = ("unknown" if x is None else f"{x:.1%}" for x in (last.error90, last.moved))
        said.append(
            f"The waves ended before the posterior had settled: 90 % of the last curves were predicted to {error} of "
            f"the peak, and a median moved by {moved} of its interval."
        )
    elif not posterior.converged:
        said.append("Fine simulations of the posterior were not predicted well enough for anything to be identified.")
    return tuple(said)
