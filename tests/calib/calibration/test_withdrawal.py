"""A calibration of both ways of the blade, from the record to the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calib.calibration.description import description
from calib.calibration.result import CalibrationResult, read_result
from calib.calibration.run import run
from calib.errors import MaterialError, OutputError, TraceError
from calib.material.food import load_food
from calib.material.scene import Sizing
from calib.problem.food_parameters import sticking
from calib.problem.request import Request
from calib.problem.setup import set_up
from calib.problem.withdrawal import BothWays
from calib.trace.trace import Trace
from calib.validation.not_shown import not_simulated
from cutcal.main import main
from tests.calib.cheap import LOG, CheapPool
from tests.calib.cheap import cut as cheap_cut

FITTED = ("E", "R", "mu", "adhesion_energy")
TRUTH = {"E": 2e5, "R": 260.0, "mu": 0.5, "adhesion_energy": 2.0}
HEIGHT, STROKE, SPEED, RATE = 0.03, 0.027, 0.02, 200.0


def request_of(trace: Trace) -> Request:
    """A banana of known size, both ways."""
    return Request(load_food("banana"), trace, sizing=Sizing(height=HEIGHT, width=HEIGHT), fit=FITTED, dx=4.1e-3,
                   budget=40, withdrawal=True)  # fmt: skip


def made(pulls: float = 1.0, truth: Mapping[str, float] = TRUTH) -> Trace:
    """What the formula gives of the truth, at 20 mm/s, from 10 mm above the food until the edge is out of it.

    Args:
        pulls: Factor on the force of the way up.
        truth: Its values [SI].
    """
    blank = Trace(np.arange(600) / RATE, np.zeros(600), None, "cut.csv", "", {"force": "F", "time": "t"}, "measured")
    ramp = np.clip(np.arange(600) / RATE * SPEED - 0.01, 0.0, STROKE)
    still = replace(blank, force=10.0 * ramp / STROKE, position=0.1 - ramp)
    scene = set_up(replace(request_of(still), withdrawal=False, fit=("E", "R"))).scene({})
    food, _ = sticking(load_food("banana"))
    motion = replace(scene.motion, stroke=STROKE, retract=STROKE)
    scene = replace(scene.with_material(adhesion=food.value("adhesion"), **truth), motion=motion)
    record = cheap_cut(scene)
    time = np.arange(0.0, (0.01 + 2 * STROKE) / SPEED, 1 / RATE)
    path = time * SPEED - 0.01
    force = np.interp(path, record.time, record.resolved, left=0.0) * np.where(path > STROKE, pulls, 1.0)
    height = np.where(path <= STROKE, path, 2 * STROKE - path)
    noise = 0.01 * np.random.default_rng(5).normal(size=len(time))
    return Trace(time, force + noise, 0.1 - height, "cut.csv", "", {"force": "F", "time": "t"}, "measured")


@pytest.fixture(scope="module")
def done(tmp_path_factory) -> CalibrationResult:
    """A calibration of both ways, with a formula in place of the solver."""
    folder = tmp_path_factory.mktemp("both")
    with pytest.MonkeyPatch.context() as patch, CheapPool(2) as pool:
        patch.setenv(LOG, str(folder / "runs.log"))
        run(request_of(made()), folder / "out", pool)
    return read_result(folder / "out")


def test_both_ways_are_fitted_and_told(done):
    """The values are found, friction and adhesion too, which only the way up has; the pull is among the curves, and its
    own tare is kept apart from that of the cut."""
    for name, value in TRUTH.items():
        assert done.fitted[name].value == pytest.approx(value, rel=0.2)
        assert done.fitted[name].low95 < value < done.fitted[name].high95
    up = done.withdrawal
    assert done.material.properties["adhesion"].status == "assumed"  # and not given by anybody
    assert up is not None and up.nrmse < 0.05 and up.to_m == pytest.approx(STROKE, abs=3e-4)
    assert up.peak_sim_N == pytest.approx(up.peak_real_N, rel=0.05)
    assert up.work_sim_J == pytest.approx(up.work_real_J, rel=0.05) and up.predictive_inside > 0.9
    assert set(up.nuisances) == {"tare", "gain"}
    assert up.nuisances["tare"].prior_sd > done.nuisances["tare"].prior_sd
    pull = done.withdrawal_curves
    np.testing.assert_allclose(pull["sim_N"] - pull["real_N"], pull["residual_N"], atol=1e-6)
    assert pull["real_N"].max() == pytest.approx(up.peak_real_N, rel=1e-6)
    assert done.curves["stroke_m"].iloc[-1] == pytest.approx(STROKE, abs=3e-4)
    line = done.verdicts[2]  # below that of the cut's curve
    assert line.name == "curve error of the withdrawal (NRMSE)"
    assert line.passed and line.value == up.nrmse and 0.08 < line.limit < 0.5


def test_friction_adhesion_and_resistance_are_told_apart_by_evidence(done):
    """The made-up cut has all three: without any of them the least chi-square rises by more than the criterion asks.
    The runs are those of the fit, and counted."""
    found, asked = done.withdrawal.without, BothWays.of(set_up(request_of(made())))
    assert list(found) == ["R", "mu", "adhesion_energy"]
    for name, one in found.items():
        assert one.value == asked.objective.parameters[name].low
        assert one.evidence == pytest.approx(one.chi_square - one.whole - np.log(asked.objective.effective_rows))
        assert one.evidence > 2.0 and one.whole < 10.0


def test_what_a_cut_does_not_have_has_no_evidence(tmp_path: Path, monkeypatch):
    """A made-up cut of a food that does not stick."""
    monkeypatch.setenv(LOG, str(tmp_path / "runs.log"))
    dry = made(truth=TRUTH | {"adhesion_energy": 1e-3})
    with CheapPool(2) as pool:
        found = run(request_of(dry), tmp_path / "out", pool).withdrawal.without
    assert found["adhesion_energy"].evidence < 0.0 < 2.0 < found["mu"].evidence


def test_the_report_shows_both_ways(done):
    """Page and PDF have the pull; members are shown by their way down; nothing says that adhesion was left out."""
    page = (done.folder / "report.html").read_text(encoding="utf-8")
    assert "The withdrawal of the blade" in page and "Largest pull" in page
    assert (done.folder / "report.pdf").stat().st_size > 50_000
    assert any("Not simulated: relaxation and moisture" in text for text in done.limits)
    assert any("nobody has measured how banana sticks" in text.lower() for text in done.limits)
    assert not_simulated(load_food("banana")).startswith("The laws are independent of rate. Not simulated: relaxation,")


def test_a_pull_that_no_food_has_fails(tmp_path: Path, monkeypatch):
    """Five times the pull, beyond what friction and adhesion may be: the line of the way up fails, not that of the
    cut."""
    monkeypatch.setenv(LOG, str(tmp_path / "runs.log"))
    with CheapPool(2) as pool:
        found = run(replace(request_of(made(25.0)), fit=("E", "R")), tmp_path / "out", pool)
    lines = {v.name: v.passed for v in found.verdicts}
    assert lines["curve error of the withdrawal (NRMSE)"] is False and not found.passed


def test_what_is_read_is_said_before():
    """--check names the way that would be compared, and what is assumed of adhesion; a given one is left as it is."""
    text = description(request_of(made()))
    assert "withdrawal  from 2 to 26" in text and "adhesion_energy is sought from 0.1 to 10 J/m^2" in text
    held = set_up(replace(request_of(made()), fit=("E", "R", "mu")))
    assert held.request.food.value("adhesion") is None  # nobody asked for it
    given = load_food("banana").with_values({"adhesion": 2e3, "adhesion_energy": 0.5})
    assert sticking(given) == (given, ())


def test_a_way_up_that_cannot_be_compared_is_refused(tmp_path: Path, capsys):
    """No position, a sensor with a low-pass, and options that do not go with it: one sentence each."""
    trace = made()
    with pytest.raises(TraceError, match="needs the knife's position"):
        BothWays.of(set_up(replace(request_of(replace(trace, position=None)), speed=SPEED, t_end=1.85)))
    with pytest.raises(TraceError, match="low-pass of 20 Hz.*leave --withdrawal out"):
        BothWays.of(set_up(replace(request_of(trace), bandwidth=20.0)))
    pd.DataFrame({"t": trace.time, "F": trace.force, "z": trace.position}).to_csv(tmp_path / "cut.csv", index=False)
    with pytest.raises(MaterialError, match="--sample beside --withdrawal"), CheapPool(1) as pool:
        run(replace(request_of(trace), sample=True), tmp_path / "out", pool)
    base = ["calibrate", "--food", "banana", "--trace", str(tmp_path / "cut.csv"), "--withdrawal"]
    for more, said in ((["--sample"], "--sample beside --withdrawal"), (["--all"], "--withdrawal is for one trace")):
        assert main([*base, *more]) == 1
        assert said in capsys.readouterr().err


def test_a_calibration_of_one_way_has_no_pull(tmp_path: Path, done):
    """The document of another calibration has no such part, and its curve of the way up says what to do."""
    alone = replace(done, withdrawal=None)
    assert "withdrawal" not in alone.summary
    with pytest.raises(OutputError, match="calibrate with withdrawal=True"):
        _ = alone.withdrawal_curves
