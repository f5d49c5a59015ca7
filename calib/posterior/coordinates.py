"""Coordinates in which an emulator sees a food: ratios of its properties, and what they mean for the cut.

A quasi-static cut has no scale of stress of its own: all stress-like properties times k give the force times k. So one
of them is the scale of the force, and the others enter as ratios. Three more axes hold one piece of physics each, so
that a process with a length for every axis can follow it: where the cut starts, how far the food flows on the way, and
how near to yield it is when the edge goes in.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.material.properties import property_of
from calib.problem.parameters import STRESS_LIKE, ParameterSet
from mpm.arrays import FloatArray

SCALES = ("R", "R_skin", "R_initiation", "E", "yield_stress", "tensile_strength")
"""Properties that may be the scale of the force, the first fitted one is."""
HEIGHT = "height"
"""The specimen's height among the factors of a product."""
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

    @cached_property
    def scale_name(self) -> str | None:
        """The fitted property that is the scale of the force; None where no stress-like one is fitted."""
        names = {property_of(n): n for n in self.parameters.names}
        return next((names[n] for n in SCALES if n in names and self.parameters[names[n]].log), None)

    def scale(self, z: FloatArray) -> FloatArray:
        """Logarithm of the scale of the force (q,) at internal coordinates (q, p); zero where nothing scales it.

        Where a stress-like property is fixed it does not scale along, and the scale itself is an axis too.
        """
        if self.scale_name is None:
            return np.zeros(len(z))
        out: FloatArray = z[:, self.parameters.names.index(self.scale_name)]
        return out

    def __call__(self, z: FloatArray) -> FloatArray:
        """Coordinates (q, d) at internal coordinates (q, p)."""
        rows, constants = self._linear
        linear = z @ rows.T + constants
        if self._start is None:
            return linear
        pressed, depth = self._start
        start = START_WORK * np.exp(z @ pressed[:-1] + pressed[-1])
        if depth is not None:
            start = start + np.exp(z @ depth[:-1] + depth[-1])
        return np.column_stack([linear, np.log(start)])

    def combinations(self, z: FloatArray) -> dict[str, FloatArray]:
        """Logarithms (q,) of the combinations that a cut sees, by their formula, those whose properties are known."""
        terms = {
            "E R / (yield_stress^2 h)": {"E": 1.0, "R": 1.0, "yield_stress": -2.0, HEIGHT: -1.0},
            "R / (yield_stress h)": {"R": 1.0, "yield_stress": -1.0, HEIGHT: -1.0},
            "yield_stress / E": {"yield_stress": 1.0, "E": -1.0},
            "tensile_strength / yield_stress": {"tensile_strength": 1.0, "yield_stress": -1.0},
            "R_skin / R": {"R_skin": 1.0, "R": -1.0},
            "R_initiation / R": {"R_initiation": 1.0, "R": -1.0},
            "initiation_depth / h": {"initiation_depth": 1.0, HEIGHT: -1.0},
        }
        rows = {formula: self._row(powers) for formula, powers in terms.items()}
        return {formula: z @ row[:-1] + row[-1] for formula, row in rows.items() if row is not None}

    @cached_property
    def _linear(self) -> tuple[FloatArray, FloatArray]:
        """Axes that are linear in the internal coordinates, and their constants: (d, p) and (d,)."""
        unit = np.eye(len(self.parameters) + 1)
        of = {p.name: unit[k] for k, p in enumerate(self.parameters)}
        fixed_stress = any(self.fixed.get(n, 0.0) > 0.0 for n in STRESS_LIKE)
        rows = []
        for p in self.parameters:
            if p.name == self.scale_name:
                rows += [of[p.name]] if fixed_stress else []
            elif property_of(p.name) in STRESS_LIKE and p.log and self.scale_name is not None:
                rows.append(of[p.name] - of[self.scale_name])
            else:
                rows.append(of[p.name])
        start = self._start_name
        for powers in (
            {"E": 1.0, "R": 1.0, "yield_stress": -2.0, HEIGHT: -1.0},
            {"E": 0.5, start: 0.5, "yield_stress": -1.0, HEIGHT: -0.5},
        ):
            row = self._row(powers)
            rows += [] if row is None else [row]
        found = np.array(rows).reshape(-1, len(self.parameters) + 1)
        return found[:, :-1], found[:, -1]

    @cached_property
    def _start(self) -> tuple[FloatArray, FloatArray | None] | None:
        """Linear forms (p + 1,) of the logarithms of what the edge presses in before it cuts, and of the depth of the
        start, both over the height."""
        pressed = self._row({self._start_name: 1.0, "E": -1.0, HEIGHT: -1.0})
        return None if pressed is None else (pressed, self._row({"initiation_depth": 1.0, HEIGHT: -1.0}))

    @property
    def _start_name(self) -> str:
        """The property that is the work of a start."""
        return next((n for n in ("R_skin", "R_initiation") if self._row({n: 1.0}) is not None), "R")

    def _row(self, powers: Mapping[str, float]) -> FloatArray | None:
        """Linear form (p + 1,) of the logarithm of a product of powers; None where a property is not known."""
        fitted = {property_of(p.name): k for k, p in enumerate(self.parameters) if p.log}
        row = np.zeros(len(self.parameters) + 1)
        for name, power in powers.items():
            if name in fitted:
                row[fitted[name]] += power
            elif name == HEIGHT or self.fixed.get(name, 0.0) > 0.0:
                row[-1] += power * math.log(self.height if name == HEIGHT else self.fixed[name])
            else:
                return None
        return row
