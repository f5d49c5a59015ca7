"""A measured force trace: reading it from a table, and everything that can be wrong with its clock."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.errors import TraceError
from calib.io.wording import brief, quoted
from calib.trace.columns import Column, candidates, choose, numbers
from calib.trace.reader import read_table
from calib.trace.table import MEASURED, TRACE_LABELS, Table

if TYPE_CHECKING:
    import pandas

MIN_SAMPLES = 20
"""Fewest samples of a trace: below this, baseline, onset and ramp have under seven samples each."""
SLOWEST_S, FASTEST_S = 0.5, 2e-5
"""Median sampling intervals outside are taken for a unit mix-up [s]: a clock of a kilohertz in milliseconds read as
seconds has 1 s, one of 50 Hz in seconds read as milliseconds 2e-5 s."""
CLOCK_START_S = 1000.0
"""Time of the first sample from which on a clock has begun elsewhere [s], at the start of a robot or in 1970; the trace
then counts from its first sample."""
CLOCK_JITTER = 0.5
"""Largest deviation of a step from the mean step for a column that looks like a clock [-]."""
DATA_FRAME = "DataFrame"
"""What a trace from a DataFrame is called that says nothing else."""
DISABLED = "none"
"""Value of ``position_col`` that leaves a position column unused."""


@dataclass(frozen=True)
class Trace:
    """A force trace as recorded, in SI units.

    Attributes:
        time: Time of each sample, strictly increasing [s], shape (n,).
        force: Vertical force, resistance to the downward knife positive, not tared [N], shape (n,).
        position: Height of the tool, z up [m], shape (n,), or None.
        source: File name, or what else errors and reports call the trace.
        sha256: SHA-256 of the file (and of the address in it), of the content for a DataFrame, empty for arrays.
        columns: The column used for each of ``time``, ``force`` and ``position``.
        label: ``measured`` or ``reconstructed``.
        start: Time of the first sample on the file's clock where that began elsewhere, and was subtracted [s].
        notes: What was done to read the file that its reader should know, one sentence each.

    Raises:
        TraceError: Too few samples, unequal lengths, a number that is not finite, a clock that does not run.
    """

    time: np.ndarray
    force: np.ndarray
    position: np.ndarray | None = None
    source: str = "trace"
    sha256: str = ""
    columns: dict[str, str] = field(default_factory=dict)
    label: str = MEASURED
    start: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("time", "force", "position"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._numbers(name))
        if self.label not in TRACE_LABELS:
            raise TraceError(f"{self.source}: label {quoted(self.label)} is not one of {', '.join(TRACE_LABELS)}")
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

    def until(self, end: float) -> Trace:
        """The part up to a time [s].

        Raises:
            TraceError: A time outside the record, or too near to its beginning.
        """
        keep = self.time <= end
        if np.count_nonzero(keep) < MIN_SAMPLES or not end <= self.time[-1]:
            raise TraceError(
                f"{self.source}: t_end is {end:g} s, the record runs from {self.time[0]:g} to {self.time[-1]:g} s; "
                f"choose a time inside it with at least {MIN_SAMPLES} samples before (option --t-end)"
            )
        position = None if self.position is None else self.position[keep]
        return replace(self, time=self.time[keep], force=self.force[keep], position=position)

    def _numbers(self, name: str) -> np.ndarray:
        """A column as an array of numbers.

        Raises:
            TraceError: It holds something else.
        """
        try:
            values = np.asarray(getattr(self, name), dtype=float)
        except (TypeError, ValueError):
            raise TraceError(f"{self.source}: {name} holds something that is not a number") from None
        if values.ndim != 1:
            raise TraceError(f"{self.source}: {name} has shape {values.shape}; give one number a sample")
        return values

    @classmethod
    def read(cls, path: str | Path, **columns: Any) -> Trace:
        """A trace from a file; see :func:`read_trace`."""
        return read_trace(path, **columns)

    @classmethod
    def from_frame(
        cls, frame: pandas.DataFrame, *, source: str | None = None, label: str | None = None, **columns: Any
    ) -> Trace:
        """A trace from a pandas DataFrame; columns as in :func:`read_trace`.

        Args:
            frame: A row for each sample; an index with a name is a column too.
            source: Name in errors and reports, which say that it was a DataFrame; ``frame.attrs["source"]`` if not
                given.
            label: ``measured`` or ``reconstructed``; ``frame.attrs["label"]`` or ``measured`` if not given.
            columns: ``time_col``, ``force_col``, ``position_col``, ``depth_col`` and ``sign``.

        Returns:
            The trace in SI units.

        Raises:
            TraceError: As :func:`read_trace`.
        """
        import pandas

        from calib.trace.frame_table import table_of_frame

        if not isinstance(frame, pandas.DataFrame):
            raise TraceError(f"a {type(frame).__name__} is no record: give the path of a file, or a pandas DataFrame")
        source = source or str(frame.attrs.get("source") or "")
        if DATA_FRAME not in source:
            source = f"{source} ({DATA_FRAME})" if source else DATA_FRAME
        label = label or str(frame.attrs.get("label") or MEASURED)
        return _trace(table_of_frame(frame, source=source, label=label), **columns)

    def frame(self) -> pandas.DataFrame:
        """The trace as a pandas DataFrame: ``time_s``, ``force_N`` and, where it has one, ``position_m``.

        :meth:`from_frame` makes the same numbers of it, with the label, and says that they were in a DataFrame.
        """
        import pandas

        columns = {"time_s": self.time, "force_N": self.force}
        if self.position is not None:
            columns["position_m"] = self.position
        frame = pandas.DataFrame(columns)
        frame.attrs |= {"source": self.source, "label": self.label}
        return frame

    @property
    def digest(self) -> str:
        """SHA-256 of the numbers, for a trace that comes from no file."""
        content = [np.ascontiguousarray(x) for x in (self.time, self.force, self.position) if x is not None]
        return hashlib.sha256(b"".join(x.tobytes() for x in content)).hexdigest()

    @property
    def dt(self) -> float:
        """Median sampling interval [s]."""
        return float(np.median(np.diff(self.time)))


def read_trace(
    path: str | Path | pandas.DataFrame,
    *,
    time_col: str | None = None,
    force_col: str | None = None,
    position_col: str | None = None,
    depth_col: str | None = None,
    sign: str | int | None = None,
) -> Trace:
    """Read a force trace from a CSV, JSON or HDF5 file, or a pandas DataFrame.

    Columns are found by their names, which carry the unit: ``time_s``, ``time_ms``, ``t_s``; ``force_N``, ``fz_N``,
    ``force_kN``; heights ``ee_z_m``, ``position_mm``; depths ``stroke_m``, ``displacement_mm`` (positive downwards,
    turned into heights). ``base_Fz_N`` of a robot log is preferred to a derived ``cut_force_z_N`` and has its sign
    turned round. In CSV files, lines that start with ``#`` are comments; ``# label: reconstructed`` sets the label.
    Lines above the header, a row of units below it, and decimals after a comma (where something else separates cells)
    are understood.

    JSON files hold lists by name, or a list of records; HDF5 files data sets of one group (``file.h5:/group``) or a
    structured one, with units in names or attributes. In both, vectors become columns ``_x``, ``_y``, ``_z``, and
    libfranka's ``O_F_ext_hat_K``, ``K_F_ext_hat_K`` and ``O_T_EE`` become ``base_Fz_N``, ``knife_Fz_N``, ``ee_z_m`` and
    so on. Names that ``rostopic echo -p`` and PlotJuggler write for ROS messages are known with their units. A clock
    that starts after more than 1000 s counts from its first sample.

    Args:
        path: The file, or the DataFrame.
        time_col: Column to use as time; without a unit in its name it is taken as seconds.
        force_col: Column to use as force; without a unit in its name it is taken as newtons.
        position_col: Column to use as position (metres if its name has no unit); ``none`` uses no position.
        depth_col: The same where it holds the way down, which grows as the knife descends.
        sign: ``+`` or 1 if positive numbers mean resistance to the knife, ``-`` or -1 if negative ones do.

    Returns:
        The trace in SI units.

    Raises:
        TraceError: The file or a column cannot be used; the message names file, column and row.
    """
    columns: dict[str, Any] = {
        "time_col": time_col,
        "force_col": force_col,
        "position_col": position_col,
        "depth_col": depth_col,
        "sign": sign,
    }
    if not isinstance(path, (str, Path)):
        return Trace.from_frame(path, **columns)
    return _trace(read_table(path), **columns)


def _trace(
    table: Table,
    *,
    time_col: str | None = None,
    force_col: str | None = None,
    position_col: str | None = None,
    depth_col: str | None = None,
    sign: str | int | None = None,
) -> Trace:
    """The trace in a table.

    Raises:
        TraceError: As :func:`read_trace`.
    """
    columns = {
        "time": choose(table, "time", time_col),
        "force": choose(table, "force", force_col),
    }
    if depth_col is not None:
        if position_col is not None:
            raise TraceError(
                f"{table.source}: --position-col beside --depth-col; the knife's place is in one column, give one"
            )
        column = choose(table, "position", depth_col)
        columns["position"] = replace(column, factor=-abs(column.factor))
    elif position_col != DISABLED and (position_col is not None or candidates(table, "position")):
        columns["position"] = choose(table, "position", position_col)
    if sign is not None:
        force = columns["force"]
        columns["force"] = replace(force, factor=abs(force.factor) * _parse_sign(sign))
    if len(table.rows) < MIN_SAMPLES:
        raise TraceError(f"{table.source}: {len(table.rows)} rows of data, at least {MIN_SAMPLES} are needed")
    values = {role: numbers(table, column) for role, column in columns.items()}
    _check_clock(table, columns["time"], columns["force"], values["time"], values["force"])
    start = float(values["time"][0])
    start = start if abs(start) > CLOCK_START_S else 0.0
    return Trace(
        time=values["time"] - start,
        force=values["force"],
        position=values.get("position"),
        source=table.source,
        sha256=table.sha256,
        columns={role: column.name for role, column in columns.items()},
        label=table.label,
        start=start,
        notes=table.notes,
    )


def _parse_sign(sign: str | int) -> float:
    """The factor of a ``--sign`` option."""
    signs = {"+": 1.0, "-": -1.0, "1": 1.0, "+1": 1.0, "-1": -1.0}
    if str(sign) not in signs:
        raise TraceError(f"sign {quoted(sign)} is not one of +, -, 1, -1 (option --sign)")
    return signs[str(sign)]


def _check_clock(table: Table, time: Column, force: Column, t: np.ndarray, f: np.ndarray) -> None:
    """Refuse a time that does not increase, columns that look swapped, and milliseconds named as seconds."""
    steps = np.diff(t)
    if np.any(steps <= 0.0):
        force_steps = np.abs(np.diff(f)) if np.all(np.diff(f) > 0) or np.all(np.diff(f) < 0) else np.zeros(1)
        mean = float(force_steps.mean())
        if mean > 0.0 and np.all(np.abs(force_steps - mean) <= CLOCK_JITTER * mean):
            raise TraceError(
                f"{table.source}: columns {brief(time.name)} and {brief(force.name)} look swapped ({brief(force.name)} "
                f"rises in equal steps like a clock, {brief(time.name)} does not); exchange their names or use "
                "--time-col and --force-col"
            )
        i = int(np.argmax(steps <= 0.0))
        raise TraceError(
            f"{table.source}, {table.row} {brief(table.rows[i + 1])}, column {brief(time.name)}: time does not "
            f"increase ({t[i]:.10g} s, then {t[i + 1]:.10g} s); remove repeated rows, or cut the file where the "
            "clock restarts"
        )
    median = float(np.median(steps))
    where = f"{table.source}, column {brief(time.name)}: samples are {median:g} s apart"
    if median >= SLOWEST_S:
        raise TraceError(f"{where}; this looks like milliseconds: name the column time_ms")
    if median < FASTEST_S:
        raise TraceError(f"{where}, more than {1 / FASTEST_S:g} a second; check the unit of the column")
