"""Reports of convergence, verification, stability and speed:
what they say follows from their documents, and damage is one line.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calib.errors import DocumentError
from cutcal.main import main
from reports.base import brief
from studies.convergence import report as convergence
from studies.speed import report as bench
from studies.stability import report as stability
from studies.verification import report as verification
from tests.reports.sample import pages, spaced

VERSIONS = {"cutcal": "0.1.0", "python": "3.11.7"}
ORIGIN: dict[str, Any] = {"versions": VERSIONS, "git": "c0ffee", "device": "cpu", "command": ["x", "--out", "a b"]}


def grid(dx: float, peak: float, **more: Any) -> dict[str, Any]:
    """A row of a convergence study."""
    numbers = {
        "peak_N": peak,
        "work_J": 0.3,
        "particles": 2000.0,
        "steps": 3000.0,
        "momentum_residual": 1e-15,
        "wall_s": 2.0,
        "parted": 1.0,
        "ke_over_ie": 0.001,
        "ripple_N": 0.1,
    }
    return {"dx_m": dx, **numbers, "status": "ok", "reason": "", "fraction": 1.0, **more}


def converge(folder: Path, **changes: Any) -> Path:
    """A folder of a convergence study."""
    estimate = {"verdict": "monotonic", "order": 1.9, "extrapolated": 12.0, "change": 0.0123, "gci": 0.02}
    estimate |= {"gci_coarsest": 0.05, "fitted": 12.1, "fitted_order": 2.0, "uncertainty": 0.03}
    mach = {"rows": [grid(3e-3, 13.0, mach=m) for m in (0.005, 0.01)], "spread_peak": 0.0042, "spread_work": 0.001}
    zone: dict[str, Any] = {"name": "process zone", "spread_peak": 0.0123, "spread_work": 0.002}
    zone["rows"] = [grid(3e-3, 13.0, value=z) for z in (0.004, 0.008)]
    document = {
        "food": "shine_muscat", "knife": "kitchen",
        "shape": {"kind": "sphere", "length": 0.03, "width": 0.03, "height": 0.03}, "warnings": ["E is assumed"],
        "grids": [grid(3e-3, 13.0), grid(2e-3, 12.5), grid(1e-3, 0.0, status="failed", reason="inverted")],
        "limits": {"work": 0.02, "peak": 0.03}, "peak": estimate, "work": estimate | {"order": None},
        "order_curve": 2.0, "gci_curve_median": 0.01, "gci_curve_max": 0.04, "repeat_sd_peak_N": 0.1,
        "repeat_sd_work_J": 0.002, "mach": mach, "safety": None, "ppc": None, "offset": None,
        "repeat": None, "constants": {"zone": zone}, **ORIGIN, **changes,
    }  # fmt: skip
    x = np.linspace(0, 0.03, 20)
    forces = {f"force_dx_{dx:g}_N": np.sin(x / 0.03 * np.pi) for dx in (3e-3, 2e-3)}
    pd.DataFrame({"stroke_m": x, "u_num_N": 0.1 + 0 * x, "u_num_coarsest_N": 0.2 + 0 * x, **forces}).to_csv(
        folder / "curves.csv", index=False
    )
    return written(folder / "converge.json", document)


def verify(folder: Path, **changes: Any) -> Path:
    """A folder of a verification."""
    row = {
        "group": "bar",
        "case": "free bar",
        "quantity": "period [s]",
        "expected": 0.0156,
        "got": 0.0157,
        "tolerance": 0.005,
    }
    row |= {"source": "closed form", "least": False, "error": 0.0064, "passed": False}
    order = row | {
        "group": "order",
        "quantity": "order [-]",
        "expected": 2.0,
        "got": 2.1,
        "error": 0.1,
        "least": True,
        "passed": True,
    }
    document = {
        "quick": False, "seed": 0, "code": "c0de", "complete": True, "passed": False, "rows": [row, order],
        "seconds": {"bar": 1.0, "order": 2.0},
        "broken": {"two discs": "its process was killed"}, **ORIGIN, **changes,
    }  # fmt: skip
    return written(folder / "verify.json", document)


def stress(folder: Path, **changes: Any) -> Path:
    """A folder of a stability map."""
    numbers = {
        "E_Pa": 1e6,
        "nu": 0.3,
        "momentum_residual": 2e-15,
        "energy_gain": 0.017,
        "physical": True,
        "forced": False,
    }
    good = {"name": "E and nu: 1", "family": "E and nu", "status": "stable", "reason": "", "message": "", **numbers}
    bad = good | {
        "name": "loss: odd",
        "family": "loss",
        "status": "stopped",
        "reason": "energy_growth",
        "message": "more energy",
    }
    document = {
        "seed": 0, "cells": [good, bad], "unexplained": 0, "unexplained_cells": [],
        "counts": {"stable": 1, "energy_growth": 1}, "physical": {"cells": 2, "stable": 1, "not_stable": ["loss: odd"]},
        "reasons": {"energy_growth": "more energy than was put in"},
        "limits": {"dt_over_limit": 0.8, "particle_steps": 3e8, "time_s": 300.0}, "passed": False, **ORIGIN, **changes,
    }  # fmt: skip
    return written(folder / "stress.json", document)


def speed(folder: Path, **changes: Any) -> Path:
    """A folder of a benchmark."""
    cut = {
        "wall_s": 3.8,
        "particles": 3694,
        "steps": 2817,
        "first_run_s": 20.0,
        "nodes": 20000,
        "reference_dx_m": 1.5e-3,
        "reference_wall_s": 40.0,
        "peak_error": 0.0231,
        "work_error": -0.002,
        "nrmse": 0.012,
    }
    stiff = {
        "name": "stiff",
        "status": "done",
        "wall_s": 3.7,
        "first_run_s": 19.0,
        "time_ratio": 0.98,
        "particles": 3694,
    }
    stiff |= {"steps": 2817, "nodes": 20000}
    paper = {"nodes": 120, "dx_m": 2e-3, "dt_s": 2e-5, "particles": 128792, "steps": 33000, "step_s": 0.167}
    paper |= {"wall_s_extrapolated": 5507.0}
    warp = {"name": "Warp", "version": "1.19", "seconds": 0.05, "particles": 128000, "Mps": 2.7, "ours_Mps": 6.6}
    warp |= {"ratio": 2.46, "force_error": 0.021, "ours_force_error": 0.019}
    rate = {"particles": 128000, "bandwidth_GBps": 23.3, "bytes_per_particle_step": 624, "memory_bound_Mps": 37.3}
    rate |= {"full_physics_Mps": 5.8, "single_Mps": 6.1, "textbook_Mps": 0.81, "ratio": 7.2, "cut_Mps": 4.6}
    document = {
        "food": "banana", "knife": "kitchen", "complete": True, "threads": 2, "default_cut": cut,
        "ratio_to_paper": 1455.9, "exponent": 1.02,
        "ablations": [cut | {"name": "single precision", "time_ratio": 1.05, "status": "done"}, stiff],
        "paper_config": paper,
        "throughput": rate,
        "peers": [warp, {"name": "Genesis", "error": "no module"}],
        "processes": {"processes": 2, "speed_up": 1.7, "cut_Mps": 7.8, "start_up_s": 1.4},
        "batches": [{"cuts": 1, "wall_s": 1.5, "per_cut": 1.0}, {"cuts": 8, "wall_s": 6.6, "per_cut": 0.55}],
        **ORIGIN, **changes,
    }  # fmt: skip
    return written(folder / "bench.json", document)


def written(path: Path, document: dict[str, Any]) -> Path:
    """A document in its folder, of a known date."""
    path.write_text(json.dumps(document))
    os.utime(path, (1.7e9, 1.7e9))
    return path.parent


@pytest.fixture
def typeset(monkeypatch: Any) -> list[dict[str, Any]]:
    """What the reports of a test hold, in turn; they are typeset all the same."""
    real, found = brief.publish, []

    def publish(target: Path, template: str, content: dict[str, Any], *rest: Any, **more: Any) -> None:
        found.append(content)
        real(target, template, content, *rest, **more)

    monkeypatch.setattr(brief, "publish", publish)
    return found


def text(content: dict[str, Any]) -> str:
    """All words of a report."""
    return spaced(json.dumps(content, ensure_ascii=False))


PASSED = {"converge": True, "verify": False, "stress": False, "bench": None}
KINDS = {"converge": converge, "verify": verify, "stress": stress, "bench": speed}
WRITERS = {"converge": convergence, "verify": verification, "stress": stability, "bench": bench}
SAID = {
    "converge": [
        "Shine muscat", "changes by +1.2 %", "broke down: inverted", "0.005 and 0.01", "Not varied here",
        "E is assumed", "process zone", "0.004 and 0.008",
    ],
    "verify": [
        "1 row fails, of 2", "1 case broke down", "two discs", "its process was killed", "≥ 2.000", '"no"',
        "Closed form",
    ],
    "stress": ["1 of 2 cells", "more energy than was put in", "loss: odd", "1.7 %"],
    "bench": [
        "1/1456", "2.3 % at most", "single precision", "Warp 1.19", "2.46", "2.1%", "1.9%", "not measured: no module",
        "extrapolated",
    ],
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_report_says_what_its_document_says(kind: str, tmp_path: Path, capsys, typeset) -> None:
    """``cutcal report`` knows the folder; verdict, what failed, numbers in people's units, provenance;
    the same bytes twice.
    """
    folder = KINDS[kind](tmp_path)
    assert main(["report", str(folder)]) == 0 and "report.pdf" in capsys.readouterr().out
    first = (folder / "report.pdf").read_bytes()
    assert typeset[0]["passed"] is PASSED[kind] and typeset[0]["limits"]
    for words in [*SAID[kind], "c0ffee", "2023-11-14", "'a b'"]:
        assert words in text(typeset[0]), words
    assert WRITERS[kind].write_report(folder).read_bytes() == first and pages(first) <= 4


@pytest.mark.parametrize("kind", KINDS)
def test_a_damaged_document_is_one_line_and_the_old_report_stays(kind: str, tmp_path: Path, capsys) -> None:
    """A key that is missing, another kind of value, no JSON, and no run at all."""
    folder = KINDS[kind](tmp_path)
    report = WRITERS[kind].write_report(folder)
    before = report.read_bytes()
    path = folder / f"{kind}.json"
    whole = json.loads(path.read_text())
    for change in ({k: v for k, v in whole.items() if k != "versions"}, {k: 3 for k in whole}, [], None):
        path.write_text("{" if change is None else json.dumps(change))
        with pytest.raises(DocumentError, match=path.name):
            WRITERS[kind].write_report(folder)
    assert report.read_bytes() == before
    assert main(["report", str(tmp_path / "nowhere")]) == 1
    assert main(["report", str(tmp_path.parent)]) == 1
    error = capsys.readouterr().err
    assert "no such folder" in error and "holds none of summary.json, converge.json" in error


def test_what_was_interrupted_or_coarse_is_said(tmp_path: Path, typeset) -> None:
    """An interrupted benchmark and a quick verification are not whole;
    a verification that failed nowhere but did not end has not passed.
    """
    for name in ("a", "b", "c"):
        (tmp_path / name).mkdir()
    bench.write_report(speed(tmp_path / "a", complete=False))
    verification.write_report(verify(tmp_path / "b", quick=True))
    passed = [
        dict(row, got=1.0001 * row["expected"], passed=True)
        for row in json.loads((tmp_path / "b" / "verify.json").read_text())["rows"]
    ]
    verification.write_report(verify(tmp_path / "c", rows=passed, complete=False))
    for content, words in zip(
        typeset, ("some of it is missing", "Coarse versions", "not all cases ended"), strict=True
    ):
        assert words in text(content)
