"""Friction on the faces of a blade that splits, and of one that slices: how much it adds, and where it points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from fem_reference.cutting.wedge import Blade, Block, Grid, Interface, split
from fem_reference.laws import Linear
from mpm.scene import Board
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.fracture.scene import TUBER, Wedge, brittle, scene, simulation
from studies.verification.fracture.splitting import BEAMS, FORCE_OFF, STEADY, split_by_particles
from studies.verification.result import Comparison

RUBS = replace(TUBER, mu=0.17)
SLICED = replace(brittle(1e6, 87.0, 93e3), mu=0.3)
LOAF = Shape("block", 0.03, 0.048, 0.024)
GLUED = 9.0  # friction on the board with which nothing slides [-]
RATIOS = (0.5, 1.0)  # slice/push
FROM, TO = 5e-3, 9e-3  # strokes over which forces are means, where the shoulder is above the food [m]
DIRECTION_OFF = 0.05  # largest error that passes


def splitting(options: SuiteOptions) -> Iterator[Comparison]:
    """The steady force of a wedge that splits a beam, whose arms rub on its shoulder."""
    beam = replace(BEAMS[1], food=RUBS)
    block = Block(2 * beam.arm, beam.height, Linear(RUBS.shear, RUBS.lame), held=True)
    blade = Blade(beam.wedge.angle, beam.wedge.thickness, RUBS.mu)
    found = split(block, blade, Interface(RUBS.R, RUBS.cohesion), beam.stroke, Grid(1e-3))
    want = found.mean_force(beam.stroke - STEADY, beam.stroke)
    for dx in (2e-3, 1.5e-3):
        _, got = split_by_particles(options, beam, dx)
        name = f"wedge of 22 degrees splits a beam, friction {RUBS.mu:g}, dx {1e3 * dx:g} mm"
        source = f"finite elements with a cohesive plane, {found.unknowns} unknowns"
        yield Comparison(name, "mean force per width [N/m]", want, got, FORCE_OFF, source)


def drawn_along(food: Material, wedge: Wedge, ratio: float) -> float:
    """Force along the blade over the force down of faces that slide everywhere.

    On either face the normal force N and the friction mu N along the sliding, whose parts along the edge and down the
    face are as the slice/push ratio and the cosine of half the angle: N drops out (Atkins 2009).

    Args:
        food: Constants of the food.
        wedge: The blade.
        ratio: Sliding along the edge over that down.

    Returns:
        The ratio of the forces [-].
    """
    half = wedge.angle / 2
    size = math.hypot(math.cos(half), ratio)
    return food.mu * ratio / size / (math.sin(half) + food.mu * math.cos(half) ** 2 / size)


def slicing(options: SuiteOptions) -> Iterator[Comparison]:
    """Friction points where the food slides on the faces.

    The block is glued to the board and shears while it is cut, so that the sliding has less along the edge than the
    motion has. How much is left is seen from the force of the edge, which points where the edge moves in the food.
    """
    wedge, dx = Wedge(11.0), 3e-3
    for ratio in RATIOS:
        of = scene(LOAF, SLICED, wedge, TO + 0.5e-3, dx)
        of = replace(of, motion=replace(of.motion, slice_ratio=ratio), board=Board(GLUED))
        record = simulation(options, of).run()
        on = (record.stroke > FROM) & (record.stroke < TO)
        edge, face = record.edge[on].mean(axis=0), record.face[on].mean(axis=0)
        want = drawn_along(SLICED, wedge, abs(edge[0]) / edge[2])
        got = float(abs(face[0]) / face[2]) if record.status == "done" else math.nan
        name = f"slice/push ratio {ratio:g}, friction {SLICED.mu:g}, wedge of {wedge.degrees:g} degrees"
        quantity = "force of the faces along the blade over that down [-]"
        yield Comparison(name, quantity, want, got, DIRECTION_OFF, "Coulomb friction against the sliding (Atkins 2009)")


CASES = [
    VerificationCase("splitting with friction", splitting, fast=False, cost=20),
    VerificationCase("slicing with friction", slicing, fast=False, cost=20),
]
