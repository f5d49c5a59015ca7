"""The report of a compression test, from its folder."""

from __future__ import annotations

from pathlib import Path

from calib.compression.result import CURVES_FILE, RESULT_FILE, CompressionResult, read_curves
from calib.errors import OutputError
from calib.io.typed_document import REMEDY, read_document


def write_report(folder: Path) -> Path:
    """Write ``compress.svg``, ``report.pdf`` and ``report.html`` of a folder from ``compress.json`` and ``curves.csv``.

    Returns:
        Path of ``report.pdf``.

    Raises:
        OutputError: A file is missing, damaged or incomplete, or the report cannot be written.
    """
    from reports.press import compression
    from reports.press.stress_strain import write_figure

    result = read_document(folder / RESULT_FILE, CompressionResult)
    try:
        curves = read_curves(folder)
    except (OSError, ValueError, KeyError) as e:
        raise OutputError(f"{folder / CURVES_FILE}: missing or damaged ({e}); {REMEDY}") from None
    write_figure(result, curves, folder)
    return compression.write_report(result, curves, folder)
