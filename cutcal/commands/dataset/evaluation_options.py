"""What the options of ``cutcal evaluate`` ask for: policies, foods and world."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from calib.material.food import FoodSpec, load_food, load_material_file
from calib.simulation.workers import Workers
from cutcal.options import say, workers_of
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from intsim.evaluate import PolicyEvaluation
    from intsim.task.rollout import Policy
    from intsim.task.selection import TrainingTasks

TRAINING = ("ratio", "side", "without", "demos")
"""Options that say what a server's policy was trained on."""


@dataclass(frozen=True, eq=False)
class NamedPolicy:
    """A policy that is evaluated.

    Attributes:
        policy: Who moves the knife.
        name: What the results call it.
        part: Name of the folder of its results where there are several.
        trained: What it has learnt from; None where it has not learnt, or does not say.
    """

    policy: Policy
    name: str
    part: str = ""
    trained: TrainingTasks | None = None


def check_options(args: argparse.Namespace) -> None:
    """Refuse options that do not go together.

    Raises:
        CutcalError: They do not.
    """
    from intsim.policy.openpi import is_openpi
    from intsim.task.suites import SUITES

    unknown = [s for s in args.suite or () if s not in SUITES]
    if unknown:
        raise CutcalError(f"--suite {unknown[0]}: none of {', '.join(SUITES)}")
    if (args.policy == "noisy") != (args.sigma is not None):
        raise CutcalError("--sigma M is the error of --policy noisy: give both or neither")
    if (args.policy == "clone") != (args.weights is not None):
        raise CutcalError("--weights FILE are those of --policy clone: give both or neither")
    if args.world == "table" and args.stiffness is not None:
        raise CutcalError("--stiffness is of a robot's joints: add --world intsim, or give --arm-stiffness")
    if args.world != "table" and (args.severing or args.arm_stiffness is not None):
        raise CutcalError("--severing and --arm-stiffness are of --world table; in intsim the food resists anyway")
    if (args.policy == "remote") != (args.server is not None):
        raise CutcalError("--server URL is that of --policy remote: give both or neither")
    if (args.send or args.replan) and not is_openpi(args.server or ""):
        raise CutcalError("--send and --replan are of an openpi server: give --policy remote --server ws://HOST:PORT")
    if args.world == "table" and args.pixels:
        raise CutcalError("--pixels are of a robot's cameras: add --world intsim")
    _check_paper(args)


def _check_paper(args: argparse.Namespace) -> None:
    """Refuse options of a figure without one, and others with it.

    Raises:
        CutcalError: They do not go together.
    """
    said = [f"--{name}" for name in TRAINING if getattr(args, name) is not None]
    if args.paper is not None and args.suite:
        raise CutcalError("--suite: a figure of --paper has tasks of its own; leave one of both out")
    if args.paper is None and args.folders:
        raise CutcalError("--from: say of which figure, such as --paper fig4")
    if args.paper is None and len(args.weights or ()) > 1:
        raise CutcalError("--weights: one file; several are of --paper")
    if said and (args.paper is None or args.policy != "remote"):
        raise CutcalError(
            f"{said[0]}: says what a server's policy was trained on (--paper with --policy remote); a clone's file "
            "says that itself, and the others have not learnt"
        )


def policies_of(args: argparse.Namespace) -> list[NamedPolicy]:
    """Who moves the knife: several where there are several --weights."""
    from intsim.policy.behaviour_cloning import Clone
    from intsim.policy.openpi import OpenPi, is_openpi
    from intsim.policy.oracles import make_policy
    from intsim.policy.remote import Remote

    if args.policy == "clone":
        clones = [(Clone.load(Path(file)), Path(file).stem) for file in args.weights]
        twice = [part for _, part in clones if [p for _, p in clones].count(part) > 1]
        if twice:
            raise CutcalError(f"--weights: two files are called {twice[0]}, and so would their results; rename one")
        return [NamedPolicy(clone, clone.name, part, clone.trained) for clone, part in clones]
    if args.policy == "remote":
        openpi = is_openpi(args.server)
        server = OpenPi(args.server, args.send or (), args.replan) if openpi else Remote(args.server)
        return [NamedPolicy(server, f"remote {server.name}", trained=_trained(args))]
    return [NamedPolicy(make_policy(args.policy, args.sigma or 0.0), args.policy)]


def _trained(args: argparse.Namespace) -> TrainingTasks | None:
    """What the options say of a server's training; None without any."""
    from intsim.task.selection import TaskFilter, TrainingTasks

    if all(getattr(args, name) is None for name in TRAINING):
        return None
    tasks = TaskFilter(args.ratio, args.side, tuple(args.without or ()))
    return TrainingTasks(args.demos, tasks.ratio, tasks.side, tasks.without, None)


def foods_of(args: argparse.Namespace, names: Sequence[str]) -> dict[str, FoodSpec]:
    """Foods by name, the calibrated ones from their files.

    Args:
        args: The options.
        names: Of the foods.
    """
    calibrated = {food.name: food for food in map(load_material_file, args.material)}
    return {name: calibrated.get(name) or load_food(name) for name in names}


def asked_foods(args: argparse.Namespace) -> list[str] | None:
    """Names of the foods that the options ask for; None for the usual ones."""
    return args.food or [load_material_file(file).name for file in args.material] or None


def evaluation_of(args: argparse.Namespace, who: NamedPolicy, foods: dict[str, FoodSpec]) -> PolicyEvaluation:
    """What the options ask for, of one policy.

    Args:
        args: The options.
        who: The policy.
        foods: Foods by name.

    Returns:
        The evaluation.
    """
    from intsim.evaluate import PolicyEvaluation
    from intsim.sim.severing import PANDA_ARM
    from intsim.sim.world import World
    from intsim.task.suites import SUITES
    from mpm.scene import Arm

    world = None if args.world == "table" else World(args.world == "intsim", args.stiffness, args.knife, args.pixels)
    return PolicyEvaluation(
        who.policy,
        who.name,
        foods,
        args.suite or list(SUITES),
        args.episodes,
        seed=args.seed,
        sigma=args.sigma,
        severing=args.severing,
        knife=args.knife,
        arm=PANDA_ARM if args.arm_stiffness is None else Arm(args.arm_stiffness),
        world=world,
        trained=who.trained,
    )


def pool_of(args: argparse.Namespace) -> AbstractContextManager[Workers | None]:
    """Worker processes where the world needs them.

    Raises:
        CutcalError: The robot simulator is not installed.
    """
    from intsim.data.generate import require_simulator

    if args.world == "table":
        return nullcontext()
    require_simulator()
    args.arch = "cpu"
    return workers_of(args, say)
