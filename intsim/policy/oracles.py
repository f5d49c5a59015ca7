"""Built-in policies: oracles that test the evaluation, and a policy that knows nothing."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from intsim.task.gym_action import GRIPPER_CLOSED
from intsim.task.language import parse_instruction
from intsim.task.planner import HOME, PRESS, BladeDescent, plan_cut
from intsim.task.rollout import Policy
from intsim.task.targets import CutSpec, Item, TaskError, boxed_target, target

SHALLOW_HEIGHT = 7e-3
"""Height at which the shallow oracle stops [m].

It is what 12.5 N, the paper's banana, leave of a cut under ManiSkill's arm, which gives way by 0.57 mm per N.
"""
HOVER_HEIGHT = 1e-3  # height above the food at which the hovering oracle turns back [m]
STUCK_STEPS = 40  # control steps of the policy that is stuck: longer than what counts as at rest


class Oracle:
    """Reads the instruction and the foods and follows a plan; its errors are those that it is given.

    Args:
        sigma: Standard deviation of the place along the food [m].
        wrong_side: Measure from the other end.
        wrong_item: Cut another food where there is one.
        boxed: Know the food's bounding box alone, as the published planner does.
        descent: How it brings the blade down.
        hover: Height above the food at which it turns back [m]; without it, it comes down.
    """

    def __init__(
        self,
        *,
        sigma: float = 0.0,
        wrong_side: bool = False,
        wrong_item: bool = False,
        boxed: bool = False,
        descent: BladeDescent = PRESS,
        hover: float | None = None,
    ) -> None:
        self.sigma, self.wrong_side, self.wrong_item, self.boxed = sigma, wrong_side, wrong_item, boxed
        self.descent, self.hover = descent, hover
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Forget the plan."""
        self._rng = np.random.default_rng(seed)
        self._todo: list[np.ndarray] = []
        self._spec: CutSpec | None = None
        self._cuts = 0

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next step of the plan; a new one after each cut of several."""
        if not self._todo:
            self._plan(obs, instruction)
        return step_towards(self._todo.pop(0), obs["pose"]) if self._todo else None

    def _plan(self, obs: dict[str, Any], instruction: str) -> None:
        items: tuple[Item, ...] = obs["items"]
        if self._spec is None:
            self._spec = parse_instruction(instruction, [i.name for i in items])
        if self._cuts == self._spec.cuts:
            return
        self._cuts += 1
        item = next(i for i in items if i.name == self._spec.item)
        if self.wrong_item:
            item = next((i for i in items if i.name != self._spec.item), item)
        try:
            along = target(self._spec, item)
        except TaskError:  # nothing is left to cut
            return
        place, yaw = boxed_target(self._spec, item) if self.boxed else (None, None)
        if self.wrong_side and not self._spec.pieces:
            along = -along
        along += self.sigma * float(self._rng.standard_normal())
        descent = self.descent
        if self.hover is not None:
            descent = replace(descent, depth=item.shape.height + self.hover)
        planned = plan_cut(item, along, descent, start=obs["pose"], yaw=yaw, place=place)
        self._todo = list(planned.pose)


class RandomPolicy:
    """Moves at random around its home: what success without any knowledge looks like."""

    def __init__(self) -> None:
        self.reset(0)

    def reset(self, seed: int) -> None:
        """Draw where to go."""
        rng = np.random.default_rng(seed)
        goal = np.array([*rng.uniform([-0.2, -0.25], [0.2, 0.25]), 0.0, rng.uniform(-math.pi / 2, math.pi / 2), 0.0])
        above = np.array([*goal[:2], HOME[2], goal[3], 0.0])
        self._todo = [*np.linspace([*HOME, 0.0, 0.0], above, 40), *np.linspace(above, goal, 100)]

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """The next step, whatever it was told."""
        del instruction
        return step_towards(self._todo.pop(0), obs["pose"]) if self._todo else None


class StuckPolicy:
    """Stays where it is for :data:`STUCK_STEPS`."""

    def __init__(self) -> None:
        self.reset(0)

    def reset(self, seed: int) -> None:
        """It has not stood yet."""
        del seed
        self._left = STUCK_STEPS

    def act(self, obs: dict[str, Any], instruction: str) -> np.ndarray | None:
        """No change of pose, whatever it was told."""
        del instruction
        self._left -= 1
        return step_towards(obs["pose"], obs["pose"]) if self._left >= 0 else None


def step_towards(goal: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """The action (7,) that brings the edge from one pose (5,) to another [m, rad], the gripper closed."""
    change = goal - pose
    return np.array([*change[:3], 0.0, change[4], change[3], GRIPPER_CLOSED])


POLICIES: dict[str, tuple[Callable[[float], Policy], str]] = {
    "oracle": (lambda sigma: Oracle(), "cuts where it is told"),
    "noisy": (lambda sigma: Oracle(sigma=sigma), "misses the place along the food by a normal error (--sigma)"),
    "wrong-side": (lambda sigma: Oracle(wrong_side=True), "takes left for right"),
    "wrong-item": (lambda sigma: Oracle(wrong_item=True), "cuts another food where there is one"),
    "shallow": (lambda sigma: Oracle(descent=BladeDescent(depth=SHALLOW_HEIGHT)), "stops 7 mm above the board"),
    "overdrive": (
        lambda sigma: Oracle(descent=BladeDescent(depth=-0.03, hold=0.5)),
        "commands the edge 30 mm into the board and holds it for half a second",
    ),
    "boxed": (lambda sigma: Oracle(boxed=True), "knows the bounding box alone, as the published planner does"),
    "hover": (lambda sigma: Oracle(hover=HOVER_HEIGHT), "turns back a millimetre above the food"),
    "stuck": (lambda sigma: StuckPolicy(), "stays where it is"),
    "random": (lambda sigma: RandomPolicy(), "comes down somewhere"),
}
"""Policies by name, each from a standard deviation [m], and what they do."""


def make_policy(name: str, sigma: float = 0.01) -> Policy:
    """A policy by its name.

    Args:
        name: One of :data:`POLICIES`.
        sigma: Standard deviation of the noisy oracle's place along the food [m].

    Returns:
        A policy that no episode has begun with.

    Raises:
        TaskError: There is none of this name.
    """
    if name not in POLICIES:
        raise TaskError(f"policy: {name!r} is none of {', '.join(POLICIES)}")
    return POLICIES[name][0](sigma)
