"""Where a search for layers begins: at the resistances and sizes that a made-up force was made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import cut_scene
from calib.problem.food_parameters import fit_parameters
from calib.problem.layer_guess import EDGE_PART, layer_chords, layer_guesses
from calib.problem.request import Request
from calib.problem.setup import set_up
from mpm.scene.shapes import Shape
from tests.data_dir import data_file

HEIGHT = 0.042
CUCUMBER = load_food("cucumber")
SCENE = cut_scene(CUCUMBER, Shape("cylinder", 0.15, HEIGHT, HEIGHT), load_knife("kitchen"))
TRUE = {"R": 120.0, "R_rind": 400.0, "rind_thickness": 2.5e-3, "R_core": 30.0, "core_ratio": 0.5}
DENT = 4.2e-3


def made() -> tuple[np.ndarray, np.ndarray]:
    """Stroke and force of a fruit of these layers that gives way by a dent, until there is nothing below it."""
    stroke = np.linspace(0.0, HEIGHT, 240)
    food = replace(SCENE.food.material, rind_thickness=TRUE["rind_thickness"], core_ratio=TRUE["core_ratio"])
    depth, chords = layer_chords(SCENE.food.shape, food)
    at = np.clip((stroke - DENT) * HEIGHT / (HEIGHT - DENT), 0.0, HEIGHT)
    force = sum(TRUE[name] * np.interp(at, depth, c) for name, c in zip(("R", "R_rind", "R_core"), chords, strict=True))
    return stroke, np.maximum(force, 0.3 * stroke / DENT) / EDGE_PART


def test_the_layers_of_a_made_up_force_are_found() -> None:
    """Two peaks, a dip and a fall tell the three resistances to a quarter and the sizes to a step of what is tried."""
    names = ("E", "R", "R_rind", "rind_thickness", "R_core", "core_ratio", "R_skin", "initiation_depth", "mu")
    parameters = fit_parameters(CUCUMBER, names)
    _, guess, _ = layer_guesses(SCENE, parameters, *made())
    found = parameters.to_dict(guess)
    for name in ("R", "R_rind", "rind_thickness", "core_ratio"):
        assert found[name] == pytest.approx(TRUE[name], rel=0.25), name
    assert found["R_core"] < 0.5 * found["R"]
    assert found["R_skin"] == pytest.approx(found["R_rind"])
    assert 0 < found["mu"] < CUCUMBER.properties["mu"].value


def test_the_guess_of_a_fast_cut_is_at_the_reference_speed() -> None:
    """At 40 mm/s and an exponent of a half the same force means half the resistances, and the same stiffness."""
    parameters = fit_parameters(CUCUMBER, ("E", "R", "R_rind", "rind_thickness", "R_core", "core_ratio", "R_skin"))
    motion = replace(SCENE.motion, speed=0.04)
    fast = replace(SCENE, motion=motion).with_material(rate_exponent=0.5)
    for plain, found in zip(
        layer_guesses(SCENE, parameters, *made()), layer_guesses(fast, parameters, *made()), strict=True
    ):
        usual, got = parameters.to_dict(plain), parameters.to_dict(found)
        for name in ("R", "R_rind", "R_core", "R_skin"):
            assert got[name] == pytest.approx(max(usual[name] / 2, parameters[name].low)), name
        assert got["E"] == pytest.approx(usual["E"]) and got["core_ratio"] == usual["core_ratio"]


def test_a_soft_start_yields_at_the_strain_of_its_food() -> None:
    """A start that is softer than the food of the literature yields at the same strain, the stiff ones as it."""
    parameters = fit_parameters(CUCUMBER, ("E", "yield_stress", "R", "R_rind", "rind_thickness", "R_skin"))
    firm, soft, dented = (parameters.to_dict(guess) for guess in layer_guesses(SCENE, parameters, *made()))
    modulus, limit = (CUCUMBER.properties[name].value for name in ("E", "yield_stress"))
    assert soft["E"] < 0.5 * modulus
    assert soft["yield_stress"] / soft["E"] == pytest.approx(limit / modulus)
    for stiff in (firm, dented):
        assert (stiff["E"], stiff["yield_stress"]) == pytest.approx((modulus, limit))


def test_a_firm_food_parts_at_once() -> None:
    """Its layers are those of the others, and it gives way by a twentieth of its height only."""
    names = ("E", "R", "R_rind", "rind_thickness", "R_core", "core_ratio", "R_skin", "initiation_depth")
    parameters = fit_parameters(CUCUMBER, names)
    firm, soft, dented = (parameters.to_dict(guess) for guess in layer_guesses(SCENE, parameters, *made()))
    assert firm["initiation_depth"] == pytest.approx(HEIGHT / 20)
    assert firm["initiation_depth"] < dented["initiation_depth"]
    assert [firm[name] for name in TRUE] == [soft[name] for name in TRUE] == [dented[name] for name in TRUE]


def test_a_peak_at_the_start_may_be_a_dent_of_stiff_food() -> None:
    """The other start has the food's usual stiffness, and a cut that starts where the first force is largest, by the
    chord of a circle there and no easier than through the rind."""
    names = ("E", "R", "R_rind", "rind_thickness", "R_core", "core_ratio", "R_skin", "initiation_depth")
    parameters = fit_parameters(CUCUMBER, names)
    stroke = np.linspace(0.0, HEIGHT, 240)
    force = np.where(stroke < 11e-3, 50.0 * (stroke / 11e-3) ** 2, 12.0)
    *_, guess = layer_guesses(SCENE, parameters, stroke, force)
    found, top = parameters.to_dict(guess), float(stroke[stroke < 11e-3][-1])
    chord = 2.0 * np.sqrt(top * (HEIGHT - top))
    assert found["initiation_depth"] == pytest.approx(top)
    assert found["R_skin"] == pytest.approx(max(EDGE_PART * force.max() / chord, found["R_rind"]), rel=0.02)
    assert found["E"] == pytest.approx(CUCUMBER.properties["E"].value)


@pytest.mark.parametrize("names", [("E", "R", "R_skin"), ("E", "R_rind", "rind_thickness"), ("R", "R_rind")])
def test_there_is_no_guess_without_layers_to_fit(names: tuple[str, ...]) -> None:
    """A food without layers, or one whose flesh or size of layers is held, begins as it did."""
    assert layer_guesses(SCENE, fit_parameters(CUCUMBER, names), *made()) == ()


def test_a_whole_cucumber_is_through_before_its_stroke_ends() -> None:
    """The measured force falls to nothing 2 mm before the knife stops: that is the height. Peaks, dip and fall ask for
    a rind tougher than the flesh and a softer core."""
    request = Request(
        food=CUCUMBER,
        trace=data_file("franka_knife_cutting", "cucumber_large_cut1.csv"),
        air=data_file("franka_knife_cutting", "cucumber_session_large_air.csv"),
        knife="slicing",
    )
    setup = set_up(request)
    assert setup.curve.stroke_length_m == pytest.approx(0.0425, abs=3e-4) == setup.fine.food.shape.height
    assert any("edge is through" in text for text in setup.curve.warnings)
    guess, *_ = setup.objective.guesses
    found = setup.objective.parameters.to_dict(guess)
    assert found["R_rind"] > 2 * found["R"] > 4 * found["R_core"]
    assert 2e-3 < found["rind_thickness"] < 3.5e-3 and 0.4 < found["core_ratio"] < 0.65
