"""``cutcal report``: typeset the report of a finished calibration again."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

HELP = "write report.pdf of a finished calibration again"
DESCRIPTION = "Typeset report.pdf from summary.json, curves.csv and evaluations.h5 of a calibration."
EPILOG = "example:\n  cutcal report runs/banana"


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("dir", help="folder that a calibration wrote (--out)")
    p.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")


def run(args: argparse.Namespace) -> int:
    """Write the report."""
    from reports.calibration import write_report

    path = write_report(Path(args.dir))
    print(json.dumps({"report": str(path)}) if args.json else f"wrote {path}")
    return 0
