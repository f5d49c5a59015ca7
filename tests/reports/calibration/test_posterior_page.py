"""The sampled posterior in a report."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from calib.calibration.report import write_report
from calib.calibration.result import read_result
from calib.io.typed_document import to_document
from calib.posterior.estimates import ModeSummary, PosteriorSummary, Range, WaveSummary
from reports.calibration.posterior_page import identified, posterior
from tests.reports import sample

RANGES = {name: Range(0.8 * row[0], row[0], 1.3 * row[0]) for name, row in sample.FITTED.items()}
FOUND = PosteriorSummary(
    converged=True,
    waves=(WaveSummary(256, 142), WaveSummary(96, 90, 2.0, 0.024, 0.053, 0.22)),
    judged=0.0104,
    judged90=0.0195,
    explained=0.87,
    log_evidence=-15.26,
    log_evidence_sd=0.2,
    likelihoods=44590,
    combinations={"E R / (yield_stress^2 h)": Range(2.0, 9.0, 40.0)},
    modes=(ModeSummary(0.7, -15.6, RANGES, {"R": 287.0}, 16.1), ModeSummary(0.3, -16.5, RANGES)),
    alike=("R", "mu"),
)


def test_modes_are_told_with_weights_and_best_members(tmp_path: Path) -> None:
    """Two modes, one without a simulated food, what they differ in, and the errors of each wave."""
    fitted = read_result(sample.write_run(tmp_path / "run")).fitted
    told = posterior(FOUND, fitted)
    assert told is not None
    said = {k: sample.spaced(str(v).replace("\\xa0", " ")) for k, v in told.items()}
    assert "'70.0 %', '-15.6', '16.1'" in said["modes"] and "none was cut" in said["modes"]
    assert said["differ"] == "E, yield_stress and R_skin"
    assert "'prior', '-'" in said["waves"].replace("–", "-") and "2.40 %" in said["waves"] and "5.30 %" in said["waves"]
    assert "9" in said["combinations"] and told["judged90"].startswith("1.95")
    assert posterior(None, fitted) is None


def test_line_above_the_verdict_counts_what_is_identified(tmp_path: Path) -> None:
    """The sample has two of five; none is said as well."""
    fitted = read_result(sample.write_run(tmp_path / "run")).fitted
    assert sample.spaced(identified(fitted)) == "2 of 5 parameters identified: E and R."
    none = {name: replace(p, verdict="weak") for name, p in fitted.items()}
    assert sample.spaced(identified(none)) == "0 of 5 parameters identified."


def test_report_with_a_posterior_is_written(tmp_path: Path) -> None:
    """The template takes one mode and two, and an end before the emulator was good."""
    early = replace(FOUND, modes=FOUND.modes[:1], converged=False, judged=None, judged90=None)
    for name, found in (("two", FOUND), ("one", early)):
        folder = sample.write_run(tmp_path / name, sampled=to_document(found))
        assert read_result(folder).sampled == found
        assert write_report(folder).stat().st_size > 50_000
