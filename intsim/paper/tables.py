"""Rows of each figure of the paper: our rates beside the printed ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from intsim.outcomes import EpisodeOutcome, SuccessRate
from intsim.paper.designs import FIGURE_FOODS, RATIOS, SPLITS, held_out, transfers_of
from intsim.paper.published import (
    ALL_FOODS,
    GEOMETRY,
    ONE_FOOD,
    PUBLISHED,
    REAL_ROBOT,
    SEEN_FOOD,
    SEVERAL_FOODS,
    UNSEEN_FOOD,
    WITH_FOOD,
    split_row,
    training_row,
    transfer_row,
)
from intsim.paper.runs import MET, MET_AND_SEVERED, PaperRun, rates
from intsim.paper.wording import policy_differs, policy_words, training_differs, world_differs, world_words
from intsim.task.selection import TrainingTasks
from intsim.task.success import PLACE_TOLERANCE
from intsim.task.suites import FOODS
from mpm.scene.errors import CutcalError

TRAINED_IN = {"kinematic": "ManiSkill", "planned": "ManiSkill", "sustained": "IntSim"}
"""Where the paper's RDT of Table 4 was trained, by our kind of demonstration."""
IN_PLACE = "in its place"  # column of Table 3
WITHOUT_RESISTANCE, RESISTING = "food that does not resist", "food that resists"


@dataclass(frozen=True)
class PaperRow:
    """A row of a figure.

    Attributes:
        label: What was asked for, or how it was judged.
        ours: Our rates by column; empty where we have no episode of it.
        paper: Rates that the paper prints, by model [-]; empty where it has no such row, None where it has one
            without a number.
    """

    label: str
    ours: Mapping[str, SuccessRate]
    paper: Mapping[str, float] | None


@dataclass(frozen=True)
class PaperTable:
    """A figure of the paper with the rates of one policy in one world.

    Attributes:
        policy: Who moved the knife.
        world: Where.
        foods: Foods that were asked for.
        rows: The rows.
        differs: What differs from the paper's experiment, in sentences.
    """

    policy: str
    world: str
    foods: Sequence[str]
    rows: Sequence[PaperRow]
    differs: Sequence[str]


@dataclass(frozen=True)
class PaperComparison:
    """A figure of the paper beside ours.

    Attributes:
        figure: Its name, such as ``fig4``.
        title: What it shows.
        source: Where the printed numbers stand in the paper.
        words: What the paper says in words where it prints no number; empty where all are printed.
        tables: A table for each policy and world.
    """

    DOCUMENT: ClassVar[str] = "paper"

    figure: str
    title: str
    source: str
    words: str
    tables: Sequence[PaperTable]


def compare(figure: str, runs: Sequence[PaperRun]) -> PaperComparison:
    """A figure of the paper, with the rates of the evaluations that there are.

    Args:
        figure: Name in :data:`intsim.paper.published.PUBLISHED`.
        runs: Evaluations; episodes that the figure does not ask for are not looked at.

    Returns:
        Our rates beside the printed ones.

    Raises:
        CutcalError: No evaluation has an episode of the figure.
    """
    groups: dict[str, list[PaperRun]] = {}
    for run in runs:
        groups.setdefault(_group(figure, run), []).append(run)
    tables = [_table(figure, group) for group in groups.values()]
    kept = [table for table in tables if any(row.ours for row in table.rows)]
    if not kept:
        raise CutcalError(
            f"--paper {figure}: none of the evaluations has an episode of it; name folders of --paper {figure}, or run "
            "it without --from"
        )
    about = PUBLISHED[figure]
    return PaperComparison(figure, about.title, about.source, about.words, kept)


def _group(figure: str, run: PaperRun) -> str:
    """Runs of one group make one table."""
    settings = replace(run.settings, paper=None, seed=0, foods={})
    if figure == "table4":
        stiffness = None if settings.world is None else settings.world.stiffness
        return repr((settings.policy, settings.arm, stiffness, settings.knife, settings.world is None))
    if figure in ("fig6", "fig8") and settings.trained is not None:
        trained = replace(settings.trained, without=(), ratio=None, side=None, foods=None)
        filtered = settings.trained.ratio is not None
        settings = replace(settings, policy="" if figure == "fig6" or filtered else settings.policy, trained=trained)
    return repr(settings)


def _table(figure: str, runs: Sequence[PaperRun]) -> PaperTable:
    """The table of one group."""
    policies = list(dict.fromkeys(policy_words(run.settings) for run in runs))
    first = runs[0].settings
    differs = [policy_differs(first, PUBLISHED[figure].models)]
    differs += [*filter(None, [training_differs(first, figure)]), world_differs(first)]
    return PaperTable(
        "; ".join(policies),
        ", and ".join(dict.fromkeys(world_words(run.settings) for run in runs)),
        _foods(runs),
        ROWS[figure](runs),
        (*differs, *PUBLISHED[figure].differs),
    )


def _foods(runs: Sequence[PaperRun]) -> list[str]:
    """Foods that were asked for, the paper's first and in its order."""
    asked = dict.fromkeys(row.food for run in runs for row in run.rows)
    return [*(food for food in FOODS if food in asked), *(food for food in asked if food not in FOODS)]


def _own_foods(figure: str, run: PaperRun) -> Sequence[str] | None:
    """Foods of the figure that count: all where they were asked for as its tasks, else those of the figure."""
    return None if run.settings.paper == figure else FIGURE_FOODS[figure]


def _chosen(runs: Sequence[PaperRun], suite: str, foods: Sequence[str] | None = None) -> list[EpisodeOutcome]:
    return [row for run in runs for row in run.chosen(suite=suite, foods=foods)]


def _by_food(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Fig. 4."""
    rows = [PaperRow(food, rates(_chosen(runs, "seeds", [food])), None) for food in _foods(runs)]
    return [*rows, PaperRow(ALL_FOODS, rates(_chosen(runs, "seeds")), PUBLISHED["fig4"].rates[ALL_FOODS])]


def _beside_others(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Fig. 5."""
    printed = PUBLISHED["fig5"].rates
    rows = ((ONE_FOOD, "seeds"), (SEVERAL_FOODS, "objects"))
    return [PaperRow(label, rates(_chosen(runs, suite)), printed[label]) for label, suite in rows]


def _unseen(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Fig. 6."""
    printed, seen, unseen = PUBLISHED["fig6"].rates, [], []
    for run in runs:
        known, new = held_out(_foods([run]), run.settings.trained)
        seen += run.chosen(suite="seeds", foods=known)
        unseen += run.chosen(suite="language", foods=new)
    return [
        PaperRow(SEEN_FOOD, rates(seen), printed[SEEN_FOOD]),
        PaperRow(UNSEEN_FOOD, rates(unseen), printed[UNSEEN_FOOD]),
    ]


def _by_ratio(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Fig. 7."""
    foods = _foods(runs)

    def row(label: str, ratio: float | None) -> PaperRow:
        ours: dict[str, SuccessRate] = {}
        for food in foods:
            found = _chosen(runs, "continuous", [food])
            asked = [one for one in found if any(one.ratio == r for r in RATIOS) and ratio in (None, one.ratio)]
            ours |= {_column(food, name): rate for name, rate in rates(asked).items()}
        return PaperRow(label, ours, None)

    return [*(row(f"{ratio:g}", ratio) for ratio in RATIOS), row("all", None)]


def _column(food: str, name: str) -> str:
    return food if name == MET else f"{food}, in pieces"


def _by_cut(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Table 3."""
    printed, out = PUBLISHED["table3"].rates, []
    for food in _foods(runs):
        for pieces in SPLITS:
            asked = [row.offsets for run in runs for row in run.chosen(suite="split", foods=[food], pieces=pieces)]
            for k in range(pieces - 1 if asked else 0):
                label = split_row(food, pieces, k + 1)
                hit = [len(offsets) > k and abs(offsets[k]) <= PLACE_TOLERANCE for offsets in asked]
                out.append(PaperRow(label, {IN_PLACE: SuccessRate.of(hit)}, printed.get(label, {})))
    return out


def _by_judge(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Table 4."""
    trained = runs[0].settings.trained
    geometry, parted = [], []
    for run in runs:
        world, found = run.settings.world, run.chosen(suite="seeds", foods=_own_foods("table4", run))
        if world is None or not world.coupled:
            geometry += found
        if (world is None and run.settings.severing) or (world is not None and world.coupled):
            parted += found
    met, both = rates(geometry).get(MET), rates(parted)
    return [
        PaperRow(WITHOUT_RESISTANCE, {} if met is None else {MET: met}, _printed(trained, GEOMETRY)),
        PaperRow(
            RESISTING,
            both if runs[0].settings.world is not None else {k: v for k, v in both.items() if k == MET_AND_SEVERED},
            _printed(trained, WITH_FOOD),
        ),
        PaperRow("a real robot, 10 cuts (ours has none)", {}, _printed(trained, REAL_ROBOT)),
    ]


def _printed(trained: TrainingTasks | None, judged: str) -> dict[str, float]:
    """RDT of Table 4 that was trained as ours, or both where ours has not learnt."""
    own = None if trained is None or trained.demos is None else TRAINED_IN.get(trained.demos)
    printed = PUBLISHED["table4"].rates
    return {
        f"RDT trained in {demos}": printed[training_row(demos, judged)]["RDT"]
        for demos in ("ManiSkill", "IntSim")
        if own in (None, demos)
    }


def _transfers(runs: Sequence[PaperRun]) -> list[PaperRow]:
    """Fig. 8."""
    printed, out = PUBLISHED["fig8"].rates, []
    asked: dict[str, list[EpisodeOutcome]] = {label: [] for label in printed}
    for run in runs:
        for cut, other in transfers_of(run.settings.trained):
            for task in (cut, other):
                found = run.chosen(suite="seeds", foods=_own_foods("fig8", run))
                found = [r for r in found if task.is_asked_by(r.ratio, r.side)]
                asked[transfer_row(cut.words(), task.words())] += found
    for label, found in asked.items():
        out.append(PaperRow(label, rates(found), printed[label]))
    return out


ROWS: Mapping[str, Callable[[Sequence[PaperRun]], list[PaperRow]]] = {
    "fig4": _by_food,
    "fig5": _beside_others,
    "fig6": _unseen,
    "fig7": _by_ratio,
    "table3": _by_cut,
    "table4": _by_judge,
    "fig8": _transfers,
}
"""What makes the rows of each figure."""
