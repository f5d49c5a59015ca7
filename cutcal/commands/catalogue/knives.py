"""``cutcal knives``: the blades of knives.yaml and what is known of them."""

from __future__ import annotations

import argparse
from dataclasses import asdict

from calib.io.schema import tag
from calib.material.knife import knife_fields, load_knife, wedge_height
from cutcal.options import add_json, print_json

HELP = "list the knives, or the sizes of one with their sources"
DESCRIPTION = """List the knives of knives.yaml, or every size of one with its source. A knife of
your own is a YAML file of the same layout, which --knife takes as well."""
EPILOG = "examples:\n  cutcal knives\n  cutcal knives edc\n  cutcal knives mine.yaml"


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("name", nargs="?", metavar="KNIFE", help="show one knife, or the one of a .yaml file")
    add_json(p)


def run(args: argparse.Namespace) -> int:
    """Print the list or one knife."""
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
