"""``cutcal report``: typeset the report of a finished run again."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from calib.io.schema import tag
from cutcal.options import add_json, print_json
from reports import ReportError

HELP = "write report.pdf and report.html of a finished run again"
DESCRIPTION = """Write report.pdf and report.html again from the files that a calibration, a
study of several cuts, compress, converge, verify, stress or bench wrote."""
EPILOG = "examples:\n  cutcal report runs/banana\n  cutcal report runs/banana --context context.yaml"


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("dir", metavar="DIR", help="folder of the run (--out)")
    p.add_argument("--context", metavar="YAML", help="what the calibration is for, for its credibility.json")
    add_json(p)


def run(args: argparse.Namespace) -> int:
    """Write the report."""
    folder = Path(args.dir)
    write = writer(folder)
    if args.context is not None:
        state(folder, args.context)
    path = write(folder)
    if args.json:
        print_json({"schema": tag("report"), "report": str(path)})
    else:
        page = path.with_suffix(".html")
        print(f"wrote {path}{f' and {page.name}' if page.exists() else ''}")
    return 0


def state(folder: Path, context: str) -> None:
    """Write what a calibration is for into its ``credibility.json``.

    Raises:
        CutcalError: The file cannot be read, or the folder is of no calibration on one trace.
    """
    from calib.calibration.credibility import read_context, write_credibility
    from calib.calibration.result import read_result

    write_credibility(read_result(folder), read_context(context))


def writer(folder: Path) -> Callable[[Path], Path]:
    """What writes the report of a folder, by the file that a run of its kind leaves there.

    Raises:
        ReportError: The folder is missing, or holds no finished run.
    """
    from calib.calibration import report as calibration
    from calib.compression import report as compression
    from calib.multi_specimen import report as multi_specimen
    from reports.multi_specimen.report import is_study
    from studies.convergence import report as convergence
    from studies.speed import report as bench
    from studies.stability import report as stability
    from studies.verification import report as verification

    found: dict[str, Callable[[Path], Path]] = {
        "converge.json": convergence.write_report,
        "verify.json": verification.write_report,
        "stress.json": stability.write_report,
        "bench.json": bench.write_report,
        "compress.json": compression.write_report,
    }
    for name, write in found.items():
        if (folder / name).exists():
            return write
    if not folder.is_dir():
        raise ReportError(f"{folder}: no such folder; give the output folder of a calibration, or of another run")
    summary = folder / "summary.json"
    if not summary.exists():
        names = ", ".join(("summary.json", *found))
        raise ReportError(f"{folder}: holds none of {names}; give the --out of a finished run")
    return multi_specimen.write_report if is_study(summary) else calibration.write_report
