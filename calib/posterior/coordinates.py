"""Coordinates in which an emulator sees a food: ratios of its properties, and what they mean for the cut.

A quasi-static cut has no scale of stress of its own: all stress-like properties times k give the force times k. So one
of them is the scale of the force, and the others enter as ratios. Three more axes hold one piece of physics each, so
that a process with a length for every axis can follow it: where the cut starts, how far the food flows on the way, and
how near to yield it is when the edge goes in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.problem.parameters import STRESS_LIKE, ParameterSet, property_of
from mpm.arrays import FloatArray

SCALES = ("R", "R_skin", "R_initiation", "E", "yield_stress", "tensile_strength")
"""Properties that may be the scale of the force, the first fitted one is."""
START_WORK = 2.0
"""Work of surface over modulus and height which the edge presses in before it cuts, times this [-]."""


@dataclass(frozen=True)
class Coordinates:
    """Coordinates of a food, from the internal ones of its fitted parameters.

    Attributes:
        parameters: The fitted parameters.
        fixed: Values [SI] of properties that are not fitted, by name; those that are missing or zero are left out.
        height: Height of the specimen [m].
    """

    parameters: ParameterSet
    fixed: Mapping[str, float]
    height: float

    @property
    def scale_name(self) -> str | None:
        """The fitted property that is the scale of the force; None where no stress-like one is fitted."""
        names = {property_of(n): n for n in self.parameters.names}
        return next((names[n] for n in SCALES if n in names and self.parameters[names[n]].log), None)

    def scale(self, z: FloatArray) -> FloatArray:
        """Logarithm of the scale of the force (q,) at internal coordinates (q, p); zero where nothing scales it.

        It is one only where all stress-like properties that matter are fitted: a fixed one does not scale along, and
        its ratio to the scale is an axis then.
        """
        name = self.scale_name
        if name is None:
            return np.zeros(len(z))
        out: FloatArray = z[:, self.parameters.names.index(name)]
        return out

    def __call__(self, z: FloatArray) -> FloatArray:
        """Coordinates (q, d) at internal coordinates (q, p)."""
        scale = self.scale(z)
        axes: list[FloatArray] = []
        for k, p in enumerate(self.parameters):
            if p.name == self.scale_name:
                if self._fixed_stress():
                    axes.append(z[:, k])
            elif property_of(p.name) in STRESS_LIKE and p.log:
                axes.append(z[:, k] - scale)
            else:
                axes.append(z[:, k])
        return np.column_stack([*axes, *self._physics(z)])

    def combinations(self, z: FloatArray) -> dict[str, FloatArray]:
        """Logarithms (q,) of the combinations that a cut sees, by their formula, those whose properties are known."""
        h = np.log(self.height)
        modulus, strength = self._log(z, "E"), self._log(z, "yield_stress")
        work, start, depth = self._log(z, "R"), self._log(z, "R_skin", "R_initiation"), self._log(z, "initiation_depth")
        tensile = self._log(z, "tensile_strength")
        terms = {
            "E R / (yield_stress^2 h)": ((modulus, 1.0), (work, 1.0), (strength, -2.0), (h, -1.0)),
            "R / (yield_stress h)": ((work, 1.0), (strength, -1.0), (h, -1.0)),
            "yield_stress / E": ((strength, 1.0), (modulus, -1.0)),
            "tensile_strength / yield_stress": ((tensile, 1.0), (strength, -1.0)),
            "R_start / R": ((start, 1.0), (work, -1.0)),
            "initiation_depth / h": ((depth, 1.0), (h, -1.0)),
        }
        out = {}
        for formula, parts in terms.items():
            known = [power * np.broadcast_to(log, len(z)) for log, power in parts if log is not None]
            if len(known) == len(parts):
                out[formula] = np.sum(known, axis=0)
        return out

    def _fixed_stress(self) -> bool:
        """Whether a stress-like property keeps its value whatever the scale."""
        return any(self.fixed.get(n, 0.0) > 0.0 for n in STRESS_LIKE)

    def _log(self, z: FloatArray, *names: str) -> FloatArray | None:
        """Logarithm (q,) of the first of some properties that is fitted or fixed; None where none is."""
        fitted = {property_of(p.name): k for k, p in enumerate(self.parameters) if p.log}
        for name in names:
            if name in fitted:
                out: FloatArray = z[:, fitted[name]]
                return out
            if self.fixed.get(name, 0.0) > 0.0:
                return np.full(len(z), np.log(self.fixed[name]))
        return None

    def _physics(self, z: FloatArray) -> list[FloatArray]:
        """The axes of physics (q,), those whose properties are known."""
        modulus, strength = self._log(z, "E"), self._log(z, "yield_stress")
        work, start = self._log(z, "R"), self._log(z, "R_skin", "R_initiation", "R")
        depth, h = self._log(z, "initiation_depth"), np.log(self.height)
        out = []
        if modulus is not None and start is not None:
            pressed = START_WORK * np.exp(start - modulus - h)
            out.append(np.log(pressed + (0.0 if depth is None else np.exp(depth - h))))
        if modulus is not None and strength is not None and work is not None:
            out.append(modulus + work - 2.0 * strength - h)
        if modulus is not None and strength is not None and start is not None:
            out.append(0.5 * (modulus + start - h) - strength)
        return out
