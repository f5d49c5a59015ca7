"""What a stability map ends with: ``stress.json``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from calib.io.provenance import CommandLine, Commit, DeviceName, Seed, Versions
from calib.io.type_schema import Count, Fraction, NotNegative, Positive, keywords, one_of
from calib.io.typed_document import FLAT
from calib.simulation.workers import DIED
from mpm.scene.errors import BREAKDOWNS

RESULT_FILE = "stress.json"
REASONS = {
    **BREAKDOWNS,
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
    """One cell. Beside the keys that are listed it has the values that are varied, names with units where they have
    one.

    Attributes:
        name: The cell in words.
        family: Which values are varied together.
        values: A value that is varied.
        physical: Whether a user could ask for it and it must be stable.
        forced: Whether checks that would refuse it were passed by.
        status: How it ended.
        reason: Why it is not stable, a key of reasons; empty where it is, another word where it is unexplained.
        message: The reason in words.
        fraction: Part of the stroke that was reached.
        particle_steps: Particles times steps.
        particles: Particles.
        peak_N: Largest force [N].
        work_J: Work [J].
        energy_gain: Energy beyond what was put in, a fraction.
        momentum_residual: Part of the momentum balance that does not close.
        steps: Time steps.
        dt_s: Time step [s].
        wall_s: Run time [s].
    """

    name: str
    family: str
    values: Mapping[str, float | str | None] = field(metadata=FLAT)
    physical: bool
    forced: bool
    status: Annotated[str, one_of("stable", "refused", "stopped", "unexplained")]
    reason: str
    message: str
    fraction: Fraction | None = None
    particle_steps: NotNegative | None = None
    particles: NotNegative | None = None
    peak_N: float | None = None
    work_J: float | None = None
    energy_gain: float | None = None
    momentum_residual: float | None = None
    steps: NotNegative | None = None
    dt_s: Positive | None = None
    wall_s: NotNegative | None = None

    @property
    def stable(self) -> bool:
        """Whether it is."""
        return self.status == "stable"


@dataclass(frozen=True)
class PhysicalCells:
    """Cells that must be stable: how many, how many are, and the names of the others.

    Attributes:
        cells: How many.
        stable: How many of them are.
        not_stable: Names of the others.
    """

    cells: Count
    stable: Count
    not_stable: tuple[str, ...]


@dataclass(frozen=True)
class MapLimits:
    """Limits of the map.

    Attributes:
        dt_over_limit: Time step over its limit below which a physical cell must be stable.
        particle_steps: Particle steps that a cell may take.
        time_s: Time that a cell may take [s].
    """

    dt_over_limit: Positive
    particle_steps: Positive
    time_s: Positive


@dataclass(frozen=True, kw_only=True)
class StabilityMap:
    """Stability map.

    ``stress.json`` of ``cutcal stress``, and what ``cutcal stress --json`` prints.

    Attributes:
        command: Command line, or the call from Python, that made the document.
        seed: Seed of the particles, and of the search or the draws where there are any.
        cells: The map.
        reasons: What each reason means.
        limits: Limits.
        device: Device of the simulations.
        versions: Versions of cutcal, of Python and of the packages that a result depends on.
        git: Commit of the checkout that ran, with +changes where it was edited; null where cutcal was installed without
            one.
    """

    DOCUMENT: ClassVar[str] = "stress"
    KEYS: ClassVar[tuple[str, ...]] = (
        "command", "seed", "cells", "unexplained", "unexplained_cells", "physical", "counts", "reasons", "limits",
        "passed", "device", "versions", "git",
    )  # fmt: skip

    command: CommandLine
    seed: Seed
    cells: tuple[CellResult, ...]
    reasons: Mapping[str, str] = field(default_factory=lambda: dict(REASONS))
    limits: MapLimits
    device: DeviceName
    versions: Versions
    git: Commit

    @property
    def unexplained_cells(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(cell.name for cell in self.cells if cell.status == "unexplained")

    @property
    def unexplained(self) -> Count:
        """Cells that ended for no reason of the list."""
        return len(self.unexplained_cells)

    @property
    def physical(self) -> PhysicalCells:
        """Cells that must be stable."""
        bound = [cell for cell in self.cells if cell.physical]
        unstable = tuple(cell.name for cell in bound if not cell.stable)
        return PhysicalCells(len(bound), len(bound) - len(unstable), unstable)

    @property
    def counts(self) -> Mapping[str, Annotated[int, keywords(minimum=1)]]:
        """Number of cells by reason; stable for those that are."""
        return dict(Counter(cell.reason or "stable" for cell in self.cells))

    @property
    def passed(self) -> bool:
        """Whether no cell is unexplained and every physical one is stable."""
        return not self.unexplained_cells and not self.physical.not_stable
