"""``cutcal foods``: the foods of materials.yaml and what is known of them."""

from __future__ import annotations

import argparse

from calib.io.schema import tag
from calib.material.food import load_food, load_foods
from calib.material.properties import FORM, PROPERTIES
from cutcal.options import add_json, print_json

HELP = "list the foods, or the values of one with their sources"
DESCRIPTION = """List the foods of materials.yaml, or every value of one with range, status and
source."""
EPILOG = """examples:
  cutcal foods
  cutcal foods banana"""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("name", nargs="?", metavar="FOOD", help="show one food")
    add_json(p)


def run(args: argparse.Namespace) -> int:
    """Print the list or one food."""
    if args.name is None:
        names = list(load_foods())
        if args.json:
            print_json(names)
        else:
            print("\n".join(names))
        return 0
    food = load_food(args.name)
    if args.json:
        print_json({"schema": tag("food"), food.name: food.as_dict(), "warnings": food.warnings()})
        return 0
    size = " x ".join(f"{food.dims[n].value * 1e3:g}" for n in ("length", "width", "height"))
    print(f"{food.name}: {food.shape_kind}, {size} mm (length x width x height)")
    for name, sizes in food.inclusions.items():
        size = " x ".join(f"{sizes[n].value * 1e3:g}" for n in ("length", "width", "height"))
        print(f"  {name:17s}{size} mm in a cut that asks for it (--{name})")
    for name in (*FORM, *PROPERTIES):
        p = food.roundness if name in FORM else food.properties.get(name)
        if p is not None:
            text = f"{p.value:g} {p.unit}"
            print(f"  {name:17s}{text:16s} {p.low:g} to {p.high:g}, {p.status}: {p.source}")
    for warning in food.warnings():
        print(f"  ! {warning}")
    return 0
