"""Single simulations of a fit with their curves, as a report shows them to choose from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from calib.calibration.result import CalibrationResult
from calib.errors import CurveError, OutputError
from calib.problem.target import Smoother
from calib.simulation.evaluation_file import UNREADABLE, Header, StoredEvaluation, read_hdf5
from calib.simulation.evaluation_frame import STORE
from calib.trace.filters import BandLimited, filter_simulated
from mpm.arrays import FloatArray

GRIDS = ("fine", "coarse")
"""Kinds of stored simulations that the search compared with the trace; others repeat one of them in another way."""
MOST = 100
"""Members that a page shows: more are no longer told apart, and each takes 2 kB."""
SAME = 1e-9
"""Relative difference of two values that are one, written and read."""


@dataclass(frozen=True, eq=False)
class Member:
    """One simulation of a fit that went to the end of the stroke.

    Attributes:
        number: Its place in the store, from 1 on.
        grid: ``fine``, the grid that counts, or ``coarse``, that of the screening.
        parameters: The values it was run with [SI], by name.
        curve: Its force on the stroke grid of the trace, filtered as the trace was [N], shape (n,).
        peak_N: Its largest force [N].
        nrmse: Root mean square difference to the trace over the measured peak [-].
        best: Whether its values are those that the fit ended with.
        modes: Modes of the sampled posterior whose best simulated food it is, from 1 on.
    """

    number: int
    grid: str
    parameters: Mapping[str, float]
    curve: FloatArray
    peak_N: float
    nrmse: float
    best: bool
    modes: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Members:
    """Members of a fit.

    Attributes:
        shown: Some of them, those on the fine grid first, and the nearest to the trace first.
        stored: How many there are in the store.
    """

    shown: tuple[Member, ...] = ()
    stored: int = 0


def read_members(result: CalibrationResult, most: int = MOST) -> Members:
    """The simulations of a calibration whose curves can be shown beside the trace.

    Args:
        result: The calibration, whose folder has ``curves.csv`` and ``evaluations.h5``.
        most: How many are taken; the best values and the best of each mode are always among them.

    Returns:
        The members, those on the fine grid first; none where the store holds no curves, or cannot be read.
    """
    try:
        curves = result.curves
        stroke, real = (curves[name].to_numpy(dtype=float) for name in ("stroke_m", "real_N"))
    except (OutputError, KeyError, ValueError):
        return Members()
    if len(stroke) < 2:  # which the report refuses
        return Members()
    # A file's digits leave its grid not as even as the filter asks for.
    stroke = np.linspace(stroke[0], min(stroke[-1], result.conditioning.stroke_m), len(stroke))
    felt = sensed(result, stroke)
    found = [_member(result, entry, stroke, real, felt) for entry in _stored(result.folder / STORE)]
    members = sorted((m for m in found if m is not None), key=_order)
    named = [m for m in members if m.best or m.modes]
    others = [m for m in members if not (m.best or m.modes)][: max(most - len(named), 0)]
    return Members(tuple(sorted([*named, *others], key=_order)), len(members))


def sensed(result: CalibrationResult, stroke: FloatArray) -> Smoother:
    """What puts a simulation on the strokes of the trace, through the sensor's low-pass where there is one.

    Args:
        result: The calibration, with its curves.
        stroke: Stroke grid of the trace [m], shape (n,).

    Returns:
        It takes strokes [m] (k,), a simulated stroke [m] (m,) and its force [N] (m,), and gives the force [N] (k,).
    """
    bandwidth = result.conditioning.bandwidth_Hz
    if bandwidth is None or "after_contact_s" not in result.curves:
        return partial(filter_simulated, sd_m=result.conditioning.filter_sd_m)
    return BandLimited(bandwidth, stroke, result.curves["after_contact_s"].to_numpy(dtype=float))


def _order(member: Member) -> tuple[int, float]:
    return GRIDS.index(member.grid), member.nrmse


def _stored(path: Path) -> list[StoredEvaluation]:
    """The sound runs of a store; none where it has no curves or cannot be read."""
    try:
        with h5py.File(path) as file:
            if not {"key", "sha256", "curves"} <= set(file):
                return []
            header = Header(str(file.attrs["trace_sha256"]), str(file.attrs["scene_key"]))
        return read_hdf5(path, header)[0]
    except (OutputError, *UNREADABLE):
        return []


def _member(
    result: CalibrationResult, entry: StoredEvaluation, stroke: FloatArray, real: FloatArray, felt: Smoother
) -> Member | None:
    """A stored run as a member, as the sensor would have felt it; None where it is none of the search or broke down."""
    run = entry.evaluation.down
    if entry.fidelity not in GRIDS or not run.ok:
        return None
    try:
        curve = felt(stroke, run.stroke, run.force)
    except CurveError:
        return None
    if not np.all(np.isfinite(curve)):
        return None
    fitted = {name: p.value for name, p in result.fitted.items()}
    fine = entry.fidelity == GRIDS[0]
    modes = () if result.sampled is None else result.sampled.modes
    of = tuple(k for k, mode in enumerate(modes, 1) if fine and mode.best and _same(run.parameters, mode.best))
    return Member(
        number=run.index + 1,
        grid=entry.fidelity,
        parameters=run.parameters,
        curve=curve,
        peak_N=float(curve.max()),
        nrmse=nrmse(stroke, real, curve),
        best=fine and _same(run.parameters, fitted),
        modes=of,
    )


def nrmse(stroke: FloatArray, real: FloatArray, curve: FloatArray) -> float:
    """What :func:`calib.validation.metrics.compare` gives as NRMSE, without its ratings, which take 50 ms a curve.

    Args:
        stroke: Stroke [m], shape (n,).
        real: Measured force [N], shape (n,).
        curve: Simulated force [N], shape (n,).

    Returns:
        Root mean square difference over the measured peak [-].
    """
    square = np.trapezoid((curve - real) ** 2, stroke) / (stroke[-1] - stroke[0])
    return float(np.sqrt(square) / real.max())


def _same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Whether two sets of values are one."""
    return set(one) == set(other) and all(bool(np.isclose(one[n], other[n], rtol=SAME, atol=0.0)) for n in one)
