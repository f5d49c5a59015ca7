"""``cutcal evaluate``: a policy's cuts, judged geometrically and in the solver."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from calib.material.food import FoodSpec, load_food, load_material_file
from cutcal.options import KNIFE_HELP, Group, add_workers, number, print_json, say, whole, workers_of
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from intsim.evaluate import PolicyEvaluation
    from intsim.outcomes import EvaluationResult, SuccessRate, SuiteResult
    from intsim.task.rollout import Policy

HELP = "evaluate a policy that cuts what it is told, geometrically and in the solver"
DESCRIPTION = """Rolls a policy out in suites of tasks in words, and counts its successes: the
four published criteria, stricter ones, and whether the food is in pieces: on a
plain table, with the motion simulated afterwards (--severing), or in closed
loop with the food (--world intsim). Writes evaluate.json, evaluate.jsonl."""
EPILOG = """example:
  cutcal evaluate --policy shallow --suite seeds --episodes 20 --severing

The built-in policies are oracles that test the evaluation; a policy of your
own is any object with reset(seed) and act(obs, instruction), from Python:
intsim.evaluate.evaluate. Exit codes: 0 done, 1 error."""
WORLDS = ("table", "intsim", "kinematic")


def add_args(p: Group) -> None:
    """Options of the command."""
    p.add_argument(
        "--policy", default="oracle", metavar="NAME", help="oracle (default), noisy, wrong-side, ... ('list': all)"
    )
    p.add_argument(
        "--suite", action="append", metavar="NAME", help="a suite, or several times this (default: all; 'list')"
    )
    p.add_argument(
        "--food", action="append", metavar="NAME", help="ask for this food alone, or several (default: the 15)"
    )
    p.add_argument(
        "--material", action="append", default=[], metavar="YAML", help="a calibrated food: a material.yaml, or several"
    )
    p.add_argument("--episodes", type=whole(1), default=20, metavar="N", help="of each suite (default 20)")
    p.add_argument("--sigma", type=number(0, 1, "m"), metavar="M", help="error of the noisy oracle along the food [m]")
    p.add_argument("--severing", action="store_true", help="simulate each single cut too")
    p.add_argument(
        "--arm-stiffness", type=number(1, 1e9, "N/m"), metavar="N/M", help="of the arm in the solver (default 1754)"
    )
    p.add_argument("--server", metavar="URL", help="of --policy remote: a policy server (intsim.policy.remote)")
    p.add_argument("--weights", metavar="FILE", help="of --policy clone: what cutcal dataset clone has written")
    p.add_argument(
        "--world", choices=WORLDS, default="table", metavar="NAME", help="table, intsim, or kinematic (no resistance)"
    )
    p.add_argument(
        "--stiffness",
        type=number(1, 1e6, "N m/rad"),
        metavar="K",
        help="of intsim's joints [N m/rad] (default: Franka)",
    )
    p.add_argument("--pixels", type=whole(0), default=0, metavar="N", help="of intsim's pictures (default 0: none)")
    add_workers(p, "episodes of intsim")
    p.add_argument("--knife", default="kitchen", metavar="NAME", help=KNIFE_HELP)
    p.add_argument("--seed", type=whole(0), default=0, metavar="N", help="first seed of the tests (default 0)")
    p.add_argument("--out", metavar="DIR", help="folder of the results; never overwritten")
    p.add_argument("--resume", action="store_true", help="go on with the evaluation in --out")
    p.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")


def run(args: argparse.Namespace) -> int:
    """Evaluate and write."""
    from intsim.data.generate import require_simulator
    from intsim.evaluate import evaluate

    if args.policy == "list" or args.suite == ["list"]:
        _list()
        return 0
    _check(args)
    evaluation = _evaluation(args)
    out = Path(args.out or f"cutcal-evaluate-{args.policy}")
    if evaluation.world is not None:
        require_simulator()
    args.arch = "cpu"
    with nullcontext() if evaluation.world is None else workers_of(args, say) as pool:
        command = ["cutcal", *sys.argv[1:]]
        result = evaluate(evaluation, out, pool=pool, resume=args.resume, say=say, command=command)
    if args.json:
        print_json(to_document(result))
    else:
        print(table(result))
        print(f"  wrote {out}")
    return 0


def _list() -> None:
    """Policies and suites, with what they are."""
    from intsim.policy.oracles import POLICIES
    from intsim.task.suites import SUITES

    for name, (_, what) in POLICIES.items():
        print(f"policy {name:12s}{what}")
    print(f"policy {'clone':12s}does what it has learnt from demonstrations (--weights)")
    print(f"policy {'remote':12s}is asked of a server, such as those of RDT, Octo and OpenVLA (--server)")
    for name, suite in SUITES.items():
        print(f"suite  {name:12s}{suite.what}")


def _check(args: argparse.Namespace) -> None:
    """Refuse options that do not go together.

    Raises:
        CutcalError: They do not.
    """
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
    if args.world == "table" and args.pixels:
        raise CutcalError("--pixels are of a robot's cameras: add --world intsim")


def _evaluation(args: argparse.Namespace) -> PolicyEvaluation:
    """What the options ask for."""
    from intsim.evaluate import PolicyEvaluation
    from intsim.sim.severing import PANDA_ARM
    from intsim.sim.world import World
    from intsim.task.suites import SUITES
    from mpm.scene import Arm

    policy, name = _policy(args)
    world = None if args.world == "table" else World(args.world == "intsim", args.stiffness, args.knife, args.pixels)
    return PolicyEvaluation(
        policy,
        name,
        _foods(args),
        args.suite or list(SUITES),
        args.episodes,
        seed=args.seed,
        sigma=args.sigma,
        severing=args.severing,
        knife=args.knife,
        arm=PANDA_ARM if args.arm_stiffness is None else Arm(args.arm_stiffness),
        world=world,
    )


def _policy(args: argparse.Namespace) -> tuple[Policy, str]:
    """Who moves the knife, and what the results call it."""
    from intsim.policy.behaviour_cloning import Clone
    from intsim.policy.oracles import make_policy
    from intsim.policy.remote import Remote

    if args.policy == "clone":
        clone = Clone.load(Path(args.weights))
        about = clone.about
        return clone, f"clone of {about['trajectories']} trajectories of {about['dataset']} ({about['keep']})"
    if args.policy == "remote":
        server = Remote(args.server)
        return server, f"remote {server.name}"
    return make_policy(args.policy, args.sigma or 0.0), args.policy


def _foods(args: argparse.Namespace) -> dict[str, FoodSpec]:
    """The foods that are asked for, by name."""
    from intsim.task.suites import FOODS

    calibrated = {food.name: food for food in map(load_material_file, args.material)}
    names = args.food or (list(calibrated) if args.material else FOODS)
    return {name: calibrated.get(name) or load_food(name) for name in names}


def table(result: EvaluationResult) -> str:
    """What the terminal shows at the end."""
    trials = ", ".join(f"{name} {found.published.trials}" for name, found in result.suites.items())
    lines = [f"{result.settings.policy}: successes of {trials}"]
    lines.append(f"  {'':14s}{'published':>22s}{'strict':>22s}{'severed':>22s}")
    for name, found in result.suites.items():
        cells = [found.published, found.strict, found.severing]
        lines.append(f"  {name:14s}" + "".join(f"{_cell(c):>22s}" for c in cells))
        failed = [f"{key} {_cell(c)}" for key, c in found.criteria.items() if c.successes < c.trials]
        if failed:
            lines.append("      fails: " + ", ".join(failed))
        lines += _splits(found)
        if found.expected_place is not None:
            lines.append(f"      place expected of its error: {found.expected_place:.0%}")
        if found.not_simulated:
            lines.append(f"      {found.not_simulated} cuts were not simulated and count as whole: see evaluate.jsonl")
    return "\n".join(lines)


def _splits(found: SuiteResult) -> list[str]:
    """How the cuts of splits went, a line for each number of pieces, and how even the pieces are."""
    by_pieces: dict[str, list[str]] = {}
    for name, rate in (found.steps or {}).items():
        by_pieces.setdefault(name.partition(",")[0], []).append(f"{rate.rate:.0%}")
    lines = [f"      {pieces}: cuts in their place {', '.join(rates)}" for pieces, rates in by_pieces.items()]
    if found.volume_variation is not None:
        lines.append(f"      volumes of the pieces: standard deviation {found.volume_variation:.1%} of their mean")
    return lines


def _cell(found: SuccessRate | None) -> str:
    if found is None:
        return "not simulated"
    return f"{found.rate:.0%} ({found.low95:.0%} to {found.high95:.0%})"
