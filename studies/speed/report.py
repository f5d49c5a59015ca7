"""The report of a benchmark, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.io.typed_document import read_document
from studies.speed.result import RESULT_FILE, BenchmarkResult


def write_report(folder: Path) -> Path:
    """Typeset ``report.pdf`` of a folder from its ``bench.json``.

    Returns:
        Path of the report.

    Raises:
        DocumentError: The file is missing or damaged.
        ReportError: Too little was measured, or the report cannot be written.
    """
    from reports.studies import benchmark

    return benchmark.write_report(read_document(folder / RESULT_FILE, BenchmarkResult), folder)
