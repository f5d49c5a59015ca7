"""Killed and resumed until it is done: nothing is lost, nothing is made twice, and the optimum is that of an
undisturbed study."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.simulation import record_file
from calib.simulation.record_file import read_record, record_errands
from mpm.output.record import ForceRecord
from mpm.output.topology import Topology
from mpm.scene import Scene
from tests.calib.cheap import LOG, SECONDS, cut, noted
from tests.data_dir import ROOT

KILLS = 10
AT_A_TIME = 2  # simulations, and so at most so many in flight when the study is killed
RUN_S = 0.05
PATIENCE_S = 120.0  # until a study that was started anew has got on, on a loaded machine
STUDY = """
if __name__ == "__main__":
    import sys
    from types import SimpleNamespace

    from cutcal import options
    from cutcal.main import main
    from tests.calib.cheap import CheapPool

    options.Pool = CheapPool
    sys.modules["reports.calibration.report"] = SimpleNamespace(write_report=lambda result, members: None)
    sys.exit(main(sys.argv[1:]))
"""


class Study:
    """A calibration with a formula in place of the solver, in a process of its own with workers of its own.

    Args:
        folder: Where its log, script and results are.
        name: What they are called.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.out, self.log, self.script = folder / name, folder / f"{name}.log", folder / "study.py"
        self.script.write_text(STUDY)

    def start(self, *options: str) -> subprocess.Popen[str]:
        """Begin, or go on with ``--resume``."""
        trace = ROOT / "force_data" / "banana_reconstructed.csv"
        command = [sys.executable, str(self.script), "calibrate", "--food", "banana", "--trace", str(trace)]
        command += ["--fit", "E,R", "--budget", "20", "--workers", str(AT_A_TIME), "--out", str(self.out), *options]
        env = os.environ | {"PYTHONPATH": str(ROOT), LOG: str(self.log), SECONDS: str(RUN_S)}
        return subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def finish(self, *options: str) -> str:
        """Let it end; returns what it said."""
        process = self.start(*options)
        _, said = process.communicate()
        assert process.returncode in (0, 2), said
        return said

    def killed_at(self, begun: int, later: float, *options: str) -> set[str]:
        """Kill it a moment [s] after so many runs in all have been begun; returns the runs that are stored then."""
        process = self.start(*options)
        deadline = time.monotonic() + PATIENCE_S
        while noted(self.log, "begin").total() < begun and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.005)
        time.sleep(later)
        assert process.poll() is None, f"it ended before it could be killed: {process.communicate()[1]}"
        process.send_signal(signal.SIGKILL)
        process.communicate()  # returns when its workers have ended as well: they hold the other end
        return self.stored()

    def stored(self) -> set[str]:
        """Names of the runs on disk, in the file and in the journal beside it, which may end in a torn line."""
        found: set[str] = set()
        path = self.out / "evaluations.h5"
        if path.exists():
            with h5py.File(path) as f:
                found |= {repr(float(peak)) for peak in f["scalars/peak_N"][()]}
        journal = path.with_name(path.name + ".journal")
        for line in journal.read_bytes().split(b"\n") if journal.exists() else []:
            try:
                found.add(repr(json.loads(line[9:])["scalars"]["peak_N"]))
            except (ValueError, KeyError):
                continue
        return {f"run:{peak}" for peak in found} | self.whole()

    def whole(self) -> set[str]:
        """Name of the run whose whole record is on disk."""
        path = self.out / "record.h5"
        if not path.exists():
            return set()
        with h5py.File(path) as f:
            key = f.attrs["key"]
        record = record_file._read(path, key)
        assert record is not None
        return {f"whole:{record.peak!r}"}

    def begun(self) -> list[str]:
        """Names of all runs in the order in which they were begun."""
        lines = [line.split() for line in self.log.read_text().splitlines()]
        return [line[1] for line in lines if line[0] == "begin"]

    def results(self) -> dict[str, Any]:
        """What the study found, less when and how long."""
        s = json.loads((self.out / "summary.json").read_text())
        del s["created"], s["wall_s"], s["command"]
        return s


@pytest.mark.long
# Only a signal that cannot be caught proves this; where there is none (Windows) test_store covers the states that a
# kill leaves.
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes cannot be killed without notice here")
def test_ten_kills_change_nothing(tmp_path):
    """kill -9 at ten random moments: the same summary to the last digit; what was stored is never begun again, and all
    that is begun twice was in flight at a kill. The same command once more begins no run at all, and changes no
    number."""
    calm, hunted = (Study(tmp_path, name) for name in ("calm", "hunted"))
    calm.finish()
    runs = Counter(calm.begun())
    assert set(runs.values()) == {1} and len(runs) > 2 * KILLS
    assert set(runs) == calm.stored()

    random = np.random.default_rng(20)
    moments = np.sort(random.choice(np.arange(1, len(runs)), KILLS, replace=False))
    seen = []
    for k, moment in enumerate(moments):
        stored = hunted.killed_at(int(moment), random.uniform(0, RUN_S), *(["--resume"] if k else []))
        seen.append((len(hunted.begun()), stored))
    hunted.finish("--resume")
    begun = hunted.begun()
    assert [name for length, stored in seen for name in begun[length:] if name in stored] == []
    assert set(begun) == set(runs)
    assert len(begun) <= len(runs) + KILLS * AT_A_TIME
    assert seen[-1][1] > seen[0][1], "the kills were spread over the study"
    assert hunted.results() == calm.results()
    assert (hunted.out / "curves.csv").read_bytes() == (calm.out / "curves.csv").read_bytes()

    said = hunted.finish("--resume")
    assert hunted.begun() == begun and "simulating" not in said
    assert hunted.results() == calm.results()


def brought(scene: Scene, path: Path, record: ForceRecord) -> ForceRecord:
    """A record as it is read back after it was made."""
    (errand,) = record_errands(scene, path)
    errand.keep(record)
    assert record_errands(scene, path) == []
    return read_record(scene, path)


def test_a_record_comes_back_whole(tmp_path):
    """Every number, the pieces of the food, and None; a record of another scene or a damaged file is made anew."""
    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"))
    path = tmp_path / "record.h5"
    for pieces in (None, Topology((2e-5, 1e-5), 1e-9, 0.0, None, 0.0), Topology((3e-5,), 0.0, 1e-4, (0.0, 0.01), 2e-3)):
        first = replace(
            cut(scene), pieces=pieces, counters={"inverted": 3}, status="left_grid", fraction=1 / 3, resistance=350.0
        )
        path.unlink(missing_ok=True)
        again = brought(scene, path, first)
        for name, value in vars(first).items():
            assert type(getattr(again, name)) is type(value) and np.array_equal(getattr(again, name), value), name
    other = scene.with_material(E=1e5)
    assert brought(other, path, cut(other)).peak == cut(other).peak
    path.write_bytes(path.read_bytes()[:1000])
    again = brought(scene, path, cut(scene))
    assert again.peak == cut(scene).peak
    assert np.isnan(again.resistance) and np.isnan(read_record(scene, path).resistance)
