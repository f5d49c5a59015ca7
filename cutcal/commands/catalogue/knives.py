"""``cutcal knives``: the blades of knives.yaml and what is known of them."""

from __future__ import annotations

import argparse
import re
from dataclasses import asdict

from calib.io.schema import tag
from calib.material.knife import TEMPLATE, knife_fields, load_knife, load_knives, wedge_height
from cutcal.options import add_json, print_json

HELP = "list the knives, or the sizes of one with their sources"
DESCRIPTION = """List the knives of knives.yaml, or every size of one with its source. A knife of
your own is a YAML file of the same layout, which --knife takes as well."""
EPILOG = """examples:
  cutcal knives
  cutcal knives edc
  cutcal knives --template mine
  cutcal knives mine.yaml"""
NAME = re.compile(r"[a-z][a-z0-9_]*")


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("name", nargs="?", metavar="KNIFE", help="show one knife, or the one of a .yaml file")
    p.add_argument("--template", metavar="NAME", type=knife_name, help="print a file to begin a knife of your own with")
    add_json(p)


def knife_name(text: str) -> str:
    """Type of an option that names a new knife."""
    if not NAME.fullmatch(text) or text in load_knives():
        raise argparse.ArgumentTypeError(f"{text!r} is no name for a new knife: lower case with _, and not a known one")
    return text


def run(args: argparse.Namespace) -> int:
    """Print the list, one knife, or a file to begin one with."""
    if args.template is not None:
        print(TEMPLATE.format(name=args.template), end="")
        return 0
    if args.name is None:
        known = knife_fields()
        if args.json:
            print_json(list(known))
            return 0
        print(f"{'':10s}  spine   angle  height  length")
        for name, size in known.items():
            mm = {n: f"{1e3 * size[n].value:g} mm" for n in ("spine", "height", "length")}
            print(f"{name:10s}  {mm['spine']:7s}{size['angle'].value:4g}°   {mm['height']:7s} {mm['length']}")
        return 0
    knife = load_knife(args.name)
    from_file = args.name.endswith((".yaml", ".yml"))
    size = knife_fields(args.name if from_file else None)[knife.name]
    if args.json:
        print_json({"schema": tag("knife"), knife.name: {n: asdict(f) for n, f in size.items()}})
        return 0
    print(
        f"{knife.name}: a wedge of {size['angle'].value:g}° up to {wedge_height(knife) * 1e3:.3g} mm above the edge, "
        "parallel above"
    )
    for name, field in size.items():
        print(f"  {name:8s}{field.value:g} {field.unit:6s}{field.status}: {field.source}")
    return 0
