"""Work of new surface: the same R under every blade, in every food, on every grid."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from mpm.output.record import ForceRecord
from mpm.scene.material import COHESIVE_ZONE, Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.fracture.scene import TUBER_R, Wedge, brittle, scene, simulation
from studies.verification.result import Comparison

ANGLES = (2.5, 11.0, 20.0, 30.0)
MODULI = (0.3e6, 1e6, 10e6)
CELLS = (3e-3, 2e-3, 1.5e-3)
LENGTH = 0.036  # of the block, across the blade [m]
HEIGHTS = (0.024, 0.048)
"""Heights of two blocks [m]. What the higher one takes more is free of the beginning, where a dent is cut for the work
of the start, and of the end, where the last of the food is squeezed on the board."""
SURFACE_OFF, UNBOOKED = 0.03, 0.05  # largest errors that pass
RUBS = 0.17  # friction of a food that flows [-]


@dataclass(frozen=True)
class Food:
    """A food of the sweep: its strength makes a process zone of 10 mm.

    Attributes:
        modulus: Young's modulus [Pa].
        flows: Whether it yields at half its strength and rubs on the blade, as real ones do; else it is elastic.
    """

    modulus: float
    flows: bool

    def __str__(self) -> str:
        return f"E {self.modulus / 1e6:g} MPa, {'flows and rubs' if self.flows else 'elastic'}"


EVERY = tuple(Food(modulus, flows) for modulus in MODULI for flows in (False, True))
PLAIN = Food(1e6, False)


@dataclass(frozen=True)
class Paid:
    """What new surface took.

    Attributes:
        surface: Work of edge and ties over R and the area that the higher block has more [-].
        unbooked: Part of the work on the higher block that no law took [-].
    """

    surface: float
    unbooked: float


def paid(options: SuiteOptions, degrees: float, food: Food, dx: float) -> Paid:
    """Cut a low and a high block, four cells wide, down to the board.

    Args:
        options: Seed and device.
        degrees: Angle between the faces of the blade.
        food: The food.
        dx: Cell size [m].

    Returns:
        Work of new surface between the two heights, and what is unbooked; not numbers where a run broke down.
    """
    strength = math.sqrt(food.modulus * TUBER_R / COHESIVE_ZONE)
    material = brittle(food.modulus, TUBER_R, strength)
    if food.flows:
        material = replace(material, yield_stress=strength / 2, mu=RUBS)
    low, high = (_cut(options, degrees, material, height, dx) for height in HEIGHTS)
    if {low.status, high.status} != {"done"}:
        return Paid(math.nan, math.nan)
    area = 4 * dx * (HEIGHTS[1] - HEIGHTS[0])
    more = float(high.surface[-1] - low.surface[-1])
    return Paid(more / (TUBER_R * area), float(high.unbooked[-1]) / high.work)


def _cut(options: SuiteOptions, degrees: float, material: Material, height: float, dx: float) -> ForceRecord:
    block = Shape("block", LENGTH, 4 * dx, height)
    return simulation(options, scene(block, material, Wedge(degrees), height, dx)).run()


def sweep(options: SuiteOptions, degrees: float, foods: Sequence[Food], cells: Sequence[float]) -> Iterator[Comparison]:
    """The worst food on each grid.

    Args:
        options: Seed and device.
        degrees: Angle between the faces of the blade.
        foods: The foods.
        cells: Cell sizes [m].

    Yields:
        Work of new surface over R, and what no law took of the work.
    """
    for dx in cells:
        found = {food: paid(options, degrees, food, dx) for food in foods}
        name = f"blade of {degrees:g} degrees, dx {1e3 * dx:g} mm"
        of = f"worst of {len(foods)} foods: " if len(foods) > 1 else ""
        worst = max(foods, key=lambda food: _badness(found[food].surface - 1))
        got = found[worst].surface
        quantity = "work of new surface over R, between two heights [-]"
        yield Comparison(f"{name}, {of}{worst}", quantity, 1.0, got, SURFACE_OFF, "R is all the work of new surface")
        worst = max(foods, key=lambda food: _badness(found[food].unbooked))
        quantity = "energy that no law took, of the work [-]"
        got = found[worst].unbooked
        yield Comparison(f"{name}, {of}{worst}", quantity, 0.0, got, UNBOOKED, "conservation of energy")


def _badness(error: float) -> float:
    """Size of an error, without end where it is no number."""
    return math.inf if math.isnan(error) else abs(error)


def _case(degrees: float) -> VerificationCase:
    def run(options: SuiteOptions) -> Iterator[Comparison]:
        if options.quick:
            yield from sweep(options, degrees, (PLAIN,), CELLS[:1])
        else:
            yield from sweep(options, degrees, EVERY, CELLS)

    return VerificationCase(f"work of new surface: {degrees:g} degrees", run, fast=degrees in ANGLES[::2], cost=500)


CASES = [_case(degrees) for degrees in ANGLES]
