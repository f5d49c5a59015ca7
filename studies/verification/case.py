"""A case of the verification, what is common to all, and the list of them."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from mpm.output.record import ForceRecord
from mpm.runtime import Runtime
from mpm.scene import Numerics, Scene
from mpm.scene.material import Material
from mpm.scene.shapes import Shape
from mpm.solver import Simulation
from studies.verification.free_body import AT_REST, FreeBody, InitialState
from studies.verification.result import Comparison

PARTS = (
    "constitutive_point",
    "motion",
    "contact",
    "bending",
    "pressing",
    "cutting",
    "fracture.splitting",
    "fracture.surface_work",
    "fracture.wedge_cuts",
    "fracture.friction",
    "fem_reference",
)
"""Modules with cases, in the order of the table."""


@dataclass(frozen=True)
class SuiteOptions:
    """What is common to all cases.

    Attributes:
        quick: Whether coarse versions are run.
        seed: Seed of the particles.
        arch: Taichi device.
    """

    quick: bool = False
    seed: int = 0
    arch: str = "cpu"

    @property
    def runtime(self) -> Runtime:
        """Device of the simulations."""
        return Runtime(self.arch, threads=1)

    def body(
        self,
        shape: Shape,
        material: Material,
        grid: Numerics,
        initial: InitialState = AT_REST,
        *,
        board: float | None = None,
    ) -> FreeBody:
        """A free body of this seed, on this device.

        Args:
            shape: Outline.
            material: Its constants.
            grid: Grid; its seed is not used.
            initial: Where and how fast the particles begin.
            board: Friction on the board [-]; without it there is no board.

        Returns:
            The body.
        """
        return FreeBody(shape, material, replace(grid, seed=self.seed), initial, board=board, runtime=self.runtime)

    def simulate(self, scene: Scene) -> ForceRecord:
        """A cut or press of this seed, on this device."""
        return Simulation(replace(scene, numerics=replace(scene.numerics, seed=self.seed)), self.runtime).run()


@dataclass(frozen=True)
class VerificationCase:
    """A function that makes comparisons.

    Attributes:
        name: Its name in the table.
        run: The function.
        fast: Whether it belongs to the quick part.
        cost: About the time that it takes [s]: long ones start first.
    """

    name: str
    run: Callable[[SuiteOptions], Iterator[Comparison]]
    fast: bool = True
    cost: float = 5.0


def cases() -> list[VerificationCase]:
    """All cases in the order of the table."""
    return [case for part in PARTS for case in importlib.import_module(f"studies.verification.{part}").CASES]
