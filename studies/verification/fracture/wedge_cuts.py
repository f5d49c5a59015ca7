"""Cuts of a block by a wedge: force over stroke against finite elements whose crack finds its own way."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fem_reference.cutting.wedge import Blade, Block, Cut, Grid, Interface, cut
from fem_reference.laws import Corotated
from mpm.arrays import FloatArray
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.fracture.scene import TUBER, Wedge, brittle, scene, simulation
from studies.verification.result import Comparison

BLOCK = Shape("block", 0.03, 0.012, 0.03)
FROM, TO, ASKED = 2e-3, 22e-3, 24e-3  # strokes between which forces are compared, and stroke of the elements [m]
WINDOW = 2e-3  # over which both forces are smoothed [m]
OFF = 0.05  # largest errors that pass


@dataclass(frozen=True)
class WedgeCut:
    """A cut.

    Attributes:
        wedge: The blade.
        food: What it cuts, with its friction.
        cells: Cell sizes of the particles [m].
        elements: Size of the finite elements [m].
        coarser: Size of other elements, from which the answer is carried on to elements of nothing [m]; 0 for none. The
            wedge opens what the elements hold above the edge, by as much as they are large, and rubs for it.
    """

    wedge: Wedge
    food: Material = TUBER
    cells: tuple[float, ...] = (3e-3, 1.5e-3)
    elements: float = 1e-3
    coarser: float = 0.0

    @property
    def window(self) -> float:
        """Over which forces are smoothed [m]: what is carried on ripples twice as much, with the larger elements."""
        return max(WINDOW, 2 * self.coarser)

    def __str__(self) -> str:
        rubs = f", friction {self.food.mu:g}" if self.food.mu else ""
        return f"wedge of {self.wedge.degrees:g} degrees, E {self.food.E / 1e6:g} MPa{rubs}"


THIN = WedgeCut(Wedge(2.5))
RUBS = WedgeCut(Wedge(2.3), replace(brittle(9.35e6, 303.0, 0.613e6), mu=0.24), coarser=2e-3)
CUTS = (
    THIN,
    WedgeCut(Wedge(11.0)),
    WedgeCut(Wedge(11.0), replace(TUBER, mu=0.17)),
    WedgeCut(Wedge(22.0), brittle(1e6, 150.0, 0.1e6)),
    WedgeCut(Wedge(30.0)),
)


def by_elements(test: WedgeCut, size: float) -> Cut:
    """The cut by finite elements of a size [m], with the particles' law of large strains, and free ends."""
    food = test.food
    block = Block(BLOCK.length, BLOCK.height, Corotated(food.shear, food.lame), width=BLOCK.width)
    blade = Blade(test.wedge.angle, test.wedge.thickness, food.mu)
    tie = Interface(food.R, food.cohesion)
    return cut(block, blade, tie, ASKED, Grid(size, layers=1))


def smoothed(stroke: FloatArray, work: FloatArray, at: FloatArray, window: float = WINDOW) -> FloatArray:
    """Force as the mean over a window about each stroke.

    Args:
        stroke: Strokes [m], shape (n,).
        work: Work done until then [J/m], shape (n,).
        at: Strokes at which the force is wanted [m], shape (m,).
        window: Its width [m].

    Returns:
        Forces [N/m], shape (m,).
    """
    low, high = (np.interp(at + half, stroke, work) for half in (-window / 2, window / 2))
    return (high - low) / window


def work_between(stroke: FloatArray, work: FloatArray) -> float:
    """Work between :data:`FROM` and :data:`TO` [J/m], of strokes [m] and the work done until then [J/m]."""
    return float(np.diff(np.interp([FROM, TO], stroke, work))[0])


def reference(test: WedgeCut, at: FloatArray) -> tuple[FloatArray, float, str]:
    """What finite elements say of a cut.

    Args:
        test: The cut.
        at: Strokes [m], shape (n,).

    Returns:
        Smoothed forces there [N/m], shape (n,), work between :data:`FROM` and :data:`TO` [J/m], and the source.
    """
    fine = by_elements(test, test.elements)
    force, work = smoothed(fine.stroke, fine.work, at, test.window), work_between(fine.stroke, fine.work)
    source = f"finite elements with a cohesive plane, {fine.unknowns} unknowns"
    if test.coarser:
        coarse = by_elements(test, test.coarser)
        part = test.elements / (test.coarser - test.elements)  # an error that is in proportion to their size
        force = force + part * (force - smoothed(coarse.stroke, coarse.work, at, test.window))
        work += part * (work - work_between(coarse.stroke, coarse.work))
        source += f" and {coarse.unknowns}, carried on to elements of no size"
    return force, work, source


def compare(options: SuiteOptions, test: WedgeCut) -> Iterator[Comparison]:
    """Force over stroke, work and unbooked energy of a cut, on each grid.

    Args:
        options: Seed and device.
        test: The cut.

    Yields:
        Comparisons.
    """
    at = np.arange(FROM, TO, 0.1e-3)
    want, wanted_work, source = reference(test, at)
    for dx in test.cells:
        record = simulation(options, scene(BLOCK, test.food, test.wedge, ASKED, dx)).run()
        stroke = np.concatenate([[0.0], record.stroke])
        work = np.concatenate([[0.0], record.work_done]) / BLOCK.width
        sound = record.status == "done"
        off = smoothed(stroke, work, at, test.window) - want
        k = int(np.argmax(np.abs(off)))
        name = f"{test}, dx {1e3 * dx:g} mm"
        got = float(off[k]) / float(want.max()) if sound else math.nan
        quantity = f"largest error of the force, {1e3 * at[k]:.1f} mm deep, over the highest force [-]"
        yield Comparison(name, quantity, 0.0, got, OFF, source)
        done = work_between(stroke, work)
        quantity = f"work per width, {1e3 * FROM:g} to {1e3 * TO:g} mm deep [J/m]"
        yield Comparison(name, quantity, wanted_work, done if sound else math.nan, OFF, source)
    part = float(record.unbooked[-1]) / record.work
    yield Comparison(name, "energy that no law took, of the work [-]", 0.0, part, OFF, "conservation of energy")


def thin(options: SuiteOptions) -> Iterator[Comparison]:
    """A blade so thin that the edge cuts nearly all."""
    yield from compare(options, THIN)


def rubbing(options: SuiteOptions) -> Iterator[Comparison]:
    """A thin blade that rubs in a strong food: friction is many times the work of what it opens."""
    yield from compare(options, RUBS)


def thick(options: SuiteOptions) -> Iterator[Comparison]:
    """Blades that open the food ahead of their edge."""
    for test in CUTS[1:]:
        yield from compare(options, test)


CASES = [
    VerificationCase("cut by finite elements: thin", thin, fast=False, cost=30),
    VerificationCase("cut by finite elements: thin, with friction", rubbing, fast=False, cost=120),
    VerificationCase("cut by finite elements: thick", thick, fast=False, cost=200),
]
