"""One line of the verification table, and the list of all cases."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from studies.verification.free_body import FreeBody

PARTS = ("constitutive_point", "motion", "contact", "bending", "pressing", "cutting", "fem_reference")
"""Modules with cases, in the order of the table."""


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        case: What is simulated.
        quantity: What is compared, with its unit.
        expected: Value of the closed form or the reference; with ``least`` the least value that passes.
        got: What the solver gives.
        error: Difference over the expected value, or the difference itself where that is 0 [-].
        tolerance: Largest error that passes [-].
        source: Where the expected value comes from.
        least: Whether more is also right: orders of convergence.
    """

    case: str
    quantity: str
    expected: float
    got: float
    tolerance: float
    source: str
    least: bool = False

    @property
    def error(self) -> float:
        """See the class."""
        difference = self.got - self.expected
        return difference / abs(self.expected) if self.expected else difference

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return -self.error <= self.tolerance if self.least else abs(self.error) <= self.tolerance  # false for nan

    def as_dict(self) -> dict[str, Any]:
        """For verify.json."""
        numbers = {"got": self.got, "error": self.error}
        finite = {name: value if np.isfinite(value) else None for name, value in numbers.items()}
        return {**vars(self), **finite, "passed": self.passed}


@dataclass(frozen=True)
class How:
    """What is common to all cases. Attributes: quick, for coarse versions; seed of the particles; arch, Taichi device."""

    quick: bool = False
    seed: int = 0
    arch: str = "cpu"

    @property
    def runtime(self) -> Runtime:
        """Device of the simulations."""
        return Runtime(self.arch, threads=1)

    def body(self, shape: Shape, material: Material, grid: Numerics, **options: Any) -> FreeBody:
        """A free body of this seed, on this device; see :class:`studies.verification.free_body.FreeBody`."""
        return FreeBody(shape, material, replace(grid, seed=self.seed), runtime=self.runtime, **options)

    def simulate(self, scene: Scene) -> ForceRecord:
        """A cut or press of this seed, on this device."""
        return Simulation(replace(scene, numerics=replace(scene.numerics, seed=self.seed)), self.runtime).run()


@dataclass(frozen=True)
class Case:
    """A function that makes rows.

    Attributes: name; run; fast, whether it belongs to the quick part; cost, about the seconds that it takes: long ones start first.
    """

    name: str
    run: Callable[[How], Iterator[Row]]
    fast: bool = True
    cost: float = 5.0


def cases() -> list[Case]:
    """All cases in the order of the table."""
    return [case for part in PARTS for case in importlib.import_module(f"studies.verification.{part}").CASES]
