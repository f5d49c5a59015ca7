"""``cutcal evaluate``: a policy's cuts, judged geometrically and in the solver."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from cutcal.commands.dataset.evaluation_options import (
    asked_foods,
    check_options,
    evaluation_of,
    foods_of,
    policies_of,
    pool_of,
)
from cutcal.commands.dataset.paper_figure import run_paper
from cutcal.options import KNIFE_HELP, Group, add_workers, number, print_json, say, whole

if TYPE_CHECKING:
    from intsim.outcomes import EvaluationResult, SuccessRate, SuiteResult

HELP = "evaluate a policy that cuts what it is told, geometrically and in the solver"
DESCRIPTION = """Rolls a policy out in suites of tasks in words, and counts its successes: the
four published criteria, stricter ones, and whether the food is in pieces: on a
plain table, with the motion simulated afterwards (--severing), or in closed
loop with the food (--world intsim). Writes evaluate.json, evaluate.jsonl.
--paper asks for the tasks of a figure of the CulinaryCut paper, and prints our
rates beside those that the paper prints."""
EPILOG = """examples:
  cutcal evaluate --policy shallow --suite seeds --episodes 20 --severing
  cutcal evaluate --policy oracle --paper table3 --out runs/table3

The built-in policies are oracles that test the evaluation; a policy of your
own is any object with reset(seed) and act(obs, instruction), from Python:
intsim.evaluate.evaluate. Exit codes: 0 done, 1 error."""
WORLDS = ("table", "intsim", "kinematic")
FIGURES = ("fig4", "fig5", "fig6", "fig7", "fig8", "table3", "table4")
DEMOS = ("kinematic", "sustained")


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
    p.add_argument("--episodes", type=whole(1), default=20, metavar="N", help="of each suite or task (default 20)")
    p.add_argument("--sigma", type=number(0, 1, "m"), metavar="M", help="error of the noisy oracle along the food [m]")
    p.add_argument("--severing", action="store_true", help="simulate each single cut too")
    p.add_argument(
        "--arm-stiffness", type=number(1, 1e9, "N/m"), metavar="N/M", help="of the arm in the solver (default 1754)"
    )
    p.add_argument("--server", metavar="URL", help="of --policy remote; ws://HOST:PORT is openpi's")
    p.add_argument("--send", action="append", metavar="LAYOUT", help="to openpi: libero (default), droid, or KEY=WHAT")
    p.add_argument("--replan", type=whole(1), metavar="N", help="of openpi: actions of an answer to use (default: all)")
    p.add_argument("--weights", action="append", metavar="FILE", help="of --policy clone (cutcal dataset clone)")
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
    p.add_argument("--paper", choices=FIGURES, metavar="FIGURE", help=", ".join(FIGURES))
    p.add_argument("--from", dest="folders", nargs="+", metavar="DIR", help="of --paper: run nothing, count these runs")
    p.add_argument("--demos", choices=DEMOS, metavar="KIND", help="a server learnt from: kinematic, sustained")
    p.add_argument("--ratio", type=number(0, 1, "-"), metavar="R", help="a server learnt from cuts of this part alone")
    p.add_argument("--side", metavar="NAME", help="a server learnt from this side alone")
    p.add_argument("--without", action="append", metavar="FOOD", help="a server learnt without this food, or several")
    p.add_argument("--out", metavar="DIR", help="folder of the results; never overwritten")
    p.add_argument("--resume", action="store_true", help="go on with the evaluation in --out")
    p.add_argument("--json", action="store_true", help="print one JSON document on stdout and nothing else")


def run(args: argparse.Namespace) -> int:
    """Evaluate and write."""
    from intsim.evaluate import evaluate
    from intsim.task.suites import FOODS

    if args.policy == "list" or args.suite == ["list"]:
        _list()
        return 0
    check_options(args)
    if args.paper is not None:
        return run_paper(args)
    evaluation = evaluation_of(args, policies_of(args)[0], foods_of(args, asked_foods(args) or FOODS))
    out = Path(args.out or f"cutcal-evaluate-{args.policy}")
    with pool_of(args) as pool:
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
    print(f"policy {'remote':12s}is asked of a server, such as those of RDT, Octo, OpenVLA and pi0 (--server)")
    for name, suite in SUITES.items():
        print(f"suite  {name:12s}{suite.what}")


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
