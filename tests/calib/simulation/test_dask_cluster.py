"""A real Dask cluster on this machine: the same bits as here, nothing lost with a worker, one clear error for the
rest."""

from __future__ import annotations

import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from calib.errors import ClusterError
from calib.io.provenance import code_key
from calib.material.food import load_food
from calib.material.knife import load_knife
from calib.material.scene import Sizing, cut_scene, specimen
from calib.simulation import dask_cluster
from calib.simulation.dask_cluster import Cluster
from calib.simulation.process_pool import Pool
from calib.simulation.workers import DIED, Errand
from cutcal.main import main
from mpm.output.record import ForceRecord
from tests.calib.cheap import CheapCluster, CheapPool, noted
from tests.data_dir import ROOT

# Only a signal that cannot be caught ends a worker in the middle of a run; there is none on Windows.
pytestmark = pytest.mark.skipif(not hasattr(os, "killpg"), reason="processes cannot be killed without notice here")

PATIENCE_S = 120.0  # until a server is up, on a loaded machine
STUDY = ["--food", "banana", "--trace", str(ROOT / "force_data" / "banana_reconstructed.csv"), "--fit", "E,R"]
STUDY += ["--budget", "20"]
JOBS = """
import os, time

def sleep(k, seconds, arch, threads):
    time.sleep(seconds)
    return os.getpid()

def die(k, guilty, folder, arch, threads):
    with open(f"{folder}/{k}", "a") as log:
        log.write("begun ")
    time.sleep(0.2)
    if k == guilty:
        os.kill(os.getpid(), 9)
    return k

def fail(arch, threads):
    raise ZeroDivisionError("a bug")
"""


class Servers:
    """A scheduler and its workers as processes, which end with it, and after minutes of idleness too.

    Args:
        folder: Where they keep their files.
        environment: Variables of the workers.
    """

    def __init__(self, folder: Path, environment: dict[str, str]) -> None:
        self.folder, self.environment = folder, environment
        self.processes: list[subprocess.Popen[bytes]] = []
        told = folder / "scheduler.json"
        self.start("scheduler", "--port", "0", "--idle-timeout", "300", "--scheduler-file", str(told))
        wait_for(lambda: told.exists() and told.read_text().endswith("}"))
        self.address = json.loads(told.read_text())["address"]

    def start(self, kind: str, *options: str, path: str = "") -> subprocess.Popen[bytes]:
        """Start a server in a session of its own, so that the processes it starts end with it."""
        command = [
            sys.executable,
            "-m",
            f"distributed.cli.dask_{kind}",
            *options,
            "--host",
            "127.0.0.1",
            "--no-dashboard",
        ]
        env = os.environ | self.environment | ({"PYTHONPATH": path} if path else {})
        with (self.folder / f"{kind}.log").open("ab") as log:
            process = subprocess.Popen(
                command, cwd=self.folder, env=env, stdout=log, stderr=log, start_new_session=True
            )
        self.processes.append(process)
        return process

    def worker(self, *options: str, path: str = "") -> subprocess.Popen[bytes]:
        """Start a worker with its nanny, which starts another where it dies."""
        given = options or ("--nthreads", "1")
        return self.start(
            "worker", self.address, *given, "--death-timeout", "60", "--local-directory", str(self.folder), path=path
        )

    def stop(self, *processes: subprocess.Popen[bytes]) -> None:
        """End these, or all."""
        for process in processes or self.processes[::-1]:
            for number in (signal.SIGTERM, signal.SIGKILL):
                try:
                    os.killpg(process.pid, number)
                    process.wait(10)
                except (ProcessLookupError, subprocess.TimeoutExpired):
                    continue


def wait_for(what: Callable[[], Any]) -> Any:
    """Wait until it is true."""
    deadline = time.monotonic() + PATIENCE_S
    while not (found := what()):
        assert time.monotonic() < deadline, "nothing came of it"
        time.sleep(0.05)
    return found


@contextmanager
def servers(folder: Path, workers: int) -> Iterator[Servers]:
    """A cluster with so many workers ready, and none of its processes afterwards."""
    from distributed import Client

    (folder / "jobs.py").write_text(JOBS)
    path = os.pathsep.join([str(ROOT), str(folder)])
    made = Servers(folder, {"PYTHONPATH": path, "CHEAP_LOG": str(folder / "log"), "CHEAP_SECONDS": "0.1"})
    try:
        for _ in range(workers):
            made.worker()
        if workers:
            with Client(made.address, set_as_default=False) as client:
                client.wait_for_workers(workers, PATIENCE_S)
        yield made
    finally:
        made.stop()


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Servers]:
    """A cluster of two workers."""
    with servers(tmp_path_factory.mktemp("cluster"), 2) as made:
        yield made


@pytest.fixture
def jobs(two: Servers, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The jobs that the workers know too."""
    monkeypatch.syspath_prepend(str(two.folder))
    import jobs

    return jobs


def full(two: Servers) -> Cluster:
    """Both workers, also after one was killed: its nanny needs a moment."""
    found = []

    def ready() -> bool:
        try:
            found.append(Cluster(two.address))
        except ClusterError:
            return False
        if found[-1].workers == 2:
            return True
        found.pop().close()
        return False

    wait_for(ready)
    return found[0]


@pytest.mark.slow
def test_the_same_bits_as_on_this_machine(two):
    """Candidates and a whole record of a tiny cut: every number of physics, from either worker and from here."""
    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"), stroke=2e-3, dx=6e-3)
    candidates = [(scene, {"E": value}) for value in (2e5, 4e5, 8e5)]
    with Pool(1) as here, full(two) as there:
        own, other = ({e.index: e for e in place.run(candidates)} for place in (here, there))
        records: list[ForceRecord] = []
        for place in (here, there):
            place.errands([Errand(scene, records.append, whole=True)])
    for k in range(3):
        assert own[k].ok and other[k].parameters == own[k].parameters
        assert other[k].scalars == own[k].scalars
        assert np.array_equal(other[k].stroke, own[k].stroke) and np.array_equal(other[k].force, own[k].force)
    assert len({e.scalars["peak_N"] for e in own.values()}) == 3
    one, same = (vars(replace(record, wall=0.0, section=None)) | vars(record.section) for record in records)
    for name, value in one.items():
        assert np.array_equal(value, same[name]), name


@pytest.fixture
def no_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """No report of what a study has found, which takes longer than its runs."""
    monkeypatch.setattr("reports.calibration.report.write_report", lambda result, members: None)


@pytest.mark.slow
@pytest.mark.usefixtures("no_report")
def test_a_killed_worker_costs_one_run(two, tmp_path, monkeypatch, capsys):
    """SIGKILL in the middle of a run: the study ends with the same optimum as one undisturbed, each run stored once."""
    log = two.folder / "log"
    monkeypatch.setenv("CHEAP_LOG", str(tmp_path / "log"))
    monkeypatch.setattr("cutcal.options.Pool", CheapPool)
    monkeypatch.setattr("cutcal.options.Cluster", CheapCluster)
    main(["calibrate", *STUDY, "--out", str(tmp_path / "here")])
    full(two).close()
    killed: list[str] = []

    def kill() -> None:
        begun = wait_for(lambda: log.exists() and log.read_text().count("begin") > 20 and log.read_text().splitlines())
        _, run, process = [line for line in begun if line.startswith("begin")][-1].split()
        os.kill(int(process), signal.SIGKILL)
        killed.append(run)

    killer = threading.Thread(target=kill)
    killer.start()
    main(["calibrate", *STUDY, "--out", str(tmp_path / "there"), "--scheduler", two.address])
    killer.join()
    assert "2 workers" in capsys.readouterr().err
    begun, ended, before = noted(log, "begin"), noted(log, "end"), noted(tmp_path / "log", "end")
    assert ended == before, "the same runs, each to its end once"
    assert begun == before + Counter(killed), "and only the killed one begun twice"
    here, there = (stored(tmp_path / name / "evaluations.h5") for name in ("here", "there"))
    assert sorted(here) == sorted(there) and len(set(there)) == len(there)
    own, other = (json.loads((tmp_path / n / "summary.json").read_text())["parameters"] for n in ("here", "there"))
    assert own == other


@pytest.mark.slow
@pytest.mark.usefixtures("no_report")
def test_one_worker_finds_what_two_find(tmp_path, monkeypatch):
    """The same runs, the same values and the same intervals: a round of the search does not shrink with the workers."""
    monkeypatch.setenv("CHEAP_LOG", str(tmp_path / "log"))
    monkeypatch.setattr("cutcal.options.Pool", CheapPool)
    found = {}
    for workers in ("1", "2"):
        out = tmp_path / workers
        main(["calibrate", *STUDY, "--workers", workers, "--out", str(out)])
        found[workers] = (
            json.loads((out / "summary.json").read_text())["parameters"],
            sorted(stored(out / "evaluations.h5")),
        )
    assert found["1"] == found["2"]


def stored(path: Path) -> list[tuple[Any, ...]]:
    """Key, state and values of each run of a store."""
    with h5py.File(path) as f:
        columns = [f[name].asstr()[()].tolist() for name in ("key", "status", "reason")]
        columns += [np.nan_to_num(values[()]).tolist() for _, values in sorted(f["parameters"].items())]
        columns += [values[()].tolist() for _, values in sorted(f["scalars"].items())]
    return list(zip(*columns, strict=True))


def test_a_job_that_kills_two_workers_is_given_up_and_its_neighbours_are_not(two, jobs, tmp_path):
    """It is made twice, all others once; as a run it is a failed one that another study makes again."""
    with full(two) as there:
        found = dict(there.each(jobs.die, [(k, 2, str(tmp_path)) for k in range(6)]))
    assert found == {k: None if k == 2 else k for k in range(6)}
    assert {p.name: len(p.read_text().split()) for p in tmp_path.iterdir()} == {
        str(k): 2 if k == 2 else 1 for k in range(6)
    }
    assert DIED == "worker_died"


def test_workers_that_join_are_used_and_others_refused(two, jobs, tmp_path):
    """A third worker gets work at once; one that runs other code gets none, and a study that starts then is refused."""
    said: list[str] = []
    copy = tmp_path / "old"
    for name in ("mpm", "calib", "fem_reference"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("materials.yaml", "knives.yaml"):
        shutil.copy(ROOT / name, copy / name)
    with (copy / "mpm" / "solver.py").open("a") as code:
        code.write("# changed\n")
    full(two).close()
    with Cluster(two.address, say=said.append) as there:
        joined = [two.worker(), two.worker(path=os.pathsep.join([str(copy), str(two.folder)]))]
        try:
            used = set()
            for _, process in there.each(jobs.sleep, [(k, 0.1) for k in range(400)]):
                used.add(process)
                if len(used) == 3 and len(said) == 2:
                    break
            assert "2 workers" in said[0] and "2 simulations" in said[0] and there.workers == 2
            assert "another version (code of cutcal" in said[1] and "restart" in said[1]
            with pytest.raises(ClusterError, match="another version"):
                Cluster(two.address)
        finally:
            two.stop(*joined)


def test_ctrl_c_cancels_and_leaves_the_cluster(two, jobs):
    """What was asked for is forgotten by the scheduler, the workers live, and the next study gets them."""
    with full(two) as there:
        runs = there.each(jobs.sleep, [(k, 2.0 * (k > 0)) for k in range(500)])
        next(runs)
        assert wait_for(lambda: any(there._client.processing().values()))
        with pytest.raises(KeyboardInterrupt):
            runs.throw(KeyboardInterrupt)
        assert wait_for(
            lambda: not any(there._client.processing().values())
        )  # the scheduler hears of it a little later
        assert len(dict(there.each(jobs.sleep, [(k, 0.0) for k in range(4)]))) == 4


def test_a_bug_is_no_dead_worker(two, jobs):
    """What a job raises is raised here."""
    with full(two) as there, pytest.raises(ZeroDivisionError, match="a bug"):
        list(there.each(jobs.fail, [()]))


def test_an_impossible_device_names_the_worker(two):
    """A scene that a worker refuses is one clear error."""
    food = load_food("banana")
    scene = cut_scene(food, specimen(food, None, Sizing())[0], load_knife("kitchen"), stroke=2e-3, dx=6e-3)
    with Cluster(two.address, arch="abacus") as there, pytest.raises(ClusterError, match="worker tcp://.*abacus"):
        list(there.run([(scene, {})]))


def refused(capsys: pytest.CaptureFixture[str], out: Path, *options: str) -> str:
    """Run ``calibrate`` and return its one line of error; nothing is written."""
    assert main(["calibrate", *STUDY, "--out", str(out), *options]) == 1
    captured = capsys.readouterr()
    assert captured.out == "" and not out.exists()
    (line,) = captured.err.splitlines()
    assert line.startswith("cutcal: --scheduler")
    return line


def test_what_cannot_be_used_is_one_clear_error(tmp_path, capsys, monkeypatch):
    """No workers, workers of several threads, no scheduler, what is none, and Dask that is not installed."""
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 2.0)
    out = tmp_path / "out"
    with servers(tmp_path, 0) as made:
        assert "no workers" in refused(capsys, out, "--scheduler", made.address)
        made.worker("--nthreads", "3")
        wait_for(lambda: "no workers" not in refused(capsys, out, "--scheduler", made.address))
        line = refused(capsys, out, "--scheduler", made.address)
        assert "has 3 threads" in line and "--nthreads 1" in line
        worker = line.split("worker ")[1].split()[0]
        assert "address of a worker" in refused(capsys, out, "--scheduler", worker)
    assert "no Dask scheduler" in refused(capsys, out, "--scheduler", made.address)
    assert "port" in refused(capsys, out, "--scheduler", "somewhere")
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'cutcal[cluster]'" in refused(capsys, out, "--scheduler", made.address)


def test_the_code_that_workers_run_is_compared():
    """Each package that is named is there: of one that is not, a worker with other code would pass for the same."""
    for package in dask_cluster.EXECUTED:
        assert code_key(package) != code_key("no such package"), package


@pytest.mark.slow
def test_a_scheduler_that_ends_is_said(tmp_path, monkeypatch):
    """Its loss in the middle of a study is one clear error, not an endless wait; so is the loss of all workers."""
    monkeypatch.setattr(dask_cluster, "CONNECT_S", 2.0)
    monkeypatch.setattr(dask_cluster, "DESERTED_S", 1.0)
    monkeypatch.syspath_prepend(str(tmp_path))
    with servers(tmp_path, 1) as made:
        import jobs

        with Cluster(made.address) as there, pytest.raises(ClusterError, match="--resume"):
            for k, _ in there.each(jobs.sleep, [(k, 0.2) for k in range(100)]):
                if k == 1:
                    made.stop(made.processes[-1])
        made.worker()
        wait_for(lambda: usable(made))
        with Cluster(made.address) as there, pytest.raises(ClusterError, match="connection was lost"):
            for k, _ in there.each(jobs.sleep, [(k, 0.2) for k in range(100)]):
                if k == 1:
                    made.stop(made.processes[0])


@pytest.mark.parametrize("greeted", [True, False])
def test_news_that_comes_with_the_greeting(two, monkeypatch, greeted):
    """What a scheduler tells all its clients while one connects is no fault: it connects again, and not for ever."""
    import distributed

    connected = distributed.Client._ensure_connected
    attempts = []

    async def crowded(self: Any, timeout: float | None = None) -> None:
        attempts.append(self)
        await connected(self, timeout)
        assert greeted and len(attempts) > 2, "as Client says where a greeting does not come alone"

    full(two).close()
    monkeypatch.setattr(distributed.Client, "_ensure_connected", crowded)
    if greeted:
        with Cluster(two.address) as there:
            assert there.workers == 2 and len(attempts) == 3
    else:
        with pytest.raises(ClusterError, match="too busy to greet"):
            Cluster(two.address)
        assert len(attempts) == dask_cluster.GREETINGS


def test_a_client_that_nobody_holds_is_gone_before_another_starts() -> None:
    """One that was not greeted is part of a cycle; collected in the midst of another's start it would wait for ever."""
    gone, seen = [], []

    class Ungreeted:
        def __init__(self) -> None:
            self.myself = self

        def __del__(self) -> None:
            gone.append(self)

    def connect() -> Any:
        seen.append(len(gone))
        Ungreeted()
        assert len(seen) > 1, "as Client says where a greeting does not come alone"

    gc.disable()
    try:
        Ungreeted()
        dask_cluster._client(connect)
    finally:
        gc.enable()
    assert seen == [1, 2]


def usable(made: Servers) -> bool:
    """Whether there is a worker."""
    try:
        Cluster(made.address).close()
    except ClusterError:
        return False
    return True
