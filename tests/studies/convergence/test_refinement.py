"""``cutcal converge``: a small study end to end, its contract, what is stored, what is refused."""

from __future__ import annotations

import json

import pandas as pd
import pytest

from calib.simulation.evaluation import Evaluation
from calib.validation.method_constants import CONSTANTS
from cutcal.main import main
from tests.calib.documents import valid

SMALL = ["converge", "--food", "banana", "--stroke", "4e-3", "--repeats", "1", "--dx", "6e-3,4.5e-3", "--mach", "0.02"]
SMALL += ["--numerics", "--workers", "1"]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study of two coarse grids, a second speed and other constants; returns its folder and exit code."""
    out = tmp_path_factory.mktemp("study")
    return out, main([*SMALL, "--out", str(out)])


def test_study_writes_what_it_promises(study):
    """converge.json has the contract's fields, curves.csv a curve for each grid and the uncertainty."""
    out, code = study
    document = valid(json.loads((out / "converge.json").read_text()))
    assert code == (0 if document["converged"] else 2)
    assert [g["dx_m"] for g in document["grids"]] == [6e-3, 4.5e-3]
    for grid in document["grids"]:
        assert {"peak_N", "work_J", "wall_s", "particles", "steps", "status"} <= set(grid)
        assert grid["status"] == "ok"
        assert grid["momentum_residual"] < 1e-10
    assert {"order", "gci_peak", "gci_work", "verdict"} <= set(document)
    assert document["verdict"] == "two grids"
    assert [row["mach"] for row in document["mach"]["rows"]] == [0.01, 0.02]
    curves = pd.read_csv(out / "curves.csv")
    assert list(curves) == ["stroke_m", "force_dx_0.006_N", "force_dx_0.0045_N", "u_num_N", "u_num_coarsest_N"]
    assert (0 <= curves["u_num_N"]).all() and (curves["u_num_N"] <= curves["u_num_coarsest_N"] + 1e-12).all()
    (own, other) = document["repeat"]["rows"]
    assert own["repeat"] == 0
    assert own["work_J"] == document["grids"][0]["work_J"]  # of two grids on the coarser one
    assert other["work_J"] != own["work_J"]
    assert document["repeat_sd_work_J"] == pytest.approx(abs(own["work_J"] - other["work_J"]) / 2**0.5, rel=1e-9)
    assert (out / "converge.svg").read_bytes().startswith(b"<?xml")


def test_resume_simulates_nothing_twice(study, capsys):
    """The same command with --resume finds all runs; without it the folder is never overwritten."""
    out, code = study
    assert main([*SMALL, "--out", str(out)]) == 1
    assert "--resume" in capsys.readouterr().err
    before = json.loads((out / "converge.json").read_text())["grids"]
    assert main([*SMALL, "--out", str(out), "--resume"]) == code
    err = capsys.readouterr().err
    assert "23 of 23 runs are known already" in err
    assert "left" not in err
    assert json.loads((out / "converge.json").read_text())["grids"] == before


def test_a_food_that_is_pressed_away_is_said_to_be(study, capsys, monkeypatch):
    """A study whose edge took too little of R times the new area says so on the terminal,
    in its document and its report.
    """
    out, code = study
    assert json.loads((out / "converge.json").read_text())["grids"][0]["parted"] is None  # too short a stroke to judge
    monkeypatch.setattr(Evaluation, "parted", property(lambda self: 0.4))
    assert main([*SMALL, "--out", str(out), "--resume"]) == code
    assert "the food was pressed away rather than cut: the edge took 40% of R" in capsys.readouterr().err
    document = valid(json.loads((out / "converge.json").read_text()))
    assert [text for text in document["warnings"] if text.startswith("the food was pressed away")]


def test_a_study_varies_every_constant_of_the_method(study, capsys):
    """Each has rows with the run of the coarsest grid among them, and a line on the terminal; values that are asked for
    take the place of half the speed."""
    out, code = study
    document = json.loads((out / "converge.json").read_text())
    zone = document["constants"]["zone"]
    assert zone["rows"][0] == {k: v for k, v in document["grids"][0].items() if k != "dx_m"} | {"value": 8e-3}
    assert [row["value"] for row in zone["rows"]] == [8e-3, 16e-3] and zone["spread_work"] > 1e-3
    # an axis; of foods without strength, with a sharp crack, with layers
    unused = {"safety", "cohesive_zone", "crack_ties", "layer_rows", "board_suction"}
    varied = {c.key for c in CONSTANTS} - unused
    assert set(document["constants"]) == varied
    assert [row["mach"] for row in document["mach"]["rows"]] == [0.01, 0.02]
    assert [row["safety"] for row in document["safety"]["rows"]] == [0.35, 0.7]
    assert [row["offset"] for row in document["offset"]["rows"]] == [0.0, 0.5]
    assert main([*SMALL, "--out", str(out), "--resume"]) == code
    said = capsys.readouterr().out
    assert all(f"  {c.name}: work within " in said for c in CONSTANTS if c.key in varied)


@pytest.mark.parametrize(
    ("options", "word"),
    [(["--dx", "3e-3"], "at least two cell sizes"), (["--dx", "3e-3,3e-3"], "different"), (["--dx", "3"], "0.02")],
)
def test_bad_grids_are_one_clear_error(options, word, capsys, tmp_path):
    """One cell size, the same one twice, or millimetres are refused before anything runs."""
    try:
        code = main(["converge", "--food", "banana", "--out", str(tmp_path / "x"), *options])
    except SystemExit as e:
        code = e.code
    assert code != 0
    assert word in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
