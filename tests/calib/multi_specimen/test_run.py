"""A study from its file to its results, with an analytic simulator in place of the particles."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest

import cutcal.commands.calibration.calibrate
from calib import Study
from calib.errors import DocumentError
from calib.io.folder import finite
from calib.io.typed_document import to_document
from calib.material.food import load_material_file
from calib.material.scene import of_specimen
from calib.multi_specimen.result import read_result
from calib.simulation.evaluation import Evaluation
from calib.simulation.workers import Errand, Workers
from cutcal.main import main
from mpm.output.section import Section
from mpm.scene import Scene
from reports.base.run_folder import read_section
from tests.calib.cheap import cut
from tests.calib.documents import valid

FLESH = {"E": 4e5, "R": 420.0}
SPECIMENS = {"a": (300.0, 0.030), "b": (700.0, 0.024), "c": (450.0, 0.034)}
"""Line force of the skin [N/m] and width [m] of each made-up specimen of 33 mm."""
HEIGHT = 0.033


def force(stroke: np.ndarray, height: float, width: float, p: Mapping[str, float]) -> np.ndarray:
    """A cut [N]: a skin that is pierced, flesh that is parted, faces that are pressed."""
    x = stroke / height
    skin = p["R_skin"] * np.exp(-(((x - 0.12) / 0.05) ** 2))
    flesh = p["R"] * (1.0 - np.exp(-x / 0.06))
    faces = 6e-4 * p["E"] * np.minimum(x / 0.5, 1.0)
    return width * (skin + flesh + faces)


class FakePool(Workers):
    """A pool without processes: the analytic cut at each scene's size, with its material where nothing is fitted."""

    runs = 0
    balances: ClassVar = {"momentum_residual": 1e-12, "ke_over_ie": 0.001}

    def __init__(self) -> None:
        super().__init__(2, "cpu", 1)

    def close(self) -> None:
        """Nothing to end."""

    def errands(self, errands: Sequence[Errand]) -> None:
        """A cut each, or its record with a look at a food of one particle [mm]."""
        for errand in errands:
            if errand.whole:
                FakePool.runs += 1
                mm = np.full((1, 1), 1e-3)
                errand.keep(replace(cut(errand.scene), section=Section(mm[0], -mm, mm, mm, np.vstack([mm, mm]), True)))
            else:
                errand.keep(next(self.run([(errand.scene, {})])))

    def each(self, work: Any, jobs: Any) -> Any:
        """A study asks for runs alone; anything else would need a process."""
        raise AssertionError(f"{work} was asked of a pool without processes")

    def run(self, jobs: Sequence[tuple[Scene, Mapping[str, float]]]) -> Iterator[Evaluation]:
        """Each cut at once, with half a per cent of repeatable waviness."""
        for index, (scene, values) in enumerate(jobs):
            FakePool.runs += 1
            shape, material = scene.food.shape, scene.food.material
            p = {n: getattr(material, n) for n in ("E", "R", "R_skin")} | dict(values)
            stroke = np.linspace(0.0, scene.motion.stroke, 400)[1:]
            wave = 1.0 + 0.005 * np.sin(40.0 * stroke / shape.height + p["E"] / 1e4)
            curve = force(stroke, shape.height, shape.width, p) * wave
            scalars = {
                "peak_N": float(curve.max()),
                "work_J": float(np.trapezoid(curve, stroke)),
                "unbooked_J": 0.0,
                **FakePool.balances,
            }
            yield Evaluation(index, dict(values), "ok", "", 1.0, stroke, curve, scalars, 0.01)


@pytest.fixture(autouse=True)
def fake_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    """No particles in this file, and no report but that of ``finished``."""
    monkeypatch.setattr(cutcal.commands.calibration.calibrate, "workers_of", lambda args, say: FakePool())
    monkeypatch.setattr("reports.multi_specimen.report.write_report", lambda out, meanings, cited: None)


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Three traces of one flesh, and a study that holds each out in turn."""
    return made_up(tmp_path)


def made_up(folder: Path) -> Path:
    """Write three traces of one flesh, and a study that holds each out in turn."""
    random = np.random.default_rng(4)
    lines = ["food: banana", "fit: [E, R, R_skin]", "hold_out: each", "traces:"]
    for name, (skin, width) in SPECIMENS.items():
        time = np.arange(0.0, 1.0 + HEIGHT / 0.02, 0.005)
        way = 0.02 * (time - 1.0)
        inside = (way > 0.0) & (way <= HEIGHT)
        cut = np.where(inside, force(np.clip(way, 0.0, None), HEIGHT, width, FLESH | {"R_skin": skin}), 0.0)
        noisy = cut + 5.0 + 0.05 * random.standard_normal(len(time))
        pd.DataFrame({"time_s": time, "force_N": noisy, "position_m": 0.1 - way}).to_csv(
            folder / f"{name}.csv", index=False
        )
        lines.append(f"  {name}: {{trace: {name}.csv, height: {HEIGHT}}}")
    path = folder / "three.yaml"
    path.write_text("\n".join(lines))
    return path


def ran(study: Path, out: Path, *more: str) -> tuple[int, dict[str, Any]]:
    """Exit code and summary of a study."""
    code = main(["calibrate", "--config", str(study), "--out", str(out), "--budget", "30", *more])
    return code, valid(json.loads((out / "summary.json").read_text()))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, int]:
    """The study, its folder and its exit code, run once."""
    folder = tmp_path_factory.mktemp("study")
    study = made_up(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cutcal.commands.calibration.calibrate, "workers_of", lambda args, say: FakePool())
        code, _ = ran(study, folder / "out")
    return study, folder / "out", code


@pytest.mark.slow
def test_each_cut_is_predicted_from_the_others(finished: tuple[Path, Path, int]) -> None:
    """Held-out NRMSE under 3 %, with the specimen's own skin and width found and the flesh that of the others."""
    _, out, code = finished
    summary = json.loads((out / "summary.json").read_text())
    assert (out / "report.pdf").read_bytes().startswith(b"%PDF")
    assert "<!doctype html>" in (out / "report.html").read_text(encoding="utf-8")
    assert code == 0 and summary["passed"] and summary["held_out"] == ["a", "b", "c"]
    for name, (skin, _) in SPECIMENS.items():
        held = summary["hold_out"][name]
        assert held["trained_on"] == [n for n in SPECIMENS if n != name]
        assert held["metrics"]["nrmse"] < 0.03 and held["predictive_inside"] > 0.9
        assert {"ramp", "half_sine"} <= set(held["beats"]) and "mean of the others" in held["null_models"]
        assert set(held["fitted"]) == {"R_skin"}
        assert 0.05 < held["predictive_width"] < held["limits"]["width"] == 0.5
        scale = held["nuisances"]["scale"]
        assert np.exp(scale["value"]) == pytest.approx(held["factor"]) and 0.0 < scale["sd"] < scale["prior_sd"]
        assert held["shape"]["height"] == HEIGHT and held["conditioning"]["stroke_m"] == pytest.approx(HEIGHT, rel=0.1)
        trace = summary["traces"][name]
        assert trace["in_sample"] and trace["predictive_inside"] > 0.9
        assert trace["values"]["R_skin"] / trace["values"]["R"] == pytest.approx(skin / FLESH["R"], rel=0.15)
    factors = np.array([summary["traces"][n]["factor"] for n in SPECIMENS])
    true = np.array([w for _, w in SPECIMENS.values()])
    assert factors / factors[0] == pytest.approx(true / true[0], rel=0.03)
    assert summary["parameters"]["R"]["shared"] and not summary["parameters"]["R_skin@b"]["shared"]


@pytest.mark.slow
def test_what_is_written_can_be_read(finished: tuple[Path, Path, int]) -> None:
    """material.yaml holds the flesh, the curves of each trace the fit and the prediction with their bands, records the
    looks."""
    out = finished[1]
    summary = json.loads((out / "summary.json").read_text())
    food = load_material_file(out / "material.yaml")
    assert food.value("R") == pytest.approx(summary["parameters"]["R"]["value"])
    assert food.properties["R"].source == "fitted to a, b, c of three.yaml"
    columns = pd.read_csv(out / "curves-b.csv")
    assert {"stroke_m", "real_N", "sim_N", "band_low_N", "predicted_N", "predicted_high_N"} <= set(columns)
    assert (columns["band_low_N"] <= columns["band_high_N"]).all()
    assert all(read_section(out / f"record-{name}.h5") is not None for name in SPECIMENS)
    assert summary["traces"]["b"]["shape"]["height"] == HEIGHT and summary["traces"]["b"]["knife"]["name"] == "kitchen"
    assert any("are predictions from the other cuts" in text for text in summary["limits"])
    names = list(summary["parameters"])
    assert len(summary["correlations"]) == len(names) * (len(names) - 1) // 2
    assert all(set(pair.split(",")) <= set(names) and abs(r) <= 1.0 for pair, r in summary["correlations"].items())
    scene = summary["traces"]["b"]["scene"]
    assert scene["motion"]["mach"] == summary["traces"]["b"]["mach"] and scene["food"]["shape"]["height"] == HEIGHT
    assert summary["discrepancy"] == 0.03


@pytest.mark.slow
def test_the_result_is_read_back_as_it_was_written(finished: tuple[Path, Path, int]) -> None:
    """The document gives the typed result back, which makes the very same document; a damaged one is one line."""
    out = finished[1]
    document = json.loads((out / "summary.json").read_text())
    result = read_result(out)
    assert finite(to_document(result)) == document
    assert result.hold_out["a"].metrics.iso18571.R == document["hold_out"]["a"]["metrics"]["iso18571"]["R"]
    assert result.passed and result.traces["b"].shape.height == HEIGHT
    damaged = out.parent / "damaged"
    damaged.mkdir()
    del document["traces"]["b"]["factor"]
    (damaged / "summary.json").write_text(json.dumps(document))
    with pytest.raises(DocumentError, match=r"summary\.json: traces\.b\.factor is missing"):
        read_result(damaged)


@pytest.mark.slow
def test_a_study_runs_from_python(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two lines of a script do what the command does: without an argument the folder has the name of the study's file,
    it holds the document that they return, a bar is shown, and the folder gives the same again."""
    monkeypatch.setattr("calib.simulation.process_pool.Pool", lambda workers, arch: FakePool())
    monkeypatch.chdir(tmp_path)
    text = study.read_text().replace("hold_out: each\n", "budget: 30\n")
    study.write_text("\n".join(line for line in text.splitlines() if not line.startswith("  c:")))
    said: list[str] = []
    found = Study.read(study).run(say=said.append, progress=True)
    assert found.folder == Path(f"cutcal-{study.stem}")
    assert found.summary == json.loads((found.folder / "summary.json").read_text()) == valid(found.summary)
    assert list(found.result.traces) == ["a", "b"] and not found.result.hold_out
    assert "fitting a, b together" in said and capsys.readouterr().err
    again = Study.load(found.folder)
    assert again.summary == found.summary and again.material.name == found.material.name == found.result.food
    table = found.parameters
    assert list(table.index) == list(found.result.parameters)
    assert table["value"].to_dict() == {name: p.value for name, p in found.result.parameters.items()}


@pytest.mark.slow
def test_resuming_a_finished_study_simulates_nothing(finished: tuple[Path, Path, int]) -> None:
    """The second identical run costs no simulation and gives the same numbers; without --resume it is refused."""
    study, out, _ = finished
    first = json.loads((out / "summary.json").read_text())
    before = FakePool.runs
    _, second = ran(study, out, "--resume")
    assert FakePool.runs == before
    changing = ("wall_s", "command", "created")
    assert {k: v for k, v in first.items() if k not in changing} == {
        k: v for k, v in second.items() if k not in changing
    }
    assert main(["calibrate", "--config", str(study), "--out", str(out)]) == 1


@pytest.mark.slow
def test_one_cut_is_held_out_for_good(study: Path, tmp_path: Path) -> None:
    """Named, not in turn: the final fit leaves it out as well, so nothing of it is in the material. Its band knows
    that specimens differ, unless the study says that they do not, and its prediction is the same.
    """
    study.write_text(study.read_text().replace("hold_out: each", "hold_out: [b]"))
    _, summary = ran(study, tmp_path / "out")
    assert list(summary["traces"]) == ["a", "c"] and summary["hold_out"]["b"]["trained_on"] == ["a", "c"]
    assert "R_skin@b" not in summary["parameters"]
    study.write_text(study.read_text() + "\nscatter: 0")
    _, alike = ran(study, tmp_path / "alike")
    wide, narrow = (pd.read_csv(tmp_path / name / "curves-b.csv") for name in ("out", "alike"))
    assert np.array_equal(wide["predicted_N"], narrow["predicted_N"]) and not wide.equals(narrow)
    assert summary["scatter"] == 0.25 and any("scatter by 25 %" in text for text in summary["limits"])
    assert alike["scatter"] == 0.0 and not any("scatter by" in text for text in alike["limits"])


@pytest.mark.slow
def test_a_void_phase_is_said_and_does_not_pass(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A prediction whose phase search ends at its bound fails by R, and terminal and limits say what R is without its
    phase."""
    monkeypatch.setattr("calib.validation.metrics._best_shift", lambda r, m, most: most)
    study.write_text(study.read_text().replace("hold_out: each", "hold_out: [b]"))
    code, summary = ran(study, tmp_path / "out")
    held = summary["hold_out"]["b"]
    rating = held["metrics"]["iso18571"]
    said = f"without it the ISO rating is {rating['without_phase']:.3f}"
    assert code == 2 and not held["passed"] and rating["R"] < 0.8 < rating["without_phase"]
    assert said in capsys.readouterr().out
    assert any(text.startswith("b: ") and said in text for text in summary["limits"])


@pytest.mark.slow
def test_a_force_without_balance_does_not_pass(study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Curves as good as before, but 2 % of the momentum is missing: neither the fit nor the prediction passes."""
    monkeypatch.setattr(FakePool, "balances", {"momentum_residual": 0.02, "ke_over_ie": 0.001})
    study.write_text(study.read_text().replace("hold_out: each", "hold_out: [b]"))
    code, summary = ran(study, tmp_path / "out")
    assert code == 2 and summary["hold_out"]["b"]["metrics"]["nrmse"] < 0.03
    assert not any(t["passed"] for t in (*summary["traces"].values(), *summary["hold_out"].values()))


def test_a_study_and_the_options_of_one_trace_exclude_each_other(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--trace beside --config, or neither food nor study: one line that says what to do. No option is passed over."""
    assert main(["calibrate", "--config", str(study), "--trace", "x.csv", "--out", str(tmp_path / "o")]) == 1
    assert "--trace beside --config" in capsys.readouterr().err
    for option, value in (("--seed", "3"), ("--dx", "5mm"), ("--knife", "edc"), ("--set", "E=2e5")):
        assert main(["calibrate", "--config", str(study), option, value]) == 1, "it would not be heeded"
        assert f"{option} beside --config: write it into {study}" in capsys.readouterr().err
    for option in (["--all"], ["--u-num", "x"]):
        assert main(["calibrate", "--config", str(study), *option]) == 1
        assert f"{option[0]} beside --config, which does not take it" in capsys.readouterr().err
    assert main(["calibrate", "--food", "banana"]) == 1
    assert "--trace missing: name the food and its trace, or a study with --config" in capsys.readouterr().err


def test_a_fake_scene_is_a_real_one() -> None:
    """The fake answers to the same call as the pool's evaluator: a fitted height scales the specimen."""
    from calib.material.food import load_food
    from calib.material.scene import Sizing, cut_scene, specimen
    from mpm.scene import Knife

    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], Knife("k", 2e-3, 0.2, 0.02, 0.1))
    taller, rest = of_specimen(scene, {"height": 0.04, "R": 300.0})
    assert rest == {"R": 300.0} and taller.food.shape.height == 0.04
    assert replace(scene, food=taller.food) != scene
