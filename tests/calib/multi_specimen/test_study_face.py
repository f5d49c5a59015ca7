"""What ``Study`` takes in Python is what ``calibrate`` takes for several cuts, and it reaches the run."""

from __future__ import annotations

from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib.multi_specimen.compression_modulus import CompressionModulus
from calib.multi_specimen.run import _pressed
from cutcal import Calibration, Study, Trace
from cutcal.commands.calibration.calibrate import OF_A_STUDY
from mpm.scene.errors import CutcalError
from tests.data_dir import ROOT

OTHERWISE = {"config", "json", "check"}
"""Said in another way: the file that was read, the result's summary, and the method of a trace."""


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What each run is asked to do, in place of doing it."""
    calls: list[dict[str, Any]] = []

    def run(study: Any, out: Path, pool: Any, **how: Any) -> None:
        calls.append({"study": study, "out": out, "pool": pool} | how)

    monkeypatch.setattr("calib.multi_specimen.run.run", run)
    return calls


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """Two cuts of the bundled trace, as specimens."""
    trace = ROOT / "force_data" / "banana_reconstructed.csv"
    file = tmp_path / "twice.yaml"
    file.write_text(f"food: banana\ntraces:\n  a: {{trace: {trace}}}\n  b: {{trace: {trace}}}\n")
    return file


def test_every_option_of_a_study_is_an_argument() -> None:
    """None is missing on either side."""
    assert set(OF_A_STUDY) - OTHERWISE == set(signature(Study.run).parameters) - {"self", "progress", "say"}


def test_arguments_reach_the_run(study: Path, ran: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Budget and device of every cut; the number of workers; the command that the summary states; the folder."""
    Study.read(study).run(workers=3, budget=7, arch="cuda")
    (call,) = ran
    assert [(r.budget, r.arch) for r in call["study"].requests.values()] == [(7, "cuda")] * 2
    assert call["study"].budget == 7 and (call["pool"].workers, call["pool"].arch) == (3, "cuda")
    assert call["study"].first.command == (f"Study.read({str(study)!r}).run(budget=7, arch='cuda')",)
    assert call["out"] == Path("cutcal-twice")
    seen: list[Any] = []
    monkeypatch.setattr(
        "calib.simulation.dask_cluster.Cluster", lambda *args, **how: seen.append(args) or pytest.fail("not caught")
    )
    with pytest.raises(pytest.fail.Exception):
        Study.read(study).run(scheduler="tcp://host:8786")
    assert seen == [("tcp://host:8786", None, "cpu")]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"workers": 0}, "workers = 0; give a whole number"),
        ({"budget": -1.0}, "budget"),
        ({"arch": "abacus"}, "arch = abacus is none of cpu"),
    ],
)
def test_impossible_arguments_are_one_line(study: Path, change: dict[str, Any], words: str) -> None:
    """Before anything is written."""
    with pytest.raises(CutcalError, match="Study.run") as caught:
        Study.read(study).run(study.with_name("out"), **change)
    assert words in str(caught.value) and not study.with_name("out").exists()


def twice_cut() -> Trace:
    """A record of two cuts 4 s apart, each of 2 s, with the knife's height [m]."""
    time = np.arange(0.0, 12.0, 0.01)
    cuts = [
        np.clip(np.sin(np.pi * (time - start) / 2.0), 0.0, None) * (abs(time - start - 1.0) < 1.0) for start in (2, 7)
    ]
    return Trace(time=time, force=9.0 * sum(cuts), position=0.05 - 0.03 * sum(cuts), source="two.csv", label="measured")


def test_all_cuts_of_a_record(ran: list[dict[str, Any]]) -> None:
    """As ``--all``: each is a specimen of its own; what is for one cut is refused, and a record of one cut is."""
    Study.of_cuts(Calibration("banana", twice_cut(), budget=20)).run()
    (call,) = ran
    assert list(call["study"].requests) == ["cut1", "cut2"] and call["out"] == Path("cutcal-banana-two")
    (words,) = call["study"].first.command
    assert words.startswith("Study.of_cuts(Calibration('banana', trace=Trace('two.csv'), budget=20))")
    with pytest.raises(CutcalError, match="withdrawal is for one cut"):
        Study.of_cuts(Calibration("banana", twice_cut(), withdrawal=True))
    with pytest.raises(CutcalError, match=r"fit them all with Study\.of_cuts"):
        Calibration("banana", twice_cut()).run()
    with pytest.raises(CutcalError, match="holds one cut"):
        Study.of_cuts(Calibration("banana", ROOT / "force_data" / "banana_reconstructed.csv"))


def test_a_range_that_a_compression_test_has_narrowed_says_so() -> None:
    """In place of the literature alone, whose range is another one."""
    pressed = CompressionModulus("pressed", 278e3, 0.13, 4, 0.45, ())
    assert _pressed([pressed], "ripe kiwi") == "compression: pressed, 278 kPa to 13 %. Before: ripe kiwi"
