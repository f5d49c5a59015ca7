"""The time that a calibration is said to take: from earlier ones, over all its stages."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import h5py
import pytest

from calib.calibration.run_clock import (
    CLOSING_S,
    FIRST_GUESS,
    INTERVAL_RUNS,
    LAST_RUNS,
    MOST_CLOSING_S,
    SLOWER,
    RunClock,
    earlier_runs,
)
from calib.io.progress import Progress

TEXT = h5py.string_dtype()


def finished(folder: Path, wall: float, seconds: float, status: str = "done") -> None:
    """A calibration that has taken this long [s], with two default runs of this time [s] and a coarse one."""
    folder.mkdir()
    (folder / "summary.json").write_text(json.dumps({"status": status, "wall_s": wall}))
    with h5py.File(folder / "evaluations.h5", "w") as store:
        store["seconds"], store["fraction"] = [seconds, seconds, 0.1], [1.0, 1.0, 1.0]
        for name, values in (("status", ["ok"] * 3), ("reason", [""] * 3), ("fidelity", ["fine", "fine", "coarse"])):
            store.create_dataset(name, data=values, dtype=TEXT)
        store.create_group("parameters")


def test_earlier_runs_beside_the_folder_tell(tmp_path: Path) -> None:
    """60 s with default runs of 2 s on two workers are 60; interrupted, damaged and own folders are left out."""
    finished(tmp_path / "a", 60.0, 2.0)
    finished(tmp_path / "stopped", 5.0, 2.0, "interrupted")
    finished(tmp_path / "own", 600.0, 2.0)
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "summary.json").write_text("{")
    assert earlier_runs(tmp_path / "own", 2) == [pytest.approx(60.0)]
    assert earlier_runs(tmp_path / "none" / "own", 2) == []


def test_only_the_newest_are_read(tmp_path: Path) -> None:
    """Nine earlier runs: the oldest is left out."""
    for k in range(9):
        finished(tmp_path / f"run{k}", 10.0 + k, 1.0)
        os.utime(tmp_path / f"run{k}" / "summary.json", (k, k))
    assert earlier_runs(tmp_path / "own", 1) == [pytest.approx(18.0 - k) for k in range(8)]


def test_one_bar_from_the_first_simulation_to_the_last() -> None:
    """A default run of 2 s for a worker: 160 s in all as before, the longest is the budget and the last runs; the part
    never falls and is not whole before the end."""
    seen: list[Progress] = []
    now = [0.0]
    clock = RunClock(seen.append, [80.0, 70.0, 90.0], lambda: now[0])
    clock.begin(100.0)
    assert seen[-1].line() == "0 simulations, 0 of a budget of 100, chi2 -, compiling for the first simulations"
    for k in range(1, 31):
        now[0] = 2.0 * k
        clock.search(Progress(k, float(k), 100.0, 0, 9.0, 2.0 * (100.0 - k), "round"))
    assert seen[-1].typical_s == pytest.approx(160.0 - 60.0)
    assert seen[-1].eta_s == pytest.approx(2.0 * (70.0 + INTERVAL_RUNS + LAST_RUNS) + MOST_CLOSING_S)
    clock.analysis()
    assert seen[-1].stage == "profiles of the parameters" and seen[-1].done == 30
    clock.intervals("intervals, round 1")
    for k in range(1, 4):
        now[0] += 10.0
        clock.intervals(f"intervals, round 1, {k} of 3")
        assert seen[-1].typical_s == pytest.approx(max(160.0 - now[0], 2.0 * LAST_RUNS + CLOSING_S))
        assert seen[-1].eta_s == pytest.approx(2.0 * (INTERVAL_RUNS + LAST_RUNS) - 10.0 * k + MOST_CLOSING_S)
    for k in range(5):
        clock.last(f"last simulations, {k} of 4", k, 4)
        now[0] += 20.0
    parts = [p.part for p in seen]
    assert all(a <= b for a, b in zip(parts, parts[1:], strict=False))  # type: ignore[operator]
    assert parts[-1] < 1.0 and seen[-1].done == 34
    assert "left" not in seen[-1].line()  # another batch may follow
    clock.closing("report")
    assert (seen[-1].stage, seen[-1].typical_s, seen[-1].eta_s) == ("report", CLOSING_S, MOST_CLOSING_S)


def test_simulations_of_the_intervals_are_counted() -> None:
    """Three of a first round and two of a second one are five more than the search has made."""
    seen: list[Progress] = []
    clock = RunClock(seen.append, [80.0], lambda: 0.0)
    clock.search(Progress(30, 30.0, 100.0, 0, 9.0, 140.0, "round"))
    for words, rounds in (("round 1", 3), ("round 2", 2)):
        clock.intervals(words)
        for k in range(rounds):
            clock.intervals(f"{words}, {k + 1} of {rounds}", k + 1)
    for whole in (2, 1):
        for k in range(whole + 1):
            clock.last("last simulations", k, whole)
    assert [p.done for p in seen] == [30, 30, 31, 32, 33, 33, 34, 35, 35, 36, 37, 37, 38]
    assert seen[-1].line().startswith("38 simulations, 30 of a budget of 100")


def test_the_last_simulations_tell_their_own_time() -> None:
    """Where they take four times what the search let expect, the time left follows them: the longest come first, so the
    rest takes no longer than they took; were all as long, it would, and twice that is the most."""
    seen: list[Progress] = []
    now = [0.0]
    clock = RunClock(seen.append, [80.0], lambda: now[0])
    clock.search(Progress(1, 1.0, 100.0, 0, 9.0, 99.0, "round"))
    clock.last("last simulations", 0, 4)
    assert (seen[-1].typical_s, seen[-1].eta_s) == pytest.approx(
        (LAST_RUNS + CLOSING_S, SLOWER * LAST_RUNS + MOST_CLOSING_S)
    )
    now[0] += LAST_RUNS
    clock.last("last simulations, 1 of 4", 1, 4)
    assert (seen[-1].typical_s, seen[-1].eta_s) == pytest.approx(
        (LAST_RUNS + CLOSING_S, SLOWER * 3.0 * LAST_RUNS + MOST_CLOSING_S)
    )
    now[0] += 0.2 * LAST_RUNS
    clock.last("last simulations, 3 of 4", 3, 4)
    assert (seen[-1].typical_s, seen[-1].eta_s) == pytest.approx(
        (0.4 * LAST_RUNS + CLOSING_S, SLOWER * 0.4 * LAST_RUNS + MOST_CLOSING_S)
    )


def test_nothing_is_said_of_a_time_that_is_not_known() -> None:
    """While workers compile, no time is told; without earlier runs a first guess serves; with no listener nothing
    happens."""
    seen: list[Progress] = []
    clock = RunClock(seen.append, [], lambda: 0.0)
    clock.search(Progress(1, 0.25, 100.0, 0, math.inf, math.nan, "design"))
    assert math.isnan(seen[-1].eta_s) and "left" not in seen[-1].line()
    clock.search(Progress(2, 1.0, 100.0, 0, math.inf, 99.0, "design"))
    assert seen[-1].typical_s == pytest.approx(FIRST_GUESS)
    RunClock(None, []).search(seen[-1])
