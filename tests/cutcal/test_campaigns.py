"""Campaigns against a calibration, with a formula in place of the solver: signals, full disks, odd environments.

Nothing is lost, nothing is made up, no traceback. They run for many minutes: ``pytest -m long tests/cutcal``.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.calib.cheap import LOG, SECONDS
from tests.data_dir import ROOT

pytestmark = pytest.mark.long
TRACE = ROOT / "force_data" / "banana_reconstructed.csv"
PROGRAM = """
if __name__ == "__main__":
    import sys

    from cutcal import main as program

    real = program.command

    def command(name):
        from cutcal import options
        from tests.calib.cheap import CheapPool

        options.Pool = CheapPool
        return real(name)

    program.command = command
    sys.exit(program.main(sys.argv[1:]))
"""
DONE = (0, 2)  # exit codes of a calibration that came to its end
STARTED_S = 0.15  # after which Python itself has started, on a loaded machine too


class Calibration:
    """A calibration of a second or two in a folder of its own."""

    def __init__(self, folder: Path, out: Path | None = None) -> None:
        folder.mkdir(exist_ok=True)
        self.folder, self.out, self.script = folder, out or folder / "out", folder / "study.py"
        self.script.write_text(PROGRAM)
        self.env = os.environ | {"PYTHONPATH": str(ROOT), LOG: str(folder / "log"), SECONDS: "0.02"}
        self.fixed = ["calibrate", "--food", "banana", "--fit", "E,R", "--budget", "20"]

    def start(self, *more: str, **env: str) -> subprocess.Popen[str]:
        """Begin, or go on."""
        words = [sys.executable, str(self.script), *self.fixed, "--trace", str(TRACE), "--out", str(self.out), *more]
        return subprocess.Popen(
            words, env=self.env | env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=self.folder
        )

    def finish(self, *more: str) -> dict[str, object]:
        """Let it end; what its summary says, less when, how long and of which commit."""
        process = self.start(*more)
        _, said = process.communicate()
        assert process.returncode in DONE, said
        found = json.loads((self.out / "summary.json").read_text())
        return {k: v for k, v in found.items() if k not in ("created", "wall_s", "command", "git")}


def test_forty_kills_and_signals(tmp_path):
    """SIGKILL, SIGINT, SIGTERM and SIGHUP at forty moments of one study, which is taken up again after each: no
    traceback, Ctrl-C is exit code 130, and the end is that of an undisturbed study."""
    calm = Calibration(tmp_path / "calm").finish()
    random = np.random.default_rng(5)
    hunted, round_ = Calibration(tmp_path / "hunted0"), 0
    for k in range(40):
        number = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)[k % 4]
        process = hunted.start(*(["--resume"] if hunted.out.exists() else []))
        time.sleep(STARTED_S + random.uniform(0, 4.0))
        ended = process.poll() is not None
        process.send_signal(number)
        _, said = process.communicate()
        assert "Traceback" not in said, said
        if not ended and process.returncode not in DONE:
            assert process.returncode == (130 if number == signal.SIGINT else -number), (number, said)
        if process.returncode in DONE:  # it was quicker
            assert hunted.finish("--resume") == calm
            round_ += 1
            hunted = Calibration(tmp_path / f"hunted{round_}")
    assert hunted.finish(*(["--resume"] if hunted.out.exists() else [])) == calm


DISK = """
import os, shutil, subprocess, sys, time
from pathlib import Path

disk, left, journal, words = Path(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]), sys.argv[4:]
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=40M", "tmpfs", str(disk)], check=True)
process = subprocess.Popen(words, env=os.environ | {"TMPDIR": str(disk)}, stderr=subprocess.PIPE, text=True)
while process.poll() is None and not journal.exists():
    time.sleep(0.01)
while process.poll() is None:
    try:
        with open(disk / "filler", "wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(shutil.disk_usage(disk).free - left, 1))
        break
    except OSError:
        time.sleep(0.002)
_, said = process.communicate()
(disk / "filler").unlink(missing_ok=True)
again = subprocess.run([*words, "--resume"], stderr=subprocess.PIPE, text=True)
print(repr((process.returncode, said, again.returncode, again.stderr)))
"""


def test_twenty_full_disks(tmp_path):
    """A disk on which 4 kB to 3 MB are left once the first run is stored: one line, or done; with room again --resume
    comes to the end."""
    if subprocess.run(["unshare", "-rm", "true"], check=False).returncode:
        pytest.skip("no disk can be mounted here without being root")
    disk = tmp_path / "disk"
    disk.mkdir()
    program = Calibration(tmp_path / "run", disk / "out")
    journal = disk / "out" / "evaluations.h5.journal"
    words = [sys.executable, str(program.script), *program.fixed, "--trace", str(TRACE), "--out", str(program.out)]
    for k in range(20):
        left = str(int(4096 * 1.42**k))
        done = subprocess.run(
            ["unshare", "-rm", sys.executable, "-c", DISK, str(disk), left, str(journal), *words],
            env=program.env,
            capture_output=True,
            text=True,
            check=True,
        )
        code, said, again, after = eval(done.stdout.splitlines()[-1])
        assert "Traceback" not in said + after and again in DONE, (left, said, after)
        lines = [line for line in said.splitlines() if line.startswith("cutcal: ")]
        assert code in DONE or (code == 1 and len(lines) == 1 and "space" in lines[0]), (left, code, said)


ENVIRONMENTS = {  # what is done to the shell, what to the command, and whether it works (None) or what is said
    "notebook": ("export MPLBACKEND=module://matplotlib_inline.backend_inline", "", None),
    "no such backend": ("export MPLBACKEND=nonsense", "", None),
    "backend with a screen": ("export MPLBACKEND=TkAgg; unset DISPLAY", "", None),
    "C locale": ("export LC_ALL=C LANG=C", "", None),
    "no UTF-8": ("export LC_ALL=POSIX PYTHONUTF8=0 PYTHONCOERCECLOCALE=0", "", None),
    "ASCII streams": ("export PYTHONIOENCODING=ascii", "", None),
    "no HOME": ("unset HOME", "", None),
    "HOME that cannot be written": ("export HOME=/proc/1", "", None),
    "HOME that is not there": ("export HOME=/nonexistent", "", None),
    "TMPDIR that is not there": ("export TMPDIR=/nonexistent", "", None),
    "optimised": ("export PYTHONOPTIMIZE=2", "", None),
    "stdin closed": ("", "<&-", None),
    "stdout closed": ("", ">&-", None),
    "stderr closed": ("", "2>&-", None),
    "all closed": ("", "<&- >&- 2>&-", None),
    "stderr full": ("", "2>/dev/full", None),
    "stdout full": ("", ">/dev/full", "stdout cannot be written"),
    "JSON into a full stdout": ("", "--json >/dev/full", "stdout cannot be written"),
    "a reader that has gone": ("", "| true", None),
    "60 files": ("ulimit -n 64", "", None),
    "20 files": ("ulimit -n 20", "", "ulimit -n"),
    "files of 40 kB": ("ulimit -f 40", "", "File too large"),
    "paths of bytes": (
        "mkdir -p $'d\\xff'; cp TRACE $'d\\xff/c\\xfe.csv'",
        "--out $'d\\xff/o' --trace $'d\\xff/c\\xfe.csv'",
        None,
    ),
    "trace from stdin": ("", "--trace /dev/stdin < TRACE", None),
    "trace from a pipe": ("", "--trace <(cat TRACE)", "a pipe or a device"),
    "trace from a FIFO": ("rm -f pipe; mkfifo pipe", "--trace pipe", "a pipe or a device"),
    "trace from a device": ("", "--trace /dev/zero", "a pipe or a device"),
    "material from a FIFO": ("rm -f pipe; mkfifo pipe", "--material pipe", "a pipe or a device"),
    "knife from a device": ("ln -sf /dev/zero k.yaml", "--knife k.yaml", "a pipe or a device"),
    "trace is a folder": ("", "--trace /tmp", "is a directory"),
    "results into a device": ("", "--out /dev/null", "is a file, not a folder"),
    "results into /proc": ("", "--out /proc/x", "cannot be written"),
    "a long name": ("", "--out " + "a" * 300, "File name too long"),
}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="environments are those of Linux")
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_environments(name, tmp_path):
    """It works, or it is one line that says why not; never a traceback, and nothing waits for ever."""
    before, after, said = ENVIRONMENTS[name]
    program = Calibration(tmp_path / "run")
    line = f"{before}\n{sys.executable} {program.script} {' '.join(program.fixed)} --trace TRACE --out out {after}"
    done = subprocess.run(
        ["bash", "-c", line.replace("TRACE", str(TRACE))],
        env=program.env,
        cwd=program.folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    if said is None:
        assert done.returncode in DONE, done.stderr
        assert list(program.folder.rglob("report.pdf"))
    else:
        assert done.returncode == 1
        (last,) = [text for text in done.stderr.splitlines() if text.startswith("cutcal: ")]
        assert said in last
    shutil.rmtree(program.folder)
