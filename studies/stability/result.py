"""What a stability map ends with: ``stress.json``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from calib.io.typed_document import FLAT
from calib.simulation.workers import DIED

RESULT_FILE = "stress.json"
REASONS = {
    "not_finite": "a force, energy or position is no number",
    "inverted": "a particle was turned inside out",
    "left_grid": "food left the grid",
    "energy_growth": "more energy than was put in",
    "momentum": "momentum does not balance",
    "cfl": "the time step is refused",
    "refused": "the scene is refused",
    "too_long": "it needs more steps or time than a cell has",
    DIED: "its process was killed",
}
"""Why a cell is not stable; whatever else happens is unexplained."""


@dataclass(frozen=True, kw_only=True)
class CellResult:
    """One cell of the map.

    Attributes:
        name: The cell in words.
        family: Which values are varied together.
        values: Names with units and values of what is varied.
        physical: Whether a cut like this one exists, so that it must be stable.
        forced: Whether checks that would refuse it were passed by.
        status: ``stable``, ``refused``, ``stopped`` or ``unexplained``.
        reason: Why it is not stable: of :data:`REASONS`, another word where it is unexplained, empty where it is
            stable.
        message: The reason in words.
        fraction: Part of the stroke that was reached [-]; this and all that follows is None where nothing was run.
        particle_steps: Particles times steps; the rest but the time is None where the run was too long.
        particles: Particles.
        peak_N: Largest force [N].
        work_J: Work [J].
        energy_gain: Largest energy from nothing over what was put in [-].
        momentum_residual: Part of the momentum balance that does not close, over the largest force [-].
        steps: Time steps.
        dt_s: Time step [s].
        wall_s: Run time [s].
    """

    name: str
    family: str
    values: Mapping[str, float | str | None] = field(metadata=FLAT)
    physical: bool
    forced: bool
    status: str
    reason: str
    message: str
    fraction: float | None = None
    particle_steps: float | None = None
    particles: float | None = None
    peak_N: float | None = None
    work_J: float | None = None
    energy_gain: float | None = None
    momentum_residual: float | None = None
    steps: float | None = None
    dt_s: float | None = None
    wall_s: float | None = None

    @property
    def stable(self) -> bool:
        """Whether it is."""
        return self.status == "stable"


@dataclass(frozen=True)
class PhysicalCells:
    """Cells that must be stable: how many, how many are, and the names of the others."""

    cells: int
    stable: int
    not_stable: tuple[str, ...]


@dataclass(frozen=True)
class MapLimits:
    """Limits of the map.

    Attributes:
        dt_over_limit: Time step over its limit below which a physical cell must be stable [-].
        particle_steps: Particle steps that a cell may take.
        time_s: Time that a cell may take [s].
    """

    dt_over_limit: float
    particle_steps: float
    time_s: float


@dataclass(frozen=True, kw_only=True)
class StabilityMap:
    """A finished stability map.

    Attributes:
        command: Words of the command line.
        seed: Seed of the particles.
        cells: The cells.
        reasons: What each reason means.
        limits: What was allowed.
        device: Device of the runs.
        versions: Versions of cutcal, Python and packages.
        git: Commit of the checkout.
    """

    DOCUMENT: ClassVar[str] = "stress"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "seed", "cells", "unexplained", "unexplained_cells", "physical", "counts", "reasons", "limits",
        "passed", "device", "versions", "git",
    )  # fmt: skip

    command: tuple[str, ...]
    seed: int
    cells: tuple[CellResult, ...]
    reasons: Mapping[str, str] = field(default_factory=lambda: dict(REASONS))
    limits: MapLimits
    device: str
    versions: Mapping[str, str]
    git: str | None

    @property
    def unexplained_cells(self) -> tuple[str, ...]:
        """Names of the cells that ended for no known reason."""
        return tuple(cell.name for cell in self.cells if cell.status == "unexplained")

    @property
    def unexplained(self) -> int:
        """How many they are."""
        return len(self.unexplained_cells)

    @property
    def physical(self) -> PhysicalCells:
        """The cells that must be stable."""
        bound = [cell for cell in self.cells if cell.physical]
        unstable = tuple(cell.name for cell in bound if not cell.stable)
        return PhysicalCells(len(bound), len(bound) - len(unstable), unstable)

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells by reason; ``stable`` for those that are."""
        return dict(Counter(cell.reason or "stable" for cell in self.cells))

    @property
    def passed(self) -> bool:
        """Whether every end is explained and every physical cell is stable."""
        return not self.unexplained_cells and not self.physical.not_stable
