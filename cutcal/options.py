"""Options that several sub-commands share, checks of their values, and lines beside the results."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from dataclasses import fields
from typing import Any, TypeAlias

from calib.io.folder import finite
from calib.io.yaml_checks import suggest
from calib.material.food import FoodSpec, check_override, load_food, load_material_file
from calib.material.scene import MID_LENGTH, Sizing
from calib.outline.outline_file import POSE, OutlineFile
from calib.outline.silhouette import WAYS
from calib.simulation.dask_cluster import Cluster
from calib.simulation.process_pool import Pool
from calib.simulation.workers import Workers
from calib.table.si_numbers import si_number
from cutcal.parsing import NamedBeside
from mpm.runtime import ARCHES
from mpm.scene.errors import CutcalError, SceneError
from mpm.scene.shapes import SHAPE_KINDS, named

Group: TypeAlias = argparse._ActionsContainer
"""A parser, or a group of its options."""
RUN = "run"  # title of the group of options that say where and how
RESUME_HELP = "go on with the run in --out; nothing is run twice"
KNIFE_HELP = "knife of knives.yaml, or a YAML file (default kitchen)"
WIDTH, LENGTH = "along the blade", "across the blade"  # of a food
LOCAL_WORKERS = 2  # simulations at a time on this machine: a process each


def say(text: str) -> None:
    """One line beside the results, which are on stdout."""
    print(text, file=sys.stderr, flush=True)


def note(text: str) -> None:
    """One line about the input or the run that a reader of the results should know."""
    say(f"note: {text}")


def number(low: float, high: float, unit: str) -> Callable[[str], float]:
    """Type of an option that takes a number between two limits (both excluded).

    Args:
        low: Lower limit, in the option's unit.
        high: Upper limit, in the option's unit.
        unit: The unit, ``-`` for a part; a number may also be written with its own, as in ``45mm`` or ``30%``.

    Returns:
        What argparse calls with the text of the option.

    Raises:
        ArgumentTypeError: From what is returned, for a text that is no such number.
    """

    def convert(text: str) -> float:
        try:
            value = si_number(text, unit)
        except ValueError as e:
            raise argparse.ArgumentTypeError(str(e)) from None
        if not math.isfinite(value):
            raise argparse.ArgumentTypeError(f"{text} is not a finite number")
        if not low < value < high:
            raise argparse.ArgumentTypeError(
                f"{text} must be more than {low:g} and less than {high:g} {unit}".rstrip(" -")
            )
        return value

    return convert


def whole(least: int) -> Callable[[str], int]:
    """Type of an option that takes a whole number of at least so many."""

    def convert(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
        if value < least:
            raise argparse.ArgumentTypeError(f"{text} must be at least {least}")
        return value

    return convert


def numbers(low: float, high: float, unit: str) -> Callable[[str], tuple[float, ...]]:
    """Type of an option that takes several numbers with commas between them, none twice.

    Args:
        low: Lower limit of each, in the option's unit.
        high: Upper limit of each, in the option's unit.
        unit: The unit, for the error.

    Returns:
        What argparse calls with the text of the option.

    Raises:
        ArgumentTypeError: From what is returned, for a text that is no such list.
    """
    one = number(low, high, unit)

    def convert(text: str) -> tuple[float, ...]:
        values = tuple(one(part) for part in text.split(",") if part.strip())
        if not values or len(set(values)) < len(values):
            raise argparse.ArgumentTypeError(f"{text!r}: write different numbers with commas between them")
        return values

    return convert


def add_food(p: Group, *, cell: bool = True, required: bool = True) -> None:
    """Options that say what is cut with what.

    Args:
        p: Where they are added.
        cell: Whether the cell size is an option.
        required: Whether ``--food`` must be given.
    """
    p = p.add_argument_group("food and knife")
    p.add_argument("--food", required=required, metavar="NAME", help="food that cutcal foods lists, or its YAML file")
    p.add_argument("--material", metavar="YAML", help="take the food from this file: a material.yaml")
    p.add_argument(
        "--set", action="append", default=[], metavar="NAME=VALUE", help="give a property a value [SI, or its unit]"
    )
    p.add_argument("--knife", default="kitchen", metavar="NAME", help=KNIFE_HELP)
    add_outline(p)
    p.add_argument(
        "--at",
        type=number(0, 1, "-"),
        default=MID_LENGTH,
        metavar="PART",
        help="place of the blade, part of the length (default 0.5)",
    )
    if cell:
        p.add_argument(
            "--dx", type=number(1e-4, 0.02, "m"), metavar="M", help="cell of the grid [m] (default: by the food)"
        )


def add_outline(p: Group) -> None:
    """Options that say what the specimen looks like: a kind of shape or a file, and its sizes."""
    p.add_argument("--shape", type=shape_kind, metavar="KIND", help="outline of the specimen, such as half_cylinder")
    p.add_argument("--outline", metavar="FILE", help="its silhouette, radii or mesh, with --scale 0.1mm/px")
    p.add_argument("--scale", action=NamedBeside, metavar="SIZE", help="size of a pixel, or of a unit of a mesh")
    p.add_argument("--outline-as", metavar="WAY", help=f"{', '.join(WAYS)}; of a mesh its axes {POSE}")
    for name, what in (("height", "0.045 or 45mm; so --width, --length"), ("width", WIDTH), ("length", LENGTH)):
        p.add_argument(
            f"--{name}",
            action="store" if name == "height" else NamedBeside,
            type=number(1e-3, 1.0, "m"),
            metavar="M",
            help=f"of the specimen, {what}",
        )


def shape_kind(text: str) -> str:
    """A kind of shape, with its roundness where it has one.

    Raises:
        argparse.ArgumentTypeError: There is no such shape.
    """
    try:
        named(text)
    except SceneError as e:
        kind = text.partition(":")[0]
        unknown = f"unknown kind {kind!r}{suggest(kind, SHAPE_KINDS)}"
        said = str(e).removeprefix("shape: ") if kind in SHAPE_KINDS else unknown
        raise argparse.ArgumentTypeError(said) from None
    return text


def add_run(p: Group) -> None:
    """Options that say where and how."""
    p = titled(p, RUN)
    p.add_argument("--out", metavar="DIR", help="folder of the results; never overwritten")
    p.add_argument(
        "--seed", type=whole(0), default=0, metavar="N", help="seed of particles, search and draws (default 0)"
    )
    add_arch(p)
    add_json(p)


def titled(p: Group, title: str) -> Group:
    """The group of a title, made where there is none yet."""
    own = [g for g in getattr(p, "_action_groups", []) if g.title == title]
    return own[0] if own else p.add_argument_group(title)


def add_arch(p: Group) -> None:
    """The option that says on which device."""
    p.add_argument("--arch", choices=ARCHES, default="cpu", metavar="DEVICE", help=f"{', '.join(ARCHES)} (default cpu)")


def add_json(p: Group) -> None:
    """The option that every command with a document has."""
    p.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")


def print_json(document: Any) -> None:
    """Print a document: JSON, in letters that every terminal and pipe can take."""
    print(json.dumps(finite(document), indent=2, allow_nan=False))


def add_workers(p: Group, what: str) -> None:
    """Options that say how many at a time, and on which machines."""
    p = titled(p, RUN)
    p.add_argument("--workers", type=whole(1), metavar="N", help=f"{what} at a time (2); on a Dask --scheduler")
    p.add_argument("--scheduler", metavar="ADDRESS", help=argparse.SUPPRESS)


def workers_of(args: argparse.Namespace, say: Callable[[str], None]) -> Workers:
    """Where the options want the simulations to run; nothing is started before it has to do.

    Args:
        args: The options.
        say: Called with a sentence about the workers of a cluster.

    Raises:
        CutcalError: A cluster that cannot be used.
    """
    if args.scheduler is not None:
        return Cluster(args.scheduler, args.workers, args.arch, say=say)
    return Pool(LOCAL_WORKERS if args.workers is None else args.workers, args.arch)


def food_of(args: argparse.Namespace) -> FoodSpec:
    """The food that the options name.

    Raises:
        MaterialError: Unknown food, bad file, or an impossible value.
        CutcalError: ``--set`` without a value.
    """
    food = load_food(args.food) if args.material is None else load_material_file(args.material)
    if args.material is not None and food.name != args.food:
        raise CutcalError(f"--material {args.material}: holds {food.name}, but --food is {args.food}")
    values = {}
    for item in args.set:
        name, sign, value = item.partition("=")
        if not sign:
            raise CutcalError(f"--set {item}: write NAME=VALUE, for instance --set E=2e5")
        values[name.strip()] = check_override(name.strip(), value.strip())
    return food.with_values(values) if values else food


def sizing_of(args: argparse.Namespace) -> Sizing:
    """Sizes that the user gave, and the outline of a file.

    Raises:
        ShapeError: The file gives no outline that can be simulated.
    """
    names = [one.name for one in fields(OutlineFile)]
    file = OutlineFile(**{name: getattr(args, name) for name in names})
    return file.sizing(Sizing(args.shape, args.height, args.width, args.length, args.at))
