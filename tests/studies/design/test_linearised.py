"""A made-up food of formulas: its records are fitted, and the tests leave what was promised."""

from __future__ import annotations

from pathlib import Path

import pytest

from studies.design.kept_promise import KEPT
from studies.design.linearised import study
from tests.calib.made_food import MadeFood


def test_promises_are_kept_by_records_of_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The recommended test and the other blade leave R an interval of the promised width within 30 %."""
    monkeypatch.setattr("reports.studies.design.write_figure", lambda result, out: None)
    monkeypatch.setattr("studies.design.linearised.MADE", ("width", "blade"))
    found = study("potato", "R", 0, tmp_path, MadeFood(0.003))
    assert found["recommended"] is not None
    assert {"width", "blade edc"} == set(found["tests"])
    for made in found["tests"].values():
        assert abs(made["ratio"] - 1.0) <= KEPT
        assert made["parts"]["R"]["promised"] < 0.95
