"""A food between two plates as a quasi-linear viscoelastic body that may be damaged and is not held by the plate.

The instantaneous stress is E (exp(b e) - 1) / b at the strain e. It relaxes by a Prony series: the stress is the
integral of the relaxation over the rise of the instantaneous stress (quasi-linear viscoelasticity, Fung 1993,
Biomechanics, 2nd ed., section 7.6). The series is a spectrum: times in decades, shares in proportion to a power of
their time; at power 0 it is Fung's box spectrum. Damage is continuous: it grows with the work that goes through the
body, in loading and unloading (Miehe 1995, Eur. J. Mech. A 14:697-720), to a largest value. The plate does not pull:
where the body would, it recovers freely, without load.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.errors import CurveError
from calib.io.type_schema import Fraction, Positive
from calib.texture.prony_series import PronySeries
from mpm.arrays import FloatArray

TIMES = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
"""Relaxation times of the spectrum [s]: from a tenth of the shortest time that bites show to ten times the longest."""
REFERENCE = 0.5
"""Strain whose elastic work is the unit of the work that damages [-]: that of one bite."""


@dataclass(frozen=True)
class QuasiLinearLaw:
    """Law of a food in one direction of compression.

    Attributes:
        E_Pa: Instantaneous Young's modulus [Pa].
        stiffening: Exponent b of the instantaneous stress [-].
        equilibrium: Share of the modulus that remains in the end [-].
        power: Power of the spectrum: a share is in proportion to its time to the power of minus this [-].
        damage: Largest damage: the part of the stress that is lost when much work has gone through [-].
    """

    E_Pa: Positive
    stiffening: Positive
    equilibrium: Fraction
    power: float
    damage: Fraction

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            CurveError: One is impossible.
        """
        if not (self.E_Pa > 0.0 and self.stiffening > 0.0):
            raise CurveError(f"a law needs a modulus and a stiffening above 0, not {self.E_Pa} and {self.stiffening}")
        if not (0.0 <= self.equilibrium <= 1.0 and 0.0 <= self.damage <= 1.0):
            raise CurveError(f"equilibrium and damage lie between 0 and 1, not {self.equilibrium} and {self.damage}")

    @cached_property
    def series(self) -> PronySeries:
        """The spectrum as a Prony series."""
        weights = np.array(TIMES) ** -self.power
        shares = weights / weights.sum() * (1.0 - self.equilibrium)
        return PronySeries(tuple(float(x) for x in shares), TIMES)

    def elastic(self, strain: FloatArray) -> FloatArray:
        """Instantaneous stress without damage at strains; shape (n,) [Pa]."""
        return self.E_Pa * np.expm1(self.stiffening * strain) / self.stiffening

    def work(self, strain: FloatArray) -> FloatArray:
        """Elastic work over that at the reference strain, at strains; shape (n,) [-]."""
        b = self.stiffening
        density = np.expm1(b * strain) / b - strain
        return np.asarray(density / (math.expm1(b * REFERENCE) / b - REFERENCE))

    def stress(self, time: FloatArray, strain: FloatArray) -> FloatArray:
        """Stress under a plate, nowhere below zero.

        A step in time is exact for an instantaneous stress that is straight between samples. Where the plate goes back
        faster than the body recovers, the body is free: its instantaneous stress is the one at which it carries no
        load.

        Args:
            time: Times, increasing [s], shape (n,).
            strain: Strain to which the plate presses at them [-], shape (n,); the body is at rest at the first.

        Returns:
            Engineering stress, compression positive [Pa], shape (n,).
        """
        return stresses([self], time[None], strain[None])[0]


def stresses(laws: Sequence[QuasiLinearLaw], time: FloatArray, strain: FloatArray) -> FloatArray:
    """Stress of several laws, each under its own plate; as :meth:`QuasiLinearLaw.stress`.

    Args:
        laws: The laws, m of them.
        time: Times of each, increasing [s], shape (m, n).
        strain: Strains of each [-], shape (m, n).

    Returns:
        Stress of each [Pa], shape (m, n).
    """
    shares = np.array([law.series.shares for law in laws])
    equilibrium = np.array([law.equilibrium for law in laws])
    damage = np.array([law.damage for law in laws])
    elastic = np.stack([law.elastic(e) for law, e in zip(laws, strain, strict=True)], axis=1)
    work = np.stack([law.work(e) for law, e in zip(laws, strain, strict=True)], axis=1)
    step = np.diff(time).T[:, :, None] / np.array(TIMES)
    decay, lead = np.exp(-step), -np.expm1(-step) / step * shares
    leads = lead.sum(axis=2)
    held = np.zeros(shares.shape)
    out = np.zeros(strain.T.shape)
    now, through = np.zeros(len(laws)), np.zeros(len(laws))  # instantaneous stress; work that has gone through
    for k in range(len(step)):
        past = decay[k] * held
        spent = through + np.abs(work[k + 1] - work[k])
        pressed = elastic[k + 1] * (1.0 + damage * np.expm1(-spent))
        # without load: equilibrium * free + past + leads * (free - now) = 0
        free = (leads[k] * now - past.sum(axis=1)) / (equilibrium + leads[k])
        touched = pressed >= free
        through = np.where(touched, spent, through)
        new = np.where(touched, pressed, free)
        held = past + lead[k] * (new - now)[:, None]
        now = new
        out[k + 1] = np.maximum(equilibrium * now + held.sum(axis=1), 0.0)
    return np.asarray(out.T)
