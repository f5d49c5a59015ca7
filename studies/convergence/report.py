"""The report of a convergence study, from its folder."""

from __future__ import annotations

from pathlib import Path

from studies.convergence.result import read_result


def write_report(folder: Path) -> Path:
    """Typeset ``report.pdf`` of a folder from its files.

    Returns:
        Path of the report.

    Raises:
        DocumentError: A file is missing, damaged or incomplete.
        ReportError: The report cannot be written.
    """
    from reports.studies import convergence

    return convergence.write_report(*read_result(folder), folder)


def write_figure(folder: Path) -> None:
    """Draw ``converge.svg`` of a folder from its files.

    Raises:
        DocumentError: A file is missing, damaged or incomplete.
    """
    from reports.studies import convergence

    convergence.write_figure(*read_result(folder), folder)
