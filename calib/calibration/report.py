"""The report of a calibration, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.calibration.members import read_members
from calib.calibration.result import CalibrationResult, read_result


def write_report(folder: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` of the finished calibration in a folder.

    Args:
        folder: The output folder of ``calibrate``.

    Returns:
        Path of ``report.pdf``; ``report.html`` lies beside it.

    Raises:
        OutputError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    return write_reports_of(read_result(Path(folder)))


def write_reports_of(result: CalibrationResult) -> Path:
    """Write ``report.pdf`` and ``report.html`` of a calibration into its folder.

    Args:
        result: The calibration.

    Returns:
        Path of ``report.pdf``.

    Raises:
        OutputError: As :func:`write_report`.
    """
    from reports.calibration import report

    return report.write_report(result, read_members(result))
