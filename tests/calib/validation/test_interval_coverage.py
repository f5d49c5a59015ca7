"""The study of coverage: what it makes up, what it counts, and that an interruption costs nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cutcal.commands.calibration.coverage
from calib.material.food import FoodSpec
from calib.posterior.sampling import Effort
from calib.posterior.waves import Plan
from calib.trace.conditioning import condition
from calib.trace.trace import read_trace
from calib.validation.interval_coverage import MadeUpSensor, coverage_of
from cutcal.main import main
from tests.calib.documents import valid
from tests.calib.multi_specimen.test_run import FakePool

STROKE = np.linspace(0.0, 0.033, 300)[1:]
FITTED = ("E", "R", "R_skin")
"""What the analytic simulator knows of a food."""
WAVES = Plan(64, 16, 4, 6, Effort(40, 8, 1.0), Effort(80, 8, 0.5), waves=4)
"""Enough for them."""


@pytest.fixture
def analytic(monkeypatch: pytest.MonkeyPatch) -> None:
    """The analytic simulator, and what it knows of a food is fitted."""
    monkeypatch.setattr(cutcal.commands.calibration.coverage, "workers_of", lambda args, say: FakePool())
    monkeypatch.setattr(FoodSpec, "default_fit", FITTED)


def row(value: float, low: float, high: float, verdict: str = "identified") -> dict[str, Any]:
    """One calibrated trace whose truth is R = 100."""
    found = {"value": value, "low95": low, "high95": high, "verdict": verdict}
    return {"truth": {"R": 100.0}, "parameters": {"R": found}, "inside": 1.0, "simulations": 9, "coarse_simulations": 9}


def test_a_made_up_record_is_what_it_says(tmp_path: Path) -> None:
    """Baseline, contact and peak of a noiseless record come back; gain and drift are where they were put."""
    sensor = MadeUpSensor(drift_sd=0.0, gain_sd=0.0, noise=0.01, ripple=0.0)
    force = 12.0 * np.sin(np.pi * np.minimum(STROKE / 0.04, 1.0))
    path = tmp_path / "trace.csv"
    sensor.measure(STROKE, force, np.random.default_rng(0)).to_csv(path, index=False)
    cut = condition(read_trace(path))
    assert cut.baseline_N == pytest.approx(25.0, abs=0.01) and cut.onset_s == pytest.approx(1.0, abs=0.02)
    assert cut.peak_N == pytest.approx(12.0, rel=0.01) and cut.stroke_length_m == pytest.approx(0.033, abs=1e-3)
    strong = MadeUpSensor(drift_sd=0.0, gain_sd=0.5, noise=0.0, ripple=0.0)
    one, two = (strong.measure(STROKE, force, np.random.default_rng(k))["force_N"] - 25.0 for k in (1, 2))
    assert np.ptp(one) / np.ptp(two) != pytest.approx(1.0, rel=0.05)


def test_coverage_is_counted_where_it_is_claimed() -> None:
    """25 identified intervals of which 24 hold the truth, 5 weak ones that do not: 96 % and 80 %, median error 4 %."""
    rows = [row(104.0, 90.0, 110.0)] * 24 + [row(130.0, 120.0, 140.0)] + [row(50.0, 40.0, 60.0, "weak")] * 5
    found = coverage_of(rows)
    r = found["parameters"]["R"]
    assert r["covered_identified"] == 0.96 and r["covered"] == 0.8 and r["identified"] == 25
    assert r["median_error_identified"] == pytest.approx(0.04) and r["verdicts"] == {"identified": 25, "weak": 5}
    assert found["passed"]


@pytest.mark.parametrize(
    "rows",
    [
        [row(104.0, 90.0, 110.0)] * 22 + [row(130.0, 120.0, 140.0)] * 3,
        [row(115.0, 90.0, 130.0)] * 25,
        [row(104.0, 90.0, 110.0)] * 10,
        [row(104.0, 90.0, 110.0)] * 100,
        [row(104.0, 90.0, 110.0)] * 25 + [{"error": "no contact"}],
    ],
    ids=[
        "intervals too narrow",
        "median too far off",
        "too few to tell",
        "too wide: all of a hundred",
        "one not calibrated",
    ],
)
def test_it_does_not_pass_by_chance(rows: list[dict[str, Any]]) -> None:
    """88 % coverage, a median error of 15 %, ten intervals, all of a hundred, a trace that was lost: none passes."""
    assert not coverage_of(rows)["passed"]


@pytest.mark.long
def test_the_study_goes_on_where_it_stopped(analytic: None, tmp_path: Path) -> None:
    """Two traces on the analytic simulator; a torn last line is done again from the store, the other is not touched."""
    out = tmp_path / "out"
    command = ["coverage", "--food", "banana", "--traces", "2", "--out", str(out)]
    assert main(command) in (0, 2)
    lines = (out / "coverage.jsonl").read_text().splitlines()
    first = valid(json.loads((out / "coverage.json").read_text()))
    assert len(lines) == 2 and first["calibrated"] == 2
    assert set(first["parameters"]) == set(json.loads(lines[0])["truth"]) == set(FITTED)
    (out / "coverage.jsonl").write_text(lines[0] + "\n" + lines[1][:50])
    before = FakePool.runs
    assert main([*command, "--resume"]) in (0, 2)
    assert FakePool.runs == before
    assert json.loads((out / "coverage.json").read_text())["parameters"] == first["parameters"]
    assert (out / "coverage.jsonl").read_text().splitlines()[-1] == lines[-1]


@pytest.mark.slow
def test_a_study_can_sample_each_posterior(analytic: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One trace on the analytic simulator: the intervals hold the truth, and the waves' runs are counted."""
    monkeypatch.setattr("calib.posterior.posterior.Plan", lambda: WAVES)
    out = tmp_path / "out"
    main(["coverage", "--food", "banana", "--traces", "1", "--sample", "--out", str(out)])
    (row,) = (json.loads(line) for line in (out / "coverage.jsonl").read_text().splitlines())
    held = [p["low95"] <= row["truth"][name] <= p["high95"] for name, p in row["parameters"].items()]
    assert all(held)
    assert row["coarse_simulations"] >= WAVES.first + WAVES.later and row["simulations"] >= WAVES.pairs + WAVES.judges
    assert (row["coarse_simulations"] - WAVES.first) % WAVES.later == 0  # whole waves, which a search has not
