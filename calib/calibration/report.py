"""The report of a calibration, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.calibration.result import read_result


def write_report(folder: Path) -> Path:
    """Write ``report.pdf`` of the finished calibration in a folder.

    Args:
        folder: The output folder of ``calibrate``.

    Returns:
        Path of the report.

    Raises:
        OutputError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    from reports.calibration import report

    return report.write_report(read_result(Path(folder)))
