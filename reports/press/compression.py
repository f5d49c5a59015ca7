"""Report of a compression test: the verdict, stress over strain, the modulus of each repeat, and how it was got."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import TYPE_CHECKING

import numpy as np

from reports.base.brief import Brief, ReportPart, ReportTable
from reports.base.format import breakable, count, interval, plain, quantity, uncertain
from reports.base.labels import capital
from reports.base.references import Citations
from reports.press.tables import sentences, verdict_table
from reports.web.brief import Chart, Panel, publish_brief

if TYPE_CHECKING:
    from calib.compression.result import CompressionResult, StressCurves

STRESS = "Stress"
"""Title of the part that shows it."""
ALT = "Measured and fitted stress over strain, and their difference"
LAW = (
    "fixed-corotated, isotropic elasticity [@Stomakhin 2012]: stress is in proportion to Young's modulus, so that one "
    "simulated curve is scaled to each repeat by least squares"
)
NRMSE = (
    "NRMSE: root mean square difference of the fitted stress and the mean of the repeats over the largest measured "
    "stress. Stress: force over the area before the test. Strain: compression over the height before the test. Slope: "
    "of the least-squares line over 0 to 5 % strain."
)
SOLVER = (
    "Error of the solver: largest relative difference, beyond 2 % strain, of the simulated stress from the closed form "
    "of the same law for a homogeneous press between plates without friction."
)
GRID = "Change from a coarser grid: largest relative change, beyond 2 % strain, on two thirds of the cells."
NUMERICS = (
    "chosen here: less than a third of what the slope may miss, so that numerics do not decide; on 15 cells the solver "
    "is within 0.2 % of the closed form"
)
#: Where the limit of each line of the verdict comes from.
LIMIT_SOURCES = {
    "curve error (NRMSE)": "chosen here, by no standard: thirteen silicones of known modulus were fitted to 1.2 % or "
    "better, up to 40 % strain [@Dawood 2026]",
    "slope over 0 to 5 % strain, fitted against measured": "chosen here, by no standard: of these thirteen silicones "
    "the fitted slope was within 7.5 % of the published modulus [@Dawood 2026]",
    "error of the solver against the closed form": NUMERICS,
    "change from a coarser grid": NUMERICS,
}


def write_report(result: CompressionResult, curves: StressCurves, out: Path) -> Path:
    """Write ``report.pdf`` and ``report.html`` beside ``compress.json`` and ``compress.svg``.

    Args:
        result: The calibrated modulus.
        curves: Stress over strain.
        out: The folder.

    Returns:
        Path of ``report.pdf``.

    Raises:
        ReportError: The report cannot be written.
    """
    explained = f"{NRMSE} {SOLVER if result.solver_error is not None else GRID}"
    citations = Citations()
    facts = [(label, str(citations.numbered(text))) for label, text in _facts(result)]
    brief = Brief(
        kind="Compression",
        name="Young's modulus",
        passed=result.passed,
        sentence=_sentence(result),
        facts=facts,
        parts=[
            ReportPart("Verdict", explained, table=verdict_table(result.verdicts)),
            *_limits(result, citations),
            ReportPart(STRESS, picture=(out / "compress.svg").read_bytes(), alt=ALT),
            ReportPart("Modulus of each repeat", table=_repeats(result)),
            ReportPart("How close the fitted curve is", table=_closeness(result)),
            *([ReportPart("If another assumption holds", table=_others(result))] if _other_rows(result) else []),
            ReportPart("Files", table=_files(result)),
            ReportPart("References", table=_references(citations.listed)),
        ],
        limits=sentences(result.not_shown),
    )
    return publish_brief(out / "compress.json", brief, _Origin(result), _chart(curves))


def _chart(curves: StressCurves) -> Chart:
    """Stress over strain to point at, with the range of the repeats and what is left."""
    repeats = np.array(list(curves.repeats.values())) / 1e3
    several = len(repeats) > 1
    mean, fitted = curves.measured / 1e3, curves.fitted / 1e3
    drawn = {"measured": ("measured, mean" if several else "measured", mean), "fitted": ("fitted", fitted)}
    band = (repeats.min(axis=0), repeats.max(axis=0)) if several else None
    panel = Panel("", 1e2 * curves.strain, drawn, band, fitted - mean)
    of = f"range of {len(repeats)} repeats"
    return Chart(STRESS, ("strain", "%"), ("stress", "kPa"), [panel], band=of, residual="fitted − measured")


def _sentence(result: CompressionResult) -> str:
    """The modulus, its interval, and what that interval leaves out."""
    modulus = result.E
    window = f"over 0 to {plain(100 * modulus.window[1], None)} % strain"
    text = f"Young's modulus is {quantity(modulus.mean_Pa, 'Pa')} {window}"
    if modulus.repeats > 1:
        ends = interval(modulus.low_Pa, modulus.high_Pa, "Pa")
        text += f". The 95 % interval of {ends} is of the {modulus.repeats} repeats alone"
    else:
        text += " from one repeat, without an interval"
    nu, plates = plain(result.assumed.nu, None), result.assumed.plates
    other = result.bracket
    if other is None or math.isnan(other.E_Pa):
        return f"{text}: a Poisson's ratio of {nu} and {plates} plates are assumed."
    return (
        f"{text}: between {other.plates} plates, in place of {plates} ones, the same forces give "
        f"{quantity(other.E_Pa, 'Pa')}. A Poisson's ratio of {nu} is assumed."
    )


def _facts(result: CompressionResult) -> list[tuple[str, str]]:
    """Specimen, what is assumed, law, and how the press was simulated."""
    shape, run = result.specimen, result.simulation.run
    return [
        (
            "Specimen",
            f"{shape.kind.replace('_', ' ')}, height {quantity(shape.height, 'm')}, "
            f"area {plain(1e6 * shape.area_m2)} mm²",
        ),
        ("Assumed", f"Poisson's ratio {plain(result.assumed.nu, None)}, {result.assumed.plates} plates"),
        ("Law", LAW),
        (
            "Simulation",
            f"moving least squares material point method [@Hu 2018]: {run.cells} cells of {quantity(run.dx_m, 'm')} "
            f"over the height, {count(run.particles)} particles, {count(run.steps)} steps, plate at "
            f"{plain(run.mach, 2)} of the speed of pressure waves, no gravity",
        ),
        ("Seed", str(result.simulation.seed)),
    ]


class _Origin:
    """Where the result comes from, with the device of its simulation."""

    def __init__(self, result: CompressionResult) -> None:
        self.device = result.simulation.arch
        self.command = result.command
        self.versions = result.versions
        self.git = result.git


def _repeats(result: CompressionResult) -> ReportTable:
    """A row for each repeat, and one for their mean."""
    rows = [[breakable(one.name), quantity(one.E_Pa, "Pa"), quantity(one.slope_Pa, "Pa")] for one in result.repeats]
    if len(rows) > 1:
        slopes = [one.slope_Pa for one in result.repeats]
        mean = uncertain(result.E.mean_Pa, result.E.sd_Pa, "Pa")
        rows.append(["Mean ± standard deviation", mean, uncertain(fmean(slopes), stdev(slopes), "Pa")])
    return ReportTable(("Repeat", "Young's modulus", "Slope over 0 to 5 % strain"), ("1fr", "auto", "auto"), rows)


def _closeness(result: CompressionResult) -> ReportTable:
    """The fitted slope beside the measured one, and the largest error of the force."""
    slope, force = result.slope, result.force_error
    end, beyond = plain(100 * slope.window[1], None), plain(100 * force.from_strain, None)
    rows = [
        [f"Slope over 0 to {end} % strain, measured", uncertain(slope.measured_Pa, slope.measured_sd_Pa, "Pa")],
        ["The same of the fitted curve", quantity(slope.fitted_Pa, "Pa")],
        ["Fitted over measured, less 1", quantity(slope.error, "fraction", signed=True)],
        [
            f"Largest error of the force beyond {beyond} % strain",
            f"{quantity(force.value, 'fraction', signed=True)} at {plain(100 * force.strain, 2)} %",
        ],
    ]
    return ReportTable(("Quantity", "Value"), ("1fr", "auto"), rows)


def _other_rows(result: CompressionResult) -> list[list[str]]:
    """The modulus at other Poisson's ratios, and between the other plates."""
    rows = [[f"Poisson's ratio {plain(one.nu, None)}", quantity(one.E_Pa, "Pa")] for one in result.sensitivity or ()]
    if result.bracket is not None and not math.isnan(result.bracket.E_Pa):
        rows.append([f"{result.bracket.plates.capitalize()} plates", quantity(result.bracket.E_Pa, "Pa")])
    return rows


def _others(result: CompressionResult) -> ReportTable:
    return ReportTable(("Assumed", "Young's modulus"), ("1fr", "auto"), _other_rows(result))


def _files(result: CompressionResult) -> ReportTable:
    """The files of the test with their columns and hashes."""
    rows = [
        [breakable(one.name), breakable(one.compression), breakable(one.force), breakable(one.sha256)]
        for one in result.files
    ]
    return ReportTable(("File", "Compression", "Load", "SHA-256"), ("1fr", "auto", "auto", "70mm"), rows, left=4)


def _limits(result: CompressionResult, citations: Citations) -> list[ReportPart]:
    """Where the limits of the lines come from; nothing for lines of other versions alone."""
    rows = [
        [capital(line.name), citations.numbered(LIMIT_SOURCES[line.name])]
        for line in result.verdicts
        if line.name in LIMIT_SOURCES
    ]
    table = ReportTable(("Line", "Its limit"), ("62mm", "1fr"), rows, left=2)
    return [ReportPart("Where the limits come from", table=table)] if rows else []


def _references(texts: Sequence[str]) -> ReportTable:
    rows = [[f"[{k}]", text] for k, text in enumerate(texts, start=1)]
    return ReportTable(("", "Cited"), ("auto", "1fr"), rows, left=2)
