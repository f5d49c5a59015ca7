"""The output folder: one run at a time, of one command, on a disk with room."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
from collections import namedtuple

import pytest

from calib.errors import OutputError
from calib.io.folder import LOCK, OWN_FILES, RUN_FILES, prepare
from calib.io.schema import names, tag
from tests.data_dir import ROOT

HOLDER = """
import sys
from pathlib import Path
from calib.io.folder import prepare
with prepare(Path(sys.argv[1]), "calibrate", resume=True):
    print("held", flush=True)
    sys.stdin.read()
"""


def holder(folder):
    """A process that holds the folder until its input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(folder)], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "held\n"
    return process


def test_one_run_at_a_time(tmp_path):
    """While a process holds the folder another run is refused, also with --resume, here and in other threads."""
    process = holder(tmp_path)
    try:
        with pytest.raises(OutputError, match="another run is at work there"), prepare(tmp_path, "study", resume=True):
            pass
    finally:
        process.communicate()
    with prepare(tmp_path, "calibrate", resume=True):
        with pytest.raises(OutputError, match="at work"), prepare(tmp_path, "calibrate", resume=True):
            pass
    with prepare(tmp_path, "calibrate", resume=True):
        pass


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="processes cannot be killed without notice here")
def test_a_kill_leaves_no_lock(tmp_path):
    """A process that is killed holds nothing: the same command with --resume goes on at once."""
    process = holder(tmp_path)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert (tmp_path / LOCK).exists()
    with prepare(tmp_path, "calibrate", resume=True):
        pass


@pytest.mark.parametrize(
    ("document", "name"),
    [
        ("calibrate", "converge.json"),
        ("calibrate", "force.csv"),
        ("converge", "summary.json"),
        ("verify", "evaluations.h5"),
        ("evaluate", "coverage.jsonl"),
        ("prior", "scalars.json"),
    ],
)
def test_resume_leaves_other_commands_alone(document, name, tmp_path):
    """--resume goes on with a run of the same command and with no other; the error names the file."""
    (tmp_path / name).write_text("precious")
    with pytest.raises(OutputError, match=f"{name} there is of another command"):
        with prepare(tmp_path, document, resume=True):
            pass
    assert [path.name for path in tmp_path.iterdir()] == [name] and (tmp_path / name).read_text() == "precious"


@pytest.mark.parametrize("other", ["study", "predict", "simulate"])
def test_a_summary_says_whose_it_is(other, tmp_path):
    """summary.json has several commands: its schema decides; one that is damaged is written anew."""
    path = tmp_path / "summary.json"
    path.write_text(json.dumps({"schema": tag(other)}))
    with pytest.raises(OutputError, match="summary.json there is of another command"):
        with prepare(tmp_path, "calibrate", resume=True):
            pass
    for content in (json.dumps({"schema": tag("calibrate")}), '{"schema"', "[]"):
        path.write_text(content)
        with prepare(tmp_path, "calibrate", resume=True):
            pass


def test_every_run_file_is_known():
    """Files that runs may go on with are files by which a run is known, and belong to documents there are."""
    assert {name for own in OWN_FILES.values() for name in own} <= set(RUN_FILES)
    assert set(OWN_FILES) <= set(names())


def test_a_full_disk_is_said_at_once(tmp_path, monkeypatch):
    """A disk without room is refused before anything is computed."""
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(10**9, 10**9 - 10**6, 10**6))
    with pytest.raises(OutputError, match="1 MB are free on its disk and 20 MB are needed"):
        with prepare(tmp_path, "calibrate", resume=False):
            pass
