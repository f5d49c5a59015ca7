"""Episodes of an evaluation: what is on the table, what is asked for, and in which words; all from seeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from calib.material.food import FoodSpec, load_foods
from intsim.task.language import instructions
from intsim.task.targets import MIN_VIEW_ANGLE, CutSpec, Item, TaskError
from mpm.scene.shapes import Shape

FOODS = (
    "banana", "cucumber", "apple", "peach", "melon", "orange", "strawberry", "pear", "kiwi", "tomato", "lemon", "grape",
    "shine_muscat", "plum", "cherry",
)  # fmt: skip
"""The fifteen foods of the published data set."""
FIRST_TEST_SEED = 1_000_000
"""First seed of the tests; those of training are below."""
CUT_RATIOS = tuple(Fraction(*r) for r in ((1, 2), (1, 3), (1, 4), (1, 6), (2, 3), (3, 4)))
SIZE_VARIATION = 0.1  # most that a food's size deviates from its usual one, part of it
FOOD_X, FOOD_Y = (-0.08, 0.08), (-0.12, 0.12)  # where a food may lie [m]
FOOD_SPACING = 0.03  # between foods [m]
MAX_PIECES = 5  # as in the published table of splits
PLACEMENT_TRIES = 200


@dataclass(frozen=True)
class Episode:
    """One task on one table.

    Attributes:
        suite, seed: Which it is.
        spec: What is asked for.
        item: The food that is meant.
        others: Other foods on the table.
        instruction: What is asked for, in words.
    """

    suite: str
    seed: int
    spec: CutSpec
    item: Item
    others: tuple[Item, ...]
    instruction: str


@dataclass(frozen=True)
class FixedTask:
    """What is asked for in place of what a suite would draw; place and size of the food are still drawn.

    Attributes:
        food: Name of the food.
        ratio: Part that is cut off; None to leave the cut to the suite.
        side: From where it is measured; None to leave that to the suite.
        pieces: Into how many equal pieces, in place of ratio and side; 0 for one cut.
    """

    food: str
    ratio: Fraction | float | None = None
    side: str | None = None
    pieces: int = 0

    def spec(self, drawn: CutSpec) -> CutSpec:
        """What is asked for, with what it leaves open as it was drawn."""
        if self.pieces:
            return CutSpec(self.food, pieces=self.pieces)
        if self.ratio is None:
            return drawn
        return CutSpec(self.food, self.ratio, self.side or drawn.side)


def random_item(food: FoodSpec, rng: np.random.Generator) -> Item:
    """A food of a random size, place and direction; its ends can be told apart in the front camera's picture."""
    scale = 1 + rng.uniform(-SIZE_VARIATION, SIZE_VARIATION)
    usual = food.to_scene_food().shape
    shape = Shape(usual.kind, scale * usual.length, scale * usual.width, scale * usual.height)
    turn = math.pi / 2 - 1.2 * MIN_VIEW_ANGLE
    yaw = math.pi / 2 + rng.uniform(-turn, turn)
    return Item(food.name, shape, float(rng.uniform(*FOOD_X)), float(rng.uniform(*FOOD_Y)), float(yaw))


def distractors(item: Item, foods: dict[str, FoodSpec], count: int, rng: np.random.Generator) -> tuple[Item, ...]:
    """Other foods beside one, no two of a kind and none touching another: on the board or beside it, none on its rim.

    Args:
        item: The food that is there.
        foods: Foods that they are taken from, by name.
        count: How many.
        rng: Generator of the choice and the places.

    Returns:
        The other foods.

    Raises:
        TaskError: There is no room for them.
    """
    names = [n for n in foods if n != item.name]
    rng.shuffle(names)
    out: list[Item] = []
    for _ in range(PLACEMENT_TRIES):
        if len(out) == count:
            break
        new = random_item(foods[names[len(out)]], rng)
        new = replace(new, x=float(rng.uniform(-0.2, 0.2)), y=float(rng.uniform(-0.35, 0.35)))
        if new.base is not None and all(
            math.hypot(new.x - o.x, new.y - o.y) > _reach(new) + _reach(o) + FOOD_SPACING for o in (item, *out)
        ):
            out.append(new)
    if len(out) < count:
        raise TaskError(f"suite: no room for {count} foods beside the {item.name}")
    return tuple(out)


def _reach(item: Item) -> float:
    return math.hypot(item.shape.length, item.shape.width) / 2


def _fraction(rng: np.random.Generator, name: str) -> CutSpec:
    ratio = CUT_RATIOS[rng.integers(len(CUT_RATIOS))]
    side = ("left", "right")[rng.integers(2)]
    return CutSpec(name, ratio, "centre" if ratio == Fraction(1, 2) and rng.random() < 0.5 else side)


def _continuous(rng: np.random.Generator, name: str) -> CutSpec:
    return CutSpec(name, round(float(rng.uniform(0.1, 0.9)), 2), ("left", "right")[rng.integers(2)])


def _split(rng: np.random.Generator, name: str) -> CutSpec:
    return CutSpec(name, pieces=int(rng.integers(2, MAX_PIECES + 1)))


def _flip(rng: np.random.Generator, name: str) -> CutSpec:
    ratio = (Fraction(1, 4), Fraction(3, 4))[rng.integers(2)]
    return CutSpec(name, ratio, ("left", "right")[rng.integers(2)])


@dataclass(frozen=True)
class TaskSuite:
    """A kind of task.

    Attributes:
        what: What it tests, in words.
        task: Draws what is asked for from a generator, for a food.
        distractors: Other foods on the table at most.
        unseen: Whether the sentences are of those that are kept for testing.
    """

    what: str
    task: Callable[[np.random.Generator, str], CutSpec] = _fraction
    distractors: int = 0
    unseen: bool = False


SUITES = {
    "seeds": TaskSuite("places and sizes that training has not seen"),
    "objects": TaskSuite("other foods on the table", distractors=3),
    "language": TaskSuite("sentences that training has not seen", unseen=True),
    "continuous": TaskSuite("any part from 0.1 to 0.9", task=_continuous),
    "split": TaskSuite("two to five equal pieces", task=_split),
    "flips": TaskSuite("a quarter and three quarters from either end", task=_flip),
}
"""Suites by name. Leave one food out by naming it: a suite of a policy that was trained without it."""


def sample_episode(suite: str, seed: int, foods: dict[str, FoodSpec], fixed: FixedTask | None = None) -> Episode:
    """The episode of a suite with a seed; the same seed is the same episode.

    Args:
        suite: Name in ``SUITES``.
        seed: From ``TEST`` on for a test.
        foods: Foods that may be asked for, by name.
        fixed: What is asked for in place of what the suite draws.

    Returns:
        What is on the table, what is asked for, and in which words.

    Raises:
        TaskError: No such suite.
    """
    if suite not in SUITES:
        raise TaskError(f"suite: {suite!r} is none of {', '.join(SUITES)}")
    kind = SUITES[suite]
    rng = np.random.default_rng([seed, *suite.encode()])
    names = list(foods)
    drawn = names[rng.integers(len(names))]
    name = drawn if fixed is None else fixed.food
    item, spec = random_item(foods[name], rng), kind.task(rng, name)
    if fixed is not None:
        spec = fixed.spec(spec)
    others: tuple[Item, ...] = ()
    if kind.distractors:
        item = replace(item, x=float(np.clip(item.x, -0.05, 0.05)), y=float(np.clip(item.y, -0.05, 0.05)))
        others = distractors(
            item,
            load_foods() if len(foods) <= kind.distractors else foods,
            int(rng.integers(1, kind.distractors + 1)),
            rng,
        )
    words = instructions(spec, int(rng.integers(2**31)), unseen=kind.unseen)
    return Episode(suite, seed, spec, item, others, words[0])
