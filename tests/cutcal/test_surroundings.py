"""What machines do to a command: streams that are closed or full, limits, variables, paths of bytes, things that are no
files."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest

from calib.io.folder import finite
from cutcal import surroundings
from cutcal.main import main
from mpm.files import read_regular, write_atomic
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT

resource = pytest.importorskip("resource", reason="limits of open files are those of Unix")
LINUX = pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")


def cutcal(words: str, how: str = "", **env: str) -> subprocess.CompletedProcess[str]:
    """A command in a shell that does something to it first, or to its streams."""
    line = f"{sys.executable} -m cutcal.main {words} {how}"
    return subprocess.run(
        ["bash", "-c", line], cwd=ROOT, env=os.environ | env, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    ("how", "code", "said"),
    [
        ("<&- >&- 2>&-", 0, ""),
        (">/dev/full", 1, "cutcal: stdout cannot be written (No space left on device)"),
    ],
)
@LINUX
def test_streams_that_are_closed_or_full(how, code, said):
    """Without streams a command works; where results cannot be printed one line says so."""
    done = cutcal("knives", how)
    assert done.returncode == code and "Traceback" not in done.stderr
    assert done.stderr.startswith(said) and done.stderr.count("\n") == bool(said)


def test_a_closed_stream_is_no_file(tmp_path):
    """What is opened by a process without standard streams does not get their numbers, nor what is printed."""
    code = (
        "import os, sys\nfrom cutcal.surroundings import fit_process\n"
        f"with fit_process():\n    f = open({str(tmp_path / 'results')!r}, 'w')\n"
        "    os.write(1, b'noise of a library'); print('words'); assert f.fileno() > 2"
    )
    done = subprocess.run(
        ["bash", "-c", f'{sys.executable} -c "$CODE" >&- 2>&-'], env=os.environ | {"CODE": code}, cwd=ROOT
    )
    assert done.returncode == 0 and (tmp_path / "results").read_text() == ""


class Full(io.RawIOBase):
    """A stream on a full disk."""

    def writable(self):
        return True

    def write(self, data):
        raise OSError(28, "No space left on device")

    def fileno(self):
        return self.number


@pytest.mark.parametrize("name", ["stdout", ""])
def test_a_stream_that_fills_up(name, tmp_path):
    """Results that are lost are an error; notes that are lost are not, and a later one is dropped as well."""
    raw = Full()
    raw.number = os.open(tmp_path / "stream", os.O_WRONLY | os.O_CREAT)
    stream = surroundings.Stream(io.TextIOWrapper(io.BufferedWriter(raw), write_through=True), name)
    if name:
        with pytest.raises(CutcalError, match="stdout cannot be written"):
            stream.write("words\n")
            stream.flush()
    else:
        stream.write("words\n")
        stream.flush()
    os.close(raw.number)


def test_few_files_are_raised_or_refused(monkeypatch):
    """A soft limit is raised; a hard one that is too small is one line that says what to do."""
    limits = {"now": (20, 4096)}
    monkeypatch.setattr(resource, "getrlimit", lambda which: limits["now"])
    monkeypatch.setattr(resource, "setrlimit", lambda which, new: limits.update(now=new))
    surroundings.check_limits()
    assert limits["now"] == (surroundings.ENOUGH_FILES, 4096)
    limits["now"] = (20, 20)
    with pytest.raises(CutcalError, match="20 files open and 64 are needed.*ulimit -n"):
        surroundings.check_limits()


def test_a_notebooks_way_of_drawing_is_left(monkeypatch):
    """MPLBACKEND of a notebook is nothing to a command that draws into files."""
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    with surroundings.fit_process():
        assert os.environ["MPLBACKEND"] == "agg"


@pytest.mark.parametrize("option", ["--trace", "--material", "--knife"])
@pytest.mark.parametrize("kind", ["fifo", "/dev/zero", "/dev/null"])
@LINUX
def test_what_is_no_file_is_refused(option, kind, tmp_path, capsys):
    """A pipe that nobody writes into and a device that never ends are one line at once."""
    path = kind
    if kind == "fifo":
        path = str(tmp_path / "pipe")
        os.mkfifo(path)
    argv = ["calibrate", "--food", "banana", "--trace", str(ROOT / "force_data" / "banana_reconstructed.csv")]
    folder = tmp_path / "out"
    if option == "--knife" and "/" in path:
        (tmp_path / "knife.yaml").symlink_to(path)
        path = str(tmp_path / "knife.yaml")
    assert main([*argv, option, path, "--out", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "a pipe or a device, not a file" in said and said.count("\n") == 1 and not folder.exists()


def test_a_file_behind_stdin_is_one():
    """What stdin is redirected from can be read, and so can a file behind a link; a folder and a large file cannot."""
    done = subprocess.run(
        [sys.executable, "-c", "from mpm.files import *; print(len(read_regular(Path('/dev/stdin'))))"],
        stdin=open(ROOT / "knives.yaml"),
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert int(done.stdout) == (ROOT / "knives.yaml").stat().st_size
    with pytest.raises(OSError):
        read_regular(ROOT)
    with pytest.raises(OSError, match="at most 1e-06 MB"):
        read_regular(ROOT / "knives.yaml", 1)


def test_bytes_of_a_path_are_printable(tmp_path):
    """A path that is not UTF-8 is written as an escape, into documents and into text."""
    name = os.fsdecode(b"cut\xff.csv")
    assert finite({"trace": name, name: [name]}) == {"trace": "cut\\xff.csv", "cut\\xff.csv": ["cut\\xff.csv"]}
    assert finite("half a letter \ud83d") == "half a letter \\ud83d" and finite("5 µm") == "5 µm"
    write_atomic(tmp_path / "text", f"trace: {name}\n")
    assert (tmp_path / "text").read_text(encoding="utf-8") == "trace: cut\\udcff.csv\n"


def test_other_errors_of_the_machine_are_one_line(tmp_path, capsys, monkeypatch):
    """A name that is too long, no memory: one line and exit code 1."""
    argv = ["calibrate", "--food", "banana", "--trace", str(ROOT / "force_data" / "banana_reconstructed.csv")]
    assert main([*argv, "--out", "a" * 300]) == 1
    assert "File name too long; check path and disk" in capsys.readouterr().err
    monkeypatch.setattr("cutcal.commands.catalogue.knives.run", lambda args: bytearray(1 << 62))
    assert main(["knives"]) == 1
    assert capsys.readouterr().err.startswith("cutcal: out of memory; ")


@pytest.mark.parametrize(("command", "resume"), [("calibrate", True), ("simulate", False)])
def test_ctrl_c_names_resume(command, resume, monkeypatch, capsys):
    """Ctrl-C is exit code 130 and one line, which names --resume where there is such an option."""

    def pressed(args):
        raise KeyboardInterrupt

    kind = "calibration" if command == "calibrate" else "solver"
    monkeypatch.setattr(f"cutcal.commands.{kind}.{command}.run", pressed)
    assert main([command, "--food", "banana"]) == 130
    said = capsys.readouterr().err
    assert said.startswith("cutcal: interrupted") and ("--resume goes on" in said) is resume and said.count("\n") == 1
