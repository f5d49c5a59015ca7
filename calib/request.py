"""What a calibration is asked to do, and what is decided before its first simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib.conditioning import Conditioned
from calib.materials import FoodSpec
from calib.objective import ErrorModel, Objective
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
        gain_sd: Relative standard deviation of the sensor's gain [-]; None for what its kind suggests.
        lag_sd: Standard deviation of the sensor's delay [s], or None.
        scaled: Whether the search has a factor for the width of the specimen, as it has in a fit of several.
        u_num: Folder of a convergence study whose numerical uncertainty enters the likelihood, or None.
        errors: How far a right model may be from the trace.
        sample: Whether the posterior is sampled beside its profiles.
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
    gain_sd: float | None = None
    lag_sd: float | None = None
    scaled: bool = False
    u_num: Path | None = None
    errors: ErrorModel = field(default_factory=ErrorModel)
    sample: bool = False
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
