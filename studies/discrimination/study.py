"""The pairs judged one after the other, each kept as soon as it is, and the table that they end with."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

from calib.io.folder import write_json
from calib.io.provenance import key_of
from calib.simulation.evaluation_store import EvaluationStore, Header
from calib.simulation.workers import Workers
from calib.validation.acceptance import CONFLICT_LINE, CURVE_LINE, EXPLAINED_LINE
from studies.discrimination.judged_pair import Judged, judge_pair
from studies.discrimination.made_up_cut import SENSOR
from studies.discrimination.pair import RIGHT, Pair

LEAST = 18
"""Pairs of twenty, wrong ones refused and right ones passed, that the verdict has to tell."""
BUDGET = 45.0
"""Simulations of a calibration, not quite half of the default: what a search that explains its curve takes."""

HEAD = ("pair", "what is wrong", "verdict", "NRMSE", "explained", "values of the food", "intervals hold", "refused by")
"""Head of the table; *intervals hold*: how many of the 95 % intervals hold what was cut."""


def run(
    pairs: Sequence[Pair], out: Path, pool: Workers, *, budget: float = BUDGET, say: Callable[[str], None]
) -> list[Judged]:
    """Judge pairs; those that a folder knows are not judged again.

    Args:
        pairs: The pairs.
        out: Folder of the results: a JSON document for each pair, its record, and all simulations.
        pool: Where the simulations run.
        budget: Largest number of simulations of a calibration.
        say: Called with a line after each pair.

    Returns:
        What the verdict said of each, in their order.
    """
    out.mkdir(parents=True, exist_ok=True)
    header = Header("", key_of({"study": "discrimination", "sensor": vars(SENSOR)}))
    found = []
    with EvaluationStore(out / "evaluations.h5", header, resume=True, say=say) as store:
        for pair in pairs:
            path = out / f"{pair.name}.json"
            if not path.exists():
                write_json(path, judge_pair(pair, out, store, pool, budget).as_dict())
                pool.renew()
            one = Judged.from_dict(json.loads(path.read_text(encoding="utf-8")))
            say(words(one))
            found.append(one)
    return found


def words(one: Judged) -> str:
    """One pair in a line."""
    said = one.error or ", ".join(one.failed) or "passed"
    return f"{one.name} ({one.kind}): {'refused: ' if one.refused else ''}{said} [{one.seconds:.0f} s]"


def table(found: Sequence[Judged]) -> str:
    """The pairs as a table in Markdown."""
    lines = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    for one in found:
        numbers = [one.numbers.get(name) for name in (CURVE_LINE, EXPLAINED_LINE, CONFLICT_LINE)]
        shown = ["" if x is None else f"{x:.2g}" for x in numbers]
        held = f"{one.held[0]} of {one.held[1]}" if one.held[1] else ""
        by = "input: " + one.error.partition(": ")[2].partition(";")[0] if one.error else ", ".join(one.failed)
        verdict = "refused" if one.refused else "passed"
        lines.append("| " + " | ".join([one.name, one.kind, verdict, *shown, held, by]).rstrip() + " |")
    return "\n".join(lines)


def told(found: Sequence[Judged]) -> tuple[int, int, int, int]:
    """Wrong pairs refused and all wrong ones, right pairs passed and all right ones."""
    wrong = [one for one in found if one.kind != RIGHT]
    right = [one for one in found if one.kind == RIGHT]
    return sum(one.refused for one in wrong), len(wrong), sum(not one.refused for one in right), len(right)


def passed(found: Sequence[Judged]) -> bool:
    """Whether enough of the wrong pairs were refused and enough of the right ones passed."""
    refused, _, kept, _ = told(found)
    return min(refused, kept) >= LEAST
