"""Cuts side by side are what they are alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpm.batch import simulate_together
from mpm.discretisation.capacity import batch_capacity
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Scene
from mpm.setup.setup import Setup
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM, WEDGE

CUT = replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=4e-3, mach=0.03))
SHAPE = CUT.food.shape
SCENES = (
    CUT,
    replace(CUT.with_material(E=3e6, loss_factor=0.3, R=80.0), motion=replace(CUT.motion, stroke=6e-3, retract=1e-3)),
    replace(CUT, food=replace(CUT.food, shape=replace(SHAPE, width=1.2 * SHAPE.width, height=1.1 * SHAPE.height))),
)
"""A wedge that cuts, rubs and lets the food flow; stiff food with a step of its own, cut deeper and left again; a
larger piece."""
BRITTLE = tuple(scene.with_material(tensile_strength=1e4, fracture_energy=20.0) for scene in SCENES)


def alone(scenes: tuple[Scene, ...]) -> list[ForceRecord]:
    """Each cut by itself, on one thread."""
    return [Simulation(scene, Runtime(threads=1)).run() for scene in scenes]


@pytest.mark.long
def test_a_thread_for_each_cut_changes_no_bit() -> None:
    """Three cuts that differ in food, size, time step and way, on two threads: bit for bit those of one run each; so
    are two of them in the fields of three, after the third has gone.
    """
    one = alone(SCENES)
    assert len({r.dt for r in one}) == 2 and len({r.steps for r in one}) == 2 and len({r.particles for r in one}) == 2
    for scenes, single in ((SCENES, one), (SCENES[1:], one[1:])):
        for record, want in zip(simulate_together(scenes, runtime=Runtime(threads=2)), single, strict=True):
            assert record.status == "done" and record.steps == want.steps
            for name in ("stroke", "edge", "face", "board", "momentum", "elastic", "plastic", "friction", "tilt"):
                np.testing.assert_array_equal(getattr(record, name), getattr(want, name))
            assert record.pieces is not None and want.pieces is not None
            assert record.pieces.uncut_area == want.pieces.uncut_area


@pytest.mark.slow
@pytest.mark.parametrize("scenes", [SCENES, pytest.param(BRITTLE, marks=pytest.mark.long)], ids=["flows", "breaks"])
def test_one_launch_for_all_cuts(scenes: tuple[Scene, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a GPU, where a launch does a step of all cuts and those that are through rest: the forces of each alone, to
    1e-9, and the momentum closes.
    """
    one = alone(scenes)
    monkeypatch.setattr(Setup, "threads", lambda self: 0)
    for record, want in zip(simulate_together(scenes, runtime=Runtime(threads=2)), one, strict=True):
        assert record.status == "done" and record.steps == want.steps and record.momentum_residual < 1e-9
        for part in ("edge", "face", "board"):
            np.testing.assert_allclose(getattr(record, part), getattr(want, part), atol=1e-9 * want.peak)
        assert (want.damage[-1] > 0) == (scenes is BRITTLE)
        np.testing.assert_allclose(record.damage[-1], want.damage[-1], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("threads", [pytest.param(1, marks=pytest.mark.long), 0])
def test_a_cut_that_breaks_down_stops_alone(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Food that leaves the grid ends its own run with its reason; the one beside it goes on to its end. Scenes of
    another kind, or in another precision, may be among them.
    """
    monkeypatch.setattr(Setup, "threads", lambda self: threads)
    tight = replace(
        SCENES[0], numerics=replace(CUT.numerics, room=1e-3), motion=replace(CUT.motion, stroke=SHAPE.height)
    )
    weak = replace(tight, knife=replace(WEDGE, spine=3e-2, angle=1.2))
    single = replace(CUT, numerics=replace(CUT.numerics, precision="f32"))
    records = simulate_together([CUT, weak, single], runtime=Runtime(threads=2))
    assert [r.status for r in records] == ["done", "left_grid", "done"]
    assert 0 < records[1].fraction < 1 and len(records[1].stroke) > 2
    np.testing.assert_allclose(records[2].peak, records[0].peak, rtol=1e-3)
    assert records[2].peak != records[0].peak


def test_fields_have_room_for_batches_of_few_sizes() -> None:
    """Up to 64 cuts the next power of two, then multiples of 64."""
    assert [batch_capacity(n) for n in (1, 2, 3, 16, 17, 64, 65, 200)] == [1, 2, 4, 16, 32, 64, 128, 256]
