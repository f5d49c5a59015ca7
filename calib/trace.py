"""A measured force trace: reading it from a table, and everything that can be wrong with its clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import TraceError
from calib.tables import LABELS, Column, Table, candidates, choose, numbers, read_table

MIN_SAMPLES = 20
"""Fewest samples of a trace: below this, baseline, onset and ramp have under seven samples each."""
MS_SUSPICION_S = 1.0
"""Median sampling interval [s] above which a time column is taken for milliseconds: no cut is sampled so
slowly."""
CLOCK_JITTER = 0.5
"""Largest deviation of a step from the mean step for a column that looks like a clock [-]."""
DISABLED = "none"
"""Value of ``position_col`` that leaves a position column unused."""


@dataclass(frozen=True)
class Trace:
    """A force trace as recorded, in SI units.

    Attributes:
        time: Time of each sample, strictly increasing [s], shape (n,).
        force: Vertical force, resistance to the downward knife positive, not tared [N], shape (n,).
        position: Height of the tool, z up [m], shape (n,), or None.
        source: File name.
        sha256: SHA-256 of the file, empty for a trace made in memory.
        columns: The column used for each of ``time``, ``force`` and ``position``.
        label: ``measured`` or ``reconstructed``.
    """

    time: np.ndarray
    force: np.ndarray
    position: np.ndarray | None
    source: str
    sha256: str
    columns: dict[str, str]
    label: str = "measured"

    def __post_init__(self) -> None:
        if self.label not in LABELS:
            raise TraceError(f"{self.source}: label {self.label!r} is not one of {', '.join(LABELS)}")
        if len(self.time) < MIN_SAMPLES:
            raise TraceError(
                f"{self.source}: {len(self.time)} samples, at least {MIN_SAMPLES} are needed; record the "
                "whole cut with the approach before it, or at a higher rate"
            )
        for name, values in (("force", self.force), ("position", self.position)):
            if values is not None and values.shape != self.time.shape:
                raise TraceError(f"{self.source}: {name} has shape {values.shape}, time {self.time.shape}")
            if values is not None and not np.all(np.isfinite(values)):
                raise TraceError(f"{self.source}: {name} holds NaN or infinite values")
        if not (np.all(np.isfinite(self.time)) and np.all(np.diff(self.time) > 0.0)):
            raise TraceError(f"{self.source}: time is not strictly increasing")

    @property
    def dt(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.time)))


def read_trace(
    path: str | Path,
    *,
    time_col: str | None = None,
    force_col: str | None = None,
    position_col: str | None = None,
    sign: str | int | None = None,
) -> Trace:
    """Read a force trace from a CSV file.

    Columns are found by their names, which carry the unit: ``time_s``, ``time_ms``, ``t_s``; ``force_N``,
        ``fz_N``,
    ``force_kN``; heights ``ee_z_m``, ``position_mm``; depths ``stroke_m``, ``displacement_mm`` (positive
    downwards, turned into heights). ``base_Fz_N`` of a robot log is preferred to a derived ``cut_force_z_N``
    and has its sign turned round. Lines that start with ``#`` are comments; ``# label: reconstructed`` sets
    the label.

    Args:
        path: CSV file with one header line.
        time_col: Column to use as time; without a unit in its name it is taken as seconds.
        force_col: Column to use as force; without a unit in its name it is taken as newtons.
        position_col: Column to use as position (metres if its name has no unit); ``none`` uses no position.
        sign: ``+`` or 1 if positive numbers mean resistance to the knife, ``-`` or -1 if negative ones do.

    Returns:
        The trace in SI units.

    Raises:
        TraceError: The file or a column cannot be used; the message names file, column and row.
    """
    table = read_table(Path(path))
    columns = {
        "time": choose(table, "time", time_col),
        "force": choose(table, "force", force_col),
    }
    if position_col != DISABLED and (position_col is not None or candidates(table, "position")):
        columns["position"] = choose(table, "position", position_col)
    if sign is not None:
        force = columns["force"]
        columns["force"] = Column(force.name, force.index, abs(force.factor) * _parse_sign(sign))
    if len(table.rows) < MIN_SAMPLES:
        raise TraceError(f"{table.source}: {len(table.rows)} rows of data, at least {MIN_SAMPLES} are needed")
    values = {role: numbers(table, column) for role, column in columns.items()}
    _check_clock(table, columns["time"], columns["force"], values["time"], values["force"])
    return Trace(
        time=values["time"],
        force=values["force"],
        position=values.get("position"),
        source=table.source,
        sha256=table.sha256,
        columns={role: column.name for role, column in columns.items()},
        label=table.label,
    )


def _parse_sign(sign: str | int) -> float:
    """The factor of a ``--sign`` option."""
    signs = {"+": 1.0, "-": -1.0, "1": 1.0, "+1": 1.0, "-1": -1.0}
    if str(sign) not in signs:
        raise TraceError(f"sign {sign!r} is not one of +, -, 1, -1 (option --sign)")
    return signs[str(sign)]


def _check_clock(table: Table, time: Column, force: Column, t: np.ndarray, f: np.ndarray) -> None:
    """Refuse a time that does not increase, columns that look swapped, and milliseconds named as seconds."""
    steps = np.diff(t)
    if np.any(steps <= 0.0):
        force_steps = np.abs(np.diff(f)) if np.all(np.diff(f) > 0) or np.all(np.diff(f) < 0) else np.zeros(1)
        mean = float(force_steps.mean())
        if mean > 0.0 and np.all(np.abs(force_steps - mean) <= CLOCK_JITTER * mean):
            raise TraceError(
                f"{table.source}: columns {time.name} and {force.name} look swapped ({force.name} rises in "
                f"equal steps like a clock, {time.name} does not); exchange their names or use --time-col "
                "and --force-col"
            )
        i = int(np.argmax(steps <= 0.0))
        raise TraceError(
            f"{table.source}, row {table.lines[i + 1]}, column {time.name}: time does not increase "
            f"({t[i]:g} s, then {t[i + 1]:g} s); remove repeated rows, or cut the file where the clock "
            "restarts"
        )
    median = float(np.median(steps))
    if median > MS_SUSPICION_S:
        raise TraceError(
            f"{table.source}, column {time.name}: samples are {median:g} s apart; this looks like "
            "milliseconds: name the column time_ms"
        )
