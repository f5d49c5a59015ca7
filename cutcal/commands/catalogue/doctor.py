"""``cutcal doctor``: whether this machine has what cutcal needs."""

from __future__ import annotations

import argparse
import textwrap
from pathlib import Path

from calib.io.schema import tag
from cutcal.doctor import Finding, examine
from cutcal.options import add_json, print_json

HELP = "try what cutcal needs of this machine"
DESCRIPTION = """Try one by one what cutcal needs: its packages, the data it ships, a small cut
on the CPU and on every graphics device that Taichi knows, the cache of compiled
kernels, typesetting, memory, and a folder for results. Each failure says what
to do about it. Nothing is left behind."""
EPILOG = """example:
  cutcal doctor

Exit codes: 0 all that is needed is there, 2 something is not."""

WIDE = 110
"""Columns after which a finding goes on below itself."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("--out", metavar="DIR", default=".", help="folder for results (default: the current one)")
    add_json(p)


def line(finding: Finding) -> str:
    """A finding as the terminal shows it: state, name, and words that go on below themselves."""
    head = f"  {finding.state:7s} {finding.name:19s} "
    return textwrap.fill(
        finding.words,
        WIDE,
        initial_indent=head,
        subsequent_indent=" " * len(head),
        break_long_words=False,
        break_on_hyphens=False,
    )


def run(args: argparse.Namespace) -> int:
    """Print each finding as it comes."""
    found = []
    for finding in examine(Path(args.out)):
        found.append(finding)
        if not args.json:
            print(line(finding), flush=True)
    failed = sum(f.state == "fail" for f in found)
    if args.json:
        print_json({"schema": tag("doctor"), "passed": not failed, "findings": [f.as_dict() for f in found]})
    elif failed:
        print(f"{failed} of {len(found)} failed")
    else:
        print("all that is needed is there")
    return 2 if failed else 0
