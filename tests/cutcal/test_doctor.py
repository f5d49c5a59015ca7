"""``cutcal doctor``: each thing that can be missing is found, named, and has a remedy."""

from __future__ import annotations

import json
import subprocess
from importlib import metadata
from pathlib import Path

import pytest
import taichi

from cutcal import doctor
from cutcal.commands.catalogue.doctor import WIDE, line
from cutcal.main import main
from mpm.runtime import Runtime, start
from mpm.scene.errors import SceneError
from tests.calib.documents import valid


@pytest.mark.slow
def test_a_sound_machine_passes(capsys, tmp_path):
    """Where these tests run all that is needed is there: the small cut needs R times the width, within 5 %."""
    assert main(["doctor", "--json", "--out", str(tmp_path)]) == 0
    document = valid(json.loads(capsys.readouterr().out))
    found = {f["name"]: f for f in document["findings"]}
    assert document["passed"] and all(f["state"] != "fail" for f in found.values())
    assert "7.2 N" in found["solver"]["words"] and "16 foods" in found["foods and knives"]["words"]
    assert list(tmp_path.iterdir()) == []


def test_a_missing_package_is_named_with_its_remedy(monkeypatch):
    """One that is needed fails; one of an extra is only said, with the option it is for."""
    real = metadata.version

    def version(name: str) -> str:
        if name in gone:
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", version)
    gone = {"scipy"}
    assert doctor.packages() == doctor.Finding("packages", "fail", "missing: pip install scipy")
    gone = {"dynesty"}
    found = doctor.packages()
    assert found.state == "ok" and "dynesty for --sample (pip install 'cutcal[sample]')" in found.words
    gone = {"av", "pyarrow"}
    assert "av, pyarrow for dataset export (pip install 'cutcal[data]')" in doctor.packages().words


def test_a_long_finding_goes_on_below_itself():
    """Lines stay short, nothing is lost, and the words of the second begin under those of the first."""
    words = "all are installed; absent: " + "; ".join(f"some-package-{k} for something" for k in range(9))
    lines = line(doctor.Finding("packages", "ok", words)).splitlines()
    assert len(lines) > 2 and max(map(len, lines)) <= WIDE
    assert {len(text) - len(text.lstrip()) for text in lines[1:]} == {lines[0].index("all are")}
    assert " ".join(text.strip() for text in lines).endswith(words)


@pytest.mark.parametrize(
    ("stdout", "stderr", "code", "said"),
    [
        ("", "arch: cuda is not available on this machine; use --arch cpu", 1, "not on this machine"),
        ("", "Traceback\nRuntimeError: no driver", 1, "RuntimeError: no driver"),
        ("", "", -11, "ended with -11"),
    ],
)
def test_a_device_that_is_not_there_is_no_failure_but_a_solver_is(monkeypatch, stdout, stderr, code, said):
    """Missing, broken or crashed: the reason is said, and the CPU is what remains; without it nothing works."""
    done = subprocess.CompletedProcess([], code, stdout, stderr)
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: done)
    cuda, cache = doctor.device("cuda", "CUDA")
    assert cuda.state == "absent" and said in cuda.words and "CPU" in cuda.words and cache is None
    cpu, _ = doctor.device("cpu", "solver")
    assert cpu.state == "fail" and "pip install" in cpu.words


def test_a_device_that_computes_wrongly_or_hangs_is_told(monkeypatch):
    """A force that is not R times the width, a balance that does not close, no answer."""

    def device(**changes: float) -> doctor.Finding:
        answer = {"force_N": 7.2, "balance": 1e-14, "seconds": 0.1, "cache": ""} | changes
        done = subprocess.CompletedProcess([], 0, "noise\n" + json.dumps(answer), "")
        monkeypatch.setattr(subprocess, "run", lambda *a, **k: done)
        return doctor.device("vulkan", "Vulkan")[0]

    assert device().state == "ok"
    assert device(force_N=6.5).state == device(balance=0.1).state == device(force_N=float("nan")).state == "fail"

    def hang(command: list[str], timeout: float, **_: object) -> None:
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    assert "no answer" in doctor.device("vulkan", "Vulkan")[0].words


def test_a_busy_machine_is_not_called_broken(monkeypatch):
    """Where many processes want the cores a solver that has not answered may only have waited: that comes first."""
    if not hasattr(doctor.os, "getloadavg"):
        pytest.skip("no load average on this system")

    def hang(command: list[str], timeout: float, **_: object) -> None:
        raise subprocess.TimeoutExpired(command, timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    monkeypatch.setattr(doctor, "_cores", lambda: 2)
    said = {}
    for load in (0.3, 7.2):
        monkeypatch.setattr(doctor.os, "getloadavg", lambda load=load: (load, load, load))
        said[load] = doctor.device("cpu", "solver")[0].words
    assert said[0.3] == "no answer within 180 s; pip install --force-reinstall taichi"
    assert "while 7 processes wanted 2 cores; end other programs and try again, else pip" in said[7.2]


def test_cache_memory_and_folder(monkeypatch, tmp_path):
    """No cache is slow, not wrong; little memory and a folder that is missing fail."""
    assert doctor.kernels(None).state == doctor.kernels(tmp_path / "none").state == "absent"
    (tmp_path / "a").write_bytes(b"0" * 2_000_000)
    assert doctor.kernels(tmp_path).words.endswith("2 MB")
    assert doctor.writable("folder", tmp_path).state == "ok"
    lost = doctor.writable("folder", tmp_path / "none")
    assert lost.state == "fail" and "--out" in lost.words
    monkeypatch.setattr(doctor, "_free_memory", lambda: 1e6)
    assert doctor.memory().state == "fail" and "--workers 1" in doctor.memory().words


def test_failures_count(monkeypatch, capsys):
    """One failure makes exit code 2."""
    lines = [doctor.Finding("a", "ok", "fine"), doctor.Finding("b", "fail", "broken; mend it")]
    monkeypatch.setattr("cutcal.commands.catalogue.doctor.examine", lambda folder: iter(lines))
    assert main(["doctor"]) == 2
    assert "1 of 2 failed" in capsys.readouterr().out


def test_a_device_that_is_missing_is_one_line(monkeypatch, capsys, tmp_path: Path):
    """An error that names the device, in the solver and on the command line. Metal, which has no doubles, cannot be
    asked for."""

    def init(**options):
        raise RuntimeError("Arch=cuda is not supported")

    monkeypatch.setattr(taichi, "init", init)
    with pytest.raises(SceneError, match="cuda is not available"):
        start(Runtime("cuda"), "f64")
    assert main(["simulate", "--food", "banana", "--arch", "cuda", "--out", str(tmp_path / "x")]) == 1
    assert capsys.readouterr().err.strip().splitlines()[-1].startswith("cutcal: arch: cuda is not available")
    with pytest.raises(SceneError, match="'metal' is not one of cpu, cuda, vulkan, gpu"):
        Runtime("metal")


ATTEMPTS = pytest.mark.parametrize(
    ("code", "stdout", "stderr", "state", "said"),
    [
        (0, "drawn without a screen by X\n", "", "ok", "drawn without"),
        (1, "", "Traceback\nRuntimeError: no OpenGL", "absent", "no OpenGL; everything else works"),
        (-11, "", "", "absent", "ended with -11"),
    ],
)
"""How a process that tries something optional may end."""


@ATTEMPTS
def test_the_robot_simulator_may_be_missing_or_blind(monkeypatch, code, stdout, stderr, state, said):
    """Not installed: what to install. Installed without a renderer: which feature of Vulkan it asks for. Neither is a
    failure."""
    monkeypatch.setattr(doctor, "_installed", lambda name: False)
    assert doctor.robot().state == "absent" and "cutcal[robot]" in doctor.robot().words
    monkeypatch.setattr(doctor, "_installed", lambda name: True)
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: subprocess.CompletedProcess([], code, stdout, stderr))
    found = doctor.robot()
    assert found.state == state and said.split(";")[0] in found.words
    assert state == "ok" or "descriptorBindingPartiallyBound" in found.words


@ATTEMPTS
def test_pictures_may_be_missing(monkeypatch, code, stdout, stderr, state, said):
    """Drawing in a process of its own: whatever it dies of is said, and nothing else needs it."""
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: subprocess.CompletedProcess([], code, stdout, stderr))
    found = doctor.pictures()
    assert found.state == state and said in found.words
