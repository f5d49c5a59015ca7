"""Scenes that several tests cut: thin blade and wedge, and a prism of soft flesh."""

from __future__ import annotations

import numpy as np

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import EdgeLaw, Food, Knife, Motion, Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation

THIN = Knife("thin", 0.2e-3, np.deg2rad(1.0), 0.05, 0.4)
WEDGE = Knife("wedge", 2e-3, np.deg2rad(11.0), 0.0104, 0.2)
FLESH = Material(E=1e6, nu=0.35, rho=1000, yield_stress=2e5, R=300.0, R_initiation=300.0)
PRISM = Scene(
    Food(Shape("block", 0.03, 0.024, 0.024), FLESH),
    THIN,
    Motion(0.018, 0.01),
    edge=EdgeLaw(zone=3e-3),
    numerics=Numerics(dx=3e-3),
)


def cut(scene: Scene) -> ForceRecord:
    """Run a scene on one thread and insist on a sound end."""
    record = Simulation(scene, Runtime(threads=1)).run()
    assert record.status == "done"
    assert record.counters == {"inverted": 0, "outside": 0}
    assert record.momentum_residual < 1e-10
    return record
