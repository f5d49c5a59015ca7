"""``cutcal schema``: what the keys of the JSON documents mean."""

from __future__ import annotations

import argparse

from calib.io.schema import names, schema
from cutcal.options import add_json, print_json

HELP = "list the JSON documents, or print the schema of one"
DESCRIPTION = """List the documents that --json prints and --out holds, or print the JSON Schema
(draft 2020-12) of one: every key with its meaning and unit. A document names
its schema under "schema", such as cutcal/calibrate/1."""
EPILOG = """examples:
  cutcal schema
  cutcal schema calibrate"""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("name", nargs="?", metavar="DOCUMENT", help="print the schema of this document")
    add_json(p)


def run(args: argparse.Namespace) -> int:
    """Print the list or one schema, which is JSON in any case."""
    if args.name is not None:
        print_json(schema(args.name))
    elif args.json:
        print_json(names())
    else:
        print("\n".join(names()))
    return 0
