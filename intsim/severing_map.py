"""A map of the physics gap: whether a cut parts over the force it takes and what the arm can give.

    python -m intsim.severing_map --food grape --food cherry --draws 4 --out runs/map.json

An arm in impedance control pushes with its stiffness times how far its command runs ahead of it. Two kinds of policy
command a press cut through the middle of a food, behind an arm that yields downwards:

* ``relative``: a fixed lead below where the edge is, as a policy does that gives changes of pose from what it sees. It
  never has more than stiffness x lead, and stands where the food asks for more.
* ``absolute``: an even descent to a lead below the board, as a policy does that plans the motion. Where it stands the
  command goes on, up to the lead.

Foods are drawn evenly in the logarithm from the literature's range of their resistance; the largest force F_peak is
that of the same food under a rigid arm.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from calib.material.food import FoodSpec, load_food
from intsim.sim.coupling import Coupling
from intsim.task.motion import STALL_STEPS
from intsim.task.planner import CONTROL_RATE, DESCENT_SPEED
from intsim.task.success import wilson
from intsim.task.targets import Item
from mpm.scene.errors import CutcalError

KINDS = ("relative", "absolute")
STEPS = 5  # steps of the arm in a step of control
LAG = 0.04  # time in which the arm goes most of the way to its command [s]: damping over stiffness of sim.panda
STAND = 1e-4  # way in a second and a half below which the edge stands [m]
STIFFNESSES = (1754.0, 5348.0)  # of the arm upwards: ManiSkill's own gains, and libfranka's [N/m]
LEADS = (1e-3, 2e-3, 5e-3, 1e-2)  # of the command [m]
BOUNDS = (0.0, 0.5, 0.8, 1.0, 1.25, 2.0, np.inf)
"""Bins of the table, of F_peak / (stiffness x lead) [-]."""


@dataclass(frozen=True)
class SeveringTrial:
    """One cut behind one arm.

    Attributes:
        food: Name of the food.
        R: Its resistance [J/m^2].
        kind: Of the policy, in :data:`KINDS`.
        stiffness: Of the arm, upwards [N/m].
        lead: How far the command runs ahead of the edge, or below the board [m].
        peak: Largest force under a rigid arm [N].
        severed: Whether it is in pieces; None where the simulation broke down, which counts as not.
        uncut: Part of the section that still holds [-].
    """

    food: str
    R: float
    kind: str
    stiffness: float
    lead: float
    peak: float
    severed: bool | None
    uncut: float

    @property
    def load(self) -> float:
        """F_peak / (stiffness x lead) [-]."""
        return self.peak / (self.stiffness * self.lead)


def drawn_food(name: str, draw: int, draws: int) -> FoodSpec:
    """A food with one of several resistances, even in the logarithm over the literature's range.

    Args:
        name: Of the food.
        draw: Which, from 0.
        draws: How many.

    Returns:
        The food.
    """
    food = load_food(name)
    r = food.properties["R"]
    part = (draw + 0.5) / draws
    return food.with_values(
        {"R": float(r.low ** (1 - part) * r.high**part)}, source="drawn from the literature's range"
    )


def press(food: FoodSpec, kind: str, stiffness: float, lead: float) -> tuple[float, bool | None, float]:
    """Press a knife through the middle of a food behind an arm that yields.

    Args:
        food: The food.
        kind: Of the policy, in :data:`KINDS`, or ``rigid``.
        stiffness: Of the arm [N/m].
        lead: Of the command [m].

    Returns:
        The largest force [N], whether the food is in pieces (None where the simulation broke down), and the part of the
        section that holds [-].
    """
    item = Item(food.name, food.to_scene_food().shape)
    coupling, span = Coupling([item], {food.name: food}), 1 / (CONTROL_RATE * STEPS)
    top = item.shape.height + 0.011
    pose = np.array([item.x, item.y, top, item.yaw - np.pi / 2, 0.0])
    command, force, most, way = top, 0.0, 0.0, [top]
    pace = DESCENT_SPEED / CONTROL_RATE
    while coupling.live is not None or not coupling.done:
        command = max(command - pace, -lead) if kind != "relative" else max(pose[2] - lead, command - pace)
        for _ in range(STEPS):
            if kind == "rigid":
                pose[2] -= pace / STEPS
            else:
                pose[2] += (command + force / stiffness - pose[2]) * (1 - np.exp(-span / LAG))
            pose[2] = max(pose[2], 0.0)
            force = float(coupling.move(pose, span)[2])
            most = max(most, force)
        way.append(float(pose[2]))
        if len(way) > STALL_STEPS and max(way[-STALL_STEPS:]) - way[-1] < STAND:
            break
    uncut = coupling.uncut()
    coupling.end()
    return most, coupling.done[-1].severed, uncut


def trials(
    foods: Sequence[str], draws: int, stiffnesses: Sequence[float], leads: Sequence[float]
) -> list[SeveringTrial]:
    """All combinations, each behind both kinds of policy.

    Args:
        foods: Names of foods.
        draws: Resistances of each.
        stiffnesses: Of the arm [N/m].
        leads: Of the command [m].

    Returns:
        A trial for each.
    """
    out = []
    for name in foods:
        for draw in range(draws):
            food = drawn_food(name, draw, draws)
            peak, _, _ = press(food, "rigid", 1.0, 0.0)
            for stiffness in stiffnesses:
                for lead in leads:
                    for kind in KINDS:
                        _, severed, uncut = press(food, kind, stiffness, lead)
                        r = food.properties["R"].value
                        out.append(SeveringTrial(name, r, kind, stiffness, lead, peak, severed, uncut))
    return out


def table(found: Sequence[SeveringTrial]) -> str:
    """How often the food parted, by F_peak / (stiffness x lead), with n and 95 % intervals, as Markdown."""
    lines = ["| F_peak / (stiffness x lead) | " + " | ".join(KINDS) + " |", "|---|" + "---|" * len(KINDS)]
    for low, high in zip(BOUNDS[:-1], BOUNDS[1:], strict=True):
        cells = []
        for kind in KINDS:
            own = [bool(t.severed) for t in found if t.kind == kind and low <= t.load < high]
            a, b = wilson(sum(own), len(own))
            cells.append(f"{sum(own)} of {len(own)} ({a:.0%} to {b:.0%})" if own else "-")
        lines.append(f"| {low:g} to {high:g} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Make the map, print it, and write each trial."""
    p = argparse.ArgumentParser(prog="python -m intsim.severing_map", description="Map severing over force and arm.")
    p.add_argument("--food", action="append", metavar="NAME", help="a food, or several (default: grape)")
    p.add_argument("--draws", type=int, default=4, metavar="N", help="resistances of each food (default 4)")
    p.add_argument("--stiffness", action="append", type=float, metavar="N/M", help="(default: 1754 and 5348 N/m)")
    p.add_argument("--lead", action="append", type=float, metavar="M", help="(default: 1, 2, 5 and 10 mm)")
    p.add_argument("--out", type=Path, metavar="FILE", help="each trial, as JSON; never overwritten")
    args = p.parse_args(words)
    try:
        if args.out is not None and args.out.exists():
            raise CutcalError(f"--out {args.out}: exists and is never overwritten; choose another file")
        if args.draws < 1 or min([*(args.stiffness or [1]), *(args.lead or [1])]) <= 0:
            raise CutcalError("severing map: --draws, --stiffness and --lead are above 0")
        found = trials(
            args.food or ["grape"],
            args.draws,
            args.stiffness or [1754.0, 5348.0],
            args.lead or [1e-3, 2e-3, 5e-3, 1e-2],
        )
    except CutcalError as e:
        sys.stderr.write(f"error: {e}\n")
        return 1
    if args.out is not None:
        args.out.write_text(json.dumps([asdict(t) for t in found], indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table(found) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
