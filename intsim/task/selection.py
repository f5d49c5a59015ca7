"""Which tasks a policy learns from, and which it learnt from: one ratio, one side, a food left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from intsim.task.suites import FOODS
from intsim.task.targets import SIDES, TaskError

SAME_RATIO = 0.005
"""Difference within which two ratios are the same [-]: a sentence says two digits."""


@dataclass(frozen=True)
class TaskFilter:
    """Which trajectories of a dataset are learnt from.

    Attributes:
        ratio: Those that ask for this part alone; None for all.
        side: Those that measure from here alone: left, right or centre; None for all.
        without: Foods that are left out: neither asked for nor lying beside.

    Raises:
        TaskError: A ratio, side or food that cannot be.
    """

    ratio: float | None = None
    side: str | None = None
    without: Sequence[str] = ()

    def __post_init__(self) -> None:
        if self.ratio is not None and not 0 < self.ratio < 1:
            raise TaskError(f"--ratio {self.ratio:g}: give a part between 0 and 1")
        if self.side is not None and self.side not in SIDES:
            raise TaskError(f"--side {self.side}: none of {', '.join(SIDES)}")
        unknown = [name for name in self.without if name not in FOODS]
        if unknown:
            raise TaskError(f"--without {unknown[0]}: not one of {', '.join(FOODS)}")

    def keeps(self, entry: Mapping[str, Any]) -> bool:
        """Whether a trajectory is learnt from.

        Equal pieces have no ratio and no side, so that either filter leaves them out.

        Args:
            entry: What the JSON file of its shard says of it.
        """
        task = entry["task"]
        if (self.ratio is not None or self.side is not None) and task["pieces"]:
            return False
        if self.ratio is not None and not same_ratio(task["ratio"], self.ratio):
            return False
        if self.side is not None and task["side"] != self.side:
            return False
        return not self.without or not {item["name"] for item in entry["items"]} & set(self.without)

    def words(self) -> str:
        """The filter in words; empty where everything is kept."""
        said = [] if self.ratio is None else [f"ratio {self.ratio:g}"]
        said += [] if self.side is None else [f"side {self.side}"]
        said += [f"without {name}" for name in self.without]
        return ", ".join(said)


EVERY_TASK = TaskFilter()
"""A filter that leaves nothing out."""


@dataclass(frozen=True)
class TrainingTasks:
    """What a policy has learnt from.

    Attributes:
        demos: Kind of demonstration, such as ``kinematic``; None where it is not known.
        ratio: The one part that was asked for; None for several.
        side: The one side that it was measured from; None for several.
        without: Foods that were left out.
        foods: Foods that were asked for; None where it is not known.
    """

    demos: str | None
    ratio: float | None
    side: str | None
    without: Sequence[str]
    foods: Sequence[str] | None


def same_ratio(one: float, other: float) -> bool:
    """Whether two parts of a food are the same, to what a sentence says."""
    return abs(one - other) < SAME_RATIO
