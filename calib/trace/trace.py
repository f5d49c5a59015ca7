"""A measured force trace, and reading it from a file or a DataFrame."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from calib.errors import TraceError
from calib.formats.reader import read_table
from calib.io.kinds import FLAG, NUMBER, TEXT, check_kind
from calib.io.wording import brief, quoted, speaking_of_arguments
from calib.io.yaml_checks import suggest
from calib.table.table import MEASURED, TRACE_LABELS, Table, rows_at
from calib.trace.recorded import MIN_SAMPLES as MIN_SAMPLES
from calib.trace.recorded import Reading, recorded

if TYPE_CHECKING:
    import pandas

DATA_FRAME = "DataFrame"
"""What a trace from a DataFrame is called that says nothing else."""
_KINDS: Mapping[str, tuple[tuple[type, ...], str]] = {
    **dict.fromkeys(("source", "sha256", "label", "row"), TEXT),
    **dict.fromkeys(("start", "time_sd"), NUMBER),
    **dict.fromkeys(("notes", "breaks"), ((tuple, list), "a tuple")),
    "columns": ((Mapping,), "a dict of names"),
    "rows": ((Sequence, np.ndarray), "a list of names"),
    "whole": FLAG,
}
"""What parts of a trace may be, and in words."""


@dataclass(frozen=True, repr=False)
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
        rows: What the file calls the row of each sample, n of them; empty for arrays.
        row: What such a name is: ``row`` or ``index``.
        time_sd: Standard uncertainty of a time that a repair of the clock leaves [s].
        breaks: Indices of the samples with which another record of the file begins.
        whole: Whether it is one cut, also where its force is released in it.

    Raises:
        CutcalError: Something of a wrong kind.
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
    rows: Sequence[Any] = ()
    row: str = "row"
    time_sd: float = 0.0
    breaks: tuple[int, ...] = ()
    whole: bool = False

    def __post_init__(self) -> None:
        for name, kind in _KINDS.items():
            check_kind("Trace", name, getattr(self, name), *kind)
        for name in ("time", "force", "position"):
            if name != "position" or self.position is not None:
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

    def __repr__(self) -> str:
        return f"Trace({self.source!r}, {len(self.time)} samples, {self.time[-1] - self.time[0]:.4g} s, {self.label})"

    def plot(self, ax: Any = None) -> Any:
        """Draw force over time.

        Args:
            ax: Axes of matplotlib; None for a new figure.

        Returns:
            The axes.
        """
        from reports.base.interactive import trace_axes

        return trace_axes(self.time, self.force, ax, f"{self.source} ({self.label})")

    def until(self, end: float) -> Trace:
        """The part up to a time [s].

        Raises:
            CutcalError: It is no number.
            TraceError: A time outside the record, or too near to its beginning.
        """
        check_kind("Trace.until", "end", end, *NUMBER)
        keep = self.time <= end
        if np.count_nonzero(keep) < MIN_SAMPLES or not end <= self.time[-1]:
            raise TraceError(
                f"{self.source}: t_end is {end:g} s, the record runs from {self.time[0]:g} to {self.time[-1]:g} s; "
                f"choose a time inside it with at least {MIN_SAMPLES} samples before (option --t-end)"
            )
        return self.part(np.flatnonzero(keep))

    def part(self, kept: np.ndarray) -> Trace:
        """The trace on some of its samples.

        Args:
            kept: Their indices, increasing, shape (m,).

        Raises:
            CutcalError: They are no indices.
        """
        check_kind("Trace.part", "kept", kept, (np.ndarray, list), "an array of indices")
        return replace(
            self,
            time=self.time[kept],
            force=self.force[kept],
            position=None if self.position is None else self.position[kept],
            rows=rows_at(self.rows, kept) if self.rows else (),
            breaks=tuple(sorted({int(np.searchsorted(kept, i)) for i in self.breaks} - {0, len(kept)})),
        )

    def where(self, i: int) -> str:
        """The place of a sample, as the file counts its rows, with its time."""
        row = f"{self.row} {brief(self.rows[i])}" if self.rows else f"sample {i}"
        return f"{row} ({self.time[i]:.4g} s)"

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
        with speaking_of_arguments():
            return read_trace(path, **columns)

    @classmethod
    def from_frame(
        cls, frame: pandas.DataFrame, *, source: str | None = None, label: str | None = None, **how: Any
    ) -> Trace:
        """A trace from a pandas DataFrame; columns as in :func:`read_trace`.

        Args:
            frame: A row for each sample; an index with a name is a column too.
            source: Name in errors and reports, which say that it was a DataFrame; ``frame.attrs["source"]`` if not
                given.
            label: ``measured`` or ``reconstructed``; ``frame.attrs["label"]`` or ``measured`` if not given.
            how: Attributes of :class:`calib.trace.recorded.Reading`.

        Returns:
            The trace in SI units.

        Raises:
            CutcalError: Something of a wrong kind.
            TraceError: As :func:`read_trace`.
        """
        for name, value in (("source", source), ("label", label)):
            if value is not None:
                check_kind("Trace.from_frame", name, value, *TEXT)
        import pandas

        from calib.formats.frame_table import table_of_frame

        if not isinstance(frame, pandas.DataFrame):
            plain = frame is None or isinstance(frame, (int, float, list, tuple, dict))
            shown = quoted(frame) if plain else f"a {type(frame).__name__}"
            raise TraceError(f"{shown} is no record: give the path of a file, or a pandas DataFrame")
        source = source or str(frame.attrs.get("source") or "")
        if DATA_FRAME not in source:
            source = f"{source} ({DATA_FRAME})" if source else DATA_FRAME
        label = label or str(frame.attrs.get("label") or MEASURED)
        return _trace(table_of_frame(frame, source=source, label=label), _reading(how))

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


def read_trace(path: str | Path | pandas.DataFrame, **how: Any) -> Trace:
    """Read a force trace from a file of any known kind, or a pandas DataFrame.

    Columns are found by their names, which carry the unit: ``time_s``, ``time_ms``, ``t_s``; ``force_N``, ``fz_N``,
    ``force_kN``, ``Force (g)``; heights ``ee_z_m``, ``position_mm``; depths ``stroke_m``, ``displacement_mm`` (positive
    downwards, turned into heights). ``base_Fz_N`` of a robot log is preferred to a derived ``cut_force_z_N`` and has
    its sign turned round. A commanded or filtered force is never chosen unasked. In CSV files, lines that start with
    ``#`` are comments; ``# label: reconstructed`` sets the label. Lines above the header, a row of units below it,
    units in a line above it, decimals after a comma, thousands, dates and times of the day are understood.

    JSON files hold lists by name, or a list of records; HDF5 files data sets of one group (``file.h5:/group``) or a
    structured one, with units in names or attributes. In both, vectors become columns ``_x``, ``_y``, ``_z``, and
    libfranka's ``O_F_ext_hat_K``, ``K_F_ext_hat_K`` and ``O_T_EE`` become ``base_Fz_N``, ``knife_Fz_N``, ``ee_z_m`` and
    so on. Names that ``rostopic echo -p`` and PlotJuggler write for ROS messages are known with their units. A clock
    that starts after more than 1000 s counts from its first sample.

    Args:
        path: The file, or the DataFrame.
        how: Attributes of :class:`calib.trace.recorded.Reading`: ``time_col``, ``force_col``, ``position_col``,
            ``depth_col``, ``sign``, ``rate``, ``decimal``.

    Returns:
        The trace in SI units.

    Raises:
        TraceError: The file or a column cannot be used; the message names file, column and row.
    """
    if not isinstance(path, (str, Path)):
        return Trace.from_frame(path, **how)
    reading = _reading(how)
    return _trace(read_table(path, reading.decimal), reading)


def _reading(how: Mapping[str, Any]) -> Reading:
    """How a record is to be read, by names of arguments.

    Raises:
        TraceError: There is no such argument.
    """
    names = [item.name for item in fields(Reading)]
    unknown = next((name for name in how if name not in names), None)
    if unknown is not None:
        raise TraceError(f"argument {quoted(unknown)} is not known{suggest(unknown, names)}")
    return Reading(**how)


def _trace(table: Table, how: Reading) -> Trace:
    """The trace in a table.

    Raises:
        TraceError: As :func:`read_trace`.
    """
    record = recorded(table, how)
    return Trace(
        time=record.time,
        force=record.force,
        position=record.position,
        source=table.source,
        sha256=table.sha256,
        columns=dict(record.columns),
        label=table.label,
        start=record.start,
        notes=record.notes,
        rows=record.rows,
        row=table.row,
        time_sd=record.time_sd,
        breaks=record.breaks,
    )
