"""The records of made-up cuts: simulated by other settings than those that will fit them, and measured by a sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calib.errors import OutputError
from calib.io.provenance import code_key
from calib.material.food import FoodSpec, load_food
from calib.material.knife import load_knife
from calib.material.scene import cut_scene, of_specimen
from calib.problem.food_parameters import fit_parameters
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore
from calib.simulation.workers import Workers
from calib.validation.acceptance import Conservation, balances
from calib.validation.interval_coverage import MadeUpSensor
from calib.validation.numerical_checks import FINER
from mpm.scene import Scene
from mpm.scene.shapes import Shape
from studies.discrimination.pair import Pair

SENSOR = MadeUpSensor(baseline=5.0, drift_sd=0.02, noise=0.05, ripple=0.05)
"""A load cell for soft fruit: noise and drift of a hundredth of a strawberry's peak."""
TRUTH_PART = 0.6
"""Part of each prior range, about its middle, from which truths are drawn [-]: beyond it many foods flow under the edge
and are no cuts."""
TRUTH_SEED = 10_000
"""Added to the number of a pair for the seed of its truth's particles, which no fit has."""
TRIES = 40
"""Truths drawn until one is cut to the end of the stroke."""


@dataclass(frozen=True)
class Truth:
    """A simulated cut whose values are known.

    Attributes:
        shape: The specimen.
        values: The food's values [SI], by name.
        run: The cut.
    """

    shape: Shape
    values: Mapping[str, float]
    run: Evaluation


def made_up(pair: Pair, store: EvaluationStore, pool: Workers) -> Truth:
    """Draw a food and cut it on cells of two thirds, with other particles than any fit has.

    Foods that the solver itself does not vouch for are drawn again: those that flow at the tip of their crack, are
    pressed away, snap apart faster than slowly, or lose energy to the grid.

    Args:
        pair: Whose truth it is.
        store: Where simulations are kept.
        pool: Where they run.

    Returns:
        The truth.

    Raises:
        OutputError: No food drawn reached the end of its cut.
    """
    food = load_food(pair.truth.food)
    shape = pair.truth.shape
    rough = _scene(pair, food, shape, coarse=True)
    fine = _scene(pair, food, shape, coarse=False)
    parameters = fit_parameters(food, food.default_fit)
    random = np.random.default_rng(pair.number)
    for _ in range(TRIES):
        z = parameters.in_box(0.5 + TRUTH_PART * (random.random(len(parameters)) - 0.5))
        values = parameters.to_dict(z)
        scene, material = of_specimen(fine, values)
        if not scene.with_material(**material).flows_at_its_crack and _run(rough, values, store, pool).completed == 1.0:
            run = _run(fine, values, store, pool)
            if run.completed == 1.0 and all(line.passed for line in balances(Conservation.of(run))):
                return Truth(shape, values, run)
    raise OutputError(f"{pair.name}: none of {TRIES} foods drawn from the ranges of {food.name} was cut to its end")


def write_record(pair: Pair, truth: Truth, path: Path) -> None:
    """Measure a made-up cut, and do to its force what the pair does.

    Args:
        pair: The pair.
        truth: Its cut.
        path: CSV file of the record.
    """
    random = np.random.default_rng([pair.number, 1])
    record = SENSOR.measure(np.asarray(truth.run.stroke), np.asarray(truth.run.force), random)
    record["force_N"] = pair.change(record["force_N"].to_numpy())
    record.to_csv(path, index=False, float_format="%.6g")


def _scene(pair: Pair, food: FoodSpec, shape: Shape, *, coarse: bool) -> Scene:
    scene = cut_scene(food, shape, load_knife(pair.truth.knife), coarse=coarse, seed=TRUTH_SEED + pair.number)
    if coarse:
        return scene
    return replace(scene, numerics=replace(scene.numerics, dx=FINER * scene.numerics.dx))


def _run(scene: Scene, values: Mapping[str, float], store: EvaluationStore, pool: Workers) -> Evaluation:
    evaluator = CachedEvaluator(pool.evaluator(scene), store, scene=scene.as_dict(), code=code_key(), fidelity="truth")
    return next(iter(evaluator.evaluate([dict(values)])))
