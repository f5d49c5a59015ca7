"""The design of a test keeps its promise on foods of formulas, and says what it cannot judge."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.design.candidates import candidates, coarse_cut, minutes_of
from calib.design.linear import LinearTest, information, posterior
from calib.design.measurement import CutTest, compression_measurement, cut_measurement, pressed_stress
from calib.design.quantity import asked_quantity
from calib.design.result import DesignResult, read_design
from calib.design.run import DesignRequest, run
from calib.design.start import Start, start_of_food
from calib.design.stencil import CutScene, Simulator, stencils, steps_of
from calib.errors import MaterialError, OutputError
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.problem.food_parameters import fit_parameters
from calib.simulation.evaluation_store import EvaluationStore, Header
from mpm.scene.errors import CutcalError
from tests.calib.documents import valid
from tests.calib.made_food import MadeFood


@pytest.fixture(autouse=True)
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure takes longer than the rest: one test draws it."""
    if "a_cut_food" not in request.node.name:
        monkeypatch.setattr("reports.studies.design.write_figure", lambda result, out: None)


def quiet(text: str) -> None:
    """Nobody is told."""


@pytest.fixture(scope="module")
def start() -> Start:
    """A potato that nobody has cut."""
    return start_of_food(load_food("potato"), load_knife("kitchen"))


@pytest.fixture(scope="module")
def cut(start: Start) -> Start:
    """A potato that was cut, of unknown width."""
    sd = start.parameters.prior_sd / 2.0
    z = start.parameters.start
    ends = {
        p.name: (p.from_internal(a - 1.96 * b), p.from_internal(a + 1.96 * b))
        for p, a, b in zip(start.parameters, z, sd, strict=True)
    }
    return replace(start, run=Path("runs/x"), width_sd=0.1, reported=ends)


def designed(start: Start, out: Path, asked: str = "all", pool: MadeFood | None = None, **how: object) -> DesignResult:
    """The design of a food of formulas."""
    request = DesignRequest(start, asked, **how)  # type: ignore[arg-type]
    return run(request, out, pool or MadeFood(), resume=False, say=quiet)


def test_information_is_that_of_the_whole_covariance() -> None:
    """A gain that two tests share is learnt once: rows with it written out give the same."""
    random = np.random.default_rng(0)
    slopes, gains = random.standard_normal((2, 6, 3)), random.standard_normal((2, 6))
    tests = [LinearTest(j, 0.0 * j, {"gain": g}, np.zeros(6)) for j, g in zip(slopes, gains, strict=True)]
    wide = np.hstack([np.vstack(list(slopes)), np.concatenate(list(gains))[:, None]])
    whole = np.linalg.inv(wide.T @ wide + np.diag([0.0, 0.0, 0.0, 1.0]) + 1e-9 * np.eye(4))
    assert np.allclose(np.linalg.inv(information(tests)), whole[:3, :3], rtol=1e-5)


def test_a_repeat_with_the_same_model_error_says_nothing_new() -> None:
    """Where the model is all that errs, the same cut again teaches nothing; with its own error it counts twice."""
    slopes = np.random.default_rng(1).standard_normal((5, 2))
    one = LinearTest(slopes, 0.0 * slopes, {}, np.full(5, 0.99999), "same")
    alone = LinearTest(slopes, 0.0 * slopes, {}, np.full(5, 0.99999))
    first = information([one])
    assert np.allclose(information([one, one]), first, rtol=1e-4)
    assert np.allclose(information([alone, alone]), 2.0 * first)


def test_noise_of_the_runs_is_no_knowledge() -> None:
    """Slopes that are nothing but noise leave what is known on average as it was, and a posterior is never wider."""
    random = np.random.default_rng(2)
    found, naive = [], []
    for _ in range(200):
        noise, again = random.standard_normal((2, 50, 1))
        naive.append(information([LinearTest(noise, 0.0 * noise, {}, np.zeros(50))])[0, 0])
        found.append(information([LinearTest(noise, again, {}, np.zeros(50))])[0, 0])
    assert np.mean(naive) == pytest.approx(50.0, rel=0.1)
    assert abs(np.mean(found)) < 3.0
    assert posterior(np.eye(1), np.array([[-5.0]]))[0, 0] == pytest.approx(1.0)


def test_compressed_flesh_by_the_closed_form(start: Start) -> None:
    """Its slope is E and its plateau the yield stress at constant volume; both are learnt, but for the plates."""
    strain = np.linspace(0.0, 0.3, 301)
    stress = pressed_stress(1e6, 0.3, 1e5, strain)
    assert stress[1] / strain[1] == pytest.approx(1e6, rel=2e-3)
    assert stress[-1] == pytest.approx(1e5 / 0.7)
    assert stress.max() < pressed_stress(1e6, 0.3, np.inf, strain)[-1]
    prior = np.diag(start.parameters.prior_sd**2)
    after = posterior(prior, information([compression_measurement(start, start.parameters.start)]))
    known = dict(zip(start.parameters.names, np.sqrt(np.diag(after)), strict=True))
    assert 0.13 < known["yield_stress"] < 0.2
    assert known["R"] == pytest.approx(start.parameters["R"].prior_sd)


def test_correlated_samples_do_not_count_as_independent(start: Start, tmp_path: Path) -> None:
    """A scale of all forces is known to the model's error over the root of 20 lengths and a peak, not of 241."""
    with EvaluationStore(tmp_path / "e.h5", Header("", "")) as store:
        scene = next(c.scene for c in candidates(start)[0] if c.name == "cut")
        assert scene is not None
        z, steps = start.parameters.start, steps_of(start.parameters, start.parameters.prior_sd)
        simulator = Simulator(MadeFood(), store, quiet)
        about = stencils(simulator, {"cut": CutScene(scene)}, start.parameters, z, steps)
    exact = replace(start, sensor=replace(start.sensor, curve=0.0, tare=0.0, drift=0.0, lag=0.0, gain=0.0))
    test = cut_measurement(exact, about["cut"], CutTest("cut", scene.motion.stroke, 0.0))
    scale = replace(test, slopes=test.slopes @ start.parameters.stress_like()[:, None], feigned=np.zeros((241, 1)))
    known = information([scale])[0, 0] ** -0.5
    most = (20.0 / 0.03**2 + 1.0 / 0.02**2) ** -0.5  # if the force were at its peak all the way
    assert most < known < 1.5 * most
    assert known > 2.0 * 0.03 / np.sqrt(241.0)


def test_the_promise_is_kept_by_another_food(cut: Start, tmp_path: Path) -> None:
    """About the truth, which the design did not know, the recommended test leaves what was promised within 30 %."""
    promised = designed(cut, tmp_path / "design", "yield_stress", MadeFood(0.003))
    best = promised.tests[0]
    assert best.asked is not None and promised.recommended is not None
    truth = cut.parameters.to_dict(
        cut.parameters.start + 0.5 * cut.present_sd * np.resize([1.0, -1.0], len(cut.parameters))
    )
    kept = designed(replace(cut, parameters=cut.parameters.with_values(truth)), tmp_path / "truth", "yield_stress")
    found = next(t for t in kept.tests if t.name == best.name)
    assert found.asked is not None

    def width(one: DesignResult, high: float, low: float) -> float:
        return float(np.log(high / low))

    ratio = width(kept, found.asked.high95, found.asked.low95) / width(promised, best.asked.high95, best.asked.low95)
    assert 0.7 < ratio < 1.3


def test_the_design_of_a_cut_food(cut: Start, tmp_path: Path) -> None:
    """Each test leaves no more than there was; a measured width narrows what is only known times it; a document."""
    result = designed(cut, tmp_path / "out")
    names = {t.name for t in result.tests}
    assert {"blade edc", "narrower", "rack", "slicing", "compression", "width", "photograph"} <= names
    assert all(0.0 < p.part <= 1.0 for t in result.tests for p in t.parameters.values())
    by_name = {t.name: t for t in result.tests}
    assert by_name["width"].parameters["R"].part < 0.9
    assert by_name["width"].parameters["R"].part < by_name["photograph"].parameters["R"].part
    assert by_name["compression"].parameters["yield_stress"].part < 0.5
    assert [t.bits for t in result.tests] == sorted((t.bits for t in result.tests), reverse=True)
    assert "speed" in {one.name for one in result.left_out}
    document = json.loads((tmp_path / "out" / "design.json").read_text())
    assert valid(document, "design")["recommended"] == result.recommended
    assert read_design(tmp_path / "out").tests == result.tests
    assert b"<svg" in (tmp_path / "out" / "design.svg").read_bytes()


def test_a_rack_holds_nothing_whatever_the_board_would(cut: Start) -> None:
    """The specimen on it is not held down, a cut on the board is as firmly as the fit asks; where nobody asks how
    firmly, a rack is no test."""
    (rack,) = (t for t in candidates(cut)[0] if t.kind == "rack")
    assert rack.scene is not None and rack.same_model
    values = cut.parameters.to_dict(cut.parameters.start) | {"board_suction": 3e4}
    scene, left = CutScene(rack.scene).at(values)
    assert scene.suction == 0.0 and "board_suction" not in left
    on_board, left = CutScene(coarse_cut(cut, cut.knife, cut.shape), fitted=True).at(values)
    assert on_board.suction == 3e4 and "board_suction" not in left
    known = fit_parameters(cut.food, tuple(n for n in cut.parameters.names if n != "board_suction"))
    found, out = candidates(replace(cut, parameters=known, reported={}))
    assert "rack" not in {t.kind for t in found} and "rack" in {one.name for one in out}


def test_a_photograph_tells_the_shape(cut: Start, tmp_path: Path) -> None:
    """Where roundness is fitted, a photograph narrows it and calliper and compression don't; each needs a first cut."""
    names = (*cut.parameters.names, "roundness")
    form = replace(cut.shape, kind="half_barrel", roundness=0.5)
    round_one = replace(cut, shape=form, parameters=fit_parameters(cut.food, names), width_sd=0.0, reported={})
    result = designed(round_one, tmp_path / "out")
    (photo,) = (t for t in result.tests if t.kind == "photograph")
    assert photo.what.endswith("for its width and shape")
    assert photo.parameters["roundness"].part < 0.3
    assert next(t for t in result.tests if t.kind == "compression").parameters["roundness"].part > 0.99
    known = designed(replace(cut, width_sd=0.0), tmp_path / "known")
    assert "photograph" in {one.name for one in known.left_out}


def test_asked_for_a_peak_under_another_knife(start: Start, tmp_path: Path) -> None:
    """The cut with that very knife is the best test of its peak, and its own error bounds what is known after."""
    result = designed(start, tmp_path / "out", "peak under knife edc", blades=(load_knife("edc"),))
    assert result.quantity is not None and result.quantity.unit == "N"
    best = result.tests[0]
    assert best.name == "blade edc" and best.asked is not None and best.asked.part < 0.3
    assert best.asked.low95 < result.quantity.value < best.asked.high95


def test_several_foods_are_averaged(start: Start, tmp_path: Path) -> None:
    """Draws from what is known are judged beside the present values; what is known stays about these."""
    one, two, again = (
        designed(start, tmp_path / name, "R", blades=(), draws=draws, seed=seed)
        for name, draws, seed in (("one", 1, 0), ("two", 2, 0), ("again", 2, 1))
    )
    parts = [next(t for t in r.tests if t.name == "cut").parameters["mu"].part for r in (one, two, again)]
    assert len(set(parts)) == 3
    assert {t.draws for t in two.tests} == {2} and two.simulations > one.simulations
    assert two.known["R"].value == one.known["R"].value


def test_a_cut_that_breaks_down_is_left_out_and_nothing_is_run_twice(cut: Start, tmp_path: Path) -> None:
    """The other tests are judged; with resume no cut is made again; the first cut must be one."""
    pool = MadeFood(breaks=lambda scene, values: scene.motion.slice_ratio > 0.0)
    result = designed(cut, tmp_path / "out", "R", pool)
    assert {one.name: one.reason for one in result.left_out}[
        "slicing"
    ] == "it breaks down at 50% of its stroke (inverted)"
    assert "slicing" not in {t.name for t in result.tests}
    again = MadeFood(breaks=pool.breaks)
    run(DesignRequest(cut, "R"), tmp_path / "out", again, resume=True, say=quiet)
    assert again.runs < pool.runs / 2  # those that broke down are tried again
    with pytest.raises(OutputError, match="no test can be judged"):
        designed(cut, tmp_path / "broken", "R", MadeFood(breaks=lambda scene, values: True))


def test_what_is_wrong_is_said(start: Start, cut: Start) -> None:
    """Unknown parameters, tests and knives; a start without a calibration has no width to measure."""
    with pytest.raises(MaterialError, match="no such parameter.*known: E"):
        asked_quantity(start, "F")
    with pytest.raises(CutcalError, match="unknown knife"):
        asked_quantity(start, "peak under knife spoon")
    with pytest.raises(CutcalError, match="no such test, did you mean 'blade'"):
        minutes_of({"blad": 1.0})
    assert minutes_of({"blade": 1.0})["blade"] == 1.0
    tests, left_out = candidates(start)
    assert {"width", "photograph"} <= {one.name for one in left_out}
    assert tests[0].name == "cut"
    measured = replace(cut, width_sd=0.0)
    assert "width" not in {t.name for t in candidates(measured)[0]}
