"""The tasks of each figure of the paper, and the evaluations that they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from intsim.evaluate import PolicyEvaluation
from intsim.sim.world import World
from intsim.task.selection import TrainingTasks, same_ratio
from intsim.task.suites import FOODS, FixedTask
from intsim.task.targets import TaskError

RATIOS = tuple(k / 10 for k in range(1, 10))
"""Parts that Fig. 7 asks for [-]."""
SPLITS = (3, 4, 5)
"""Equal pieces that Table 3 asks for."""
FIGURE_FOODS = {
    "fig7": ("banana", "cucumber"),
    "table3": ("banana", "cucumber"),
    "table4": ("orange",),
    "fig8": ("banana",),
}
"""Foods of the figures that do not ask for all fifteen."""


@dataclass(frozen=True)
class TransferCut:
    """A cut of Fig. 8.

    Attributes:
        ratio: Part that is cut off.
        side: From where it is measured.
    """

    ratio: Fraction
    side: str

    def words(self) -> str:
        """The cut in words."""
        place = "in the middle" if self.side == "centre" else f"from the {self.side}"
        return f"{float(self.ratio):g} {place}"

    def is_asked_by(self, ratio: float, side: str) -> bool:
        """Whether a task asks for this cut."""
        return same_ratio(float(self.ratio), ratio) and side == self.side


_QUARTER = TransferCut(Fraction(1, 4), "right")
TRANSFERS = (
    (_QUARTER, TransferCut(Fraction(1, 4), "left")),
    (TransferCut(Fraction(3, 4), "right"), _QUARTER),
    (TransferCut(Fraction(1, 2), "centre"), _QUARTER),
)
"""Pairs of Fig. 8: what is trained on, and its counterpart."""


def transfers_of(trained: TrainingTasks | None) -> tuple[tuple[TransferCut, TransferCut], ...]:
    """The pairs of Fig. 8 that a policy is one of: all of them where it has not learnt, or from several ratios.

    Raises:
        TaskError: It has learnt from a cut that is none of the figure's.
    """
    if trained is None or trained.ratio is None:
        return TRANSFERS
    own = tuple(
        (cut, other)
        for cut, other in TRANSFERS
        if same_ratio(float(cut.ratio), trained.ratio) and trained.side in (None, cut.side)
    )
    if not own:
        known = "; ".join(f"--ratio {float(cut.ratio):g} --side {cut.side}" for cut, _ in TRANSFERS)
        side = "" if trained.side is None else f", {trained.side}"
        raise TaskError(f"--paper fig8: the policy has learnt from {trained.ratio:g}{side}; Fig. 8 has {known}")
    return own


def figure_tasks(figure: str, foods: Sequence[str], trained: TrainingTasks | None) -> list[tuple[str, FixedTask]]:
    """Suite and task of every cell of a figure.

    Args:
        figure: Name in :data:`intsim.paper.published.PUBLISHED`.
        foods: Foods that are asked for.
        trained: What the policy has learnt from; None where it has not learnt.

    Returns:
        The tasks, in the order of the rows.

    Raises:
        TaskError: The policy's training is none that the figure asks for.
    """
    if figure == "fig5":
        return [(suite, FixedTask(food)) for suite in ("seeds", "objects") for food in foods]
    if figure == "fig6":
        seen, unseen = held_out(foods, trained)
        return [("seeds", FixedTask(food)) for food in seen] + [("language", FixedTask(food)) for food in unseen]
    if figure == "fig7":
        return [("continuous", FixedTask(food, ratio)) for food in foods for ratio in RATIOS]
    if figure == "table3":
        return [("split", FixedTask(food, pieces=pieces)) for food in foods for pieces in SPLITS]
    if figure == "fig8":
        cuts = dict.fromkeys(cut for pair in transfers_of(trained) for cut in pair)
        return [("seeds", FixedTask(food, cut.ratio, cut.side)) for food in foods for cut in cuts]
    return [("seeds", FixedTask(food)) for food in foods]


def held_out(foods: Sequence[str], trained: TrainingTasks | None) -> tuple[list[str], list[str]]:
    """Foods that a policy has seen in training, and those that it has not.

    A policy that has not learnt has seen none more than another: all foods are on either side.

    Args:
        foods: Foods that are asked for.
        trained: What it has learnt from; None where it has not learnt.

    Returns:
        Names of both.

    Raises:
        TaskError: It has learnt, and no food was left out, or none of these was in.
    """
    if trained is None:
        return list(foods), list(foods)
    learnt = set(foods if trained.foods is None else trained.foods) - set(trained.without)
    seen = [food for food in foods if food in learnt]
    unseen = list(trained.without) or [food for food in foods if food not in learnt]
    if not unseen:
        raise TaskError(
            "--paper fig6: the policy's training left no food out; train one with cutcal dataset clone --without FOOD"
        )
    if not seen:
        raise TaskError(f"--paper fig6: the policy has learnt from none of {', '.join(foods)}; name more with --food")
    return seen, unseen


def figure_foods(
    figure: str, asked: Sequence[str] | None, trained: TrainingTasks | None
) -> tuple[list[str], list[str]]:
    """Foods of a figure.

    Args:
        figure: Name of the figure.
        asked: Those that the user names; None for those of the figure.
        trained: What the policy has learnt from; None where it has not learnt.

    Returns:
        Those that are asked for, and all that the evaluation needs: those that training left out too.
    """
    foods = list(asked or FIGURE_FOODS.get(figure, FOODS))
    more = trained.without if figure == "fig6" and trained is not None else ()
    return foods, list(dict.fromkeys([*foods, *more]))


def figure_evaluations(figure: str, base: PolicyEvaluation, foods: Sequence[str]) -> list[tuple[str, PolicyEvaluation]]:
    """The evaluations that a figure takes, of one policy.

    Table 4 judges the same tasks without and with the food: with a robot in two worlds, on the plain table by one
    motion, which is then simulated. The other figures take one evaluation.

    Args:
        figure: Name of the figure.
        base: Policy, foods and world.
        foods: Foods that are asked for, among those of ``base``.

    Returns:
        Each with the name of its part; an empty name where it is the only one.

    Raises:
        TaskError: The policy's training or the world is none that the figure asks for.
    """
    tasks = figure_tasks(figure, foods, base.trained)
    own = replace(base, paper=figure, tasks=tasks, suites=list(dict.fromkeys(suite for suite, _ in tasks)))
    if figure != "table4":
        return [("", own)]
    if base.world is None:
        return [("", replace(own, severing=True))]
    if not base.world.coupled:
        raise TaskError("--paper table4: judges with and without the food; give --world intsim, or none for the table")
    without: World = replace(base.world, coupled=False)
    return [("kinematic", replace(own, world=without)), ("intsim", own)]
