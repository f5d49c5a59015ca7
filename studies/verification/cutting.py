"""The cutting force: what it must be for a thin blade, and what it must not depend on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from fem_reference.slit import cleave
from mpm.arrays import FloatArray
from mpm.output.energy import unbooked
from mpm.output.record import ForceRecord
from mpm.scene import Board, EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from studies.verification.case import SuiteOptions, VerificationCase
from studies.verification.result import Comparison

THIN = Knife("thin", 0.2e-3, math.radians(1.0), 0.05, 0.4)
WEDGE = Knife("wedge", 2e-3, math.radians(11.0), 0.0104, 0.2)
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
    finer = cut(options, knife=WEDGE, material=food, dx=2e-3)
    yield Comparison(
        "wedge with friction",
        "energy lost by the discretisation, of the work [-]",
        0.0,
        3 * abs(_unbooked(finer) - _unbooked(base)),
        0.02,
        "first-order error of what no law took, from cells of 3 and 2 mm",
    )
    for name, so, change in changes[:1] if options.quick else changes:
        other = cut(so, knife=WEDGE, material=food, **change)
        yield Comparison(f"wedge, {name}", "work [J]", base.work, other.work, 0.05, "the same cut")
    if not options.quick:
        slow = cut(options, knife=WEDGE, material=food, motion=Motion(0.018, 0.005))
        yield Comparison(
            "wedge, half the speed", "work [J]", base.work, slow.work, 0.03, "a food without rate dependence"
        )


def slit(options: SuiteOptions) -> Iterator[Comparison]:
    """A wedge without friction in a slit that leads its edge: the force on the faces, and the energy that the halves
    release where they part, against finite elements.

    A block of three heights, with few particles far from the blade as in a food, needs more force than one of one: its
    halves bend less. The blade lies on a plane of nodes, as in every scene whose grid is not turned, or half-way
    between two planes.

    No law of the solver knows the energy that is released: it is what its books leave open, with what viscosity takes
    of the waves. It is compared on cells that are finer than the process zone. See docs/theory.md, "Measured choices".
    """
    lead, stroke = 1.5e-3, 9e-3
    food = Material(E=1e6, nu=0.35, rho=1000, loss_factor=0.05, R=1.0, R_initiation=1.0)
    blocks = {length: Shape("block", length, 0.016, 0.024) for length in (0.024, 0.072)}
    wanted = {
        length: cleave(block, food, WEDGE, lead, stroke + lead) for length, block in blocks.items()
    }  # their middle rises

    def mean(stroke: FloatArray, force: FloatArray) -> float:
        at = np.linspace(5e-3, 8.5e-3, 50)
        return float(np.interp(at, stroke, force).mean())

    def rate(stroke: FloatArray, energy: FloatArray) -> float:
        low, high = np.interp([4e-3, 8.5e-3], stroke, energy)
        return float(high - low) / (0.016 * 4.5e-3)

    shapes = (
        (0.024, 3e-3, 0.0, None),
        (0.024, 1.5e-3, 0.0, None),
        (0.024, 1.5e-3, 0.5, None),
        (0.072, 3e-3, 0.0, 6e-3),
        (0.072, 1.5e-3, 0.0, 6e-3),
    )
    for length, dx, shift, far in shapes:
        scene = Scene(
            Food(blocks[length], food),
            WEDGE,
            Motion(stroke + lead, 0.005),
            Board(0.0),
            EdgeLaw(zone=2 * lead),
            Numerics(dx=dx, far=far, gravity=0.0, grid_shift=(0.0, shift, 0.0)),
        )
        record, want = options.simulate(scene), wanted[length]
        where = ", blade between planes of nodes" if shift else ""
        yield Comparison(
            f"wedge in a slit, {1e3 * length:g} mm long, dx {1e3 * dx:g} mm{where}",
            "mean force on the faces, 5 to 8.5 mm deep [N]",
            mean(want.stroke, want.force),
            mean(record.stroke, record.resolved_face),
            0.05,
            f"finite elements of the same law, {want.unknowns} unknowns",
        )
        if dx < 2 * lead and not shift:
            yield Comparison(
                f"wedge in a slit, {1e3 * length:g} mm long, dx {1e3 * dx:g} mm",
                "energy released where the halves part, over the area, 4 to 8.5 mm deep [J/m^2]",
                rate(want.stroke, want.released),
                rate(record.stroke, record.unbooked + record.viscous),
                0.10,
                "finite elements: work less stored energy",
            )


CASES = [
    VerificationCase("cutting resistance", resistance, cost=50),
    VerificationCase("slicing", slicing, fast=False, cost=22),
    VerificationCase("wedge in a slit", slit, fast=False, cost=140),
    VerificationCase("invariance of the cut", invariance, fast=False, cost=25),
]
