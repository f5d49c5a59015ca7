"""``cutcal foods``: the foods of materials.yaml and what is known of them."""

from __future__ import annotations

import argparse
import math
import re
from textwrap import wrap

from calib.io.schema import tag
from calib.material.food import FoodSpec, load_food, load_foods
from calib.material.own_food import template
from calib.material.properties import FORM, PROPERTIES
from calib.material.references import remarks
from cutcal.options import add_json, print_json
from mpm.output.number_text import terminal_rung

NAME = re.compile(r"[a-z][a-z0-9_]*")
CITED = re.compile(r"\(remarks? (\d[\d, and]*)\)")
"""Where the source of a value refers to remarks of materials.yaml."""
WIDTH = 100
"""Letters in a line of a remark."""
HELP = "list the foods, or the values of one with their sources"
DESCRIPTION = """List the foods of materials.yaml, or every value of one with range, status and
source. A YAML file of your own does in place of a name, here and for --food."""
EPILOG = """examples:
  cutcal foods
  cutcal foods banana
  cutcal foods --template tofu
  cutcal foods tofu.yaml"""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    p.add_argument("name", nargs="?", metavar="FOOD", help="show one food")
    p.add_argument("--template", metavar="NAME", type=food_name, help="print a file to begin a food of your own with")
    add_json(p)


def food_name(text: str) -> str:
    """Type of an option that names a new food."""
    if not NAME.fullmatch(text) or text in load_foods():
        raise argparse.ArgumentTypeError(f"{text!r} is no name for a new food: lower case with _, and not a known one")
    return text


def _outline(food: FoodSpec) -> str:
    """Shape and sizes."""
    size = " x ".join(f"{food.dims[n].value * 1e3:g}" for n in ("length", "width", "height"))
    return f"{food.shape_kind}, {size} mm"


def _table() -> str:
    """Shape, sizes, and the two values that a cut hangs on most, a food a line."""
    lines = [f"{'':15s}{'shape':15s}{'length':>9s}{'width':>9s}{'height':>9s}{'E':>10s}{'R':>11s}"]
    for name, food in load_foods().items():
        sizes = "".join(f"{food.dims[n].value * 1e3:>6g} mm" for n in ("length", "width", "height"))
        E, R = food.value("E") or math.nan, food.value("R") or math.nan
        lines.append(f"{name:15s}{food.shape_kind:15s}{sizes}{E / 1e6:>6.3g} MPa{R:>5.3g} J/m^2")
    return "\n".join([*lines, "E: Young's modulus, R: cutting resistance; cutcal foods NAME says all values"])


def run(args: argparse.Namespace) -> int:
    """Print the list, one food, or a file to begin one with."""
    if args.template is not None:
        print(template(args.template, [food.properties for food in load_foods().values()]), end="")
        return 0
    if args.name is None:
        names = list(load_foods())
        if args.json:
            print_json(names)
        else:
            print(_table())
        return 0
    food = load_food(args.name)
    if args.json:
        print_json({"schema": tag("food"), food.name: food.as_dict(), "warnings": food.warnings()})
        return 0
    said = [f"{food.name}: {_outline(food)} (length x width x height)"]
    for name, sizes in food.inclusions.items():
        size = " x ".join(f"{sizes[n].value * 1e3:g}" for n in ("length", "width", "height"))
        said.append(f"  {name:17s}{size} mm in a cut that asks for it (--{name})")
    for name in (*FORM, *PROPERTIES):
        p = food.roundness if name in FORM else food.properties.get(name)
        if p is not None:
            factor, unit = terminal_rung(p.unit, p.value)
            text = f"{p.value / factor:g} {unit}"
            said.append(f"  {name:17s}{text:12s} {p.low / factor:g} to {p.high / factor:g}, {p.status}: {p.source}")
    said += [f"  ! {warning}" for warning in food.warnings()]
    print("\n".join([*said, *_remarks("\n".join(said))]))
    return 0


def _remarks(text: str) -> list[str]:
    """The remarks of materials.yaml that a text refers to, in lines that a terminal shows."""
    cited = {number for numbers in CITED.findall(text) for number in re.findall(r"\d+", numbers)}
    return [
        line
        for number, remark in remarks().items()
        if number in cited
        for line in wrap(f"remark {number}: {remark}", WIDTH, initial_indent="  ", subsequent_indent="    ")
    ]
