"""A cluster behind TLS, set up as the documentation says, and what is said of one that is not."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest

from calib.simulation.dask_cluster import _is_trusted
from tests.data_dir import ROOT

pytest.importorskip("distributed", reason="the extra [cluster] is not installed")
ASK = """
import sys
from calib.simulation.dask_cluster import Cluster
from mpm.scene.errors import CutcalError

if __name__ == "__main__":
    said = []
    try:
        with Cluster(sys.argv[1], say=said.append) as cluster:
            print(sorted(cluster.each(str.format, [("{}{}",), ("a{}{}",)])), cluster.workers, len(said))
    except CutcalError as error:
        sys.exit(str(error))
"""


@pytest.mark.parametrize(
    ("address", "trusted"),
    [
        ("tcp://127.0.0.1:8786", True),
        ("127.0.0.1:8786", True),
        ("tcp://[::1]:8786", True),
        ("localhost:8786", True),
        ("tls://10.0.0.5:8786", True),
        ("tcp://10.0.0.5:8786", False),
        ("host:8786", False),
    ],
)
def test_who_is_trusted(address, trusted):
    """This machine and whoever shows a certificate; of others the command says what they can do."""
    assert _is_trusted(address) is trusted


def from_the_docs(what):
    """Lines of the documentation's section on TLS that match."""
    text = (ROOT / "docs" / "calibrate.md").read_text().partition("## Other machines and TLS")[2]
    return re.findall(rf"^ *({what}.*)$", text, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("openssl") is None or os.name != "posix", reason="certificates are made by openssl")
def test_tls_on_this_machine(tmp_path):
    """With the certificates of the documentation command and worker reach a scheduler; without one nobody does."""
    for line in from_the_docs("openssl"):
        subprocess.run(line.split(), cwd=tmp_path, check=True, capture_output=True)
    exports = "\n".join(["for side in SCHEDULER WORKER CLIENT; do", *from_the_docs("export"), "done"])
    done = subprocess.run(["bash", "-c", f"{exports}\nenv"], cwd=tmp_path, capture_output=True, text=True, check=True)
    own = dict(line.split("=", 1) for line in done.stdout.splitlines() if line.startswith("DASK_"))
    assert len(own) == 8
    plain = {k: v for k, v in os.environ.items() if not k.startswith("DASK_")} | {"PYTHONPATH": str(ROOT)}
    env, told = plain | own, tmp_path / "scheduler.json"
    started = []

    def start(kind, *options):
        words = [
            sys.executable,
            "-m",
            f"distributed.cli.dask_{kind}",
            *options,
            "--host",
            "127.0.0.1",
            "--no-dashboard",
        ]
        with (tmp_path / f"{kind}.log").open("wb") as log:
            started.append(
                subprocess.Popen(words, cwd=tmp_path, env=env, stdout=log, stderr=log, start_new_session=True)
            )

    (tmp_path / "ask.py").write_text(ASK)
    try:
        start("scheduler", "--protocol", "tls", "--port", "0", "--scheduler-file", str(told))
        deadline = time.monotonic() + 60
        while not (told.exists() and told.read_text().endswith("}")) and time.monotonic() < deadline:
            time.sleep(0.05)
        (address,) = set(re.findall(r"tls://127\.0\.0\.1:\d+", told.read_text()))
        start("worker", address, "--nthreads", "1", "--local-directory", str(tmp_path))
        ask = [sys.executable, "ask.py", address]
        while time.monotonic() < deadline:
            done = subprocess.run(ask, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
            if "has no workers" not in done.stderr:
                break
        assert done.returncode == 0 and done.stdout == "[(0, 'cpu1'), (1, 'acpu1')] 1 1\n", done.stderr
        done = subprocess.run(ask, cwd=tmp_path, env=plain, capture_output=True, text=True, check=False)
        assert done.returncode == 1 and "no Dask scheduler answers there" in done.stderr
        ask[-1] = address.replace("tls", "tcp")
        done = subprocess.run(ask, cwd=tmp_path, env=plain, capture_output=True, text=True, check=False)
        assert done.returncode == 1 and "no Dask scheduler answers there" in done.stderr
    finally:
        for process in started[::-1]:
            os.killpg(process.pid, signal.SIGTERM)
            process.wait(20)
