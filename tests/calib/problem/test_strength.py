"""The strength of a food as a parameter: its prior and a fit to a made-up cut."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib.fit.multistart import multistart_search
from calib.fit.options import FitOptions
from calib.material.food import load_food
from calib.problem.food_parameters import fit_parameters
from calib.problem.objective import Objective
from calib.problem.target import Target
from calib.simulation.evaluation import Evaluation
from calib.simulation.workers import evaluation_of
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.solver import Simulation
from tests.mpm.kernels.test_ties import SHORT

APPLE = load_food("apple")
STRENGTH = "strength_ratio"
PEELED = replace(
    APPLE.to_scene_food().material, E=6e6, R=60.0, R_initiation=60.0, skin_thickness=0.0, initiation_depth=5e-4
)
STROKE = 10.5e-3
SPLIT = replace(
    SHORT, food=replace(SHORT.food, material=PEELED), motion=replace(SHORT.motion, mach=0.04, stroke=STROKE)
)
"""A short cut of stiff flesh that a thick blade opens ahead of its edge: there the strength is in the force."""


class Cuts:
    """Simulates the cut in this process, in order."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.simulation = scene, Simulation(scene, Runtime(threads=1))

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """Each set of the batch."""
        for index, values in enumerate(batch):
            run = evaluation_of(self.simulation.run(replace(self.scene.food.material, **values)))
            yield replace(run, index=index, parameters=dict(values))


def test_prior_is_that_of_the_literature() -> None:
    """On a log scale, and not with the stress-like: the strength scales along with the yield stress."""
    only = fit_parameters(APPLE, (STRENGTH,))
    parameter = only[STRENGTH]
    assert (parameter.value, parameter.prior_low, parameter.prior_high) == (0.8, 0.6, 1.0)
    assert parameter.log and only.stress_like() == pytest.approx([0.0])


def test_search_stays_where_the_grid_resolves_the_crack() -> None:
    """No food of a fit is stronger than its yield stress, so that none flows at the tip of its crack."""
    both = fit_parameters(APPLE, ("yield_stress", STRENGTH))
    for corner in (both.lower, both.upper):
        scene = SPLIT.with_material(**both.to_dict(corner))
        assert not scene.flows_at_its_crack
    assert SPLIT.with_material(tensile_strength=2e6, yield_stress=2e5).flows_at_its_crack


@pytest.mark.parametrize("truth", [0.4, 0.67])
def test_strength_of_a_made_up_cut_is_found(truth: float) -> None:
    """Under a thick blade the force tells a weak food from a strong one of the same stiffness and toughness."""
    cuts = Cuts(SPLIT)
    real = next(cuts.evaluate([{STRENGTH: truth}]))
    grid = np.linspace(0.0, STROKE, 60)
    curve = np.interp(grid, real.stroke, real.force)
    noise = 0.005 * float(curve.max())
    objective = Objective(Target(grid, curve, noise, noise, np.interp), fit_parameters(APPLE, (STRENGTH,)))
    found = multistart_search(objective, cuts, options=FitOptions(budget=25, design=3))
    assert found.parameters[STRENGTH].value == pytest.approx(truth, rel=0.1)
