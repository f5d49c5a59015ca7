"""A held-out cut predicted with the flesh of the others.

Fitted to it is only what its own specimen has for itself: its skin, its size, one factor for width and sensor.  The band comes
from simulating materials drawn from the posterior of the flesh and moved as far as specimens lie apart, and from errors of the size and
correlation that the fit of the others showed. Each material has its own factor, and what the specimen has for itself is fitted to
each: by a Gauss-Newton step from the best values, with what the material changes of the curve on coarse cells, and drawn about that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.fit.multistart import FitResult, calibrate
from calib.fit.options import FitOptions
from calib.multi_specimen.specimens import Fitted, Specimens
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet, plain
from calib.simulation.evaluation import Evaluation
from calib.trace.filters import filter_simulated
from calib.uncertainty.intervals import evidence, uncertainty
from calib.uncertainty.predictive import Band, band_of, errors, materials
from calib.validation.acceptance import Verdict, balances
from calib.validation.metrics import Metrics, compare
from calib.validation.null_models import null_models
from calib.validation.prediction import NRMSE_LIMIT, RATING_LIMIT
from mpm.scene.errors import SimulationError

FloatArray = np.ndarray

BUDGET = 40.0
"""Simulations at most for the few parameters of a specimen."""
DESIGN = 5
DRAWS = 32
"""Materials of the posterior that are simulated for the band; errors are drawn for each a hundred times. With 16 the part of a potato's
points within it was 88 or 91 %, as they were drawn."""
REPEATED = 100
INSIDE_LIMIT = 0.90
"""Least part of the measured points within their 95 % band."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """A held-out cut and what was predicted of it.

    Attributes:
        name: The trace.
        trained: Traces whose flesh it is predicted with.
        curve: Predicted force with the specimen's factor [N] (n,).
        values: All values [SI] of the simulation by property.
        fitted: Those of them that are the specimen's own.
        factor: That factor [-].
        metrics: Prediction against the measured curve.
        nulls: Curves that explain nothing against it, by name.
        band: 95 % band.
        simulations: Number of simulations.
        balances: Momentum and kinetic energy of the predicted cut.
    """

    name: str
    trained: tuple[str, ...]
    curve: FloatArray
    values: dict[str, float]
    fitted: tuple[str, ...]
    factor: float
    metrics: Metrics
    nulls: dict[str, Metrics]
    band: Band
    simulations: int
    balances: tuple[Verdict, ...]

    @property
    def passed(self) -> bool:
        """Whether curve, rating and band are within their limits, and the simulation's balances close."""
        m = self.metrics
        if any(v.passed is False for v in self.balances):
            return False
        return m.nrmse <= NRMSE_LIMIT and m.iso18571.R >= RATING_LIMIT and self.band.inside >= INSIDE_LIMIT

    @property
    def beaten(self) -> tuple[str, ...]:
        """Null models that the prediction beats in both rating and shape."""
        m = self.metrics
        return tuple(n for n, x in self.nulls.items() if m.iso18571.R > x.iso18571.R and m.shape_error < x.shape_error)

    def as_dict(self) -> dict[str, object]:
        """Plain data."""
        return {
            "trained_on": list(self.trained),
            "passed": self.passed,
            "metrics": self.metrics.as_dict(),
            "factor": self.factor,
            "fitted": {n: self.values[n] for n in self.fitted},
            "predictive_inside": self.band.inside,
            "limits": {"nrmse": NRMSE_LIMIT, "rating": RATING_LIMIT, "inside": INSIDE_LIMIT},
            "null_models": {
                n: {"nrmse": x.nrmse, "shape_error": x.shape_error, "R": x.iso18571.R} for n, x in self.nulls.items()
            },
            "beats": list(self.beaten),
            "simulations": self.simulations,
            "verdicts": [v.as_dict() for v in self.balances],
        }


def predict(specimens: Specimens, fitted: Fitted, name: str) -> Prediction:
    """Predict the cut of a trace that the fit has not seen.

    Raises:
        CutcalError: No simulation of it reached the end of its stroke.
    """
    setup = specimens.setups[name]
    goal = setup.objective
    flesh = fitted.flesh()
    found = _specimen(specimens, flesh, name)
    best = {} if found is None else dict(found.result.best.evaluation.parameters)
    values = {**flesh, **best}
    others = _drawn(fitted, specimens.study.scatter, specimens.study.seed)
    drawn = [{**x, **own} for x, own in zip(others, _adapted(specimens, found, flesh, others, name), strict=True)]
    runs = _runs(specimens, name, [values, *drawn])
    count = 0 if found is None else len(found.result.history) + 1 + len(others)
    if not runs[0].ok:
        raise SimulationError(
            f"{name}: the predicted cut did not reach the end of its stroke with {values}; give its height if you measured it",
            reason="held out",
            fraction=0.0,
        )
    own_curve, *curves = (filter_simulated(goal.target.stroke, e.stroke, e.force) for e in runs if e.ok)
    scalars = runs[0].scalars
    k = goal.factor(own_curve)
    real, stroke = goal.target.curve, goal.target.stroke
    nulls = {n: m.metrics for n, m in null_models(stroke, real).items()}
    nulls |= {"mean of the others": compare(stroke, real, _mean(specimens, fitted.names, name))}
    return Prediction(
        name=name,
        trained=fitted.names,
        curve=k * own_curve,
        values=values,
        fitted=tuple(best),
        factor=k,
        metrics=compare(stroke, real, k * own_curve),
        nulls=nulls,
        band=_band(goal, [own_curve, *curves], fitted, specimens.study.seed),
        simulations=count + len(runs),
        balances=tuple(balances(scalars["momentum_residual"], scalars["ke_over_ie"], runs[0].parted)),
    )


@dataclass(frozen=True, eq=False)
class _Specimen:
    """What was fitted to a held-out trace with the flesh of the others."""

    goal: Objective
    result: FitResult


def _specimen(specimens: Specimens, flesh: Mapping[str, float], name: str) -> _Specimen | None:
    """The specimen's own values with the flesh held; None where it has none."""
    setup, chosen = specimens.setups[name], specimens.own_parameters(name)
    if not chosen:
        return None
    goal = replace(setup.objective, parameters=ParameterSet(chosen))
    fine, coarse = (
        specimens.evaluator(scene.with_material(**flesh), name, fidelity)
        for fidelity, scene in (("fine", setup.fine), ("coarse", setup.coarse))
    )
    options = FitOptions(budget=BUDGET, batch=specimens.pool.batch, design=DESIGN, seed=specimens.study.seed)
    result = calibrate(
        goal, fine, coarse=coarse, options=options, progress=specimens.staged(f"specimen of {name}, held out")
    )
    if result.status == "interrupted":
        raise KeyboardInterrupt
    return _Specimen(goal, result)


def _adapted(
    specimens: Specimens, found: _Specimen | None, flesh: Mapping[str, float], others: list[dict[str, float]], name: str
) -> list[dict[str, float]]:
    """The specimen's own values for each of some other materials, with what their fit does not know of them.

    A run that breaks down on coarse cells says nothing: the best values stay.
    """
    if found is None:
        return [{}] * len(others)
    goal, result = found.goal, found.result
    best = result.best.evaluation.parameters
    if result.jacobian is None:
        return [dict(best)] * len(others)
    evaluator = specimens.evaluator(specimens.setups[name].coarse, name, "coarse")
    runs = sorted(evaluator.evaluate([{**x, **best} for x in (flesh, *others)]), key=lambda e: e.index)
    own, *trials = (goal.trial(e, coarse=True) for e in runs)
    sd = np.linalg.cholesky(uncertainty(result.parameters, evidence(goal, result.best, result.jacobian)).alone)
    steps = np.random.default_rng(specimens.study.seed).standard_normal((len(others), len(sd))) @ sd.T
    low, high = goal.parameters.box
    out = []
    for trial, step in zip(trials, steps, strict=True):
        known = trial.ok and own.ok
        change = np.linalg.lstsq(result.jacobian, own.residual - trial.residual)[0] if known else 0.0
        z = np.clip(result.best.z + change, np.minimum(low, result.best.z), np.maximum(high, result.best.z))
        out.append(goal.parameters.to_dict(goal.parameters.clip(z + step)))
    return out


def _runs(specimens: Specimens, name: str, batch: list[dict[str, float]]) -> list[Evaluation]:
    """Simulations of a trace's cut, in their order."""
    return sorted(specimens.evaluator(specimens.setups[name].fine, name, "fine").evaluate(batch), key=lambda e: e.index)


def _drawn(fitted: Fitted, scatter: float, seed: int) -> list[dict[str, float]]:
    """Flesh of another specimen: materials from the posterior of the fit, as its own band draws them, moved by what specimens differ.

    The fitted flesh is the mean of n specimens, from which another one differs by a variance of 1 + 1/n of theirs.
    """
    if fitted.doubt is None or fitted.result.surrogate is None:
        return []
    random = np.random.default_rng(seed)
    points = materials(fitted.result.surrogate, fitted.result.best.z, fitted.doubt.uncertainty, random)[:DRAWS]
    parameters = fitted.objective.parameters
    moved = np.array([p.log and p.name == plain(p.name) for p in parameters])
    apart = scatter * math.sqrt(1.0 + 1.0 / len(fitted.names))
    steps = apart * random.standard_normal(points.shape) * moved
    return [fitted.flesh(parameters.clip(z)) for z in points + steps]


def _mean(specimens: Specimens, names: tuple[str, ...], held: str) -> FloatArray:
    """Mean of the other traces' curves over their own peaks and strokes, scaled to the held-out one [N]."""
    curves = [specimens.setups[n].curve.curve for n in names]
    mean = np.mean([c / c.max() for c in curves], axis=0)
    real = specimens.setups[held].curve.curve
    out: FloatArray = mean * float(mean @ real) / float(mean @ mean)
    return out


def _band(goal: Objective, curves: list[FloatArray], fitted: Fitted, seed: int) -> Band:
    """Band of the simulated curves, each with its own factor, and of errors as the fit showed them."""
    random = np.random.default_rng(seed)
    doubt = fitted.doubt
    widened = 1.0 if doubt is None else float(np.sqrt(doubt.uncertainty.widened))
    length = goal.errors.correlation if doubt is None else float(np.mean(doubt.uncertainty.data.lengths))
    drawn = [goal.factor(c) * c + error for c in curves for error in errors(goal, length, widened, REPEATED, random)]
    return band_of(np.array(drawn), goal.target.curve)
