"""What a calibration is asked to do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from calib.formats.reader import split_address
from calib.material.food import FoodSpec
from calib.material.scene import Sizing
from calib.problem.target import ErrorModel
from calib.trace.baselines import CONSTANT
from calib.trace.trace import Trace, read_trace


@dataclass(frozen=True)
class Request:
    """What to calibrate.

    Attributes:
        food: The food with its literature ranges.
        trace: The cut, or its file.
        air: The same motion without food, or its file, or None.
        columns: How files are read: attributes of :class:`calib.trace.recorded.Reading`.
        knife: Name or YAML file.
        speed: Knife speed [m/s], or None.
        board_z: Reading of the knife's height, or of its depth, with the edge on the board [m], or None.
        t_end: End of the record [s], or None.
        baseline: What is subtracted without an air run, one of ``calib.trace.baselines.BASELINES``.
        cut: Number of the cut in a record of several, from 1; ``whole`` for a record that is one; None for its only.
        sizing: What is known of the specimen.
        fit: Names of the fitted properties; None for the food's default.
        dx: Cell size [m], or None.
        gain_sd: Relative standard deviation of the sensor's gain [-]; None for what its kind suggests.
        lag_sd: Standard deviation of the sensor's delay [s], or None.
        bandwidth: Cut-off of the low-pass that the force went through [Hz]; None for what its kind suggests.
        withdrawal: Whether the way up is fitted beside the way down.
        scaled: Whether the search has a factor for the width of the specimen, as it has in a fit of several.
        u_num: Folder of a convergence study whose numerical uncertainty enters the likelihood, or None.
        start_from: Folder of an earlier calibration of the same food and knife, or of several, at whose closest foods
            the search begins, or None.
        errors: How far a right model may be from the trace.
        sample: Whether the posterior over all plausible foods is sampled, in place of a search for the best one.
        budget: Largest number of simulations.
        seed: Seed of particles and search.
        arch: Device.
        command: Command line, for provenance.
    """

    food: FoodSpec
    trace: Path | Trace
    air: Path | Trace | None = None
    columns: Mapping[str, Any] = field(default_factory=dict)
    knife: str = "kitchen"
    speed: float | None = None
    board_z: float | None = None
    t_end: float | None = None
    baseline: str = CONSTANT
    cut: int | str | None = None
    sizing: Sizing = field(default_factory=Sizing)
    fit: tuple[str, ...] | None = None
    dx: float | None = None
    gain_sd: float | None = None
    lag_sd: float | None = None
    bandwidth: float | None = None
    withdrawal: bool = False
    scaled: bool = False
    u_num: Path | None = None
    start_from: Path | None = None
    errors: ErrorModel = field(default_factory=ErrorModel)
    sample: bool = False
    budget: float = 100
    seed: int = 0
    arch: str = "cpu"
    command: tuple[str, ...] = ()

    @property
    def air_source(self) -> str | None:
        """What the air run is called, None without one."""
        return None if self.air is None else _source(self.air)

    @property
    def stem(self) -> str:
        """Name of the trace for a folder."""
        return Path(_source(self.trace).replace(":", "_")).stem

    def records(self) -> tuple[Trace, Trace | None]:
        """The cut, and the air run where there is one.

        Raises:
            TraceError: A file cannot be read.
        """
        return self._record(self.trace), None if self.air is None else self._record(self.air)

    def _record(self, given: Path | Trace) -> Trace:
        """A record, with the SHA-256 of its numbers if it comes from no file and no DataFrame."""
        if not isinstance(given, Trace):
            return read_trace(given, **self.columns)
        return given if given.sha256 else replace(given, source=_source(given), sha256=given.digest)


def _source(given: Path | Trace) -> str:
    """What a record is called; one made from arrays says so."""
    if not isinstance(given, Trace):
        file, address = split_address(given)
        return f"{file.name}:{address}" if address else file.name
    return given.source if given.sha256 else f"{given.source} (arrays)"
