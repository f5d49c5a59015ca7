"""What a simulation cannot follow of a trace: found where it is, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import calib.search
from calib.fit import calibrate
from calib.objective import DISCREPANCY, Objective
from calib.roughness import LIBRARY, rough_parts, roughened, roughness, words
from calib.search import FitOptions
from tests.calib.fake import FIVE, GRID, LENGTH, Fake, goal

TRUTH = {"E": 7e5, "yield_stress": 6e4, "R": 200.0, "R_skin": 500.0, "mu": 0.25}
SWING = 0.1  # of the peak
FROM = 0.75 * LENGTH
LAST = GRID >= FROM


def swinging(swing: float = SWING) -> tuple[Objective, Objective]:
    """A cut, and the same with a blade that sticks and slips three times in its last quarter."""
    calm = goal(TRUTH)
    slip = swing * calm.target.peak * np.sin(6.0 * np.pi * (GRID - FROM) / (LENGTH - FROM)) * LAST
    return calm, replace(calm, target=replace(calm.target, curve=calm.target.curve + slip))


def library(count: int = 30) -> np.ndarray:
    """Curves of materials all over the prior ranges [N]."""
    random = np.random.default_rng(0)
    low, high = FIVE.box
    batch = [FIVE.to_dict(low + (high - low) * random.random(len(low))) for _ in range(count)]
    objective = goal(TRUTH)
    return np.array([objective.trial(e).curve for e in Fake().evaluate(batch)])


def test_swings_are_found_where_they_are_and_skin_is_not_one() -> None:
    """A swing of 10 % of the peak counts with its root mean square, 7 %; elsewhere, its skin peak included, and everywhere in a
    trace without swings it stays at what is allowed for anyway, 3 %."""
    calm, rough = swinging()
    size = rough.target.peak
    found, plain = roughness(rough, library()) / size, roughness(calm, library()) / size
    assert np.median(found[GRID > FROM + 0.1 * LENGTH]) == pytest.approx(SWING / np.sqrt(2.0), rel=0.25)
    assert plain.max() < 1.05 * DISCREPANCY
    assert found[GRID < FROM - 0.15 * LENGTH].max() < 1.05 * DISCREPANCY
    assert calm.target.curve[:60].max() > 0.8 * calm.target.peak  # the skin


def test_tolerance_grows_by_it_where_it_is_the_larger_one() -> None:
    """3 % of the peak stay 3 %; the rest says in words where it is, and without it nothing is said."""
    calm, rough = swinging()
    one = replace(rough, rough=roughness(rough, library()))
    np.testing.assert_array_equal(one.sigmas[60:150], rough.sigmas[60:150])
    assert one.sigmas[-20:].min() > 1.5 * rough.sigmas[-1]
    ((first, last, size),) = rough_parts(one)
    assert FROM - 0.1 * LENGTH < first < FROM < last <= LENGTH
    assert size == pytest.approx(SWING * rough.target.peak / np.sqrt(2.0), rel=0.3)
    assert words(one)[0].startswith(f"from {first * 1e3:.0f} to {last * 1e3:.0f} mm")
    assert words(calm) == words(rough) == []


def test_few_simulations_say_nothing() -> None:
    """With fewer than twice as many curves as shapes the objective stays what it was; broken ones do not count."""
    _, rough = swinging()
    random = np.random.default_rng(1)
    low, high = FIVE.box
    batch = [FIVE.to_dict(low + (high - low) * random.random(len(low))) for _ in range(LIBRARY)]
    trials = [rough.trial(e) for e in Fake().evaluate(batch)]
    assert roughened(rough, trials[:-1]) is rough
    assert roughened(rough, trials) is not rough
    broken = [rough.trial(e) for e in Fake(breaks=lambda p: True).evaluate(batch[:1])]
    assert roughened(rough, [*trials[:-1], *broken]) is rough


def test_a_search_does_not_go_on_for_what_no_material_explains(monkeypatch: pytest.MonkeyPatch) -> None:
    """A swinging trace is fitted without strides to the ends of the prior ranges; blind to its roughness, the search makes them."""
    _, rough = swinging(0.2)

    def fit() -> set[str]:
        coarse = Fake(noisy=0.012)
        found = calibrate(rough, Fake(), coarse=coarse, options=FitOptions(seed=0))
        assert found.best.evaluation.parameters["R"] == pytest.approx(TRUTH["R"], rel=0.5)
        return {t.stage for t in found.history}

    assert "stride" not in fit()
    monkeypatch.setattr(calib.search, "roughened", lambda objective, trials: objective)
    assert "stride" in fit()
