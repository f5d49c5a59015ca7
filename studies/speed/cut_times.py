"""Run time and errors of the default cut, and of the same with one thing changed."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from calib.trace.filters import N_STROKE, filter_simulated
from calib.validation.metrics import compare
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Scene
from studies.speed.result import Ablation, CutErrors, DefaultCut
from studies.speed.timing import Session, node_count

SIZE_ABLATIONS = ("cells of two thirds", "27 particles a cell", "whole instead of a quarter")
"""Ablations that change particles times steps and nothing else that costs time."""


@dataclass(frozen=True)
class Variant:
    """A way of simulating the same cut. Attributes: name; scene; runtime; physics: whether it is another food."""

    name: str
    scene: Scene
    runtime: Runtime
    physics: bool = False


def default_cut(session: Session, scene: Scene, finest: float) -> tuple[DefaultCut, ForceRecord]:
    """Least run time of the default cut, and its errors against the finest cells.

    Args:
        session: What all measurements share.
        scene: The default cut.
        finest: Cell size of the reference [m].

    Returns:
        What was measured, and the record of the reference.
    """
    session.say(f"reference with cells of {finest * 1e3:g} mm")
    reference = session.kept.get(replace(scene, numerics=replace(scene.numerics, dx=finest)), session.runtime).run()
    session.kept.drop()
    began = time.monotonic()
    cut = session.kept.get(scene, session.runtime)
    cut.run()
    first = time.monotonic() - began
    record = min((cut.run() for _ in range(session.repeats)), key=lambda one: one.wall)
    found = DefaultCut(
        wall_s=record.wall,
        first_run_s=first,
        particles=record.particles,
        steps=record.steps,
        nodes=node_count(cut),
        reference_dx_m=finest,
        reference_wall_s=reference.wall,
        errors=cut_errors(record, reference),
    )
    errors = found.errors
    session.say(f"default cut: {found.wall_s:.2f} s, work {errors.work_error:+.1%}, NRMSE {errors.nrmse:.3f}")
    return found, reference


def cut_errors(record: ForceRecord, reference: ForceRecord) -> CutErrors:
    """Errors of peak, work and curve of a cut against a reference."""
    end = min(record.stroke[-1], reference.stroke[-1])
    grid = np.linspace(0.0, end, N_STROKE)
    fine, ours = (filter_simulated(grid, r.stroke, r.resolved) for r in (reference, record))
    return CutErrors(
        peak_error=float(ours.max() / fine.max() - 1),
        work_error=record.work / reference.work - 1,
        nrmse=compare(grid, fine, ours).nrmse,
    )


def variants(scene: Scene, screening: Scene, runtime: Runtime) -> list[Variant]:
    """The default cut with one thing changed.

    Args:
        scene: The default cut.
        screening: The same as a fit screens with it.
        runtime: Device and threads of the default cut.

    Returns:
        The variants.
    """
    num, motion, material = scene.numerics, scene.motion, scene.food.material

    def numerics(name: str, **change: Any) -> Variant:
        return Variant(name, replace(scene, numerics=replace(num, **change)), runtime)

    def stiffness(name: str, k: float) -> Variant:
        names = ("E", "yield_stress", "R", "R_initiation", "R_skin")
        values = {n: k * v for n in names if (v := getattr(material, n)) is not None}
        return Variant(name, scene.with_material(**values), runtime, physics=True)

    return [
        Variant("screening: one cell to the zone, twice the speed", screening, runtime),
        numerics("cells of two thirds", dx=num.dx * 2 / 3),
        numerics("single precision", precision="f32"),
        numerics("whole instead of a quarter", mirror=False),
        numerics("27 particles a cell", ppc=3),
        numerics("its own size of empty grid on either side", room=2.0),
        numerics("half the time step", safety=num.safety / 2),
        Variant("half the speed", replace(scene, motion=replace(motion, mach=motion.mach / 2)), runtime),
        Variant("twice the speed", replace(scene, motion=replace(motion, mach=motion.mach * 2)), runtime),
        stiffness("ten times as stiff", 10.0),
        stiffness("a tenth as stiff", 0.1),
    ]


def ablation(session: Session, scene: Scene, variant: Variant, reference: ForceRecord) -> Ablation:
    """A variant and the default cut in turns.

    Args:
        session: What all measurements share.
        scene: The default cut.
        variant: The variant.
        reference: Record of the reference.

    Returns:
        What was measured of the variant.
    """
    kept = session.kept
    began = time.monotonic()
    simulation = kept.get(variant.scene, variant.runtime)
    simulation.run()
    first = time.monotonic() - began
    same = variant.runtime == session.runtime and variant.scene.numerics.precision == scene.numerics.precision
    ours: list[ForceRecord] = []
    other: list[ForceRecord] = []
    for _ in range(session.repeats):
        for records, one, runtime in ((other, variant.scene, variant.runtime), (ours, scene, session.runtime)):
            if not same:  # the other one has stopped the runtime: the first run compiles and does not count
                kept.drop()
                kept.get(one, runtime).run()
            records.append(kept.get(one, runtime).run())
    record = min(other, key=lambda r: r.wall)
    return Ablation(
        name=variant.name,
        status=record.status,
        wall_s=record.wall,
        first_run_s=first,
        time_ratio=record.wall / min(r.wall for r in ours),
        particles=record.particles,
        steps=record.steps,
        nodes=node_count(simulation),
        errors=None if variant.physics else cut_errors(record, reference),
    )


def size_exponent(cut: DefaultCut, ablations: Sequence[Ablation]) -> float:
    """Exponent with which the time grows with particles times steps, over cells and particles a cell [-]."""
    rows = [one for one in ablations if one.name in SIZE_ABLATIONS]
    size = np.log([cut.particles * cut.steps, *(one.particles * one.steps for one in rows)])
    spent = np.log([1.0, *(one.time_ratio for one in rows)])
    return float(np.polyfit(size, spent, 1)[0])
