"""The cutting force: what it must be for a thin blade, and what it must not depend on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from mpm.output.energy import unbooked
from mpm.output.record import ForceRecord
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from mpm.state.host_transfer import of_particles
from mpm.state.state import FACE_POINTS
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.result import Comparison

THIN = Knife("thin", 0.2e-3, math.radians(1.0), 0.05, 0.4)
WEDGE = Knife("wedge", 2e-3, math.radians(11.0), 0.0104, 0.2)
TALL = Knife("tall wedge", 8e-3, math.radians(11.0), 0.05, 0.2)
FLESH = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=300.0, R_initiation=300.0)
PRISM = Shape("block", 0.03, 0.024, 0.024)
READ_BACK = "bookkeeping: "
"""Begins the name of a row that reads back what the edge's law prescribes: it finds errors in how the law is applied
and booked, but cannot tell whether the law is right."""


def cut(
    options: SuiteOptions,
    *,
    knife: Knife = THIN,
    shape: Shape = PRISM,
    material: Material = FLESH,
    motion: Motion | None = None,
    board: float = 0.5,
    **numerics: Any,
) -> ForceRecord:
    """One cut through most of a prism.

    Args:
        options: Seed and device.
        knife: The knife.
        shape: The prism.
        material: Its constants.
        motion: Motion of the knife; down to three quarters of the height without it.
        board: Friction on the board [-].
        numerics: Further values of :class:`mpm.scene.Numerics`; cells are 3 mm where they do not say.

    Returns:
        The record of the cut.
    """
    num = Numerics(**({"dx": 3e-3} | numerics))
    scene = Scene(
        Food(shape, material), knife, motion or Motion(0.018, 0.01), Board(board), edge=EdgeLaw(zone=3e-3), numerics=num
    )
    return options.simulate(scene)


def _plateau(record: ForceRecord, low: float = 8e-3, high: float = 16e-3) -> float:
    on = (record.stroke > low) & (record.stroke < high)
    return float(record.resolved[on].mean())


def _unbooked(record: ForceRecord) -> float:
    part = unbooked(record.budget)
    return math.nan if part is None else part


def resistance(options: SuiteOptions) -> Iterator[Comparison]:
    """A thin blade without friction needs R times the width, and nothing of the stiffness, as its law says."""
    base = cut(options)
    source = "F = R w (Atkins 2009)"
    yield Comparison(
        f"{READ_BACK}thin blade", "force on the plateau [N]", FLESH.R * PRISM.width, _plateau(base), 0.03, source
    )
    wide = cut(options, shape=replace(PRISM, width=0.048))
    yield Comparison(
        f"{READ_BACK}thin blade, twice the width",
        "force over that of the single width [-]",
        2.0,
        _plateau(wide) / _plateau(base),
        0.02,
        source,
    )
    stiff = cut(options, material=replace(FLESH, E=4e6, yield_stress=8e5))
    yield Comparison(
        f"{READ_BACK}thin blade, four times the stiffness",
        "force over that of the soft food [-]",
        1.0,
        _plateau(stiff) / _plateau(base),
        0.02,
        source,
    )
    deep = [int(np.searchsorted(base.stroke, at)) for at in (8e-3, 16e-3)]
    parted, area = float(np.diff(base.parting[deep])[0]), PRISM.width * float(np.diff(base.stroke[deep])[0])
    yield Comparison(
        f"{READ_BACK}thin blade", "energy of parting over the new area [J/m^2]", FLESH.R, parted / area, 0.01, "R"
    )
    yield Comparison(
        "thin blade",
        "energy that no law took, of the work [-]",
        0.0,
        _unbooked(base),
        0.02,
        "conservation of energy: a blade this thin opens nothing ahead of its edge",
    )
    balance = float(np.abs(base.residual).max() / base.peak)
    yield Comparison(
        "thin blade, balance",
        "impulse not accounted for over the peak [-]",
        0.0,
        balance,
        1e-10,
        "Newton: knife + board + weight = change of momentum",
    )


def slicing(options: SuiteOptions) -> Iterator[Comparison]:
    """A slice/push ratio lowers the force down and brings one along the blade, as its law says."""
    xi = 1.0
    held = Shape("block", 0.03, 0.072, 0.024)
    record = cut(options, shape=held, motion=Motion(0.018, 0.01, slice_ratio=xi), board=9.0)
    on = (record.stroke > 11e-3) & (record.stroke < 16e-3)  # a glued block shears until then
    down, along = float(record.edge[on, 2].mean()), abs(float(record.edge[on, 0].mean()))
    line, source = FLESH.R * held.width, "Atkins, Xu and Jeronimidis 2004"
    yield Comparison(f"{READ_BACK}slice/push ratio 1", "force down [N]", line / (1 + xi**2), down, 0.05, source)
    yield Comparison(
        f"{READ_BACK}slice/push ratio 1", "force along the blade [N]", line * xi / (1 + xi**2), along, 0.05, source
    )


def invariance(options: SuiteOptions) -> Iterator[Comparison]:
    """The force of a wedge does not follow where the grid lies, the seed of the particles or the speed."""
    food = replace(FLESH, mu=0.3)
    changes: tuple[tuple[str, SuiteOptions, dict[str, Any]], ...] = (
        ("blade shifted by half a cell", options, {"grid_shift": (0.0, 0.5, 0.0)}),
        ("grid shifted along the blade and upwards", options, {"grid_shift": (0.3, 0.0, 0.4)}),
        ("other particles", replace(options, seed=options.seed + 1), {}),
    )
    base = cut(options, knife=WEDGE, material=food)
    yield Comparison(
        "wedge with friction",
        "energy lost by the discretisation, of the work [-]",
        0.0,
        abs(_unbooked(base)),
        0.02,
        "all work is taken by a law",
    )
    for name, so, change in changes[:1] if options.quick else changes:
        other = cut(so, knife=WEDGE, material=food, **change)
        yield Comparison(f"wedge, {name}", "work [J]", base.work, other.work, 0.05, "the same cut")
    if not options.quick:
        slow = cut(options, knife=WEDGE, material=food, motion=Motion(0.018, 0.005))
        yield Comparison(
            "wedge, half the speed", "work [J]", base.work, slow.work, 0.03, "a food without rate dependence"
        )


def withdrawal(options: SuiteOptions) -> Iterator[Comparison]:
    """A wedge that is withdrawn from an elastic block feels friction and adhesion, each of a known size, and no R.

    The block is held on the board, and as heavy as ten, or it would be lifted. Without friction the force says the
    normal force at each depth, by the angle of the wedge. The faces that adhesion holds are counted at the lowest
    place.
    """
    half, mu, energy = TALL.angle / 2, 0.05, 2.0
    there = Motion(0.012, 0.005, retract=0.014)

    def scene(motion: Motion = there, **values: Any) -> Scene:
        flesh = replace(FLESH, yield_stress=math.inf, loss_factor=0.1, **values)
        num = Numerics(dx=3e-3, gravity=98.1, seed=options.seed)
        return Scene(Food(PRISM, flesh), TALL, motion, Board(9.0), edge=EdgeLaw(zone=3e-3), numerics=num)

    sticks: dict[str, Any] = {"adhesion": 5e3, "adhesion_energy": energy}
    foods: tuple[dict[str, Any], ...] = ({}, {"mu": mu}, sticks)
    dry, rubbed, sticky = (options.simulate(scene(**values)) for values in foods)
    up = np.arange(len(dry.stroke)) >= dry.cut_rows
    rows = up & (dry.stroke > 3e-3) & (dry.stroke < 9e-3)
    normal = dry.resolved_face[rows] / (2 * math.sin(half))
    drag = dry.resolved_face[rows] - rubbed.resolved_face[rows]
    yield Comparison(
        "withdrawn wedge, friction 0.05",
        "friction over the normal force [-]",
        mu,
        float(drag.sum() / (2 * math.cos(half) * normal).sum()),
        0.05,
        "Coulomb; the normal force is that of a cut without friction",
    )
    down = Simulation(scene(replace(there, retract=0.0), **sticks), options.runtime)
    down.run()
    stuck = of_particles(down.state, down.state.adhering).clip(0)
    points = sum(int(np.count_nonzero(stuck & (1 << q))) for q in range(FACE_POINTS))
    area = points / FACE_POINTS * down.setup.seeds.spacing**2 * down.setup.grid.images
    taken = 0.0 if sticky.adhesion is None else float(sticky.adhesion[-1])
    works = [0.0 if one.withdrawal is None else one.withdrawal["work_J"] for one in (dry, sticky)]
    source = "work of adhesion times the faces that have touched"
    name = "withdrawn wedge, adhesion of 2 J/m^2"
    yield Comparison(name, "energy that adhesion takes [J]", energy * area, taken, 0.05, source)
    yield Comparison(name, "more work of the knife [J]", energy * area, works[1] - works[0], 0.05, source)
    felt = float(np.abs(sticky.edge[rows, 2]).max()) / sticky.peak
    yield Comparison(name, "force on the edge over the peak [-]", 0.0, felt, 1e-3, "nothing is parted on the way up")
    lost = float(sticky.unbooked[-1] - dry.unbooked[-1]) / (energy * area)
    yield Comparison(name, "energy lost more, of that of adhesion [-]", 0.0, lost, 0.05, "all work is taken by a law")


CASES = [
    VerificationCase("cutting resistance", resistance, cost=50),
    VerificationCase("slicing", slicing, fast=False, cost=22),
    VerificationCase("invariance of the cut", invariance, fast=False, cost=25),
    VerificationCase("withdrawal", withdrawal, fast=False, cost=15),
]
