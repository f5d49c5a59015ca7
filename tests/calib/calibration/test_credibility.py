"""The words of verification and validation are those of the summary beside them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from calib.calibration.credibility import (
    NOT_STATED,
    Context,
    credibility,
    read_context,
    read_credibility,
    to_document,
    write_credibility,
)
from calib.calibration.result import read_result
from calib.errors import MaterialError
from calib.validation.numerical_checks import QUARTER_SPEED, VARIANTS, Check
from cutcal.main import main
from tests.calib.documents import valid
from tests.reports import sample

CHECKS = tuple(
    Check(name, None, change, 2.0 * change) for name, change in zip(VARIANTS, (0.03, 0.04, -0.12), strict=True)
)


def test_comparison_error_and_its_uncertainty(tmp_path: Path) -> None:
    """E = S - D; the three uncertainties by hand, and their root of squares; E +- 2 u_val holds the model's error."""
    result = replace(read_result(sample.write_run(tmp_path / "run")), numerical_checks=CHECKS)
    found, m = credibility(result), result.agreement.metrics
    peak = found.peak
    assert peak.error == pytest.approx(m.peak_sim_N - m.peak_real_N)
    assert peak.u_num == pytest.approx(0.14 * m.peak_sim_N)
    assert peak.u_input == pytest.approx(0.15 * m.peak_sim_N)
    assert peak.u_D == pytest.approx(math.hypot(0.021, 0.02 * m.peak_real_N, 0.039))
    assert peak.u_val == pytest.approx(math.hypot(peak.u_num or 0.0, peak.u_input, peak.u_D))
    assert peak.high == pytest.approx(peak.error + 2.0 * (peak.u_val or 0.0))
    assert found.work.u_num == pytest.approx(0.28 * m.work_sim_J)
    valid(to_document(found), "credibility")
    slowest = Check(QUARTER_SPEED, None, 0.03, 0.06)
    slow = credibility(replace(result, numerical_checks=(*CHECKS, slowest))).peak
    assert slow.u_num == pytest.approx(0.13 * m.peak_sim_N)  # (.03, .04, .12): nothing more comes below half the speed


def test_numerics_that_nobody_checked_are_not_zero(tmp_path: Path) -> None:
    """Without the repeated runs, or where one broke down, there is no validation uncertainty."""
    result = read_result(sample.write_run(tmp_path / "run"))
    broken = replace(CHECKS[0], peak_change=None, reason="inverted")
    for checks in ((), CHECKS[:2], (broken, *CHECKS[1:])):
        peak = credibility(replace(result, numerical_checks=checks)).peak
        assert (peak.u_num, peak.u_val, peak.low, peak.high) == (None, None, None, None)
        assert peak.u_D > 0.0


def test_the_context_is_stated_or_said_not_to_be(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What ``report --context`` states stays when the file is written again; a slip in the file is said."""
    folder = sample.write_run(tmp_path / "run")
    write_credibility(read_result(folder))
    assert read_credibility(folder).context == Context()
    file = tmp_path / "context.yaml"
    file.write_text("context_of_use: slicing bananas by robot\nmodel_influence: low\n")
    assert read_context(file) == Context("slicing bananas by robot", "low", NOT_STATED)
    write_credibility(read_result(folder), read_context(file))
    write_credibility(read_result(folder))
    assert read_credibility(folder).context.model_influence == "low"
    file.write_text("model_influence: high\nconditions: {temperature: 8 C, sensor: at the wrist}\n")
    write_credibility(read_result(folder), read_context(file))
    assert read_credibility(folder).context.conditions == {"temperature": "8 C", "sensor": "at the wrist"}
    for conditions, said in (("{temperature: 8}", "a number without a unit"), ("8 C", "a mapping of names")):
        file.write_text(f"conditions: {conditions}\n")
        with pytest.raises(MaterialError, match=said):
            read_context(file)
    file.write_text("influence: low\n")
    with pytest.raises(MaterialError, match="influence"):
        read_context(file)
    assert main(["report", str(folder), "--context", str(file)]) == 1
    assert "influence" in capsys.readouterr().err
