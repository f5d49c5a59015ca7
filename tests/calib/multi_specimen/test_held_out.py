"""What the band of a held-out cut is drawn from: flesh of other specimens, and what its own specimen then has for
itself."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import calib.multi_specimen.held_out
from calib.fit.multistart import multistart_search
from calib.fit.options import FitOptions
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.multi_specimen.held_out import HeldOutPrediction, _adapted, _counted, _drawn, _own_fit, _OwnFit
from calib.problem.objective import Objective
from calib.problem.parameters import ParameterSet
from calib.uncertainty.predictive import Band
from calib.validation.metrics import compare
from mpm.scene import Scene
from tests.calib.fake import FIVE, Fake, goal, three_terms

FLESH = {"E": 4e5, "yield_stress": 5e4, "R": 350.0, "mu": 0.25}
SKIN = 450.0


def fitted(specimens: int) -> Any:
    """A joint fit of some specimens whose posterior is a point."""
    names = tuple("abc"[:specimens])
    z = FIVE.to_vector(FLESH | {"R_skin": SKIN})
    return SimpleNamespace(
        names=names,
        analysis=SimpleNamespace(uncertainty=None),
        result=SimpleNamespace(surrogate=object(), best=SimpleNamespace(z=z)),
        objective=SimpleNamespace(parameters=FIVE),
        shared_values=lambda knife, point: {n: x for n, x in FIVE.to_dict(point).items() if n in FLESH},
    )


@pytest.mark.parametrize("specimens", [1, 3])
def test_flesh_of_another_specimen_scatters_about_the_mean_of_the_fitted_ones(
    specimens: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the root of 1 + 1/n of the scatter, in the logarithm; friction is the blade's as well and stays; without
    scatter nothing moves."""
    monkeypatch.setattr(calib.multi_specimen.held_out, "PREDICTIVE_MATERIALS", 4000)
    monkeypatch.setattr(calib.multi_specimen.held_out, "posterior_draws", lambda s, z, u, random: np.tile(z, (4000, 1)))
    drawn = _drawn(fitted(specimens), "edc", 0.25, 0)
    assert len(drawn) == 4000 and {d["mu"] for d in drawn} == {FLESH["mu"]}
    for name in ("E", "yield_stress", "R"):
        logs = np.log([d[name] for d in drawn])
        assert logs.std() == pytest.approx(0.25 * np.sqrt(1.0 + 1.0 / specimens), rel=0.05)
        assert logs.mean() == pytest.approx(np.log(FLESH[name]), abs=0.02)
    assert all(d == pytest.approx(FLESH) for d in _drawn(fitted(specimens), "edc", 0.0, 0))


@pytest.mark.filterwarnings("ignore")
def test_the_specimens_own_values_are_fitted_to_each_flesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a fifth more or less stiffness or resistance the skin goes at least two fifths of the way to what would be
    fitted anew; a run that breaks down on coarse cells leaves the best one.
    """
    monkeypatch.setattr(
        calib.multi_specimen.held_out, "uncertainty", lambda parameters, data: SimpleNamespace(alone=1e-18 * np.eye(1))
    )
    objective = goal(FLESH | {"R_skin": SKIN}, ParameterSet((FIVE.items[3],)))
    inner = Fake(lambda p: three_terms({**FLESH, **p}), noisy=0.001)
    result = multistart_search(objective, inner, options=FitOptions(budget=20, design=5))
    assert result.best.evaluation.parameters["R_skin"] == pytest.approx(SKIN, rel=0.05)
    coarse = Fake(three_terms, noisy=0.001, breaks=lambda p: p["E"] > 1e6)
    asked: list[tuple[str, str]] = []

    def evaluator(scene: object, name: str, fidelity: str) -> Fake:
        asked.append((name, fidelity))
        return coarse

    specimens: Any = SimpleNamespace(
        setups={"b": SimpleNamespace(coarse=None)}, evaluator=evaluator, study=SimpleNamespace(seed=0), say=print
    )
    others = [FLESH | {name: FLESH[name] * k} for name in ("E", "R") for k in (0.8, 1.2)] + [FLESH | {"E": 2e6}]
    found = _adapted(specimens, _OwnFit(objective, result), FLESH, others, "b")
    assert asked == [("b", "coarse")] and all(set(own) == {"R_skin"} for own in found)
    best = result.best.evaluation.parameters

    def anew(flesh: dict[str, float]) -> float:
        """Skin of least misfit with this flesh."""
        skins = best["R_skin"] * np.exp(np.linspace(-0.5, 0.5, 201))
        runs = Fake(lambda p: three_terms({**flesh, **p}), noisy=0.0, backwards=False).evaluate(
            [{"R_skin": s} for s in skins]
        )
        return float(skins[np.argmin([np.sum(objective.score(run).residual ** 2) for run in runs])])

    for x, own in zip(others[:-1], found[:-1], strict=True):
        way = np.log(anew(x) / anew(FLESH))
        assert np.log(own["R_skin"] / best["R_skin"]) == pytest.approx(way, abs=0.6 * abs(way) + 0.005)
    assert found[-1]["R_skin"] == pytest.approx(best["R_skin"], rel=1e-6)
    assert _adapted(specimens, None, FLESH, others, "b") == [{}] * len(others)


def test_a_size_that_a_study_shares_is_no_property_of_the_flesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """Height and roundness shape the cut of the held-out specimen, where each has none of its own."""
    food = load_food("potato")
    shape, _ = specimen(food, None, Sizing(), open_form=True)
    scene = cut_scene(food, shape, load_knife("kitchen"))
    done = SimpleNamespace(status="done")
    searched: list[Objective] = []
    monkeypatch.setattr(
        calib.multi_specimen.held_out,
        "multistart_search",
        lambda objective, *given, **options: searched.append(objective) or done,
    )
    cut: list[Scene] = []
    objective = replace(goal(FLESH | {"R_skin": SKIN}), guesses=(FIVE.start,))
    specimens: Any = SimpleNamespace(
        setups={"c": SimpleNamespace(objective=objective, fine=scene, coarse=scene, kept=())},
        own_parameters=lambda name, known: (FIVE.items[3].name,),
        evaluator=lambda scene, name, fidelity: cut.append(scene),
        pool=SimpleNamespace(batch=1),
        study=SimpleNamespace(seed=0),
        staged=lambda stage: None,
    )
    assert _own_fit(specimens, {"R": 300.0, "height": 0.06, "roundness": 0.2}, "c") is not None
    assert searched[0].parameters.names == (FIVE.items[3].name,)
    assert searched[0].guesses == ()  # those of the whole food have other coordinates
    for one in cut:
        assert one.food.material.R == 300.0
        assert (one.food.shape.height, one.food.shape.roundness) == (0.06, 0.2)


@pytest.mark.parametrize(("half", "passes"), [(0.2, True), (0.3, False)])
def test_a_band_wider_than_half_of_the_peak_fails_the_cut(half: float, passes: bool) -> None:
    """The curve is predicted to the last bit and lies in both bands: the wider one holds any curve, and fails."""
    stroke = np.linspace(0.0, 0.03, 200)
    curve = 20.0 * np.sin(np.pi * stroke / 0.03)
    band = Band(curve - 20.0 * half, curve + 20.0 * half, 1.0)
    found = HeldOutPrediction(
        "c", ("a",), curve, {}, 1.0, compare(stroke, curve, curve), {}, band, 1, (), Scene.__new__(Scene), None, ()
    )
    assert found.width == pytest.approx(2.0 * half, rel=1e-3) and found.passed is passes


def test_long_work_says_what_it_is_for_and_what_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the first simulation and now and then after one, but not behind the last; the order is that of the
    values."""
    monkeypatch.setattr(calib.multi_specimen.held_out, "PLAIN_INTERVAL_S", 0.0)
    said: list[str] = []
    runs: list[Any] = [SimpleNamespace(index=k) for k in (2, 0, 1)]
    assert [e.index for e in _counted(iter(runs), 3, "the band", said.append)] == [0, 1, 2]
    assert said[0] == "the band: 3 simulations" and len(said) == 3
    assert said[1].startswith("the band: 1 of 3, about ") and said[2].startswith("the band: 2 of 3, about ")
    assert all(line.endswith(" left") for line in said[1:])
