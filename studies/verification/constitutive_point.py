"""The material laws at one point."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mpm.runtime import start
from mpm.scene.material import Material
from studies.verification.case import Case, How, Row

UNIT = Material(E=1.0, nu=0.35, rho=1.0)
NOMINAL = {0.9: -0.10507, 0.7: -0.35968, 0.5: -0.72098}
"""Nominal stress over E at these stretches, nu = 0.35: root of the lateral stress of the corotated law, by hand."""


def elastic(how: How) -> Iterator[Row]:
    """Uniaxial stress and objectivity of the corotated law."""
    from studies.verification.point_kernels import Point

    start(how.runtime, "f64")
    point = Point(UNIT.shear, UNIT.lame)
    for stretch, want in NOMINAL.items():
        side = brentq(lambda s, x=stretch: point.stress(np.diag([x, s, s]))[1][1, 1], 0.9, 1.4)
        got = point.stress(np.diag([stretch, side, side]))[1][0, 0] / stretch
        yield Row(
            f"uniaxial stress at stretch {stretch:g}",
            "nominal stress over E [-]",
            want,
            float(got),
            1e-4,
            "closed form of the corotated law",
        )
    turn = Rotation.from_rotvec([0.3, -1.2, 0.8]).as_matrix()
    f = np.eye(3) + np.array([[0.1, 0.2, 0.0], [-0.1, 0.05, 0.1], [0.0, 0.15, -0.2]])
    tau, turned = point.stress(f)[1], point.stress(turn @ f)[1]
    yield Row(
        "turned point",
        "stress against the turned stress, over E [-]",
        0.0,
        float(np.abs(turned - turn @ tau @ turn.T).max()),
        1e-12,
        "objectivity",
    )


def plastic(how: How) -> Iterator[Row]:
    """J2 flow in simple shear and on a random path."""
    from studies.verification.point_kernels import Point

    start(how.runtime, "f64")
    for ratio in (0.003, 0.01):
        point, f = Point(UNIT.shear, UNIT.lame, ratio), np.eye(3)
        step = np.eye(3) + np.array([[0, ratio / 50, 0], [0, 0, 0], [0, 0, 0]])
        for _ in range(400):
            f, tau = point.stress(step @ f)
        yield Row(
            f"simple shear, yield stress {ratio:g} E",
            "shear stress over yield stress [-]",
            1 / math.sqrt(3),
            float(tau[0, 1] / ratio),
            3e-3,
            "von Mises",
        )
    point, f, rng, worst, volume = Point(UNIT.shear, UNIT.lame, 0.05), np.eye(3), np.random.default_rng(0), 0.0, 0.0
    for _ in range(50 if how.quick else 300):
        trial = (np.eye(3) + rng.uniform(-0.03, 0.03, (3, 3))) @ f
        f, tau = point.stress(trial)
        dev = tau - np.trace(tau) / 3 * np.eye(3)
        worst = max(worst, math.sqrt(1.5 * float((dev**2).sum())) / 0.05)
        volume = max(volume, abs(np.linalg.det(f) / np.linalg.det(trial) - 1))
    yield Row(
        "random path of a flowing point",
        "largest von Mises stress over yield stress [-]",
        1.0,
        worst,
        1e-3,
        "yield surface of the law itself",
    )
    yield Row(
        "random path of a flowing point",
        "largest change of volume by the return [-]",
        0.0,
        volume,
        1e-6,
        "J2 flow keeps the volume",
    )


def softening(how: How) -> Iterator[Row]:
    """The energy that damage dissipates, over the width of the crack band."""
    from studies.verification.point_kernels import Point

    start(how.runtime, "f64")
    point = Point(1.0, 1.0)
    modulus, strength, toughness = 3e6, 2e5, 100.0
    eps0 = strength / modulus
    for dx in (1e-3, 2e-3):
        band = 2.5 * dx
        eps_f = eps0 / 2 + toughness / (strength * band)
        strain = np.concatenate([np.linspace(0, eps0, 20), eps0 + (eps_f - eps0) * np.linspace(0, 14, 300)[1:]])
        stress = [(1 - point.damage(e, eps0, eps_f)) * modulus * e for e in strain]
        yield Row(
            f"softening, dx {dx * 1e3:g} mm",
            "energy per crack area [J/m^2]",
            toughness,
            float(np.trapezoid(stress, strain) * band),
            0.01,
            "fracture energy (Oliver 1989)",
        )


CASES = [Case("elastic law", elastic), Case("plastic law", plastic), Case("damage law", softening)]
