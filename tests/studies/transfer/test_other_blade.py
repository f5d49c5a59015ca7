"""A food under another blade: what is fitted under one predicts the others, and a wrong food does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mpm.runtime import Runtime
from mpm.scene.shapes import Shape
from studies.transfer.other_blade import FOLDING, KITCHEN, LIMIT, Prediction, Truth, fitted, held, scenes_of, truth_of

SMALL = Shape("block", 0.024, 0.018, 0.018)
RUNTIME = Runtime(threads=1)


@pytest.fixture(scope="module")
def truth() -> Truth:
    """A small apple under two blades, on the cells that predict: nothing is missed but what values miss."""
    scenes = scenes_of("apple", SMALL, (FOLDING, KITCHEN))
    coarse = [
        replace(scene, numerics=replace(scene.numerics, dx=3e-3), edge=replace(scene.edge, zone=3e-3))
        for scene in scenes
    ]
    short = [replace(scene, motion=replace(scene.motion, stroke=0.009, mach=0.04)) for scene in coarse]
    return truth_of(short, 3e-3, RUNTIME)


def test_true_values_on_the_same_cells_miss_nothing(truth):
    """Each prediction is the truth itself."""
    assert held(truth, RUNTIME) == [Prediction(name, 0.0, 0.0, False) for name in ("folding", "kitchen")]


def test_a_fit_under_one_blade_predicts_the_other(truth):
    """From values that are off, the fit finds the true ones and the force under the blade that it has not seen; held,
    they miss it."""
    wrong = tuple(scene.with_material(R=80.0, R_initiation=80.0) for scene in truth.scenes)
    off = Truth(wrong, truth.records)
    assert not held(off, RUNTIME)[1].passed
    values, found = fitted(off, RUNTIME, ("R",))
    assert values["R"] == pytest.approx(105.0, rel=0.01)
    assert found[1].fitted and found[1].passed and abs(found[1].work) < LIMIT / 3
