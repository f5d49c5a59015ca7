"""From a trace as recorded to a tared force over the stroke, with the uncertainty of every step."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from calib.errors import TraceError
from calib.io.wording import quoted
from calib.table.table import RECONSTRUCTED
from calib.trace.baselines import (
    BASELINES,
    CONSTANT,
    LINEAR,
    ZERO,
    Drift,
    behind_the_cut,
    check_approach,
    drift_of,
    level_behind,
    out_of_the_food,
    trigger_contact,
    untold_drift,
)
from calib.trace.contact_onset import FLOOR_FRACTION, SUSTAIN, ContactOnset, estimate_baseline, find_contact_onset
from calib.trace.cuts import single_cut
from calib.trace.filters import (
    FILTER_SD_M,
    N_STROKE,
    filtered_noise,
    leading_grid,
    parabola_peak,
    resample,
    smooth,
)
from calib.trace.mending import mended
from calib.trace.missing import held_samples
from calib.trace.recorded import rises_with_the_force
from calib.trace.stroke import DWELL_M, board_warnings, clock_of, end_of_descent, stroke_axis, stroke_in_food
from calib.trace.sudden import sudden_changes
from calib.trace.trace import MIN_SAMPLES, Trace

AIR_SLACK_SAMPLES = 3
"""Sampling intervals by which an air run may be shorter than the cut; its last value is held over them."""
AIR_PATH_M = 2e-3
"""Largest difference in height between cut and air run before contact [m] that goes without a warning."""
DRIFT_FRACTION = 0.02
"""Drift over the cut, as a fraction of the peak, that is warned about."""
DRIFT_REACH = 10.0
"""Lengths of the baseline window over which its drift is extrapolated; a shorter window says nothing of
the cut."""
DRIFT_SIGNIFICANCE = 3.0
"""Standard uncertainties by which a drift must differ from zero to be warned about."""
DRIFT_ROUNDS = 2
"""Times that drift and contact are found from each other: a drift that is not removed is taken for contact early."""
PEAK_RANGE_N = (0.05, 5e3)
"""Peak forces outside are taken for a unit mix-up [N]."""
NOTHING_N = 1e-6
#: A standard deviation below this part of the peak is that of rounding: a digitised trace has no noise [-].
ROUNDING = 1e-9
"""Variation of a force below which there is nothing in it but rounding [N]."""


@dataclass(frozen=True)
class Conditioned:
    """A cut as force over stroke, ready to be compared with a simulation.

    Attributes:
        trace: The trace it was made from, cut at ``t_end`` if that was given.
        baseline_N: Level subtracted from the force [N]; with an air run, what was left after subtracting it.
        baseline_sd_N: Standard uncertainty of that level (noise, its correlation, drift within the window)
            [N].
        baseline_kind: ``constant``, ``linear``, ``zero`` or ``air``.
        onset_s: Time of contact on the trace's clock [s].
        onset_sd_s: Its standard uncertainty [s].
        end_s: Time at which the downward stroke ends [s].
        time: Time of the whole record [s], shape (n,).
        force: Tared, unfiltered force of the whole record [N], shape (n,).
        stroke: Uniform stroke from contact to the end of the downward stroke [m], shape (240,).
        clock: Time after contact at which the edge was there first [s], shape (240,).
        curve: Filtered force on that stroke [N], shape (240,).
        stroke_source: ``position``, ``speed`` or ``height``.
        stroke_length_m: Length of the downward stroke after contact [m].
        noise_sd_N: Robust standard deviation of one unfiltered sample before contact [N].
        curve_noise_sd_N: What of it is left in a point of the filtered curve, its correlation counted [N].
        filter_sd_m: Standard deviation of the Gaussian filter [m].
        peak_N: Maximum of the curve from a parabola through the points around it [N].
        peak_sd_N: Its standard uncertainty from filtered noise and baseline [N].
        drift_N_per_s: Drift of the force in the baseline window [N/s].
        drift_sd_N_per_s: Its standard uncertainty; where the drift was removed, that of the removed one [N/s].
        warnings: What a reader should know, one sentence each.
        at_board: Whether the stroke ends where the force says that the edge is on the board.
    """

    trace: Trace
    baseline_N: float
    baseline_sd_N: float
    baseline_kind: str
    onset_s: float
    onset_sd_s: float
    end_s: float
    time: np.ndarray
    force: np.ndarray
    stroke: np.ndarray
    clock: np.ndarray
    curve: np.ndarray
    stroke_source: str
    stroke_length_m: float
    noise_sd_N: float
    curve_noise_sd_N: float
    filter_sd_m: float
    peak_N: float
    peak_sd_N: float
    drift_N_per_s: float
    drift_sd_N_per_s: float
    warnings: tuple[str, ...]
    at_board: bool = False

    def __post_init__(self) -> None:
        if self.stroke.shape != self.curve.shape or not np.all(np.isfinite(self.curve)):
            raise TraceError(f"{self.trace.source}: the conditioned curve is not finite on its stroke")


def condition(
    trace: Trace,
    *,
    air: Trace | None = None,
    speed: float | None = None,
    height: float | None = None,
    t_end: float | None = None,
    board: float | None = None,
    board_z: float | None = None,
    baseline: str = CONSTANT,
) -> Conditioned:
    """Tare a trace, find contact, and put the force on a uniform stroke with a zero-phase filter.

    Args:
        trace: The cut.
        air: The same motion without food, subtracted at equal time.
        speed: Knife speed [m/s], needed where the trace has no position.
        height: Height of the food [m]; without position and speed, onset to release is taken for this height.
        t_end: End of the record on the trace's clock [s]; what comes later (board contact, say) is dropped.
        board: Stroke at which the edge is at the board, which is the specimen's height where that was measured [m]; the
            curve ends there. Without it and ``board_z`` it ends where a force that falls to little and stays there says
            that the edge is through.
        board_z: Reading of the knife's height, or of its depth, with the edge on the board [m].
        baseline: What is subtracted where there is no air run: ``constant``, the level before contact; ``linear``, the
            line through it; ``zero``, nothing, for a record that starts at its trigger.

    Returns:
        The conditioned cut.

    Raises:
        TraceError: No usable cut in the trace; the message says why and what to do.
    """
    _check_options(trace, speed, height, baseline, air)
    trace = trace if t_end is None else trace.until(t_end)
    mend, air_mend = mended(trace), None if air is None else mended(air)
    trace = single_cut(mend.trace, None)
    force = trace.force if air_mend is None else trace.force - _air_force(trace, air_mend.trace)
    last = end_of_descent(trace)
    _check_record(trace, force, last)
    force, contact, drift = _contact(trace, force, last, baseline)
    approach = check_approach(trace, force, contact) if baseline == CONSTANT else []
    level = contact.baseline
    tared = force - level.level
    axis = stroke_axis(trace, tared, contact, last=last, speed=speed, height=height)
    axis = stroke_in_food(trace, tared, axis, contact.onset, board=board, board_z=board_z)
    held = held_samples(trace, tared, axis.stroke, axis.end, level.noise_sd)
    into, deep = (int(np.searchsorted(trace.time, contact.onset)), int(np.argmax(axis.stroke >= axis.end * (1 - 1e-9))))
    out = out_of_the_food(trace, contact)
    sudden = sudden_changes(trace, tared, (into, deep), out, held.sound)
    sound = held.sound & ~(axis.turned & (axis.stroke >= axis.end * (1 - 1e-9)))
    grid, curve = _on_grid(trace.time, axis.stroke, tared, (contact.onset, axis.end), sound)
    length = float(grid[-1])
    samples = int(np.count_nonzero((axis.stroke >= 0.0) & (axis.stroke <= length)))
    noise = filtered_noise(contact.baseline, samples, length)
    peak = parabola_peak(curve)
    _check_peak(trace, peak)
    behind_sd, behind = level_behind(trace, tared, behind_the_cut(trace, tared, contact), peak, level.noise_sd)
    end_s = float(trace.time[int(np.argmax(axis.stroke >= length * (1 - 1e-9)))])
    level_sd = math.hypot(level.level_sd, mend.level_sd, 0.0 if air_mend is None else air_mend.level_sd)
    level_sd, noise_sd = (sd if sd > ROUNDING * peak else 0.0 for sd in (level_sd, level.noise_sd))
    at_peak = contact.onset + (end_s - contact.onset) * float(grid[int(np.argmax(curve))]) / length
    drift_sd = 0.0 if drift is None else drift.sd(at_peak)
    said = (*approach, *mend.notes, *(() if air_mend is None else air_mend.notes), *sudden, *behind, *held.notes)
    removed = untold_drift(trace, force, contact, out, end_s) if air is None else []
    removed = removed if drift is None else [drift.note(trace.source, end_s)]
    return Conditioned(
        trace=trace,
        baseline_N=level.level,
        baseline_sd_N=level_sd,
        baseline_kind=baseline if air is None else "air",
        onset_s=contact.onset,
        onset_sd_s=math.hypot(contact.onset_sd, trace.time_sd),
        end_s=end_s,
        time=trace.time,
        force=tared,
        stroke=grid,
        clock=clock_of(trace.time, axis.stroke, grid, (contact.onset, end_s)),
        curve=curve,
        stroke_source=axis.source,
        stroke_length_m=length,
        noise_sd_N=noise_sd,
        curve_noise_sd_N=math.hypot(noise, held.step_sd),
        filter_sd_m=FILTER_SD_M,
        peak_N=peak,
        peak_sd_N=math.hypot(noise, level_sd, drift_sd, behind_sd, held.peak_sd, held.step_sd),
        drift_N_per_s=level.slope if drift is None else 0.0,
        drift_sd_N_per_s=level.slope_sd if drift is None else drift.slope_sd,
        at_board=axis.at_board,
        warnings=(
            *_record_warnings(trace),
            *said,
            *_baseline_warnings(trace, air, force, replace(contact, peak=peak), last),
            *removed,
            *axis.warnings,
            *board_warnings(trace.source, grid, curve),
        ),
    )


def _contact(
    trace: Trace, force: np.ndarray, last: int, baseline: str
) -> tuple[np.ndarray, ContactOnset, Drift | None]:
    """The force, without its drift where that is to be removed, its contact, and the drift."""
    if baseline == ZERO:
        return force, trigger_contact(trace, force), None
    contact = find_contact_onset(trace.time[: last + 1], force[: last + 1], source=trace.source)
    if baseline != LINEAR:
        return force, contact, None
    for _ in range(DRIFT_ROUNDS):
        drift = drift_of(trace, force, contact)
        level = drift.removed(trace.time, force)
        contact = find_contact_onset(trace.time[: last + 1], level[: last + 1], source=trace.source)
    return level, contact, drift


def _check_options(trace: Trace, speed: float | None, height: float | None, baseline: str, air: Trace | None) -> None:
    """Speed and height must be positive, one of them must be there if the trace has no position, and what an air run
    subtracts needs no other baseline."""
    if baseline not in BASELINES:
        raise TraceError(f"baseline {quoted(baseline)} is not one of {', '.join(BASELINES)} (option --baseline)")
    if air is not None and baseline != CONSTANT:
        raise TraceError(f"{trace.source}: --baseline {baseline} beside --air, which is subtracted; give one of them")
    for name, value, unit in (("speed", speed, "m/s"), ("height", height, "m")):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise TraceError(f"{name} is {value} {unit}; it must be positive (option --{name})")
    if trace.position is None and speed is None and height is None:
        raise TraceError(
            f"{trace.source}: no position column, so the stroke is unknown; give the knife speed with "
            "--speed (m/s), or name a position column with --position-col"
        )


def _check_record(trace: Trace, force: np.ndarray, last: int) -> None:
    """Refuse a record that does not go down for long enough, or in whose force there is nothing."""
    where = f"{trace.source}, column {trace.columns.get('position')}"
    if rises_with_the_force(trace.force, trace.position):
        raise TraceError(
            f"{where}: the position does not descend after contact, it rises as the force grows; say --depth-col if it "
            "is a way down, else name another with --position-col, or none and give --speed"
        )
    if last + 1 < MIN_SAMPLES:
        raise TraceError(
            f"{where}: the position is at its lowest after {last + 1} samples, at least {MIN_SAMPLES} are needed on "
            "the way down; it must be a height, or a depth named like stroke_m; name another with --position-col, or "
            "none and give --speed"
        )
    if 0.0 < np.ptp(force[: last + 1]) < NOTHING_N:
        raise TraceError(
            f"{trace.source}, column {trace.columns.get('force')}: no contact found: the force varies by "
            f"{np.ptp(force[: last + 1]):.3g} N in all; check the column and its unit (force_N, force_mN, force_kN)"
        )


def _record_warnings(trace: Trace) -> list[str]:
    """What was done to read the record, and what it is."""
    found = list(trace.notes)
    if trace.label == RECONSTRUCTED:
        found.append(f"{trace.source} is a reconstruction, not a measurement: nothing fitted to it is validated")
    if trace.start:
        found.append(
            f"the clock of {trace.source} starts at {trace.start:.10g} s; all times, also --t-end, are counted from "
            "there"
        )
    return found


def _baseline_warnings(
    trace: Trace, air: Trace | None, force: np.ndarray, contact: ContactOnset, last: int
) -> list[str]:
    """What speaks against the baseline: its drift or another air run, and a noise that is none."""
    if air is None:
        found = _drift_warnings(trace, force, contact, trace.time[last])
    else:
        found = _air_warnings(trace, air, contact.onset)
    if contact.baseline.noise_sd < FLOOR_FRACTION * contact.peak:
        found.append(
            "the force before contact hardly varies: digitised, smoothed or clipped "
            "data; the noise and every uncertainty that follows from it are too small"
        )
    return found


def _air_force(trace: Trace, air: Trace) -> np.ndarray:
    """Force of the air run at the times of the cut [N]."""
    slack = AIR_SLACK_SAMPLES * max(trace.dt, air.dt)
    missing = []
    if air.time[0] > trace.time[0] + slack:
        missing.append(f"{trace.time[0]:.4g} to {air.time[0]:.4g} s")
    if air.time[-1] < trace.time[-1] - slack:
        missing.append(f"{air.time[-1]:.4g} to {trace.time[-1]:.4g} s")
    if missing:
        raise TraceError(
            f"{air.source}: the air run does not cover the cut {trace.source}: {' and '.join(missing)} is "
            "missing; use an air run of the same motion, or end the cut earlier with --t-end"
        )
    return np.interp(trace.time, air.time, air.force)


def _air_warnings(trace: Trace, air: Trace, onset: float) -> list[str]:
    """An air run that is another quantity or another motion than the cut."""
    found = []
    if trace.columns.get("force") != air.columns.get("force"):
        found.append(
            f"the force columns differ: {trace.columns.get('force')} in the cut, {air.columns.get('force')} "
            "in the air run"
        )
    if trace.position is not None and air.position is not None:
        before = trace.time <= onset
        gap = np.abs(np.interp(trace.time, air.time, air.position) - trace.position)[before]
        if gap.max() > AIR_PATH_M:
            found.append(
                f"air run and cut differ by up to {1e3 * gap.max():.1f} mm in height before contact: not "
                "the same motion"
            )
    return found


def _drift_warnings(trace: Trace, force: np.ndarray, contact: ContactOnset, end: float) -> list[str]:
    """A constant baseline that the force before contact contradicts."""
    base = contact.baseline
    before = max(int(np.searchsorted(trace.time, contact.onset)), base.stop)
    whole = estimate_baseline(trace.time, force, 0, before)
    if whole.slope_sd < base.slope_sd:  # a drift is taken for contact early, which leaves a short window
        base = replace(base, slope=whole.slope, slope_sd=whole.slope_sd, start=0, stop=whole.stop)
    found, drift = [], base.slope * (end - contact.onset)
    told = end - contact.onset < DRIFT_REACH * (trace.time[base.stop - 1] - trace.time[base.start])
    significant = abs(base.slope) > DRIFT_SIGNIFICANCE * base.slope_sd
    if told and significant and abs(drift) > DRIFT_FRACTION * contact.peak:
        found.append(
            f"the baseline drifts by {base.slope:.3g} N/s before contact, {drift:.2g} N over the cut "
            f"({abs(drift) / contact.peak:.1%} of the peak); it was not removed: give an air run "
            "with --air, or say --baseline linear"
        )
    first = force[: max(SUSTAIN, base.stop // 10)]
    moved = base.level - float(np.median(first))
    if abs(moved) > max(DRIFT_FRACTION * contact.peak, DRIFT_SIGNIFICANCE * base.noise_sd):
        found.append(
            f"the force before contact is not constant: its level moves by {moved:.2g} N "
            f"({abs(moved) / contact.peak:.1%} of the peak) from the start of the record; give an air run "
            "with --air"
        )
    return found


def _on_grid(
    time: np.ndarray, stroke: np.ndarray, tared: np.ndarray, ends: tuple[float, float], sound: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Uniform stroke grid from 0 to the end of the cut [m] and the filtered force of its sound samples on it [N]."""
    onset, end = ends
    grid = np.linspace(0.0, end, N_STROKE)
    lead = leading_grid(grid)
    whole = np.concatenate([lead, grid])
    last = int(np.argmax((time > onset) & (stroke >= end)))
    away = np.flatnonzero((time < onset) & (stroke < whole[0]))
    first = int(away[-1]) if len(away) else 0
    deepest = np.maximum.accumulate(stroke[first : last + 1])
    advancing = (deepest - stroke[first : last + 1] <= DWELL_M) & sound[first : last + 1]
    advancing[0] = True
    s, f = deepest[advancing], tared[first : last + 1][advancing]
    if not advancing[-1]:  # the force is held over a last sample that does not show it
        s, f = np.append(s, deepest[-1]), np.append(f, f[-1])
    if s[0] > whole[0]:
        s, f = np.concatenate([[whole[0]], s]), np.concatenate([[0.0], f])
    force = resample(s, f, whole)
    return grid, smooth(grid, force[len(lead) :], FILTER_SD_M, before=force[: len(lead)])


def _check_peak(trace: Trace, peak: float) -> None:
    """Refuse a peak that no knife and no food give."""
    low, high = PEAK_RANGE_N
    if not low <= peak <= high:
        raise TraceError(
            f"{trace.source}, column {trace.columns.get('force')}: the peak is {peak:.3g} N, outside "
            f"{low:g} to {high:g} N; check the unit in the column's name (force_N, force_mN, force_kN)"
        )
