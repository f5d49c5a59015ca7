"""The stability map: what its check of a run sees, how a cell is judged, a small map end to end, killed and resumed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.process_pool import Pool
from cutcal.main import main
from mpm.output.record import ForceRecord
from studies.stability import stability_map
from studies.stability.conservation import check_conservation
from studies.stability.families import map_cells, quick_map_cells
from studies.stability.map_cell import StartState, forced, map_cell, material_values
from studies.stability.result import REASONS, PhysicalCells
from studies.stability.stability_map import KILLED, cell_result, map_result, run_cells
from tests.calib.documents import valid
from tests.data_dir import ROOT

PATIENCE_S = 400.0  # for the first stored runs, kernels compiled by two processes on a loaded machine included
ROWS = 40
WEIGHT = 0.08  # [N]


def record(**changes):
    """A sound record: 1 N over 10 mm, half of the work dissipated by flow, a tenth stored,
    the food at rest; it weighs 0.08 N.
    """
    zero, up = np.zeros(ROWS), np.tile([0.0, 0.0, 1.0], (ROWS, 1))
    stroke = np.linspace(0.25e-3, 0.01, ROWS)
    values = dict.fromkeys(("slide", "kinetic", "damage", "viscous", "friction", "parting", "moment", "tilt"), zero)
    values |= dict.fromkeys(("face", "momentum", "dampers", "residual"), 0 * up)
    values |= {"stroke": stroke, "command": stroke, "time": stroke / 0.1, "edge": up, "board": -up}
    values |= {
        "mass": WEIGHT / 9.81,
        "lagging": False,
        "gravity": -WEIGHT * up,
        "plastic": 0.5 * stroke,
        "elastic": 0.1 * stroke,
    }
    values |= {"cell": 1e-3, "speed": 0.1, "dt": 1e-4, "steps": 1000, "particles": 10, "images": 4, "cells": 100}
    values |= {"severed_area": 0.0, "pieces": None, "counters": {}, "wall": 0.1}
    return ForceRecord(**{**values, **changes})


def judged(**changes):
    """Reason of the check of such a record."""
    return check_conservation(record(**changes), precision="f64").reason


def test_a_sound_record_passes():
    """Energy below what was put in and momentum that balances is no reason to stop."""
    assert judged() == ""


@pytest.mark.parametrize("name", ["stroke", "edge", "board", "momentum", "residual", "kinetic", "elastic", "plastic"])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_one_number_that_is_none_is_seen(name, bad):
    """A single NaN or infinity anywhere in a record that claims to be done is ``not_finite``."""
    values = getattr(record(), name).copy()
    values.flat[values.size // 2] = bad
    assert judged(**{name: values}) == "not_finite"
    assert judged(**{name: values, "status": "inverted"}) == "inverted"


def test_momentum_that_does_not_balance_is_seen():
    """One part in a million of the largest force is far above rounding, also where the knife feels no force at all."""
    residual = np.zeros((ROWS, 3))
    residual[3, 1] = 1e-6
    assert judged(residual=residual) == "momentum"
    none = np.zeros((ROWS, 3))
    free = {"edge": none, "board": none, "gravity": none, "plastic": np.zeros(ROWS), "elastic": np.zeros(ROWS)}
    assert judged(**free) == ""
    assert judged(**free, residual=residual) == "momentum"
    assert check_conservation(record(residual=residual), precision="f32").reason == ""


@pytest.mark.parametrize("name", ["kinetic", "elastic", "plastic", "viscous"])
def test_energy_from_nothing_is_seen(name):
    """A form of energy that comes to twice the work of the knife is ``energy_growth``."""
    assert judged(**{name: 2 * record().work_done}) == "energy_growth"


def test_a_spike_of_contact_is_no_growth():
    """Energy that is gone before the fifth output does not count; one that stays does."""
    kinetic = np.zeros(ROWS)
    kinetic[20:24] = 1.0
    assert judged(kinetic=kinetic) == ""
    kinetic[24] = 1.0
    assert judged(kinetic=kinetic) == "energy_growth"


def test_energy_at_the_start_is_no_growth():
    """What was stored when the run began may be there; without saying so it comes from nothing."""
    elastic = np.full(ROWS, 5.0)
    assert check_conservation(record(elastic=elastic), precision="f64", stored=5.0).reason == ""
    assert judged(elastic=elastic) == "energy_growth"


def test_free_fall_makes_no_energy():
    """Kinetic energy is the work of gravity on a falling body, to the trapezoidal rule;
    without gravity it is from nothing.
    """
    g, mass = 9.81, WEIGHT / 9.81
    time = np.linspace(1e-3, ROWS * 1e-3, ROWS)
    none, momentum = np.zeros((ROWS, 3)), np.zeros((ROWS, 3))
    momentum[:, 2] = -WEIGHT * time
    fall = {"time": time, "momentum": momentum, "edge": none, "board": none, "plastic": np.zeros(ROWS)}
    falling = record(**fall, elastic=np.zeros(ROWS), kinetic=mass / 2 * (g * time) ** 2)
    found = check_conservation(falling, precision="f64")
    assert found.reason == ""
    assert abs(found.energy_gain) < 1e-12
    weightless = replace(falling, gravity=none)
    assert check_conservation(weightless, precision="f64").energy_gain > 0.01


def test_food_at_rest_on_the_board_does_not_fall():
    """The momentum of a record is ahead by the impulse of one step of contact; taken for motion, the food would rise.

    What is left is half of the first of 40 outputs, in which the momentum is taken to grow from nothing.
    """
    board = np.tile([0.0, 0.0, -WEIGHT], (ROWS, 1))
    still = record(edge=0 * board, board=board, momentum=-1e-4 * board, plastic=np.zeros(ROWS), elastic=np.zeros(ROWS))
    right, wrong = (
        check_conservation(replace(still, lagging=lag), precision="f64").energy_gain for lag in (True, False)
    )
    assert abs(right) < 0.02 * wrong


def result(reason: str = "", **scalars: float):
    """What a worker sends back."""
    ends = {"status": "failed" if reason else "ok", "reason": reason, "fraction": 0.5 if reason else 1.0}
    return replace(KILLED, **ends, scalars={"particle_steps": 1e9, **scalars})


def concluded(cells, evaluations):
    """The map of these ends."""
    return map_result(cells, evaluations, command=("stress",), seed=0, device="cpu")


BASE = map_cell("base", {"x": 1.0})
CRUSHED = map_cell("base", {"x": 2.0}, material=material_values(1e5, R=1e5))
REFUSED = map_cell("base", {"x": 3.0}, material={"nu": 0.5})
FAST = map_cell("base", {"x": 4.0}, numerics={"safety": 1.2})


@pytest.mark.parametrize("reason", [r for r in REASONS if r not in ("cfl", "refused")])
def test_each_reason_explains(reason):
    """A run that stopped for a known reason is explained, and counts against the map only where it must be stable."""
    assert cell_result(CRUSHED, result(reason)).status == "stopped"
    assert concluded([CRUSHED], [result(reason)]).passed
    found = concluded([BASE, CRUSHED], [result(reason), result(reason)])
    assert not found.passed
    assert found.physical == PhysicalCells(cells=1, stable=0, not_stable=(BASE.words,))
    assert found.unexplained == 0


def test_what_is_not_known_is_unexplained():
    """Any other reason fails the map, also of a cell that need not be stable."""
    found = concluded([BASE, CRUSHED], [result(), result("odd")])
    assert (found.unexplained, found.unexplained_cells) == (1, (CRUSHED.words,))
    assert not found.passed


def test_refusals_are_typed():
    """A time step is refused as ``cfl``, all else as ``refused``, with the words a user gets."""
    rows = concluded([FAST, REFUSED], [None, None]).cells
    assert [(r.status, r.reason) for r in rows] == [("refused", "cfl"), ("refused", "refused")]
    assert "stability limit" in rows[0].message
    assert "nu = 0.5" in rows[1].message


def test_a_killed_worker_and_a_long_run_are_told():
    """A process that was killed has a reason of its own; a run that is too long says what it would need."""
    assert cell_result(CRUSHED, KILLED).reason == "worker_died"
    assert "1e+09 particle steps" in cell_result(CRUSHED, result("too_long")).message


def test_the_map_covers_what_it_promises():
    """Both ends of every range are there, each cell can be told from the others, and a refused one says why."""
    every = map_cells()
    assert len({(c.words, c.forced) for c in every}) == len(every)
    assert all(c.refusal for c in every if c.scene is None)
    seen = {name: {c.values[name] for c in every if name in c.values} for c in every for name in c.values}
    for name, ends in {
        "E_Pa": {1e3, 1e8},
        "nu": {0.0, 0.49, 0.495},
        "speed_m_s": {1e-3, 1.0},
        "dt_over_limit": {0.1, 0.79, 1.2},
        "dx_m": {1e-3, 5e-3},
        "rho_kg_m3": {100.0, 2000.0},
    }.items():
        assert ends <= seen[name], name
    assert seen["what"] >= {"blade beside the food", "food in the air, nothing near", "100 times overlap, strained"}
    assert all(c.scene.numerics.safety < 0.8 and not c.forced for c in every if c.physical)
    assert sum(c.physical for c in every) > 100


def test_forced_cells_pass_the_checks_by():
    """What the checks refuse can be simulated all the same, by this study alone."""
    assert forced(BASE, nu=0.495).scene.food.material.nu == 0.495
    assert forced(BASE, safety=1.2).step == 1.2
    assert BASE.scene.food.material.nu == 0.4
    assert not forced(BASE, safety=1.2).physical
    each = (BASE, forced(BASE, nu=0.495), forced(BASE, safety=1.1), forced(BASE, safety=1.2))
    assert len({one.key for one in each}) == 4
    assert replace(BASE, start=StartState(depth=1e-3)).key != BASE.key


class OneKills(Pool):
    """A pool whose job 3 takes its process with it each time, and its neighbour 2 when both run."""

    def __init__(self):
        self.workers, self.arch, self.threads = 2, "cpu", 1
        self._begun = {}
        self.waiting, self.calls = [], []

    def _submit(self, work, *args):
        k, future = args[0], Future()
        self.calls.append(k)
        if k == 2 and self.calls.count(2) == 1:
            self.waiting.append(future)
        elif k == 3:
            for one in (future, *self.waiting):
                one.set_exception(BrokenProcessPool("killed"))
            self.waiting.clear()
        else:
            future.set_result(k)
        return future


def test_only_the_run_that_kills_its_process_counts_as_dead():
    """The neighbour of a killed process is made again alone and comes out well; the killer does not."""
    pool = OneKills()
    found = dict(pool.each(max, [(k,) for k in range(6)]))
    assert found == {0: 0, 1: 1, 2: 2, 3: None, 4: 4, 5: 5}
    assert pool.calls[:4] == [0, 1, 2, 3]
    assert sorted(pool.calls[4:6]) == [2, 3], "alone, before anything else is begun"
    assert pool.calls[6:] == [4, 5]


def test_known_cells_are_not_run_again(tmp_path):
    """A second study runs only what has no result yet, and once more what was killed."""
    ran, dead = [], {CRUSHED.words}

    class FakePool:
        def each(self, _, jobs):
            for k, (one, *_limits) in enumerate(jobs):
                ran.append(one.words)
                yield k, None if one.words in dead else result()

    todo = [BASE, REFUSED, CRUSHED, replace(BASE, family="again")]
    for resume, expected in ((False, {BASE.words, CRUSHED.words}), (True, {CRUSHED.words}), (True, set())):
        ran.clear()
        with EvaluationStore(tmp_path / "e.h5", Header("", "x"), resume=resume) as store:
            results = run_cells(todo, store, FakePool(), lambda _: None)
        ran_words = {w.replace("again", "base") for w in ran}
        assert ran_words == expected
        assert len(ran) == len(expected)
        assert [r is None for r in results] == [False, True, False, False]
        assert results[2].reason == ("worker_died" if dead else "")
        dead.clear()


def test_a_run_ends_at_its_limits():
    """More particle steps than allowed are not begun, and a run that takes too long is ended;
    both say what they need.
    """
    from studies.stability.cell_run import run_cell

    one = quick_map_cells()[1]
    for limits in ((10.0, 100.0), (1e12, -1.0)):
        found = run_cell(one, *limits, "cpu", 1)
        assert found.reason == "too_long"
        assert found.scalars["particle_steps"] > 1e4
        assert found.fraction < 1


def test_contact_makes_no_energy_where_waves_allow_the_longest_step():
    """A very soft food of nu = 0, which gravity squeezes on the board, ends sound;
    the contact's spring needs a shorter step.
    """
    from studies.stability.cell_run import run_cell

    one = next(c for c in map_cells() if c.words == "E and nu: E_Pa 1000, nu 0")
    found = run_cell(one, 1e9, 100.0, "cpu", 1)
    assert found.reason == ""
    assert found.scalars["energy_gain"] < 0.05


@pytest.mark.slow
def test_a_cell_does_not_feel_the_one_before():
    """Food that was drawn together below the edge gives the same work after another cut as before it."""
    from studies.stability.cell_run import run_cell

    named = {one.words: one for one in map_cells()}
    overlap, other = named["start: 10 times overlap, unstrained"], named["start: blade half off the food"]
    first, _, again = (run_cell(one, 1e9, 100.0, "cpu", 1) for one in (overlap, other, overlap))
    assert first.scalars["work_J"] == again.scalars["work_J"]
    assert first.scalars["momentum_residual"] < 1e-12
    assert again.scalars["momentum_residual"] < 1e-12


def known(journal: Path) -> int:
    """Runs in the journal of a store."""
    return journal.read_bytes().count(b'"key"') if journal.exists() else 0


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """The quick map, killed after two runs and resumed; returns its folder, its exit code and the stored lines."""
    out = tmp_path_factory.mktemp("map") / "out"
    command = [sys.executable, "-m", "cutcal.main", "stress", "--quick", "--out", str(out)]
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, cwd=ROOT, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    journal = out / "evaluations.h5.journal"
    deadline = time.monotonic() + PATIENCE_S
    while known(journal) < 2 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.05)
    assert process.poll() is None, "the map ended before it could be killed"
    process.kill()
    process.wait()
    stored = known(journal)
    return out, main(["stress", "--quick", "--out", str(out), "--resume"]), stored


@pytest.mark.long
def test_quick_map_is_explained(quick):
    """Sound foods are stable, a crushed one and a step of three times the limit are stopped, nonsense is refused."""
    out, code, _ = quick
    document = valid(json.loads((out / "stress.json").read_text()))
    assert (code, document["passed"], document["unexplained"]) == (0, True, 0)
    named = {c["name"]: c for c in document["cells"]}
    assert {c["status"] for c in document["cells"] if c["physical"]} == {"stable"}
    assert named["dt and dx: dx_m 0.005, dt_over_limit 1.2"]["reason"] == "cfl"
    fast = named["dt and dx: dx_m 0.005, dt_over_limit 3 (forced)"]
    assert fast["status"] == "stopped"
    assert fast["reason"] in ("inverted", "not_finite", "left_grid", "energy_growth")
    assert named["start: food outside the grid"]["reason"] == "left_grid"
    beside = named["start: blade beside the food"]
    assert (beside["status"], beside["peak_N"]) == ("stable", 0.0)
    assert all(
        c["energy_gain"] <= 0.1 and c["momentum_residual"] < 1e-9 for c in named.values() if c["status"] == "stable"
    )
    assert (out / "stress.svg").read_bytes().startswith(b"<?xml")


@pytest.mark.long
def test_kill_and_resume_run_nothing_twice(quick, capsys):
    """What was stored before the kill is known; a third call knows all, and --json prints the document alone."""
    out, code, stored = quick
    assert stored >= 2
    before = (out / "stress.json").read_text()
    assert main(["stress", "--quick", "--out", str(out), "--resume", "--json"]) == code
    printed = capsys.readouterr()
    assert json.loads(printed.out)["cells"] == json.loads(before)["cells"]
    assert "8 of 8 runs are known already" in printed.err
    assert "left" not in printed.err
    assert main(["stress", "--quick", "--out", str(out)]) == 1
    assert "--resume" in capsys.readouterr().err


@pytest.mark.long
def test_negative_verdict_is_exit_code_2(quick, capsys, monkeypatch):
    """A physical cell that is not stable, and one that nothing explains, each make the exit code 2 and are named."""
    out, _, _ = quick
    arguments = ["stress", "--quick", "--out", str(out), "--resume"]
    for reason, words in (("inverted", "physical, but not stable"), ("odd", "unexplained")):
        with monkeypatch.context() as patch:
            ends = [result(reason)] * len(quick_map_cells())
            patch.setattr(stability_map, "run_cells", lambda *_, ends=ends: ends)
            assert main(arguments) == 2
        assert words in capsys.readouterr().out


@pytest.mark.parametrize("options", [["--workers", "0"], ["--seed", "-1"]])
def test_bad_options_are_one_clear_error(options, capsys, tmp_path):
    """Impossible numbers are refused before anything runs."""
    assert main(["stress", "--out", str(tmp_path / "x"), *options]) == 1
    assert options[0] in capsys.readouterr().err
    assert not (tmp_path / "x").exists()
