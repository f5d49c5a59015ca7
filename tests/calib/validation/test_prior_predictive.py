"""Prior predictives: the draws, what becomes of runs, a study killed and resumed, and the recorded bands."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from calib.errors import CurveError
from calib.io.yaml_checks import data_path
from calib.material.food import load_food, load_foods
from calib.material.knife import load_knife
from calib.problem.food_parameters import fit_parameters
from calib.problem.parameters import Z95, ParameterSet
from calib.simulation.evaluation import Evaluation
from calib.validation.prior_predictive import QUANTILES, conclude, draw, plan
from cutcal.main import main
from reports.calibration.prior import write_figure
from tests.calib.documents import valid
from tests.data_dir import ROOT

FOODS = tuple(load_foods())
RECORDED = ROOT / "force_data" / "prior_predictive"
CHEAP = ("grape", "shine_muscat", "strawberry")  # some tenths of a second each, besides their kernels
PATIENCE_S = 120.0
# Part of the peak. Rounding, compilers and processors move a curve by up to 0.1 % (tests/mpm/test_regression.py); E, R,
# R_skin or the initiation depth changed by a fifth moves it by 2 % and more, which nobody would see in a band that
# spans a decade.
TOLERANCE = 0.01


def banana():
    """Default fit parameters of the banana."""
    food = load_food("banana")
    return fit_parameters(food, food.default_fit)


def recorded(name):
    """The recorded curves of a food."""
    return pd.read_csv(RECORDED / f"{name}.csv", comment="#")


@pytest.fixture(scope="module")
def document():
    """The recorded prior.json."""
    return valid(json.loads((RECORDED / "prior.json").read_text(encoding="utf-8")))


# Draws --------------------------------------------------------------------------------------------


def test_draws_follow_the_priors():
    """Mean, spread and the 95 % box of 1024 draws are those of each prior, on a log scale where it has one."""
    parameters = banana()
    z = np.array([parameters.to_vector(d) for d in draw(parameters, 1024)])
    sd = parameters.prior_sd
    cut_off = [
        parameters.names.index(name) for name in ("strength_ratio", "mu")
    ]  # at 1 and at 0, 1.96 sd from the mean
    inner = [k for k in range(len(parameters)) if k not in cut_off]  # all others far outside
    assert np.abs((z.mean(axis=0) - parameters.prior_mean) / sd)[inner].max() < 0.01
    assert np.abs(z.std(axis=0) / sd - 1)[inner].max() < 0.02
    inside = np.abs(z - parameters.prior_mean) <= Z95 * sd
    assert np.abs(inside.mean(axis=0)[inner] - 0.95).max() < 0.005
    assert np.abs(inside.mean(axis=0)[cut_off] - 0.95 / 0.975).max() < 0.005
    assert z[:, cut_off[1]].min() > 0.0 and z[:, cut_off[0]].max() < 0.0


def test_draws_do_not_pass_the_hard_bounds_nor_pile_up_there():
    """A prior that is cut off in its middle gives draws of its upper half alone, none of them at the bound."""
    parameters = banana()
    half = replace(parameters["E"], low=parameters["E"].prior_centre, value=parameters["E"].high)
    values = np.array([d["E"] for d in draw(ParameterSet((half,)), 256)])
    assert values.min() > half.low and values.max() < half.high
    assert np.median((np.log(values) - half.prior_mean) / half.prior_sd) == pytest.approx(0.6745, abs=0.02)


def test_fewer_draws_are_the_first_of_more():
    """More draws keep those that were simulated; another seed has others; none at all is refused."""
    parameters = banana()
    assert draw(parameters, 5, 3) == draw(parameters, 40, 3)[:5]
    assert draw(parameters, 5, 3) != draw(parameters, 5, 4)
    with pytest.raises(CurveError, match="at least 1"):
        draw(parameters, 0)


# What becomes of the runs -------------------------------------------------------------------------


def result(level, stroke, reason="", ke=0.0, parted=1.0):
    """A run of constant force [N], or one that broke down for a reason."""
    s = np.linspace(0, stroke, 300)
    status = "failed" if reason else "ok"
    return Evaluation(
        0, {}, status, reason, 0.5 if reason else 1.0, s, np.full(300, level), {"ke_over_ie": ke, "parted": parted}
    )


def test_quantiles_are_those_of_the_runs_that_finished():
    """Eleven levels of force have their quantiles; a run that broke down counts as such and is left out, at any force.
    Those that are not quasi-static, or not cut but pressed away, are in them and are counted."""
    one = plan(load_food("grape"), load_knife("kitchen"), draws=12)
    levels = [result(float(k), 0.02, ke=0.02 * k, parted=0.105 * k) for k in range(11)]
    columns, row = conclude(one, [result(100.0, 0.02), *levels, result(1e6, 0.02, "inverted")])
    middle = {name: float(values[120]) for name, values in columns.items()}
    assert middle["default_N"] == pytest.approx(100)
    for name, q in {"q025": 0.025, "q25": 0.25, "q50": 0.5, "q75": 0.75, "q975": 0.975}.items():
        assert middle[f"{name}_N"] == pytest.approx(10 * q)
        assert row["peak_N"][name] == pytest.approx(10 * q)
        assert row["work_J"][name] == pytest.approx(10 * q * 0.02, rel=0.05)
    assert (row["finished"], row["failed"], row["dynamic"], row["default_status"]) == (11, {"inverted": 1}, 5, "ok")
    assert row["pressed"] == 8


def test_no_run_that_finished_is_no_band(tmp_path):
    """Where the default values and all draws break down there is no number, and the row says so."""
    one = plan(load_food("grape"), load_knife("kitchen"), draws=1)
    columns, row = conclude(one, [result(1.0, 0.01, "left_grid"), result(1.0, 0.01, "inverted")])
    assert np.isnan(columns["q50_N"]).all() and np.isnan(columns["default_N"]).all()
    assert (row["default_status"], row["finished"], row["failed"]) == ("left_grid", 0, {"inverted": 1})


# The command --------------------------------------------------------------------------------------


def known(journal):
    """Runs in the journal of a store."""
    return journal.read_bytes().count(b'"key"') if journal.exists() else 0


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The default cut and a draw of some cheap foods, killed after two runs and resumed: folder, exit code, stored
    runs."""
    out = tmp_path_factory.mktemp("prior") / "out"
    words = ["prior", *CHEAP, "--draws", "1", "--workers", "1", "--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-m", "cutcal.main", *words],
        cwd=ROOT, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    journal, deadline = out / "evaluations.h5.journal", time.monotonic() + PATIENCE_S
    while known(journal) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.05)
    assert process.poll() is None, "the study ended before it could be killed"
    process.kill()
    process.wait()
    stored = known(journal)
    return out, main([*words, "--resume"]), stored


@pytest.mark.slow
def test_kill_and_resume_run_nothing_twice(study, capsys):
    """What was stored before the kill is known; a second call knows all, shows warnings and table, and changes no
    file."""
    out, code, stored = study
    assert stored >= 2 and code == 0
    before = {p.name: p.read_bytes() for p in out.glob("*.csv")}
    assert set(before) == {f"{name}.csv" for name in CHEAP}
    words = ["prior", *CHEAP, "--draws", "1", "--out", str(out), "--resume"]
    assert main(words) == 0
    printed = capsys.readouterr()
    assert "6 of 6 runs are known already" in printed.err and "left" not in printed.err.partition("known")[2]
    assert "grape: not modelled: seeds" in printed.err
    assert all(name in printed.out for name in CHEAP)
    assert main([*words, "--json"]) == 0
    assert list(valid(json.loads(capsys.readouterr().out))["foods"]) == list(CHEAP)
    assert {p.name: p.read_bytes() for p in out.glob("*.csv")} == before
    assert (out / "prior.svg").read_bytes().startswith(b"<?xml")
    assert main(words[:-1]) == 1
    assert "--resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [(["bananna"], "did you mean 'banana'"), (["--draws", "0"], "--draws"), (["--workers", "0"], "--workers"),
     (["--seed", "-1"], "--seed"), (["--knife", "kichen"], "kitchen")],
)  # fmt: skip
def test_bad_options_are_one_clear_error(words, said, tmp_path, capsys):
    """Unknown foods and knives and impossible numbers are refused before anything is written."""
    assert main(["prior", *words, "--out", str(tmp_path / "out")]) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.fixture
def copied(study, tmp_path):
    """A copy of that folder, to be written to."""
    return shutil.copytree(study[0], tmp_path / "out")


@pytest.mark.slow
def test_another_food_joins_a_folder(copied, monkeypatch):
    """A food that is run into a folder with others, or run again, leaves their entries, and the order, as they were."""
    before = json.loads((copied / "prior.json").read_text())["foods"]

    def ends(plans, *_):
        return [[result(1.0, p.scene.motion.stroke)] * 2 for p in plans]

    monkeypatch.setattr("calib.validation.prior_predictive.evaluate", ends)
    assert main(["prior", "kiwi", "grape", "--draws", "1", "--out", str(copied), "--resume"]) == 0
    after = json.loads((copied / "prior.json").read_text())["foods"]
    assert list(after) == [*CHEAP, "kiwi"]
    assert after["grape"]["peak_N"]["default"] == pytest.approx(1.0)
    assert all(after[name] == before[name] for name in CHEAP if name != "grape")


@pytest.mark.slow
def test_default_values_that_do_not_finish_are_exit_code_2(copied, capsys, monkeypatch):
    """A food whose own values break down is named, and the command says that it did not pass."""
    broken = [[result(1.0, 0.01, "inverted"), result(1.0, 0.02)]]
    monkeypatch.setattr("calib.validation.prior_predictive.evaluate", lambda *_: broken)
    assert main(["prior", "grape", "--out", str(copied), "--resume"]) == 2
    assert "DEFAULT VALUES: inverted" in capsys.readouterr().out


@pytest.mark.slow
def test_damaged_entries_are_one_clear_error(copied, capsys):
    """A prior.json that is cut off is named, and no result is lost over it."""
    (copied / "prior.json").write_text('{"foods"')
    assert main(["prior", "grape", "--draws", "1", "--out", str(copied), "--resume"]) == 1
    assert "prior.json is damaged" in capsys.readouterr().err
    assert (copied / "grape.csv").exists()


# The recorded bands -------------------------------------------------------------------------------


def test_every_food_is_recorded(document):
    """Each food of materials.yaml has its band, and nothing else does."""
    assert tuple(document["foods"]) == FOODS
    assert {p.stem for p in RECORDED.glob("*.csv")} == set(FOODS)
    assert data_path("force_data").joinpath("prior_predictive").is_dir()


@pytest.mark.parametrize("name", FOODS)
def test_recorded_band_is_of_these_values(name, document):
    """The band was made from the values and priors that materials.yaml has now, and its default cut went to its end."""
    row, one = document["foods"][name], plan(load_food(name), load_knife("kitchen"))
    assert row["inputs"] == one.inputs, f"record it again: cutcal prior {name}"
    assert (row["default_status"], row["finished"] + sum(row["failed"].values())) == ("ok", 32)
    curves = recorded(name)
    assert np.allclose(curves["stroke_m"], one.stroke, rtol=1e-5)
    ordered = curves[[f"{q}_N" for q in QUANTILES]].to_numpy()
    assert np.isfinite(ordered).all() and (np.diff(ordered, axis=1) >= 0).all()
    assert curves["default_N"].max() == pytest.approx(row["peak_N"]["default"], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEAP)
def test_recorded_default_is_what_is_simulated(name, study):
    """The default cut, simulated again, is the recorded one within 1 % of its peak."""
    now, then = pd.read_csv(study[0] / f"{name}.csv", comment="#"), recorded(name)
    difference = np.abs(now["default_N"] - then["default_N"]).max()
    assert difference < TOLERANCE * then["default_N"].max()


def test_table_of_the_docs_is_the_recorded_one(document):
    """Each row of docs/foods.md has the recorded peak, its 95 % and the work, to the digits shown."""
    lines = (ROOT / "docs" / "foods.md").read_text(encoding="utf-8").splitlines()
    rows = {cells[1]: cells[4:7] for line in lines if len(cells := [c.strip() for c in line.split("|")]) == 9}
    for name, row in document["foods"].items():
        low, high, work = (
            float(f"{x:.2g}") for x in (*(row["peak_N"][q] for q in ("q025", "q975")), row["work_J"]["default"])
        )
        assert rows[name] == [f"{row['peak_N']['default']:.3g}", f"{low:g} to {high:g}", f"{work:g}"]


def test_figure_of_the_recorded_bands(tmp_path):
    """The bands can be drawn, one panel each: fewer foods make a smaller figure; letters are paths."""
    sizes = []
    for names in (FOODS, FOODS[:5]):
        rows = json.loads((RECORDED / "prior.json").read_text())["foods"]
        (tmp_path / "prior.json").write_text(json.dumps({"foods": {n: rows[n] for n in names}}))
        for name in names:
            (tmp_path / f"{name}.csv").write_bytes((RECORDED / f"{name}.csv").read_bytes())
        write_figure(tmp_path)
        figure = (tmp_path / "prior.svg").read_bytes()
        assert b"<text" not in figure
        sizes.append(len(figure))
    assert sizes[0] > 2 * sizes[1]
