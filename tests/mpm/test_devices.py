"""The kernels as a GPU runs them: on the CPU's threads with atomic additions, and on what devices there are."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import taichi as ti

from mpm.batch import simulate_together
from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.runtime import device as runtime
from mpm.scene import Scene
from mpm.scene.errors import SceneError
from mpm.setup.setup import Setup
from mpm.solver import Simulation
from tests.mpm.scenes import PRISM, WEDGE

SCENE = replace(PRISM, knife=WEDGE, motion=replace(PRISM.motion, stroke=4e-3, mach=0.03))
"""A wedge that cuts, rubs and lets the food flow."""
BRITTLE = SCENE.with_material(tensile_strength=1e4, fracture_energy=20.0)

DEVICES = pytest.mark.parametrize(("arch", "close"), [("cuda", 1e-6), ("vulkan", 1e-4)])
"""Each in the precision that it has."""


def apart(one: ForceRecord, two: ForceRecord) -> float:
    """Largest difference of the forces of edge, faces and board, over the largest force on the knife [-]."""
    parts = ("edge", "face", "board")
    return max(float(np.abs(getattr(one, p) - getattr(two, p)).max()) for p in parts) / one.peak


@pytest.mark.slow
@pytest.mark.parametrize("scene", [SCENE, pytest.param(BRITTLE, marks=pytest.mark.long)], ids=["flows", "breaks"])
@pytest.mark.parametrize(("precision", "close"), [("f64", 1e-9), ("f32", 1e-4)])
def test_the_layout_of_a_gpu_gives_the_same_cut(
    scene: Scene, precision: str, close: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One grid for all threads, atomic additions, a node for a row and a particle for a block: the same forces, but for
    the order of sums, and the momentum closes.
    """
    scene = replace(scene, numerics=replace(scene.numerics, precision=precision))
    one = Simulation(scene, Runtime(threads=1)).run()
    monkeypatch.setattr(Setup, "threads", lambda self: 0)
    other = Simulation(scene, Runtime(threads=2))
    assert other.state.atomic and other.state.lanes == 1
    record = other.run()
    assert record.status == one.status == "done" and len(record.stroke) == len(one.stroke)
    assert apart(one, record) < close and record.momentum_residual < close
    np.testing.assert_allclose(record.plastic, one.plastic, atol=close * one.work)
    assert (one.damage[-1] > 0) == (scene.food.material.tensile_strength is not None)


def test_a_gpu_that_is_vulkans_is_started_once_and_in_single_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    """Asked for as ``gpu`` it is started again without doubles, and not a third time for the next run, which would lose
    all kernels."""
    begun = []
    monkeypatch.setitem(runtime._state, "key", None)
    monkeypatch.setitem(runtime._state, "serial", runtime._state["serial"])
    monkeypatch.setattr(ti, "init", lambda **options: begun.append(options["default_fp"]))
    monkeypatch.setattr(ti.lang.impl, "current_cfg", lambda: SimpleNamespace(arch=ti.vulkan))
    first = runtime.start(Runtime("gpu"), "f64")
    assert begun == [ti.f64, ti.f32] and not runtime.adds_doubles()
    assert runtime.start(Runtime("gpu"), "f64") == first and len(begun) == 2


@pytest.mark.gpu
@DEVICES
def test_a_device_gives_the_curve_of_the_cpu(arch: str, close: float) -> None:
    """To 1e-6 of the peak in double precision, to 1e-4 in single, and the momentum closes as well; skipped where the
    device is not there."""
    one = Simulation(SCENE, Runtime(threads=1)).run()
    try:
        record = Simulation(SCENE, Runtime(arch)).run()
    except SceneError as e:
        pytest.skip(str(e))
    assert record.status == "done" and apart(one, record) < close and record.momentum_residual < close


@pytest.mark.gpu
@DEVICES
def test_a_device_does_many_cuts_in_one_launch(arch: str, close: float) -> None:
    """Three foods side by side have the curves of the CPU, each its own; skipped where the device is not there."""
    scenes = [SCENE, SCENE.with_material(E=3e6, R=80.0), SCENE.with_material(mu=0.6)]
    try:
        records = simulate_together(scenes, runtime=Runtime(arch))
    except SceneError as e:
        pytest.skip(str(e))
    for scene, record in zip(scenes, records, strict=True):
        one = Simulation(scene, Runtime(threads=1)).run()
        assert record.status == "done" and apart(one, record) < close and record.momentum_residual < close
