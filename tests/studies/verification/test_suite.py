"""cutcal verify: its rows, its fast cases, its exit codes."""

from __future__ import annotations

import json
import math

import pytest

from calib.simulation.process_pool import Pool
from cutcal.main import main
from mpm.scene.errors import SceneError
from studies.verification import bending, case
from studies.verification.case import SuiteOptions, VerificationCase, cases
from studies.verification.result import Comparison
from tests.calib.documents import valid

FAST = [case for case in cases() if case.fast]
# The fast cases that take five seconds and more.
SECONDS = (
    *("tilted board", "rest and friction", "vortex", "cutting resistance", "press: block, sliding", "ball"),
    *("splitting: short arms", "work of new surface: 2.5 degrees", "work of new surface: 20 degrees"),
)


def row(expected: float = 2.0, got: float = 2.0, tolerance: float = 0.01, least: bool = False) -> Comparison:
    """A row about nothing."""
    return Comparison("case", "quantity", expected, got, tolerance, "nowhere", least)


@pytest.mark.parametrize(
    ("one", "passed"),
    [
        (row(got=2.019), True),
        (row(got=2.021), False),
        (row(got=1.979), False),
        (row(got=math.nan), False),
        (row(expected=0.0, got=0.009), True),
        (row(expected=0.0, got=-0.011), False),
        (row(expected=-1.0, got=-1.02), False),
        (row(got=3.0, least=True), True),
        (row(got=1.9, least=True), False),
        (row(got=math.nan, least=True), False),
    ],
)
def test_a_row_passes_within_its_tolerance(one, passed):
    """Relative to what is expected, or absolute where that is 0; an order may be larger; not a number never passes."""
    assert one.passed is passed


def test_there_are_enough_rows_of_every_kind():
    """Every group has a case, and no two have the same name."""
    names = [case.name for case in cases()]
    assert len(set(names)) == len(names) >= 18
    assert sum("press" in name for name in names) >= 6


@pytest.mark.parametrize(
    "case", [pytest.param(case, id=case.name, marks=pytest.mark.slow if case.name in SECONDS else ()) for case in FAST]
)
def test_the_fast_cases_pass(case):
    """Each row of the quick version."""
    found = list(case.run(SuiteOptions(quick=True)))
    assert found
    assert not [f"{r.case}, {r.quantity}: {r.got:g} not {r.expected:g}" for r in found if not r.passed]


@pytest.mark.long
@pytest.mark.parametrize("case", cases(), ids=[case.name for case in cases()])
def test_all_cases_pass(case):
    """Each row of the whole table."""
    assert not [
        f"{r.case}, {r.quantity}: {r.got:g} not {r.expected:g}" for r in case.run(SuiteOptions()) if not r.passed
    ]


def fakes(monkeypatch: pytest.MonkeyPatch, *made: VerificationCase) -> None:
    """Put other cases into the table, and run them in this process."""

    def each(self: Pool, work, jobs):
        for k, job in enumerate(jobs):
            yield k, None if job[0] == "killed" else work(*job, self.arch, self.threads)

    monkeypatch.setattr("studies.verification.suite.cases", lambda: list(made))
    monkeypatch.setattr(Pool, "each", each)


def good(options: SuiteOptions):
    """A case that passes."""
    yield row()


def bad(options: SuiteOptions):
    """A case that fails."""
    yield row()
    yield row(got=5.0)


def broken(options: SuiteOptions):
    """A case that breaks down after a row."""
    yield row()
    raise SceneError("the knife is bent")


def test_a_failed_row_is_exit_code_2(monkeypatch, tmp_path, capsys):
    """Table and document name it, and the figure is drawn."""
    fakes(monkeypatch, VerificationCase("good", good), VerificationCase("bad", bad))
    assert main(["verify", "--out", str(tmp_path / "a")]) == 2
    text = capsys.readouterr().out
    assert "FAIL" in text
    assert "3 rows, 1 failed" in text
    document = valid(json.loads((tmp_path / "a/verify.json").read_text()))
    assert [r["passed"] for r in document["rows"]] == [True, True, False]
    figure = (tmp_path / "a/verify.svg").read_bytes()
    assert figure.startswith(b"<?xml")
    assert b"mathdefault" not in figure  # plain numbers on the axis
    assert main(["verify", "--out", str(tmp_path / "b"), "--only", "good"]) == 0


def test_a_case_that_breaks_down_fails_and_the_others_run(monkeypatch, tmp_path, capsys):
    """Its message is kept; --json prints the document alone."""
    fakes(monkeypatch, VerificationCase("broken", broken), VerificationCase("good", good))
    assert main(["verify", "--out", str(tmp_path / "a"), "--json"]) == 2
    document = valid(json.loads(capsys.readouterr().out))
    assert document["broken"] == {"broken": "the knife is bent"}
    assert [r["group"] for r in document["rows"]] == ["broken", "good"]
    assert document["complete"] and not document["passed"]


def test_slow_cases_are_left_out_of_the_quick_run(monkeypatch, tmp_path):
    """--quick runs the fast ones only, in their quick version."""
    seen = []
    fakes(
        monkeypatch,
        VerificationCase("fast", lambda options: seen.append(options) or good(options)),
        VerificationCase("slow", lambda options: seen.append("slow") or good(options), fast=False),
    )
    assert main(["verify", "--quick", "--seed", "3", "--out", str(tmp_path / "a")]) == 0
    assert seen == [SuiteOptions(quick=True, seed=3)]


def test_an_unknown_case_and_a_used_folder_are_errors(monkeypatch, tmp_path, capsys):
    """One line each, exit code 1."""
    fakes(monkeypatch, VerificationCase("good", good))
    assert main(["verify", "--only", "nothing", "--out", str(tmp_path / "a")]) == 1
    assert "there are good" in capsys.readouterr().err
    assert main(["verify", "--out", str(tmp_path / "a")]) == 0
    assert main(["verify", "--out", str(tmp_path / "a")]) == 1
    assert "never overwritten" in capsys.readouterr().err


def test_resume_runs_what_did_not_end(monkeypatch, tmp_path, capsys):
    """Cases that ended are kept, one that broke down or whose process was killed runs again;
    another seed is refused.
    """
    seen = []
    counted = VerificationCase("good", lambda options: seen.append("good") or good(options))
    again = ["verify", "--out", str(tmp_path / "a"), "--resume"]
    fakes(monkeypatch, counted, VerificationCase("broken", broken), VerificationCase("killed", good))
    assert main(again) == 2
    document = valid(json.loads((tmp_path / "a/verify.json").read_text()))
    assert set(document["broken"]) == {"broken", "killed"}
    assert "killed" in document["broken"]["killed"]
    fakes(monkeypatch, VerificationCase("killed", good), counted, VerificationCase("broken", good))
    monkeypatch.setattr(
        Pool, "each", lambda self, work, jobs: ((k, work(*job, "cpu", 1)) for k, job in enumerate(jobs))
    )
    capsys.readouterr()
    assert main(again) == 0
    assert "1 of 3 cases are known already" in capsys.readouterr().err
    assert seen == ["good"]
    document = valid(json.loads((tmp_path / "a/verify.json").read_text()))
    assert [r["group"] for r in document["rows"]] == ["killed", "good", "broken"]
    assert main([*again, "--seed", "1"]) == 1
    assert "seed 0, not 1" in capsys.readouterr().err
    (tmp_path / "a/verify.json").write_text("{")
    assert main(again) == 1
    assert "damaged" in capsys.readouterr().err


@pytest.mark.slow
def test_cases_run_in_processes(tmp_path):
    """The whole path with real workers, on cases that take a moment."""
    out = tmp_path / "a"
    assert main(["verify", "--quick", "--only", "law", "--out", str(out)]) == 0
    document = json.loads((out / "verify.json").read_text())
    assert list(document["seconds"]) == ["elastic law", "plastic law", "damage law"]
    assert document["complete"] and document["passed"]


def test_parts_are_modules_with_cases():
    """Every part of the table exists."""
    assert len(cases()) > len(case.PARTS)


def test_the_hanging_beam_is_free_to_bend(monkeypatch):
    """In a fiftieth of the time to rest its ends have begun to fall;
    a mirror across the way that it bends would hold it straight.
    """
    monkeypatch.setattr(bending, "PERIODS", 0.04)
    place, down = bending.particles(SuiteOptions(), bending.DEPTH / 8, 2)
    assert bending.HALF - bending.DEPTH / 8 < place < bending.HALF and down > 1e-5
