"""Report of a compression test: the verdict, stress over strain, and the modulus of each repeat."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from reports.base.brief import Brief, ReportPart, ReportTable, typeset_brief
from reports.base.format import breakable, interval, plain, quantity
from reports.press.tables import verdict_table

if TYPE_CHECKING:
    from calib.compression.result import CompressionResult

ALT = "Measured and fitted stress over strain, and their difference"


def write_report(result: CompressionResult, out: Path) -> Path:
    """Write ``report.pdf`` beside ``compress.json`` and ``compress.svg``.

    Args:
        result: The calibrated modulus.
        out: The folder.

    Returns:
        Path of the report.

    Raises:
        ReportError: The report cannot be written.
    """
    modulus, shape = result.E, result.specimen
    spread = "one repeat, no interval"
    if modulus.repeats > 1:
        spread = f"95 % interval {interval(modulus.low_Pa, modulus.high_Pa, 'Pa')}, {modulus.repeats} repeats"
    brief = Brief(
        kind="Compression",
        name="Young's modulus",
        passed=result.passed,
        sentence=(
            f"Young's modulus is {quantity(modulus.mean_Pa, 'Pa')} over 0 to {plain(100 * modulus.window[1])} % strain "
            f"({spread})."
        ),
        facts=[
            (
                "Specimen",
                f"{shape.kind.replace('_', ' ')}, height {quantity(shape.height, 'm')}, "
                f"area {plain(1e6 * shape.area_m2)} mm²",
            ),
            ("Assumed", f"Poisson's ratio {plain(result.assumed.nu)}, {result.assumed.plates} plates"),
        ],  # fmt: skip
        parts=[
            ReportPart("Verdict", table=verdict_table(result.verdicts)),
            ReportPart("Stress", picture=(out / "compress.svg").read_bytes(), alt=ALT),
            ReportPart("Modulus of each repeat", table=_repeats(result)),
            *([ReportPart("If another assumption holds", table=_others(result))] if _other_rows(result) else []),
        ],
        limits=result.not_shown,
    )
    return typeset_brief(out / "compress.json", brief, _Origin(result))


class _Origin:
    """Where the result comes from, with the device of its simulation."""

    def __init__(self, result: CompressionResult) -> None:
        self.device = result.simulation.arch
        self.command = result.command
        self.versions = result.versions
        self.git = result.git


def _repeats(result: CompressionResult) -> ReportTable:
    """A row for each repeat."""
    rows = [[breakable(one.name), quantity(one.E_Pa, "Pa"), quantity(one.slope_Pa, "Pa")] for one in result.repeats]
    return ReportTable(("Repeat", "Young's modulus", "Slope over 0 to 5 % strain"), ("1fr", "auto", "auto"), rows)


def _other_rows(result: CompressionResult) -> list[list[str]]:
    """The modulus at other Poisson's ratios, and between the other plates."""
    rows = [[f"Poisson's ratio {plain(one.nu)}", quantity(one.E_Pa, "Pa")] for one in result.sensitivity or ()]
    if result.bracket is not None and not math.isnan(result.bracket.E_Pa):
        rows.append([f"{result.bracket.plates} plates", quantity(result.bracket.E_Pa, "Pa")])
    return rows


def _others(result: CompressionResult) -> ReportTable:
    return ReportTable(("Assumed", "Young's modulus"), ("1fr", "auto"), _other_rows(result))
