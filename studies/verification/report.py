"""The report of a verification, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.io.typed_document import read_document
from studies.verification.result import RESULT_FILE, Verification


def write_report(folder: Path) -> Path:
    """Typeset ``report.pdf`` of a folder from its ``verify.json``.

    Returns:
        Path of the report.

    Raises:
        DocumentError: The file is missing, damaged or incomplete.
        ReportError: The report cannot be written.
    """
    from reports.studies import verification

    return verification.write_report(read_document(folder / RESULT_FILE, Verification), folder)
