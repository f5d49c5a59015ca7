"""``cutcal dataset``: demonstrations of cuts by a simulated robot, and their export."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cutcal.options import KNIFE_HELP, RESUME_HELP, Group, add_workers, number, print_json, say, whole, workers_of
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from intsim.data.dataset_document import DatasetDocument, DatasetSpec
    from intsim.task.selection import TaskFilter

HELP = "a robot's cuts with force, in shards that learning code loads"
DESCRIPTION = """generate: a Panda in ManiSkill cuts what it is told, in words; the food is in
the cutting solver and pushes back. Writes dataset.json and shards of HDF5 and
JSON in ManiSkill's layout, with force, pieces and surface in a group mpm/, and
with --scenes pictures of all of it before other backgrounds.
export: writes them as a LeRobotDataset v3.0, with pictures where it can render,
as RLDS (TFDS), which OpenVLA and Octo read, or as RDT reads ManiSkill's.
clone: trains a small network to do what they do (evaluate --policy clone)."""
EPILOG = """examples:
  cutcal dataset generate --episodes 60 --scenes 0,1,2 --out runs/cuts
  cutcal dataset export runs/cuts --scenes 0,1,2 --out runs/lerobot

generate and clone need pip install 'cutcal[robot]', export 'cutcal[data]', its
pictures both. Exit codes: 0 done, 1 error."""
WHAT, FORMATS = ("generate", "export", "clone"), ("lerobot", "rlds", "rdt")
KEEP = ("severed", "published", "all")


def add_args(p: Group) -> None:
    """Options of the command."""
    p.add_argument("what", choices=WHAT, metavar="WHAT", help="generate, export or clone")
    p.add_argument("folder", nargs="?", metavar="DIR", help="dataset that is exported or learnt from")
    p.add_argument("--episodes", type=whole(1), default=60, metavar="N", help="trajectories (default 60)")
    p.add_argument(
        "--food", action="append", metavar="NAME", help="this food alone, or several (default: the 15, in turn)"
    )
    p.add_argument(
        "--task",
        action="append",
        metavar="SUITE",
        help="seeds, objects, language, continuous, split or flips, or several (default: all, in turn)",
    )
    p.add_argument(
        "--demos",
        choices=("sustained", "planned", "kinematic"),
        default="sustained",
        metavar="KIND",
        help="sustained until the food parts (default), planned, or kinematic",
    )
    p.add_argument(
        "--style", action="append", metavar="NAME", help="press, slice, rock or saw, or several (default: all)"
    )
    p.add_argument(
        "--stiffness",
        type=number(1, 1e6, "N m/rad"),
        metavar="K",
        help="of the arm's joints [N m/rad] (default: a Franka's)",
    )
    p.add_argument("--knife", default="kitchen", metavar="NAME", help=KNIFE_HELP)
    p.add_argument("--seed", type=whole(0), default=0, metavar="N", help="of the first trajectory (default 0)")
    p.add_argument("--shard", type=whole(1), default=20, metavar="N", help="trajectories of a file (default 20)")
    p.add_argument(
        "--scenes", metavar="LIST", help="backgrounds that are rendered, such as 0,1,2 (default: no pictures)"
    )
    p.add_argument(
        "--format",
        choices=FORMATS,
        default="lerobot",
        metavar="NAME",
        help="of an export: lerobot (default), rlds or rdt",
    )
    p.add_argument(
        "--keep", choices=KEEP, metavar="KIND", help="severed (default of clone), published, all (default of export)"
    )
    p.add_argument("--ratio", type=number(0, 1, "-"), metavar="R", help="export, clone: cuts of this part alone")
    p.add_argument("--side", metavar="NAME", help="export, clone: from left, right or centre alone")
    p.add_argument("--without", action="append", metavar="FOOD", help="export, clone: leave a food out, or several")
    p.add_argument("--most", type=whole(1), metavar="N", help="clone: learn from at most so many")
    p.add_argument("--pixels", type=whole(16), default=128, metavar="N", help="of the pictures (default 128)")
    p.add_argument("--work-camera", action="store_true", help="of a lerobot export: the close camera's pictures too")
    add_workers(p, "trajectories")
    p.add_argument("--out", metavar="DIR", help="folder of the results, file of a clone; never overwritten")
    p.add_argument("--resume", action="store_true", help=RESUME_HELP)
    p.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")


def run(args: argparse.Namespace) -> int:
    """Generate, export or learn."""
    if args.out is None:
        raise CutcalError("dataset: give --out, the folder of the results")
    document = {"generate": _generate, "export": _export, "clone": _clone}[args.what](args)
    if args.json:
        print_json(document)
    else:
        print(f"  wrote {args.out}")
    return 0


def _generate(args: argparse.Namespace) -> dict[str, Any]:
    from intsim.data import pictures
    from intsim.data.generate import generate, require_simulator

    spec, backgrounds, out = _spec(args), _backgrounds(args), Path(args.out)
    require_simulator()
    args.arch = "cpu"
    with workers_of(args, say) as pool:
        if backgrounds:
            pictures.require_renderer(pool, backgrounds, args.pixels)
        command = ("dataset", *(a for a in sys.argv[1:] if a != "dataset"))
        document = generate(spec, out, pool, resume=args.resume, say=say, command=command)
        if backgrounds:
            pool.renew()
            rendered = pictures.render_dataset(out, backgrounds, args.pixels, pool, say)
            document = replace(document, pictures=rendered)
    if not args.json:
        print(table(document, rendered=bool(backgrounds)))
    return document.as_dict()


def _spec(args: argparse.Namespace) -> DatasetSpec:
    """The dataset that the options ask for."""
    from intsim.data.dataset_document import DatasetSpec
    from intsim.data.manifest import TRAINING_SUITES, Manifest
    from intsim.task.planner import STYLES
    from intsim.task.suites import FOODS

    if args.folder is not None:
        raise CutcalError(f"dataset generate: {args.folder!r} is too much; the folder of the results is --out")
    said = [f"--{name}" for name in ("ratio", "side", "without") if getattr(args, name) is not None]
    if said:
        raise CutcalError(
            f"{said[0]}: chooses among trajectories that are there (export, clone); generate makes by --food, --task"
        )
    unknown = [name for name in args.food or () if name not in FOODS]
    if unknown:
        raise CutcalError(f"--food {unknown[0]}: not one of {', '.join(FOODS)}")
    manifest = Manifest(
        args.episodes,
        foods=args.food or FOODS,
        suites=args.task or TRAINING_SUITES,
        seed=args.seed,
        styles=args.style or STYLES,
    )
    return DatasetSpec(manifest, args.demos, args.knife, args.stiffness, args.shard)


def table(document: DatasetDocument, *, rendered: bool) -> str:
    """What the terminal shows at the end of a finished dataset, with its pictures where they were rendered."""
    found, pictures = document.totals, document.pictures
    assert found is not None
    seconds = found.seconds_per_episode
    lines = [
        f"{found.trajectories} trajectories of {found.steps} steps: {found.published} meet the published criteria, "
        f"{found.severed} are in pieces",
        f"  {seconds.solver:.1f} s of one core in the solver and {seconds.robot:.1f} s in the robot simulator each; "
        f"the longest {found.most_solver_s:.0f} s",
        f"  {found.bytes / 1e6:.1f} MB; at this pace the 21,000 trajectories of the published data set take "
        f"{found.core_hours_of_21000:.0f} core hours",
    ]
    if rendered and pictures is not None:
        lines += [
            f"  {pictures.number} pictures before {len(pictures.scenes)} backgrounds: "
            f"{pictures.seconds_per_episode:.1f} s of one core for each trajectory and background",
            f"  {pictures.bytes / 1e6:.1f} MB; at this pace those 21,000 before its 15 backgrounds take "
            f"{pictures.core_hours_of_315000:.0f} core hours",
        ]
    return "\n".join([*lines, *(f"  trajectory {broken.index}: {broken.status}" for broken in found.broken)])


def _backgrounds(args: argparse.Namespace) -> list[int]:
    """The backgrounds that are asked for, each once."""
    try:
        return list(dict.fromkeys(int(k) for k in args.scenes.split(","))) if args.scenes else []
    except ValueError:
        raise CutcalError(f"--scenes {args.scenes}: give numbers of backgrounds, such as 0,1,2") from None


def _clone(args: argparse.Namespace) -> dict[str, Any]:
    if args.folder is None:
        raise CutcalError(
            "dataset clone: name the folder of a dataset, such as cutcal dataset clone runs/cuts --out clone.npz"
        )
    path = Path(args.out)
    if path.exists():
        raise CutcalError(f"--out {path}: exists and is never overwritten; choose another file")
    from intsim.policy.training import train

    clone = train(Path(args.folder), keep=args.keep or "severed", tasks=_tasks(args), most=args.most, seed=args.seed)
    clone.save(path)
    if not args.json:
        about = clone.about
        print(
            f"learnt from {about['trajectories']} trajectories, {len(clone.vocabulary)} words; "
            f"mean error {about['loss']:.4f}"
        )
    return clone.about


def _tasks(args: argparse.Namespace) -> TaskFilter:
    """Which tasks are exported or learnt from."""
    from intsim.task.selection import TaskFilter

    return TaskFilter(args.ratio, args.side, tuple(args.without or ()))


def _export(args: argparse.Namespace) -> dict[str, Any]:
    from intsim.data.lerobot import export_lerobot
    from intsim.data.rdt import export_rdt
    from intsim.data.rlds import export_rlds

    if args.folder is None:
        raise CutcalError(
            "dataset export: name the folder of a dataset, such as cutcal dataset export runs/cuts --out runs/lerobot"
        )
    backgrounds, folder, out = _backgrounds(args), Path(args.folder), Path(args.out)
    exports: dict[str, Callable[..., dict[str, Any]]] = {
        "lerobot": export_lerobot,
        "rlds": export_rlds,
        "rdt": export_rdt,
    }
    if args.work_camera and args.format != "lerobot":
        raise CutcalError(f"--work-camera: the layout of {args.format} has no place for it; leave it out")
    more = {"work_camera": True} if args.work_camera else {}
    args.arch = "cpu"
    with workers_of(args, say) if backgrounds else nullcontext() as pool:
        found = exports[args.format](
            folder,
            out,
            backgrounds=backgrounds,
            pixels=args.pixels,
            pool=pool,
            say=say,
            keep=args.keep or "all",
            tasks=_tasks(args),
            **more,
        )
    if not args.json and args.format == "rlds":
        print(", ".join(f"{s['shardLengths'][0]} episodes to {s['name']}" for s in found["splits"]))
    elif not args.json and args.format == "rdt":
        print(f"{sum(t['episodes'] for t in found.values())} episodes of {len(found)} tasks")
    elif not args.json:
        each = "for each trajectory, background and sentence" if backgrounds else "for each trajectory and sentence"
        print(
            f"{found['total_episodes']} episodes of {found['total_frames']} frames: one {each} that asks for it "
            f"({found['total_tasks']} sentences in all)"
        )
    return found
