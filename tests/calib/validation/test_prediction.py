"""``cutcal predict``: a cut that was not fitted, with and without the one factor for its width."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calib.io.folder import finite
from calib.material.food import load_food
from calib.material.food_file import dump_material
from calib.validation.prediction import held_out, read_prediction, to_document
from cutcal.main import main
from mpm.solver import Simulation
from tests.calib.documents import valid

TRACE = ["--trace", "force_data/banana_reconstructed.csv", "--dx", "6e-3"]


@pytest.fixture(scope="module")
def material(tmp_path_factory):
    """The banana of the literature as if it had been calibrated."""
    path = tmp_path_factory.mktemp("material") / "material.yaml"
    dump_material(load_food("banana"), path, {"trace": "another"})
    return str(path)


def test_prediction_takes_one_number_from_the_trace(material, tmp_path, capsys):
    """The width scales the curve by the factor that brings it closest; without it nothing is taken from the trace."""
    code = {}
    for name, extra in (("bare", []), ("scaled", ["--scale-width"])):
        command = ["predict", "--food", "banana", "--material", material, *TRACE, *extra, "--out", str(tmp_path / name)]
        code[name] = main(command)
    bare, scaled = (valid(json.loads((tmp_path / n / "summary.json").read_text())) for n in ("bare", "scaled"))
    a, b = (pd.read_csv(tmp_path / n / "curves.csv") for n in ("bare", "scaled"))
    k = scaled["width_scale"]
    assert bare["held_out"] and bare["width_scale"] is None
    assert bare["metrics"] == bare["unscaled"] == scaled["unscaled"]
    np.testing.assert_allclose(b["sim_N"], k * a["sim_N"], rtol=1e-6, atol=1e-9)
    assert scaled["width_m"] == pytest.approx(k * bare["width_m"])
    assert scaled["metrics"]["best_scale"] == pytest.approx(1.0)
    assert scaled["metrics"]["nrmse"] <= bare["metrics"]["nrmse"]
    for name, s in (("bare", bare), ("scaled", scaled)):
        assert s["passed"] == (s["metrics"]["nrmse"] <= 0.10 and s["metrics"]["iso18571"]["R"] >= 0.80)
        assert code[name] == (0 if s["passed"] else 2)
        result = read_prediction(tmp_path / name)
        assert finite(to_document(result)) == s and result.metrics.nrmse == s["metrics"]["nrmse"]
    assert "one factor" in capsys.readouterr().out


def test_a_prediction_goes_through_the_sensors_low_pass(material, tmp_path):
    """Behind a slow filter the predicted force varies less, and its parts differ; the trace is what it was."""
    curves = []
    for name, extra in (("bare", []), ("filtered", ["--bandwidth", "2Hz"])):
        main(["predict", "--food", "banana", "--material", material, *TRACE, *extra, "--out", str(tmp_path / name)])
        curves.append(pd.read_csv(tmp_path / name / "curves.csv"))
    bare, filtered = curves
    np.testing.assert_array_equal(filtered["real_N"], bare["real_N"])
    assert filtered["sim_N"].diff().abs().sum() < 0.98 * bare["sim_N"].diff().abs().sum()
    for column in ("edge_N", "face_N"):
        assert (filtered[column] - bare[column]).abs().max() > 0.005 * bare[column].abs().max()


def test_a_trace_that_was_fitted_is_not_held_out(tmp_path, capsys):
    """Values fitted to the very trace, by its SHA-256: in-sample, in the document and in words."""
    path, out = tmp_path / "material.yaml", tmp_path / "out"
    sha256 = hashlib.sha256(Path(TRACE[1]).read_bytes()).hexdigest()
    dump_material(load_food("banana"), path, {"trace_sha256": sha256})
    main(["predict", "--food", "banana", "--material", str(path), *TRACE, "--out", str(out)])
    summary = valid(json.loads((out / "summary.json").read_text()))
    assert summary["held_out"] is False and any("in-sample" in text for text in summary["warnings"])
    said = capsys.readouterr().out
    assert "in-sample, fitted to this trace" in said and "predicted without fitting" not in said


@pytest.mark.parametrize(
    ("provenance", "unseen"),
    [
        ({"trace_sha256": "a"}, False),
        ({"traces": {"cut1": "b", "cut2": "a"}}, False),
        ({"trace_sha256": "b", "trace": "measured"}, True),
        ({"traces": {"cut1": "b"}}, True),
        (None, True),
    ],
    ids=["one trace", "a study", "another trace", "another study", "never fitted"],
)
def test_in_sample_is_told_by_hash(provenance, unseen):
    """The trace that was fitted, and each one of a study that was, is known again."""
    assert held_out(replace(load_food("banana"), calibration=provenance), "a") is unseen


def test_a_void_phase_is_said_beside_the_rating(material, tmp_path, capsys, monkeypatch):
    """Where the phase search ends at its bound, R is printed with what it is without its phase, which decides
    nothing."""
    monkeypatch.setattr("calib.validation.metrics._best_shift", lambda r, m, most: most)
    main(["predict", "--food", "banana", "--material", material, *TRACE, "--out", str(tmp_path / "x")])
    summary = valid(json.loads((tmp_path / "x" / "summary.json").read_text()))
    rating = summary["metrics"]["iso18571"]
    assert f"without it the ISO rating is {rating['without_phase']:.3f}" in capsys.readouterr().out
    assert rating["R"] < 0.8 < rating["without_phase"] and not summary["passed"]


def test_prediction_needs_a_calibrated_food(capsys, tmp_path):
    """Without --material there is nothing that was calibrated: one error, nothing written."""
    assert main(["predict", "--food", "banana", *TRACE, "--out", str(tmp_path / "x")]) == 1
    assert "--material" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


def test_run_that_breaks_down_is_an_error_and_not_a_prediction(material, tmp_path, capsys, monkeypatch):
    """A run that ends early is one error with its reason and the part that was done; nothing is compared. Of a food
    that is higher than the stroke half a cell more is cut."""
    whole, strokes = Simulation.run, []

    def broken(simulation):
        strokes.append(simulation.scene.motion.stroke)
        return replace(whole(simulation), status="not_finite", fraction=0.4)

    monkeypatch.setattr(Simulation, "run", broken)
    command = ["predict", "--food", "banana", "--material", material, *TRACE, "--out", str(tmp_path / "x")]
    assert main(command) == 1
    assert "broke down at 40% of its stroke (not_finite)" in capsys.readouterr().err
    assert not (tmp_path / "x" / "summary.json").exists()
    for cell in ("6e-3", "5e-3"):
        higher = [*command, "--height", "0.04", "--speed", "0.015", "--dx", cell]
        assert main([*higher, "--out", str(tmp_path / cell)]) == 1
    assert strokes == pytest.approx([0.033, strokes[1], strokes[1] - 5e-4])
