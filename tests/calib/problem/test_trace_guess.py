"""Where a search begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.properties import BOARD_SUCTION
from calib.material.scene import cut_scene
from calib.problem.food_parameters import fit_parameters
from calib.problem.layer_guess import EDGE_PART, FRICTION_PART, layer_chords
from calib.problem.trace_guess import FACES_EDGE_PART, start_of_cut, trace_guesses
from mpm.scene.shapes import Shape

HEIGHT, PEAK, LINE = 0.04, 0.004, 600.0
APPLE = load_food("apple")
SCENE = cut_scene(APPLE, Shape("hemisphere", 0.08, 0.08, HEIGHT), load_knife("edc"))
NAMES = ("E", "yield_stress", "R", "R_skin", "initiation_depth", "mu")
STROKE = np.linspace(0.0, HEIGHT, 161)


def chord() -> np.ndarray:
    """What the edge has met, no longer than the blade [m]."""
    depth, each = layer_chords(SCENE.food.shape, SCENE.food.material)
    return np.interp(STROKE, depth, np.minimum(each.sum(axis=0), SCENE.knife.length))


def made(skin: float = 900.0) -> np.ndarray:
    """Force of a food that costs the same for each length of the edge, and more until its skin parts."""
    return np.where(STROKE <= PEAK, skin * STROKE / PEAK, LINE) * chord()


def test_the_peak_says_how_a_cut_starts() -> None:
    """Force and dent of a peak at its true values, and the rest of the force by the edge or by the faces."""
    parameters = fit_parameters(APPLE, NAMES)
    _, faces, edge = (parameters.to_dict(z) for z in trace_guesses(SCENE, parameters, STROKE, made(), 0.1))
    for found in (faces, edge):
        assert found["R_skin"] == pytest.approx(EDGE_PART * 900.0, rel=0.01)
        assert found["initiation_depth"] == pytest.approx(EDGE_PART * PEAK, rel=0.05)
    assert edge["R"] == pytest.approx(EDGE_PART * LINE, rel=0.02)
    assert faces["R"] == pytest.approx(FACES_EDGE_PART * LINE, rel=0.02)
    usual = {p.name: p.value for p in parameters}
    assert edge["E"] == pytest.approx(usual["E"]) and faces["E"] > 1.5 * usual["E"]
    assert faces["yield_stress"] / faces["E"] == pytest.approx(usual["yield_stress"] / usual["E"])
    assert edge["mu"] < faces["mu"] < usual["mu"]


@pytest.mark.parametrize(
    ("curve", "found"),
    [
        pytest.param(np.linspace(0.0, 40.0, 90), None, id="rises all the way"),
        pytest.param(np.r_[np.linspace(0.0, 20.0, 20), np.linspace(18.0, 40.0, 70)], 19, id="peak and dip"),
        pytest.param(np.r_[np.linspace(0.0, 20.0, 20), np.linspace(19.5, 40.0, 70)], None, id="a dip too small"),
        pytest.param(np.r_[np.linspace(0.0, 40.0, 60), np.linspace(20.0, 10.0, 30)], None, id="behind the first third"),
        pytest.param(np.r_[np.linspace(0.0, 20.0, 20), np.linspace(19.9, 5.0, 70)], 19, id="falls for good"),
    ],
)
def test_where_a_cut_starts(curve: np.ndarray, found: int | None) -> None:
    """The first peak that the force falls behind, if it is in the first third."""
    assert start_of_cut(curve, 0.1) == found


def test_noise_is_no_start_of_a_cut() -> None:
    """A dip of 2 N in noise of 0.6 N."""
    curve = np.r_[np.linspace(0.0, 20.0, 20), np.linspace(18.0, 40.0, 70)]
    assert start_of_cut(curve, 0.6) is None


def test_nothing_is_guessed_where_nothing_is_seen() -> None:
    """Without a peak, or without what it would say."""
    parameters = fit_parameters(APPLE, NAMES)
    assert len(trace_guesses(SCENE, parameters, STROKE, made(skin=LINE), 0.1)) == 2
    assert len(trace_guesses(SCENE, fit_parameters(APPLE, ("E", "R", "mu")), STROKE, made(), 0.1)) == 2


def test_the_guess_of_a_fast_cut_is_at_the_reference_speed() -> None:
    """At 40 mm/s and an exponent of a half the same force means half the resistances."""
    parameters = fit_parameters(APPLE, NAMES)
    fast = replace(SCENE, motion=replace(SCENE.motion, speed=0.04)).with_material(rate_exponent=0.5)
    for plain, found in zip(
        trace_guesses(SCENE, parameters, STROKE, made(), 0.1)[1:],
        trace_guesses(fast, parameters, STROKE, made(), 0.1)[1:],
        strict=True,
    ):
        usual, got = parameters.to_dict(plain), parameters.to_dict(found)
        for name in ("R", "R_skin"):
            assert got[name] == pytest.approx(max(usual[name] / 2, parameters[name].low)), name
        assert got["E"] == pytest.approx(usual["E"])


@pytest.mark.parametrize(("names", "seen"), [(NAMES, 2), (("E", "R", "mu"), 1)])
def test_a_search_begins_at_a_stiff_food_that_hardly_rubs_too(names: tuple[str, ...], seen: int) -> None:
    """It comes first, one sd stiffer, with a fifteenth of the friction; the usual one where the trace says nothing."""
    parameters = fit_parameters(APPLE, names)
    first, *others = (parameters.to_dict(z) for z in trace_guesses(SCENE, parameters, STROKE, made(), 0.1))
    usual = {p.name: p.value for p in parameters}
    stiffer = float(np.exp(parameters["E"].prior_sd))
    changed = {name: stiffer * usual[name] for name in ("E", "yield_stress") if name in names}
    assert first == pytest.approx(usual | changed | {"mu": usual["mu"] / 15})
    assert len(others) == seen
    if seen == 1:
        assert others[0] == pytest.approx(usual)


def test_a_search_begins_on_a_board_that_hardly_holds_the_food_too() -> None:
    """Where the suction is fitted, the stiffest food of the trace once more, at the low end of the suction's prior."""
    parameters = fit_parameters(APPLE, (*NAMES, BOARD_SUCTION))
    _, loose, *others = (parameters.to_dict(z) for z in trace_guesses(SCENE, parameters, STROKE, made(), 0.1))
    stiffest = max(others, key=lambda one: one["E"])
    assert loose == pytest.approx(stiffest | {BOARD_SUCTION: APPLE.properties[BOARD_SUCTION].low})
    assert loose[BOARD_SUCTION] < 0.1 * stiffest[BOARD_SUCTION]


def test_the_usual_food_is_hardly_held_where_the_trace_says_nothing() -> None:
    """With a third of its friction."""
    parameters = fit_parameters(APPLE, ("E", "R", "mu", BOARD_SUCTION))
    _, loose, usual = (parameters.to_dict(z) for z in trace_guesses(SCENE, parameters, STROKE, made(), 0.1))
    low = {BOARD_SUCTION: APPLE.properties[BOARD_SUCTION].low}
    assert loose == pytest.approx(usual | low | {"mu": FRICTION_PART * usual["mu"]})


def test_a_search_begins_at_the_usual_food_where_no_friction_is_fitted() -> None:
    """Nothing rubs less than what is held."""
    parameters = fit_parameters(APPLE, ("E", "R"))
    (only,) = trace_guesses(SCENE, parameters, STROKE, made(), 0.1)
    assert parameters.to_dict(only) == pytest.approx({p.name: p.value for p in parameters})


def test_a_stroke_that_ends_early_has_guesses_too() -> None:
    """A trace of the first fifth of the food's height tells the force for each length of the edge as well."""
    parameters = fit_parameters(APPLE, NAMES)
    early = np.linspace(0.0, 0.2 * HEIGHT, 161)
    force = np.interp(early, [0.0, 0.002, 0.0022, early[-1]], [0.0, 16.0, 12.0, 30.0])
    _, faces, edge = (parameters.to_dict(z) for z in trace_guesses(SCENE, parameters, early, force, 0.1))
    assert all(np.isfinite(list(found.values())).all() for found in (faces, edge))
    assert edge["R"] > 2 * faces["R"]


def test_what_the_trace_does_not_tell_stays_usual_at_any_speed() -> None:
    """Only resistances that were read off the trace are those of its speed."""
    parameters = fit_parameters(APPLE, NAMES)
    fast = replace(SCENE, motion=replace(SCENE.motion, speed=0.04)).with_material(rate_exponent=0.5)
    first, *_ = (parameters.to_dict(z) for z in trace_guesses(fast, parameters, STROKE, made(), 0.1))
    usual = {p.name: p.value for p in parameters}
    assert first["R"] == pytest.approx(usual["R"]) and first["R_skin"] == pytest.approx(usual["R_skin"])
