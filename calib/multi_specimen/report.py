"""The report of a study of several cuts, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.material.properties import MEANINGS
from calib.material.references import cited


def write_report(folder: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` of the finished study in a folder.

    Returns:
        Path of ``report.pdf``.

    Raises:
        OutputError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    from reports.multi_specimen import report

    return report.write_report(folder, MEANINGS, cited)
