"""A held-out cut predicted with the flesh of the others.

Fitted to it is only what its own specimen has for itself: its skin, its size, one factor for width and sensor, and the
friction of a knife that cut none of the others. The band comes from simulating materials drawn from the posterior of
the flesh and moved as far as specimens lie apart, and from errors of the size and correlation that the fit of the
others showed. Each material has its own factor, and what the specimen has for itself is fitted to each: by a
Gauss-Newton step from the best values, with what the material changes of the curve on coarse cells, and drawn about
that.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.fit.multistart import FitResult, multistart_search
from calib.fit.options import FitOptions
from calib.io.progress import PLAIN_INTERVAL_S, Countdown
from calib.material.scene import of_specimen
from calib.multi_specimen.specimens import JointFit, Specimens
from calib.problem.nuisance import NuisanceEstimate
from calib.problem.objective import Objective
from calib.problem.parameters import is_shared
from calib.problem.setup import COARSE, FINE
from calib.simulation.evaluation import Evaluation
from calib.uncertainty.intervals import linearised_likelihood, uncertainty
from calib.uncertainty.predictive import Band, error_draws, pointwise_band, posterior_draws
from calib.validation.acceptance import BAND_LIMIT, Conservation, Verdict, balances
from calib.validation.metrics import Metrics, compare
from calib.validation.null_models import null_models
from calib.validation.prediction import PREDICTION_NRMSE_LIMIT, PREDICTION_RATING_LIMIT
from mpm.arrays import FloatArray
from mpm.scene import Scene
from mpm.scene.errors import SimulationError

SPECIMEN_BUDGET, SPECIMEN_DESIGN = 40.0, 5
"""Simulations at most for the few parameters of a specimen, and those of their design."""
PREDICTIVE_MATERIALS = 32
"""Materials of the posterior that are simulated for the band (docs/theory.md, "Measured choices")."""
ERRORS_PER_MATERIAL = 100
"""Errors that are drawn for each of them."""
INSIDE_LIMIT = 0.90
"""Least part of the measured points within their 95 % band [-]."""
MEAN_CURVE = "mean of the others"
"""The null model that only several traces have."""


@dataclass(frozen=True, eq=False)
class HeldOutPrediction:
    """A held-out cut and what was predicted of it.

    Attributes:
        name: The trace.
        trained_on: Traces whose flesh it is predicted with.
        curve: Predicted force with the specimen's factor [N] (n,).
        fitted: Values [SI] by property that are the specimen's own.
        factor: That factor [-].
        metrics: Prediction against the measured curve.
        nulls: Curves that explain nothing against it, by name.
        band: 95 % band.
        simulations: Number of simulations.
        balances: Momentum and kinetic energy of the predicted cut.
        scene: The cut that was simulated for the prediction.
        particles: Particles of it; None where the store does not say them.
        nuisances: What the prediction says of the measurement, the factor's logarithm with it.
    """

    name: str
    trained_on: tuple[str, ...]
    curve: FloatArray
    fitted: dict[str, float]
    factor: float
    metrics: Metrics
    nulls: dict[str, Metrics]
    band: Band
    simulations: int
    balances: tuple[Verdict, ...]
    scene: Scene
    particles: int | None
    nuisances: tuple[NuisanceEstimate, ...]

    @property
    def width(self) -> float:
        """Mean width of the band over the measured peak [-]."""
        return mean_width(self.band, self.metrics)

    @property
    def passed(self) -> bool:
        """Whether curve, rating and band are within their limits, and the simulation's balances close.

        A band of any width holds a curve where it is wide enough: so it has the limit of a single calibration's.
        """
        m = self.metrics
        if any(v.passed is False for v in self.balances):
            return False
        return (
            m.nrmse <= PREDICTION_NRMSE_LIMIT
            and m.iso18571.R >= PREDICTION_RATING_LIMIT
            and self.band.inside >= INSIDE_LIMIT
            and self.width <= BAND_LIMIT
        )

    @property
    def beats(self) -> tuple[str, ...]:
        """Null models that the prediction beats in both rating and shape."""
        m = self.metrics
        return tuple(n for n, x in self.nulls.items() if m.iso18571.R > x.iso18571.R and m.shape_error < x.shape_error)


def mean_width(band: Band, metrics: Metrics) -> float:
    """Mean width of a band over the measured peak [-]."""
    return float(np.mean(band.high - band.low)) / metrics.peak_real_N


def predict(specimens: Specimens, fit: JointFit, name: str) -> HeldOutPrediction:
    """Predict the cut of a trace that a fit has not seen.

    Args:
        specimens: The traces and where their simulations run.
        fit: The fit of the others.
        name: The trace.

    Returns:
        The prediction.

    Raises:
        CutcalError: No simulation of it reached the end of its stroke.
    """
    objective, seed = specimens.setups[name].objective, specimens.study.seed
    knife = specimens.knives[name]
    shared = fit.shared_values(knife)
    own = _own_fit(specimens, shared, name)
    best = {} if own is None else own.values
    others = _drawn(fit, knife, specimens.study.scatter, seed)
    drawn = [{**x, **y} for x, y in zip(others, _adapted(specimens, own, shared, others, name), strict=True)]
    runs = _simulated(specimens, name, [{**shared, **best}, *drawn])
    curve, *others_curves = (objective.target.smooth(objective.target.stroke, e.stroke, e.force) for e in runs if e.ok)
    factor = objective.factor(curve)
    stroke, real = objective.target.stroke, objective.target.curve
    nulls = {n: m.metrics for n, m in null_models(stroke, real).items()}
    return HeldOutPrediction(
        name=name,
        trained_on=fit.names,
        curve=factor * curve,
        fitted=best,
        factor=factor,
        metrics=compare(stroke, real, factor * curve),
        nulls=nulls | {MEAN_CURVE: compare(stroke, real, _mean_curve(specimens, fit.names, name))},
        band=_band(objective, [curve, *others_curves], fit, seed),
        simulations=len(runs) + (0 if own is None else len(own.result.history) + 1 + len(others)),
        balances=tuple(balances(Conservation.of(runs[0]))),
        scene=of_specimen(specimens.setups[name].fine, {**shared, **best}, specimens.setups[name].kept)[0],
        particles=None if (n := runs[0].scalars.get("particles")) is None else round(n),
        nuisances=(*objective.nuisance_estimates(curve), *objective.factor_estimate(curve)),
    )


@dataclass(frozen=True, eq=False)
class _OwnFit:
    """What was fitted to a held-out trace alone, with the flesh of the others."""

    objective: Objective
    result: FitResult

    @property
    def values(self) -> dict[str, float]:
        """The specimen's own values [SI]."""
        return dict(self.result.best.evaluation.parameters)


def _own_fit(specimens: Specimens, shared: Mapping[str, float], name: str) -> _OwnFit | None:
    """The specimen's own values, fitted with the flesh held.

    Args:
        specimens: The study's specimens.
        shared: The flesh that is held [SI], by name.
        name: The specimen.

    Returns:
        The fit; None where the specimen has no values of its own.

    Raises:
        KeyboardInterrupt: The search was interrupted.
    """
    setup, chosen = specimens.setups[name], specimens.own_parameters(name, shared)
    if not chosen:
        return None
    # guesses are of the flesh, which is held
    objective = replace(setup.objective, parameters=setup.objective.parameters.only(chosen), guesses=())
    fine, coarse = (
        specimens.evaluator(sized.with_material(**flesh), name, fidelity)
        for (sized, flesh), fidelity in (
            (of_specimen(setup.fine, shared, setup.kept), FINE),
            (of_specimen(setup.coarse, shared, setup.kept), COARSE),
        )
    )
    options = FitOptions(
        budget=SPECIMEN_BUDGET, batch=specimens.pool.batch, design=SPECIMEN_DESIGN, seed=specimens.study.seed
    )
    progress = specimens.staged(f"specimen of {name}, held out")
    result = multistart_search(objective, fine, coarse=coarse, options=options, progress=progress)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return _OwnFit(objective, result)


def _adapted(
    specimens: Specimens,
    own: _OwnFit | None,
    shared: Mapping[str, float],
    others: Sequence[Mapping[str, float]],
    name: str,
) -> list[dict[str, float]]:
    """The specimen's own values for each of some other materials, with what their fit does not know of them.

    A run that breaks down on coarse cells says nothing: the best values stay.

    Args:
        specimens: The study's specimens.
        own: The fit of the specimen's own values; None where it has none.
        shared: The flesh with which they were fitted [SI], by name.
        others: Other materials [SI], by name.
        name: The specimen.

    Returns:
        Its own values for each of the other materials [SI], by name.
    """
    if own is None:
        return [{}] * len(others)
    objective, result = own.objective, own.result
    if result.jacobian is None:
        return [own.values] * len(others)
    evaluator = specimens.evaluator(specimens.setups[name].coarse, name, COARSE)
    batch = [{**x, **own.values} for x in (shared, *others)]
    what = f"{name}, held out: its own values for other flesh, on coarse cells"
    runs = _counted(evaluator.evaluate(batch), len(batch), what, specimens.say)
    base, *moved = (objective.score(e, coarse=True) for e in runs)
    found = uncertainty(result.parameters, linearised_likelihood(objective, result.best, result.jacobian))
    sd = np.linalg.cholesky(found.alone)
    steps = np.random.default_rng(specimens.study.seed).standard_normal((len(others), len(sd))) @ sd.T
    low, high = objective.parameters.box
    out = []
    for run, step in zip(moved, steps, strict=True):
        known = run.ok and base.ok
        change = np.linalg.lstsq(result.jacobian, base.residual - run.residual)[0] if known else 0.0
        z = np.clip(result.best.z + change, np.minimum(low, result.best.z), np.maximum(high, result.best.z))
        out.append(objective.parameters.to_dict(objective.parameters.clip(z + step)))
    return out


def _simulated(specimens: Specimens, name: str, batch: list[dict[str, float]]) -> list[Evaluation]:
    """Simulations of a trace's cut in the order of their values, of which the first has ended its stroke.

    Args:
        specimens: The study's specimens.
        name: The trace.
        batch: Values of each simulation [SI], by name.

    Returns:
        The simulations.

    Raises:
        SimulationError: It has not.
    """
    evaluator = specimens.evaluator(specimens.setups[name].fine, name, FINE)
    what = f"{name}, held out: the predicted cut, and those of other flesh for its band"
    runs = _counted(evaluator.evaluate(batch), len(batch), what, specimens.say)
    if not runs[0].ok:
        raise SimulationError(
            f"{name}: the predicted cut did not reach the end of its stroke with {batch[0]}; give its height if you "
            "measured it",
            reason="held out",
            fraction=0.0,
        )
    return runs


def _counted(runs: Iterator[Evaluation], count: int, what: str, say: Callable[[str], None]) -> list[Evaluation]:
    """Simulations in the order of their values; it is said what they are for, and now and then how many are left.

    Args:
        runs: The simulations, as they come.
        count: How many there are.
        what: What they are for.
        say: Called with a sentence.

    Returns:
        All of them.
    """
    say(f"{what}: {count} simulations")
    countdown, told, out = Countdown(count), time.monotonic(), []
    for run in runs:
        out.append(run)
        left = countdown.left(1.0)
        if time.monotonic() - told >= PLAIN_INTERVAL_S and len(out) < count:
            told = time.monotonic()
            say(f"{what}: {len(out)} of {count}, {left}")
    return sorted(out, key=lambda e: e.index)


def _drawn(fit: JointFit, knife: str, scatter: float, seed: int) -> list[dict[str, float]]:
    """Flesh of another specimen: materials from the posterior of a fit, each moved by the scatter.

    The fitted flesh is the mean of n specimens, from which another one differs by a variance of 1 + 1/n of theirs.

    Args:
        fit: The fit.
        knife: The knife that cuts the other specimen.
        scatter: Standard deviation of the logarithm of a value among specimens [-].
        seed: Seed of the draws.

    Returns:
        The materials [SI], by name; none where the fit ended too early for a posterior.
    """
    if fit.analysis is None or fit.result.surrogate is None:
        return []
    random = np.random.default_rng(seed)
    points = posterior_draws(fit.result.surrogate, fit.result.best.z, fit.analysis.uncertainty, random)
    points = points[:PREDICTIVE_MATERIALS]
    parameters = fit.objective.parameters
    moved = np.array([p.log and is_shared(p.name) for p in parameters])
    apart = scatter * math.sqrt(1.0 + 1.0 / len(fit.names))
    steps = apart * random.standard_normal(points.shape) * moved
    return [fit.shared_values(knife, parameters.clip(z)) for z in points + steps]


def _mean_curve(specimens: Specimens, names: tuple[str, ...], held: str) -> FloatArray:
    """Mean of the other traces' curves over their own peaks and strokes, scaled to the held-out one.

    Args:
        specimens: The study's specimens.
        names: The other traces.
        held: The trace that is held out.

    Returns:
        The curve [N], shape (n,).
    """
    curves = [specimens.setups[n].curve.curve for n in names]
    mean = np.mean([c / c.max() for c in curves], axis=0)
    real = specimens.setups[held].curve.curve
    out: FloatArray = mean * float(mean @ real) / float(mean @ mean)
    return out


def _band(objective: Objective, curves: Sequence[FloatArray], fit: JointFit, seed: int) -> Band:
    """Band of the simulated curves, each with its own factor, and of errors as the fit showed them.

    Args:
        objective: The objective of the held-out trace.
        curves: Simulated forces [N], each of shape (n,).
        fit: The fit that shows the errors.
        seed: Seed of the errors.

    Returns:
        The band.
    """
    random = np.random.default_rng(seed)
    found = None if fit.analysis is None else fit.analysis.uncertainty
    size = 1.0 if found is None else float(np.sqrt(found.error_variance))
    length = objective.errors.correlation if found is None else float(np.mean(found.data.lengths))
    drawn = [
        objective.factor(curve) * curve + error
        for curve in curves
        for error in error_draws(objective, length, size, ERRORS_PER_MATERIAL, random)
    ]
    return pointwise_band(np.array(drawn), objective.target.curve)
