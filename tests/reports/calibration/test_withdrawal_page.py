"""The page of the way up: its evidence in words, over what its error is, and what is cited."""

from __future__ import annotations

from dataclasses import replace

import pytest

from calib.calibration.withdrawal_result import FitWithout, WithdrawalAgreement
from calib.uncertainty.estimates import FittedNuisance
from reports.base.references import REFERENCES, Citations
from reports.calibration.withdrawal_page import withdrawal
from tests.reports.sample import spaced

UP = WithdrawalAgreement(
    from_m=2e-3, to_m=0.02, speed_m_s=0.02, peak_real_N=0.3, peak_sim_N=0.3, nrmse=0.03, work_real_J=1e-3,
    work_sim_J=1e-3, nuisances={"tare": FittedNuisance(0.0, 0.01, 0.05, "N", False)},
    without={"R": FitWithout(20.0, 12.0, 4.0, 5.0), "mu": FitWithout(0.0, 3.5, 4.0, -3.0)},
)  # fmt: skip


def test_a_chi_square_rises_or_falls() -> None:
    """By how much, and what it is worth."""
    rows = {name: spaced(text) for name, text in withdrawal(UP)["rows"]}
    assert rows["Evidence for the cutting resistance"].endswith(
        "positive: without it the least chi-square rises by 8.00"
    )
    assert rows["Evidence for friction"].endswith("does not ask for it: without it the least chi-square falls by 0.500")


def test_the_error_says_over_what_it_is() -> None:
    """Over the largest pull, not the peak of the way down; the level of the pull is not that before contact."""
    found = withdrawal(UP)
    assert dict(map(tuple, found["rows"]))["Curve error (NRMSE)"].endswith("over the largest measured pull")
    assert "on the way up" in found["left_open"][0][1]


def test_evidence_has_its_references() -> None:
    """Schwarz before Kass and Raftery, as in the text; none of them where there is no evidence."""
    cited, none = Citations(), Citations()
    assert "[1], without the property less with it, in the words of [2]" in cited.numbered(withdrawal(UP))["told"]
    assert cited.listed == [REFERENCES["Schwarz 1978"], REFERENCES["Kass 1995"]]
    none.numbered(withdrawal(replace(UP, without={})))
    assert none.listed == []


def test_a_name_without_a_reference_is_an_error() -> None:
    """It is named."""
    with pytest.raises(KeyError, match="Nobody 2000"):
        Citations().numbered(["as shown [@Nobody 2000]"])
