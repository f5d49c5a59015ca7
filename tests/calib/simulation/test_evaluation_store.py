"""The store: nothing computed twice, nothing lost when the process is killed, nothing mixed up."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

from calib.errors import OutputError
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import CachedEvaluator, EvaluationStore, Header, content_key
from tests.data_dir import ROOT

HEADER = Header(trace_sha256="ab" * 32, scene_key="banana-2mm")
SCENE = {"food": "banana", "dx": 2e-3, "knife": {"angle": 0.2}}

#: Writes runs of 40 kB as fast as it can, reporting each that is acknowledged; with a second argument it also
#: closes and reopens the store after every third run, so that kills hit the writing of the HDF5 file as well.
WRITER = """
import sys
import numpy as np
from calib.simulation.evaluation import Evaluation
from calib.simulation.evaluation_store import EvaluationStore, Header
path, reopen = sys.argv[1], len(sys.argv) > 2
header = Header(trace_sha256="ab" * 32, scene_key="banana-2mm")
store = EvaluationStore(path, header, resume=True)
k = len(store)
while True:
    curve = np.full(2500, float(k))
    run = Evaluation(0, {"E": 1.0 + k}, "ok", "", 1.0, curve, -curve, {"peak_N": float(k)}, 0.5)
    store.append(f"key{k}", run, "fine")
    print(k, flush=True)
    k += 1
    if reopen and k % 3 == 0:
        store.close()
        store = EvaluationStore(path, header, resume=True)
"""


def evaluation(number: float = 1.0, status: str = "ok", reason: str = "", size: int = 50) -> Evaluation:
    """A run whose every number follows from ``number``."""
    s = np.linspace(0.0, 0.04, size)
    fraction = 1.0 if status == "ok" else 0.4
    return Evaluation(7, {"E": 1e5 * number, "mu": 0.1}, status, reason, fraction, s, number * s, {"a": number}, 2.5)


def assert_same(a: Evaluation | None, b: Evaluation) -> None:
    """Every field but the index is equal, bit for bit."""
    assert a is not None
    assert np.array_equal(a.stroke, b.stroke) and np.array_equal(a.force, b.force)
    for name in ("parameters", "status", "reason", "fraction", "scalars", "seconds"):
        assert getattr(a, name) == getattr(b, name)


class Counting:
    """A fake simulator that counts its runs and finishes them in reverse order."""

    def __init__(self, status: str = "ok", reason: str = "") -> None:
        self.runs, self.status, self.reason = 0, status, reason

    def evaluate(self, batch: Sequence[Mapping[str, float]]) -> Iterator[Evaluation]:
        """One run per set; the force tells which."""
        for index in reversed(range(len(batch))):
            self.runs += 1
            s = np.linspace(0.0, 0.04, 10)
            yield Evaluation(index, dict(batch[index]), self.status, self.reason, 1.0, s, s * batch[index]["E"])


def test_what_is_written_is_read(tmp_path: Path) -> None:
    """Runs of different lengths, a failed and an empty one survive closing and reopening bit for bit."""
    runs = [
        evaluation(1.0),
        evaluation(2.0, "failed", "inverted", 9),
        evaluation(3.0, "failed", "not_finite", 0),
    ]
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER) as store:
        for k, run in enumerate(runs):
            store.append(f"k{k}", run, "coarse" if k else "fine")
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True) as again:
        assert len(again) == 3 and [r.fidelity for r in again] == ["fine", "coarse", "coarse"]
        for k, run in enumerate(runs):
            assert_same(again.get(f"k{k}"), run)
        assert again.get("unknown") is None


def test_an_append_is_on_disk_at_once(tmp_path: Path) -> None:
    """Without closing, a second look at the files finds every run: that is what a kill would leave."""
    store = EvaluationStore(tmp_path / "evaluations.h5", HEADER)
    for k in range(3):
        store.append(f"k{k}", evaluation(1.0 + k), "fine")
        copy = tmp_path / f"copy{k}"
        copy.mkdir()
        (copy / "evaluations.h5.journal").write_bytes(store.journal.read_bytes())
        assert len(EvaluationStore(copy / "evaluations.h5", HEADER, resume=True)) == k + 1


def test_a_torn_last_line_costs_that_run_only(tmp_path: Path) -> None:
    """Cut off anywhere within the last run, the journal gives all others, and writing goes on after it."""
    store = EvaluationStore(tmp_path / "whole.h5", HEADER)
    for k in range(3):
        before = store.journal.stat().st_size if k else 0
        store.append(f"k{k}", evaluation(1.0 + k), "fine")
    content = store.journal.read_bytes()
    for cut in range(before + 2, len(content) - 1, 331):
        path = tmp_path / f"cut{cut}.h5"
        path.with_name(path.name + ".journal").write_bytes(content[:cut])
        with EvaluationStore(path, HEADER, resume=True) as again:
            assert len(again) == 2 and again.torn == 1
            assert_same(again.get("k1"), evaluation(2.0))
            again.append("k2", evaluation(3.0), "fine")
        with EvaluationStore(path, HEADER, resume=True) as third:
            assert len(third) == 3 and third.torn == 0


def test_a_write_that_fails_half_way_spoils_no_other(tmp_path: Path) -> None:
    """After half a line (an interrupt, a full disk) the next run of the same process is still read."""
    store = EvaluationStore(tmp_path / "evaluations.h5", HEADER)
    store.append("k0", evaluation(1.0), "fine")
    with store.journal.open("ab") as stream:
        stream.write(b'\n0badc0de {"key": "half')
    store.append("k1", evaluation(2.0), "fine")
    again = EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True)
    assert again.torn == 1 and len(again) == 2
    assert_same(again.get("k1"), evaluation(2.0))


def test_a_damaged_line_is_noticed(tmp_path: Path) -> None:
    """One changed character inside a curve fails the checksum: that run is dropped, not returned wrong."""
    store = EvaluationStore(tmp_path / "evaluations.h5", HEADER)
    store.append("k0", evaluation(1.0), "fine")
    store.append("k1", evaluation(2.0), "fine")
    content = bytearray(store.journal.read_bytes())
    place = content.rindex(b'"force": "') + 100
    content[place] = ord("B") if content[place] == ord("A") else ord("A")
    store.journal.write_bytes(content)
    again = EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True)
    assert again.torn == 1 and [r.key for r in again] == ["k0"]


def test_a_closed_store_can_be_appended_to(tmp_path: Path) -> None:
    """Closing is a checkpoint: runs appended afterwards are as safe as those before."""
    store = EvaluationStore(tmp_path / "evaluations.h5", HEADER)
    for k in range(3):
        store.append(f"k{k}", evaluation(1.0 + k), "fine")
        if k == 1:
            store.close()
    assert len(EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True)) == 3


def kill_while_writing(path: Path, after: int, *options: str) -> int:
    """Start the writer, kill -9 it after some runs; return the number of the last one acknowledged."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", WRITER, str(path), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        for _ in range(after):
            process.stdout.readline()
        process.send_signal(signal.SIGKILL)
        rest = process.stdout.read().split("\n")[:-1]
    return int(rest[-1]) if rest else after - 1


# Only a signal that cannot be caught proves this; where there is none (Windows) the next test covers the states it
# leaves.
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="this system has no SIGKILL to kill the writer with")
@pytest.mark.parametrize("options", [(), ("reopen",)], ids=["journal", "journal and HDF5"])
def test_kill_while_writing(tmp_path: Path, options: tuple[str, ...]) -> None:
    """Killed while it writes, the store opens and has every acknowledged run whole, at most one more."""
    path = tmp_path / "evaluations.h5"
    last = kill_while_writing(path, 8, *options)
    with EvaluationStore(path, HEADER, resume=True) as store:
        assert last + 1 <= len(store) <= last + 2 and store.torn <= 1
        for k, record in enumerate(store):
            assert record.key == f"key{k}"
            assert record.evaluation.force.size == 2500 and np.all(record.evaluation.force == -float(k))
    with h5py.File(path) as file:
        assert len(file["key"]) >= last + 1


def test_kill_between_rename_and_removal(tmp_path: Path) -> None:
    """With the new file, the old journal and a half-written draft on disk each run is there once."""
    path = tmp_path / "evaluations.h5"
    store = EvaluationStore(path, HEADER)
    for k in range(3):
        store.append(f"k{k}", evaluation(1.0 + k), "fine")
    journal = store.journal.read_bytes()
    store.close()
    store.journal.write_bytes(journal)
    path.with_name("evaluations.h5.draft").write_bytes(b"half an HDF5 file")
    with EvaluationStore(path, HEADER, resume=True) as again:
        assert [r.key for r in again] == ["k0", "k1", "k2"]
    assert [p.name for p in tmp_path.iterdir()] == ["evaluations.h5"]


@pytest.mark.parametrize(
    ("header", "word"),
    [
        (Header("cd" * 32, HEADER.scene_key), "trace_sha256"),
        (Header(HEADER.trace_sha256, "apple"), "scene_key"),
        (Header(HEADER.trace_sha256, HEADER.scene_key, schema=99), "schema"),
    ],
)
def test_a_store_of_something_else_is_refused(tmp_path: Path, header: Header, word: str) -> None:
    """Another trace, scene or layout is refused by name, from the HDF5 file and from the journal alone."""
    path = tmp_path / "evaluations.h5"
    store = EvaluationStore(path, HEADER)
    store.append("k", evaluation(), "fine")
    with pytest.raises(OutputError, match=f"another calibration: its {word}"):
        EvaluationStore(path, header, resume=True)
    store.close()
    with pytest.raises(OutputError, match=f"another calibration: its {word}"):
        EvaluationStore(path, header, resume=True)


def test_an_existing_store_is_not_overwritten(tmp_path: Path) -> None:
    """Without --resume a store that exists is left alone and the user told what to do."""
    path = tmp_path / "evaluations.h5"
    with EvaluationStore(path, HEADER) as store:
        store.append("key", evaluation(), "fine")
    with pytest.raises(OutputError, match="exists already; add --resume"):
        EvaluationStore(path, HEADER)


def test_a_store_without_a_run_leaves_no_file(tmp_path: Path) -> None:
    """A run that was refused before its first simulation can be tried again in the same folder."""
    with pytest.raises(OutputError, match="no device"), EvaluationStore(tmp_path / "evaluations.h5", HEADER):
        raise OutputError("no device")
    assert list(tmp_path.iterdir()) == []
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True) as store:
        store.append("key", evaluation(), "fine")
    assert [path.name for path in tmp_path.iterdir()] == ["evaluations.h5"]


def test_foreign_files_and_missing_folders_are_refused(tmp_path: Path) -> None:
    """A file that is no HDF5, one without our layout, and a folder that is not there give an OutputError."""
    text = tmp_path / "text.h5"
    text.write_text("hello")
    with pytest.raises(OutputError, match="no store of evaluations"):
        EvaluationStore(text, HEADER, resume=True)
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file.attrs.update(asdict(HEADER))
    with pytest.raises(OutputError, match="no store of evaluations"):
        EvaluationStore(other, HEADER, resume=True)
    with pytest.raises(OutputError, match="cannot be written"):
        EvaluationStore(tmp_path / "nowhere" / "e.h5", HEADER).append("k", evaluation(), "fine")


def test_plain_h5py_and_pandas_can_read_it(tmp_path: Path) -> None:
    """The recipe of the module's documentation gives a table and the curve of one run."""
    path = tmp_path / "evaluations.h5"
    with EvaluationStore(path, HEADER) as store:
        store.append("k0", evaluation(1.0, size=5), "fine")
        store.append("k1", Evaluation(0, {"R": 3.0}, "failed", "inverted", 0.4, np.arange(3.0), np.arange(3.0)), "fine")
    with h5py.File(path) as f:
        table = pd.DataFrame({name: column[()] for name, column in f["parameters"].items()})
        table["status"] = f["status"].asstr()[()]
        start = f["curves/start"][()]
        force = f["curves/force"][start[1] : start[2]]
        assert f.attrs["trace_sha256"] == HEADER.trace_sha256
    assert list(table.columns) == ["E", "R", "mu", "status"] and list(table.status) == ["ok", "failed"]
    assert table.R[1] == 3.0 and np.isnan(table.R[0]) and list(force) == [0.0, 1.0, 2.0]


def test_key_depends_on_everything_and_on_nothing_else() -> None:
    """Order of names and rounding errors do not change the key; scene, parameters and code do."""
    key = content_key(SCENE, {"E": 1e5, "mu": 0.3}, "1.0")
    assert key == content_key(dict(reversed(SCENE.items())), {"mu": 0.1 + 0.2, "E": 1e5 * (1 + 1e-15)}, "1.0")
    others = [
        content_key(SCENE | {"dx": 1e-3}, {"E": 1e5, "mu": 0.3}, "1.0"),
        content_key(SCENE, {"E": 1.00000001e5, "mu": 0.3}, "1.0"),
        content_key(SCENE, {"E": 1e5, "nu": 0.3}, "1.0"),
        content_key(SCENE, {"E": 1e5, "mu": 0.3}, "1.1"),
    ]
    assert len({key, *others}) == 5
    with pytest.raises(ValueError, match="not JSON compliant"):
        content_key(SCENE | {"dx": float("nan")}, {}, "1.0")


def test_known_runs_are_not_run_again(tmp_path: Path) -> None:
    """Of a batch only the unknown part is simulated, and every answer belongs to its question."""
    simulator = Counting()
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER) as store:
        cached = CachedEvaluator(simulator, store, scene=SCENE, code="1")
        list(cached.evaluate([{"E": 1.0}, {"E": 2.0}]))
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER, resume=True) as store:
        cached = CachedEvaluator(simulator, store, scene=SCENE, code="1")
        batch = [{"E": 3.0}, {"E": 2.0}, {"E": 4.0}, {"E": 1.0}]
        answers = {e.index: e for e in cached.evaluate(batch)}
        assert simulator.runs == 4 and cached.computed == 2
        for index, parameters in enumerate(batch):
            assert answers[index].parameters == parameters
            assert answers[index].force[-1] == pytest.approx(0.04 * parameters["E"])
        assert CachedEvaluator(simulator, store, scene=SCENE, code="2").computed == 0
        list(CachedEvaluator(simulator, store, scene=SCENE, code="2").evaluate(batch))
        assert simulator.runs == 8


@pytest.mark.parametrize(
    ("status", "reason", "again"),
    [("failed", "inverted", False), ("failed", "worker_died", True), ("timeout", "", True)],
)
def test_only_repeatable_failures_are_remembered(tmp_path: Path, status: str, reason: str, again: bool) -> None:
    """A material that breaks the solver breaks it again; a killed worker or a timeout is tried again."""
    with EvaluationStore(tmp_path / "evaluations.h5", HEADER) as store:
        list(CachedEvaluator(Counting(status, reason), store, scene=SCENE, code="1").evaluate([{"E": 1.0}]))
        second = Counting()
        answer = list(CachedEvaluator(second, store, scene=SCENE, code="1").evaluate([{"E": 1.0}]))
        assert (second.runs == 1) is again and len(store) == 1
        assert answer[0].ok is again


def test_the_journal_is_forced_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each run is given to the disk, whole and by fsync of the journal, before append returns: what only the system
    has taken is lost when the power fails. So is the HDF5 file before it takes the place of the journal."""
    forced: list[tuple[str, bytes]] = []

    def fsync(number: int) -> None:
        path = Path(os.readlink(f"/proc/self/fd/{number}")) if Path("/proc/self/fd").exists() else None
        if path is None:
            pytest.skip("this system does not say which file a number is")
        forced.append((path.name, path.read_bytes()))

    monkeypatch.setattr(os, "fsync", fsync)
    store = EvaluationStore(tmp_path / "evaluations.h5", HEADER)
    for k in range(3):
        store.append(f"k{k}", evaluation(1.0 + k), "fine")
        name, content = forced[-1]
        assert name == "evaluations.h5.journal" and f'"k{k}"'.encode() in content and content.endswith(b"}\n")
        assert content == store.journal.read_bytes()
    forced.clear()
    store.close()
    assert forced == [("evaluations.h5.draft", store.path.read_bytes())]
