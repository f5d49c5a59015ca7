"""``cutcal simulate``: one cut, its forces and its balance."""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib.io.folder import prepare, write_csv, write_json
from calib.io.progress import Countdown, clock, rewrites
from calib.io.provenance import git_commit, versions
from calib.io.schema import tag
from calib.io.typed_document import to_document
from calib.material.food import FoodSpec
from calib.material.inclusions import AS_USUAL, check_limit, with_inclusions
from calib.material.knife import load_knife
from calib.material.properties import BOW
from calib.material.scene import blade_warnings, cut_scene, specimen
from calib.simulation.around_stone import LEAST_TURNS, TURNS
from calib.simulation.evaluation import FULLY_PARTED, doubts_of_the_crack, pressed_away
from calib.table.si_numbers import si_number
from calib.validation.method_constants import CONSTANTS
from cutcal.commands.solver.around import document, halve
from cutcal.options import (
    add_food,
    add_run,
    food_of,
    note,
    number,
    print_json,
    say,
    sizing_of,
    whole,
)
from mpm.output.energy import doubts, spent, unbooked
from mpm.output.record import LIMIT, ForceRecord
from mpm.output.snapshot import SnapshotRecorder
from mpm.scene import CONTACTS, Arm, Inclusion, Motion, Scene
from mpm.scene.errors import BREAKDOWNS, CutcalError
from mpm.scene.shapes import Shape

if TYPE_CHECKING:
    from mpm.solver import Simulation

HELP = "simulate one cut"
DESCRIPTION = "Simulate one cut and write force.csv and summary.json."
LENGTHS = ("zone", "slip", "cohesive_zone")  # constants that may be written with a unit
VIDEO_FRAMES = 72  # of a video: five seconds
FRAMES_PER_PAGE_FRAME = 6  # frames of a video of which a page has one
FRAMES_PER_LINE = 12  # pictures of a video after which a line says how many there are
CRUSHED = (
    "the flesh between stone and board was crushed at {force:.0f} N, further than cells can follow; give a lower "
    "--force-limit, or cut around the stone (--around)"
)
EPILOG = """example:
  cutcal simulate --food cucumber --knife edc --out runs/cucumber
Exit codes: 0 done, 1 error in input or run, 2 done, but --force-limit left food
uncut, or over 10 % of the work is booked by no law or kinetic (docs/cli.md)."""


def add_args(p: argparse.ArgumentParser) -> None:
    """Options of this command."""
    add_food(p)
    p.add_argument(
        "--speed", type=number(0, 10, "m/s"), metavar="M/S", help="real speed of the knife; relaxation and rate need it"
    )
    p.add_argument(
        "--stroke", type=number(1e-4, 1, "m"), metavar="M", help="way of the edge [m] (default: the whole height)"
    )
    p.add_argument(
        "--offset",
        type=number(-10, 10, "cells"),
        default=0.0,
        metavar="CELLS",
        help="blade against the grid (default 0)",
    )
    p.add_argument(
        "--contact",
        choices=CONTACTS,
        default="cohesive",
        metavar="KIND",
        help="cohesive (default), or nodal for comparison",
    )
    p.add_argument(
        "--zone",
        type=number(1e-5, 0.05, "m"),
        metavar="M",
        help="process zone of the edge (default: the food's)",
    )
    p.add_argument(
        "--slip", type=number(1e-5, 0.05, "m"), metavar="M", help="elastic way of the edge's law (default 1mm)"
    )
    p.add_argument(
        "--contact-stiffness",
        type=number(0.1, 100, "of a layer's"),
        metavar="K",
        help="contact over a layer of particles (default 2)",
    )
    p.add_argument(
        "--constant",
        action="append",
        default=[],
        metavar="N=VALUE",
        help="another constant of the method (docs/theory.md)",
    )
    p.add_argument(
        "--safety", type=number(0, 0.9, "of the stability limit"), metavar="F", help="time step (default 0.7)"
    )
    p.add_argument(
        "--mach",
        type=number(0, 0.05, "-"),
        metavar="PART",
        help="even speed over the P-wave's (default 0.01 or less)",
    )
    p.add_argument(
        "--slice-ratio",
        type=number(-20, 20, ""),
        default=0.0,
        metavar="RATIO",
        help="speed along the edge over speed down",
    )
    p.add_argument(
        "--tilt", type=number(-60, 60, "degrees"), default=0.0, metavar="DEG", help="edge against the board [degrees]"
    )
    p.add_argument(
        "--retract",
        type=number(0, 1, "m"),
        default=0.0,
        metavar="M",
        help="withdrawal: way back up after the stroke [m]",
    )
    p.add_argument(
        "--turn", type=number(-90, 90, "degrees"), default=0.0, metavar="DEG", help="scene against the grid [degrees]"
    )
    p.add_argument(
        "--arm-stiffness",
        type=number(1, 1e9, "N/m"),
        metavar="N/M",
        help="of the robot's arm; rigid if not given",
    )
    p.add_argument("--force-limit", type=number(0, 1e6, "N"), metavar="N", help="most force that the arm bears [N]")
    for name, what in (("stone", "a stone in it"), ("cavity", "a hollow in it")):
        p.add_argument(
            f"--{name}",
            nargs="?",
            const=AS_USUAL,
            metavar="SIZE",
            help=f"{what}: the food's, or length x width x height",
        )
    p.add_argument(
        "--around",
        nargs="?",
        type=whole(LEAST_TURNS),
        const=TURNS,
        metavar="N",
        help=f"halve it around the stone, in N passes ({TURNS})",
    )
    p.add_argument("--threads", type=whole(0), default=0, metavar="N", help="CPU threads (default 0: all cores)")
    p.add_argument("--pictures", action="store_true", help="draw the cut at contact, largest force and end")
    p.add_argument("--video", action="store_true", help="draw it as a film, cut.mp4")
    p.add_argument("--page", action="store_true", help="write a page to turn it around, cut.html")
    add_run(p)


def run(args: argparse.Namespace) -> int:
    """Simulate and write."""
    food = food_of(args)
    out = Path(args.out or f"cutcal-simulate-{food.name}")
    shape, assumed = specimen(food, None, sizing_of(args))
    scene = _scene(args, food, shape)
    narrow = blade_warnings(shape, load_knife(args.knife))
    assumed += narrow
    for text in narrow:
        note(text)
    with prepare(out, "simulate", resume=False):
        done = halve(args, scene, out) if args.around is not None else None
        simulation, watch, record = _simulated(args, scene) if done is None else (None, None, done.passes[0].record)
        write_csv(out / "force.csv", record.columns())
        if record.parted < FULLY_PARTED:
            assumed.append(pressed_away(record.parted))
            note(assumed[-1])
        for text in doubts_of_the_crack(scene):
            assumed.append(text)
            note(text)
        doubted = doubts(record.budget, record.ke_over_ie) if record.status == "done" else []
        for text in doubted:
            say(f"not passed: {text}")
        if record.status == "inverted" and scene.food.stone in scene.food.crossed:
            doubted = [CRUSHED.format(force=float(record.knife[-1, 2]))]
            say(f"not passed: {doubted[0]}")
        assumed += doubted
        summary = _summary(args, food, scene, record, assumed) | ({} if done is None else {"around": document(done)})
        write_json(out / "summary.json", summary)
        if watch is not None:
            _draw(args, out, simulation, record, watch, food.name)
    if args.json:
        print_json(summary)
    else:
        print(_words(food.name, scene, record, out) if done is None else f"{food.name}: {done.words()}; wrote {out}")
    if record.status != "done":
        return 1
    parted = done.severed if done is not None else not _stopped(record)
    return 2 if doubted or not parted else 0


def _stopped(record: ForceRecord) -> bool:
    """Whether what the arm bears, or a stone, kept the blade from parting the food."""
    met = record.pieces is not None and record.pieces.stone_met is not None
    return not record.severed and (met or record.ended == LIMIT)


def _scene(args: argparse.Namespace, food: FoodSpec, shape: Shape) -> Scene:
    """The cut that the options ask for."""
    deep = shape.height + abs(food.value(BOW) or 0.0)  # to the board, which may lie below the food's middle
    way = Motion(args.stroke or deep, speed=args.speed)
    scene = cut_scene(food, shape, load_knife(args.knife), stroke=way, dx=args.dx, seed=args.seed)
    scene = with_inclusions(scene, food, args.stone, args.cavity)
    motion = replace(
        scene.motion,
        mach=scene.motion.mach if args.mach is None else args.mach,
        end_speed=scene.motion.end_speed if args.mach is None else 1.0,
        slice_ratio=args.slice_ratio,
        tilt=math.radians(args.tilt),
        retract=args.retract,
    )
    numerics = replace(
        scene.numerics,
        contact=args.contact,
        grid_shift=(0.0, args.offset, 0.0),
        grid_turn=math.radians(args.turn),
    )
    arm = Arm(args.arm_stiffness, args.force_limit)
    scene = replace(scene, motion=motion, numerics=numerics, arm=arm)
    if args.around is None:
        check_limit(scene)
    elif args.pictures or args.video or args.page:
        raise CutcalError("--around: its passes are not drawn; leave out --pictures, --video and --page")
    for name, value in _constants(args).items():
        constant = next(c for c in CONSTANTS if c.key == name)
        scene = constant.put(scene, value)
    return scene


def _constants(args: argparse.Namespace) -> dict[str, float]:
    """Constants of the method that the options give, by key.

    Raises:
        CutcalError: ``--constant`` without a value, with one that is no number, or of a constant that there is not.
    """
    own = {name: getattr(args, name) for name in ("zone", "slip", "contact_stiffness", "safety")}
    out = {name: value for name, value in own.items() if value is not None}
    known = [c.key for c in CONSTANTS]
    for item in args.constant:
        name, sign, text = item.partition("=")
        if not sign or name.strip() not in known:
            raise CutcalError(f"--constant {item}: write NAME=VALUE, with a name of {', '.join(known)}")
        try:
            out[name.strip()] = si_number(text, "m" if name.strip() in LENGTHS else "")
        except ValueError as e:
            raise CutcalError(f"--constant {item}: {e}") from None
    return out


def _simulated(args: argparse.Namespace, scene: Scene) -> tuple[Simulation, SnapshotRecorder | None, ForceRecord]:
    """The cut: what simulated it, the looks at it that pictures need, and its record."""
    from mpm.runtime import Runtime
    from mpm.solver import Simulation

    began = time.monotonic()

    def show(done: float, force: float) -> None:
        left = (time.monotonic() - began) * (1 - done) / done
        print(f"\r{done:5.0%}  {force:8.2f} N  {clock(left)} left ", end="", file=sys.stderr, flush=True)

    simulation = Simulation(scene, Runtime(args.arch, args.threads))
    watch = SnapshotRecorder(VIDEO_FRAMES) if args.pictures or args.video or args.page else None
    terminal = rewrites(sys.stderr)
    record = simulation.run(progress=show if terminal else None, snapshots=watch)
    if terminal:
        print(file=sys.stderr)
    return simulation, watch, record


def _summary(
    args: argparse.Namespace, food: FoodSpec, scene: Scene, record: ForceRecord, assumed: list[str]
) -> dict[str, Any]:
    """The content of summary.json."""
    return {
        "schema": tag("simulate"),
        "food": food.name,
        "knife": scene.knife.name,
        **record.summary(),
        "edge_m": scene.food.shape.height - float(record.stroke[-1]) if len(record.stroke) else None,
        "stone_size_m": _sizes(scene.food.stone),
        "cavity_size_m": _sizes(scene.food.cavity),
        "dx_m": scene.numerics.dx,
        "mach": scene.motion.mach,
        "contact": scene.numerics.contact,
        "constants": {constant.key: constant.value(scene) for constant in CONSTANTS},
        "shape": to_document(scene.food.shape),
        "speed_real_m_s": args.speed,
        "seed": args.seed,
        "device": args.arch,
        "versions": versions(),
        "git": git_commit(),
        "warnings": [*food.warnings(), *assumed],
    }


def _sizes(one: Inclusion | None) -> list[float] | None:
    """Length, width and height of a stone or a cavity [m]."""
    return None if one is None else [one.length, one.width, one.height]


def _state(record: ForceRecord) -> str:
    """That the cut is done, or how far it came and why no further."""
    if record.status == "done":
        return record.status
    why = f": {BREAKDOWNS[record.status]}" if record.status in BREAKDOWNS else ""
    return f"broke down after {record.fraction:.0%} of its stroke ({record.status}{why})"


def _words(name: str, scene: Scene, record: ForceRecord, out: Path) -> str:
    """What the terminal shows at the end."""
    lines = [
        f"{name}: peak {record.peak:.2f} N, work {record.work:.3f} J, {_state(record)}; "
        f"momentum balance closes to {record.momentum_residual:.1e} of the peak; wrote {out}"
    ]
    up = record.withdrawal
    if up is not None:
        lines.append(f"withdrawal: held back with up to {up['pull_N']:.2f} N, work {up['work_J']:.3f} J")
    part, fracture = unbooked(record.budget), record.fracture
    if part is not None:
        rate = "" if fracture is None else f" ({fracture['released_J_m2']:.3g} J/m^2)"
        lines.append(f"where the work went: {spent(record.budget)}; lost by the discretisation {part:.1%}{rate}")
    if record.pieces is not None:
        lines.append(record.pieces.words())
    if record.ended == LIMIT:
        height = scene.food.shape.height - record.stroke[-1]
        lines.append(
            f"the arm stopped at its limit of {scene.arm.force_limit:g} N with the edge at z = {height * 1e3:.1f} mm: "
            f"{record.severed_part:.0%} of the section's flesh is cut"
        )
    return "\n".join(lines)


def _draw(
    args: argparse.Namespace, out: Path, simulation: Any, record: ForceRecord, watch: SnapshotRecorder, food: str
) -> None:
    """Pictures, video and page, whatever was asked for; force.csv and summary.json are written before."""
    if not watch.taken:
        say("nothing to draw: the run broke down before the first look")
        return
    from reports.base.film import Film
    from reports.base.html_page import page
    from reports.base.scene_render import stills, video

    film = Film.of(food, simulation, watch.taken, record)
    if args.pictures:
        say("drawing contact, largest force and end")
        stills(film, out)
    if args.page:
        say("writing cut.html")
        page(
            replace(film, looks=[*film.looks[:-1:FRAMES_PER_PAGE_FRAME], film.looks[-1]]),
            out / "cut.html",
            f"{food}, {film.scene.knife.name} knife",
        )
    if args.video:
        rest = Countdown(len(film.looks))

        def told(done: int) -> None:
            left = rest.left(1.0)
            if done % FRAMES_PER_LINE == 0:
                say(f"drawing cut.mp4: {done} of {len(film.looks)} pictures, {left}")

        say("drawing cut.mp4")
        video(film, out / "cut.mp4", told)
