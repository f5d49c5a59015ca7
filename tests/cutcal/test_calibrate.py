"""One small calibration from the command line to the report, killed on the way and resumed."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from calib.calibration.result import from_document
from calib.material.food import load_material_file
from calib.simulation.process_pool import Pool
from calib.validation.metrics import compare
from cutcal.commands.calibration.calibrate import verdict_text
from cutcal.main import main
from tests.calib.documents import valid
from tests.data_dir import ROOT

TRACE = ROOT / "force_data" / "banana_reconstructed.csv"
# A coarse grid and two parameters: seconds a simulation, enough to pass through every stage.
SMALL = ["--food", "banana", "--trace", str(TRACE), "--fit", "E,R", "--dx", "5e-3", "--budget", "14"]
SMALL += ["--workers", "1"]  # a second one would compile the same kernels beside the other tests
pytestmark = pytest.mark.slow
PATIENCE_S = 400.0  # for the first stored runs, kernels compiled by two processes on a loaded machine included


def lines_of(journal: Path) -> list[bytes]:
    """Complete lines of a store's journal."""
    text = journal.read_bytes() if journal.exists() else b""
    return [line for line in text.splitlines(keepends=True) if line.strip()]


@pytest.fixture(scope="module")
def killed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[bytes]]:
    """An output folder whose calibration was killed with SIGKILL after three stored runs, and those runs."""
    out = tmp_path_factory.mktemp("calibration") / "run"
    command = [sys.executable, "-m", "cutcal.main", "calibrate", *SMALL, "--out", str(out)]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, cwd=ROOT, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    journal = out / "evaluations.h5.journal"
    deadline = time.monotonic() + PATIENCE_S
    while len(lines_of(journal)) < 4 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.2)
    assert process.poll() is None, "the calibration ended before it could be killed"
    process.send_signal(signal.SIGKILL)
    process.wait()
    return out, [line for line in lines_of(journal) if line.endswith(b"\n")]


@pytest.fixture(scope="module")
def finished(killed: tuple[Path, list[bytes]]) -> tuple[Path, int]:
    """The same folder after ``--resume``, and the exit code."""
    out, _ = killed
    return out, main(["calibrate", *SMALL, "--out", str(out), "--resume"])


def test_numerical_choices_are_checked(finished):
    """The best values run again at half the speed, elsewhere on the grid, on a finer one, and with the constants of the
    method halved and doubled, in lines of the verdict; resuming runs none."""
    out, _ = finished
    summary = json.loads((out / "summary.json").read_text())
    assert [c["name"] for c in summary["numerical_checks"]] == [
        "half the simulated speed",
        "grid and particles elsewhere",
        "cells of two thirds",
        "twice the process zone",
        "twice the bearing of the process zone",
        "half the slip of the edge",
        "twice the slip of the edge",
        "twice the contact stiffness",
        "half the band of the edge",
        "twice the band of the edge",
        "half the nodes that follow",
        "twice the nodes that follow",
        "half the least gap to a surface",
        "twice the least gap to a surface",
        "half the mass of the dampers",
        "twice the mass of the dampers",
        "half the friction of the board",
        "twice the friction of the board",
        "half the time step",
        "half the loss factor",
        "twice the loss factor",
        "blade half a cell aside",
    ]
    lines = {v["name"]: v["value"] for v in summary["verdicts"]}
    found = {}
    for one in summary["numerical_checks"]:
        assert one["reason"] is None
        found[one["name"]] = max(abs(one["peak_change"]), abs(one["work_change"]))
    speed, elsewhere, finer, *constants = found.items()
    assert lines[speed[0]] == 2 * speed[1]
    assert all(lines[name] == size for name, size in (elsewhere, finer))
    assert lines["constants of the method halved and doubled"] == max(size for _, size in constants)
    idle = [name for name in found if "least gap" in name]
    assert [found.pop(name) for name in idle] == [0, 0]  # no particle is squeezed flat
    assert all(0 < size < 0.2 for size in found.values())


def test_a_grid_that_counts_is_said_with_a_remedy(finished):
    """Under the failed line of the terminal stands what to do, and nothing under one that passed."""
    summary = json.loads((finished[0] / "summary.json").read_text())
    line = next(v for v in summary["verdicts"] if v["name"] == "cells of two thirds")
    for passed in (True, False):
        line["passed"] = passed
        text = verdict_text(from_document(summary, finished[0])).splitlines()
        place = next(k for k, words in enumerate(text) if line["name"] in words)
        assert ("--u-num" in text[place + 1]) == (not passed) and "".join(text).count("--u-num") == (not passed)


def test_kill_loses_nothing_and_resume_repeats_nothing(killed, finished):
    """What was stored before the kill is in the finished file unchanged, and no key is there twice."""
    _, before = killed
    with h5py.File(finished[0] / "evaluations.h5") as f:
        keys = [k.decode() for k in f["key"][()]]
    assert len(keys) == len(set(keys)) >= 8
    stored = [key for key in keys if any(key.encode() in line for line in before)]
    assert len(stored) >= 3


def test_second_run_costs_no_simulation(finished, capsys, monkeypatch):
    """Resuming a finished run simulates nothing, the record of the best values included, and prints one JSON
    document."""
    monkeypatch.setattr(Pool, "_submit", lambda self, work, *job: pytest.fail(f"{work.__name__} was asked for"))
    with h5py.File(finished[0] / "evaluations.h5") as f:
        before = f["key"][()].tolist()
    code = main(["calibrate", *SMALL, "--out", str(finished[0]), "--resume", "--json"])
    document = valid(json.loads(capsys.readouterr().out))
    with h5py.File(finished[0] / "evaluations.h5") as f:
        assert f["key"][()].tolist() == before
    assert code == finished[1] == (0 if document["passed"] else 2)


def test_summary_holds_the_contract(finished):
    """Every key that other programs call is there, and the headline figures follow from curves.csv."""
    s = json.loads((finished[0] / "summary.json").read_text())
    keys = """food trace_sha256 baseline_N baseline_sd_N onset_s peak_real_N peak_sim_N peak_error shape_error nrmse
    work_error sprague_geers iso18571 null_models parameters simulations failed_simulations wall_s dx_m particles
    momentum_residual versions git sensitivity""".split()
    assert not [k for k in keys if k not in s]
    assert all(set(rows) == set(s["parameters"]) for rows in s["sensitivity"].values())
    assert set(s["sensitivity"]) == {"peak", "work", "initial_slope"}
    assert set(s["parameters"]["R"]) >= {"value", "unit", "low95", "high95", "prior_low", "prior_high", "verdict"}
    c = pd.read_csv(finished[0] / "curves.csv")
    again = compare(c["stroke_m"].to_numpy(), c["real_N"].to_numpy(), c["sim_N"].to_numpy())
    assert s["nrmse"] == pytest.approx(again.nrmse, rel=1e-6)
    assert s["peak_error"] == pytest.approx(again.peak_error, abs=1e-6)  # parts of the peak; the file has seven digits
    assert s["momentum_residual"] < 1e-9
    np.testing.assert_allclose(c["edge_N"] + c["face_N"], c["sim_N"], atol=1e-6)


def test_fit_improves_on_the_literature(finished):
    """The calibrated curve is closer to the trace than the simulation at the literature's values."""
    c = pd.read_csv(finished[0] / "curves.csv")
    miss = {n: float(np.sqrt(np.mean((c[n] - c["real_N"]) ** 2))) for n in ("sim_N", "start_N")}
    assert miss["sim_N"] < miss["start_N"]


def test_material_file_loads_back(finished):
    """material.yaml is a food again, with the fitted values marked as fitted."""
    s = json.loads((finished[0] / "summary.json").read_text())
    food = load_material_file(finished[0] / "material.yaml")
    assert food.name == "banana"
    for name in ("E", "R"):
        assert food.value(name) == pytest.approx(s["parameters"][name]["value"])
        assert food.properties[name].status == "fitted"


def test_report_is_a_pdf_that_names_the_reconstruction(finished):
    """report.pdf and report.html were written, and summary and report call the trace reconstructed."""
    assert (finished[0] / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "Reconstructed trace, not a measurement" in (finished[0] / "report.html").read_text(encoding="utf-8")
    s = json.loads((finished[0] / "summary.json").read_text())
    assert s["trace"]["label"] == "reconstructed"
    assert any("reconstructed" in text for text in s["limits"])


def test_another_trace_is_not_mixed_in(finished, tmp_path, capsys):
    """Resuming with another trace is refused: the store belongs to the first."""
    other = tmp_path / "other.csv"
    frame = pd.read_csv(TRACE, comment="#")
    frame["force_N"] *= 1.1
    frame.to_csv(other, index=False)
    code = main(
        [
            "calibrate",
            "--food",
            "banana",
            "--trace",
            str(other),
            "--dx",
            "5e-3",
            "--out",
            str(finished[0]),
            "--resume",
        ]
    )
    assert code == 1
    assert "evaluations.h5" in capsys.readouterr().err
