"""The report of a stability map, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.io.typed_document import read_document
from studies.stability.result import RESULT_FILE, StabilityMap


def write_report(folder: Path) -> Path:
    """Typeset ``report.pdf`` of a folder from its ``stress.json``.

    Returns:
        Path of the report.

    Raises:
        DocumentError: The file is missing, damaged or incomplete.
        ReportError: The report cannot be written.
    """
    from reports.studies import stability

    return stability.write_report(read_document(folder / RESULT_FILE, StabilityMap), folder)
