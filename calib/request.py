"""What a calibration is asked to do, and what is decided before its first simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib.conditioning import Conditioned
from calib.materials import FoodSpec
from calib.objective import Objective
from calib.scenes import Sizing
from mpm.scene import Scene


@dataclass(frozen=True)
class Request:
    """What to calibrate.

    Attributes:
        food: The food with its literature ranges.
        trace: CSV of the cut.
        air: CSV of the same motion without food, or None.
        columns: ``time_col``, ``force_col``, ``position_col``, ``sign`` for reading the CSVs.
        knife: Name or YAML file.
        speed: Knife speed [m/s], or None.
        t_end: End of the record [s], or None.
        sizing: What is known of the specimen.
        fit: Names of the fitted properties; None for the food's default.
        dx: Cell size [m], or None.
        budget: Largest number of simulations.
        seed: Seed of particles and search.
        arch: Device.
        command: Command line, for provenance.
    """

    food: FoodSpec
    trace: Path
    air: Path | None = None
    columns: Mapping[str, Any] = field(default_factory=dict)
    knife: str = "kitchen"
    speed: float | None = None
    t_end: float | None = None
    sizing: Sizing = field(default_factory=Sizing)
    fit: tuple[str, ...] | None = None
    dx: float | None = None
    budget: float = 100
    seed: int = 0
    arch: str = "cpu"
    command: tuple[str, ...] = ()


@dataclass(frozen=True)
class Setup:
    """Everything that is decided before the first simulation."""

    curve: Conditioned
    fine: Scene
    coarse: Scene
    objective: Objective
    assumed: list[str]
    kept: tuple[str, ...] = ()
    air_sha256: str | None = None
