"""``cutcal evaluate --paper``: a figure of the paper beside ours, from episodes that are run or that are there."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from calib.io.typed_document import to_document
from cutcal.commands.dataset.evaluation_options import asked_foods, evaluation_of, foods_of, policies_of, pool_of
from cutcal.options import print_json, say
from mpm.scene.errors import CutcalError

if TYPE_CHECKING:
    from intsim.evaluate import PolicyEvaluation


def run_paper(args: argparse.Namespace) -> int:
    """Run the figure's episodes, or read those of --from, and print both rates."""
    from intsim.paper.printing import text
    from intsim.paper.runs import read_runs
    from intsim.paper.tables import compare

    out = Path(args.out or f"cutcal-{args.paper}-{args.policy}")
    folders = [Path(folder) for folder in args.folders or ()] or _run(args, out)
    found = compare(args.paper, read_runs(folders))
    if args.json:
        print_json(to_document(found))
        return 0
    print(text(found))
    if not args.folders:
        print(f"  wrote {out}")
    return 0


def _run(args: argparse.Namespace, out: Path) -> list[Path]:
    """Run all evaluations of the figure; returns their folders."""
    from intsim.evaluate import evaluate

    parts = _parts(args)
    command = ["cutcal", *sys.argv[1:]]
    folders = []
    with pool_of(args) as pool:
        for part, evaluation in parts:
            folder = out / part
            if part:
                say(f"{evaluation.name}, {part}")
            evaluate(evaluation, folder, pool=pool, resume=args.resume, say=say, command=command)
            folders.append(folder)
    return folders


def _parts(args: argparse.Namespace) -> list[tuple[str, PolicyEvaluation]]:
    """The evaluations of the figure, and the folder of each within --out.

    Raises:
        CutcalError: What the policies have learnt is not what the figure asks for.
    """
    from intsim.paper.designs import figure_evaluations, figure_foods

    if args.paper == "fig6" and args.policy == "remote" and not args.without:
        raise CutcalError("--paper fig6: say which food the server's policy has not learnt from: --without FOOD")
    policies, out = policies_of(args), []
    for who in policies:
        asked, needed = figure_foods(args.paper, asked_foods(args), who.trained)
        base = evaluation_of(args, who, foods_of(args, needed))
        for world, evaluation in figure_evaluations(args.paper, base, asked):
            names = [who.part] if len(policies) > 1 else []
            out.append(("-".join([*names, *filter(None, [world])]), evaluation))
    return out
