"""The references of a report: each cited one has a number, and those of foods are linked to it."""

from __future__ import annotations

import re
from pathlib import Path

from calib.material.references import cited
from reports.base.references import CITED_TOO, REFERENCES, Citations, of_foods
from tests.reports.calibration.test_credibility_page import NOBODY, text, write, write_report
from tests.reports.sample import write_run


def test_a_food_reference_that_is_cited_too_has_its_number() -> None:
    """The paper of Table 2 stands with the number that it has in the list."""
    assert set(CITED_TOO.values()) <= set(REFERENCES)
    citations = Citations()
    citations.numbered("[@Hu 2018] and [@Koh 2026]")
    rows = dict(citations.numbered(of_foods(cited(["CulinaryCut Table 2", "Kachru 1995"]))))
    assert rows["CulinaryCut"].startswith("[2] Koh") and rows["Kachru 1995"].startswith("Kachru")
    assert len(citations.listed) == 2


def test_the_standards_that_a_report_names_are_in_its_list(tmp_path: Path) -> None:
    """V&V 20 and V&V 40 have numbers where they stand, and entries at these numbers."""
    folder = write_run(tmp_path)
    write(tmp_path, NOBODY)
    found = text(write_report(folder))
    for name, entry in (("20", "ASME V&V 20 (2009)"), ("40", "ASME V&V 40 (2018)")):
        number = re.search(rf"ASME V&V {name} \[(\d+)\]", found)
        assert number and f"[{number[1]}] {entry}" in found
