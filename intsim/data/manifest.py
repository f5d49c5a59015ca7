"""Which episodes a dataset has: each is drawn from its number alone, and nothing is made until it is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from calib.material.food import FoodSpec, load_food
from intsim.render.background import BACKGROUNDS
from intsim.task.language import SENTENCES_PER_TASK
from intsim.task.planner import STYLES
from intsim.task.suites import FIRST_TEST_SEED, FOODS, SUITES, Episode, sample_episode
from intsim.task.targets import TaskError

PUBLISHED_TRAJECTORIES = 21_000
"""Trajectories of the published data set."""
PROPERTY_SCATTER = {"E": 0.2, "R": 0.1, "yield_stress": 0.1, "mu": 0.2}
"""Standard deviation of the logarithm of properties that differ from item to item [-].

Assumed: a third of what gripped fruit scatters in stiffness, and less for strength.
"""
TRAINING_SUITES = ("seeds", "continuous", "split", "flips", "objects")
"""Suites that training may see, in turn.

The sentences of ``language`` and every seed from a million on are for tests.
"""
PRESS_SHARE = 0.5  # part of the episodes that press; the other styles share the rest


@dataclass(frozen=True)
class TrajectorySpec:
    """One trajectory of a manifest.

    Attributes:
        index: Its number.
        suite: Kind of task.
        seed: Of the episode.
        style: Of the motion, in :data:`intsim.task.planner.STYLES`.
        episode: What is on the table and what is asked for.
        food: The food, with its own values.
        values: Those of its properties that were drawn, by name.
    """

    index: int
    suite: str
    seed: int
    style: str
    episode: Episode
    food: FoodSpec
    values: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Sample:
    """One element of the whole product. Attributes: trajectory, background, instruction, each a number."""

    trajectory: int
    background: int
    instruction: int


@dataclass(frozen=True)
class Manifest:
    """The product of trajectories, backgrounds and sentences, counted and never stored.

    That of the published data set is 21,000 x 15 x 5, 1,575,000 samples.

    Attributes:
        trajectories, backgrounds, instructions: How many of each.
        foods: Foods by name, asked for in turn.
        suites: Kinds of task, in turn.
        styles: Styles of the motion; half of the episodes press where that is one of several.
        seed: First seed; those of a dataset are ``seed`` to ``seed + trajectories``.

    Raises:
        TaskError: Nothing to draw from, or seeds that belong to the tests.
    """

    KEYS: ClassVar[tuple[str, ...]] = (
        "trajectories", "backgrounds", "instructions", "seed", "foods", "suites", "styles",
    )  # fmt: skip

    trajectories: int = PUBLISHED_TRAJECTORIES
    backgrounds: int = BACKGROUNDS
    instructions: int = SENTENCES_PER_TASK
    foods: Sequence[str] = FOODS
    suites: Sequence[str] = TRAINING_SUITES
    seed: int = 0
    styles: Sequence[str] = STYLES

    def __post_init__(self) -> None:
        for name in ("foods", "suites", "styles"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        lists = (self.foods, self.suites, self.styles)
        if min(self.trajectories, self.backgrounds, self.instructions, *map(len, lists)) < 1:
            raise TaskError(
                "dataset: no trajectories, backgrounds, sentences, foods, tasks or styles; give one of each at least"
            )
        for what, given, known in (("task", self.suites, SUITES), ("style", self.styles, STYLES)):
            for name in given:
                if name not in known:
                    raise TaskError(f"dataset: {name!r} is none of {', '.join(known)} (option --{what})")
        end = self.seed + self.trajectories
        if self.seed < 0 or end > FIRST_TEST_SEED:
            raise TaskError(f"dataset: seeds {self.seed} to {end}; those from {FIRST_TEST_SEED} on are for tests")

    def __len__(self) -> int:
        return self.trajectories * self.backgrounds * self.instructions

    def __getitem__(self, k: int) -> Sample:
        if not 0 <= k < len(self):
            raise IndexError(k)
        rest, sentence = divmod(k, self.instructions)
        return Sample(*divmod(rest, self.backgrounds), sentence)

    def __iter__(self) -> Iterator[Sample]:
        return (self[k] for k in range(len(self)))

    def trajectory(self, index: int) -> TrajectorySpec:
        """A trajectory: food and task in turn, all else from its seed."""
        seed = self.seed + index
        turn, place = divmod(index, len(self.foods))
        name = self.foods[place]
        suite = self.suites[(place + turn) % len(self.suites)]  # of each food every task comes, whatever their numbers
        food = load_food(name)
        rng = np.random.default_rng([seed, *b"dataset"])
        values = {}
        for prop, sd in PROPERTY_SCATTER.items():
            if prop in food.properties:
                found = food.properties[prop]
                values[prop] = float(np.clip(found.value * np.exp(sd * rng.standard_normal()), found.low, found.high))
        others = [style for style in self.styles if style != STYLES[0]]
        pressed = STYLES[0] in self.styles and rng.random() < PRESS_SHARE
        style = STYLES[0] if pressed or not others else others[int(rng.integers(len(others)))]
        episode = sample_episode(suite, seed, {name: food})
        own = food.with_values(values, source="drawn for a dataset")
        return TrajectorySpec(index, suite, seed, style, episode, own, values)
