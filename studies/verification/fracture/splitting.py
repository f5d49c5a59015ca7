"""A wedge driven into a standing beam that it splits: length of the crack and force, with no part of the edge in it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fem_reference.cutting.griffith import beam_crack_length, crack_length
from fem_reference.cutting.wedge import Blade, Block, Grid, Interface, split
from fem_reference.laws import Linear
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.fracture.crack_tip import tip_height
from studies.verification.fracture.scene import (
    NU,
    TUBER,
    TUBER_E,
    TUBER_R,
    TUBER_STRENGTH,
    Wedge,
    brittle,
    scene,
    simulation,
)
from studies.verification.result import Comparison

STEADY = 6e-3  # last part of the stroke, over which the force is a mean [m]
LENGTH_OFF, FORCE_OFF = 0.10, 0.05  # largest errors that pass


@dataclass(frozen=True)
class Beam:
    """A standing beam with a wedge in it, so thick that the crack runs ahead of the edge.

    Attributes:
        arm: Thickness of each half [m].
        height: [m].
        food: Its constants.
        wedge: The blade.
        stroke: Way of the edge [m].
    """

    arm: float
    height: float = 0.05
    food: Material = TUBER
    wedge: Wedge = Wedge(22.0)
    stroke: float = 0.018


BEAMS = (Beam(6e-3), Beam(8e-3), Beam(12e-3))
LONG = Beam(6e-3, 0.09, brittle(TUBER_E, 10.0, TUBER_STRENGTH), Wedge(22.0, 4e-3), 0.03)


def split_by_particles(options: SuiteOptions, beam: Beam, dx: float) -> tuple[float, float]:
    """Split a beam that is four cells wide.

    Args:
        options: Seed and device.
        beam: The beam.
        dx: Cell size [m].

    Returns:
        Way from the blade's shoulder to the crack's tip at the end [m]; mean force of the last part of the stroke per
        width [N/m]. Not numbers where the run broke down.
    """
    block = Shape("block", 2 * beam.arm, 4 * dx, beam.height)
    made = simulation(options, scene(block, beam.food, beam.wedge, beam.stroke, dx))
    record = made.run()
    if record.status != "done":
        return math.nan, math.nan
    end = float(record.stroke[-1])
    work = np.interp([end - STEADY, end], record.stroke, record.work_done)
    length = beam.height - end + beam.wedge.shoulder - tip_height(made)
    return length, float(np.diff(work)[0]) / STEADY / block.width


def beams(options: SuiteOptions) -> Iterator[Comparison]:
    """Arms that are short, so that finite elements must say how long the crack is and what it takes.

    The elements are in plane strain. The beam of particles has free ends, which makes the crack up to 2 % shorter.
    """
    law = Linear(TUBER.shear, TUBER.lame)
    for beam in BEAMS[1:2] if options.quick else BEAMS:
        block = Block(2 * beam.arm, beam.height, law, held=True)
        blade = Blade(beam.wedge.angle, beam.wedge.thickness)
        grid = Grid(1e-3 if options.quick else 0.5e-3)
        want, _ = crack_length(block, blade, beam.stroke, TUBER_R, grid)
        name = f"arms of {1e3 * beam.arm:g} mm"
        if not options.quick:
            held = split(block, blade, Interface(TUBER_R, TUBER_STRENGTH), beam.stroke, Grid(1e-3))
            force = held.mean_force(beam.stroke - STEADY, beam.stroke)
        for dx in (2e-3,) if options.quick else (2e-3, 1.5e-3):
            where = f"wedge of 22 degrees splits a beam, {name}, dx {1e3 * dx:g} mm"
            got, pushed = split_by_particles(options, beam, dx)
            source = "finite elements, G = -dU/da = R (Griffith)"
            yield Comparison(where, "crack from the shoulder to its tip [m]", want, got, LENGTH_OFF, source)
            if not options.quick:
                source = "finite elements with a cohesive plane; R by the balance of energies"
                yield Comparison(where, "mean force per width [N/m]", force, pushed, FORCE_OFF, source)


def slender(options: SuiteOptions) -> Iterator[Comparison]:
    """Arms so long that the formula of a beam holds, with the turning of its root (Kanninen 1973; Williams 1989)."""
    dx = 1.5e-3
    got, pushed = split_by_particles(options, LONG, dx)
    where = f"wedge of 22 degrees splits a slender beam, dx {1e3 * dx:g} mm"
    want = beam_crack_length(TUBER_E / (1 - NU**2), LONG.arm, LONG.wedge.thickness, LONG.food.R)
    source = "G = 3 E D^2 h^3 / (16 (a + 0.64 h)^4) = R (Gurney and Hunt 1967)"
    yield Comparison(where, "crack from the shoulder to its tip [m]", want, got, LENGTH_OFF, source)
    source = "R: a crack that goes on as it is stores nothing more"
    yield Comparison(where, "mean force per width [N/m]", LONG.food.R, pushed, FORCE_OFF, source)


CASES = [
    VerificationCase("splitting: short arms", beams, cost=60),
    VerificationCase("splitting: long arms", slender, fast=False, cost=20),
]
