"""Samples that are missing in a cut, because none were written or because the sensor was frozen: bridged or refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral

import numpy as np

from calib.errors import TraceError
from calib.trace.clock import JUMP
from calib.trace.contact_onset import quantum
from calib.trace.standing import Standing, standing
from calib.trace.trace import Trace

HIDDEN_PEAK = 0.03
"""Part of the peak by which the force may exceed it where samples are missing; beyond it the record is refused."""
SIDE = 8
"""Samples on each side of a gap from which the force is carried on into it."""
SHORTEST_JUMP_M = 1e-3
"""Jump of a position from one sample to the next from which on samples are missing there [m]."""
LARGEST_GAP = 0.25
"""Part of the stroke from which on samples that are missing are too many."""
LOST_SD = 8.0
"""Noise standard deviations by which the first value of a frozen force is away from the one before it to be none."""
COARSE = 2e-3
"""Part of the peak from which on the steps in which a force counts are told."""


@dataclass(frozen=True)
class Held:
    """What is left of a record without the samples that are no measurements.

    Attributes:
        sound: Whether each sample is a measurement, shape (n,).
        peak_sd: Standard uncertainty that bridging the gaps adds to the peak [N].
        step_sd: Standard uncertainty of a force that counts in coarse steps [N].
        notes: What was found, with row and time, one sentence each.
    """

    sound: np.ndarray
    peak_sd: float = 0.0
    step_sd: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Gap:
    """The last sample before a gap, the first after it, and why there is none between them."""

    before: int
    after: int
    why: str


def held_samples(trace: Trace, tared: np.ndarray, stroke: np.ndarray, end: float, noise: float) -> Held:
    """Find samples that are missing, clipped or frozen in a cut.

    Where samples are missing the force is carried on from both sides. Can it exceed the peak there by more than
    ``HIDDEN_PEAK``, the record is refused; else the gap is bridged by a line, and the peak's uncertainty grows.

    Args:
        trace: The cut.
        tared: Its force above the baseline [N], shape (n,).
        stroke: Way of the edge after contact [m], shape (n,).
        end: Stroke at the end of the cut [m].
        noise: Noise of a sample before contact [N].

    Returns:
        Which samples are measurements, and what was found.

    Raises:
        TraceError: The peak may lie in a gap, contact does, or the sensor was clipped; the message names rows.
    """
    inside = (stroke >= 0.0) & (stroke <= end * (1 + 1e-9))
    peak = float(tared[inside].max()) if inside.any() else 0.0
    notes: list[str] = []
    sound = np.ones(len(tared), dtype=bool)
    gaps = _gaps(trace)
    last = int(np.flatnonzero(inside)[-1]) if inside.any() else 0
    for place in standing(trace.force, noise):
        middle = (place.first + place.last) // 2
        until = min(place.last + 1, len(tared) - 1)
        hides = until <= last and stroke[until] > 0.0 and abs(np.diff(trace.force)[until - 1]) > LOST_SD * noise
        if not hides and (not inside[min(middle, last)] or not inside[place.first : place.last + 1].any()):
            continue
        if noise < 1e-3 * peak:
            if place.top:
                notes.append(_stands(trace, place, "a plateau without noise, or a sensor at the end of its range"))
            continue
        if place.top:
            raise TraceError(
                _stands(trace, place, "the sensor is clipped there and the peak is higher")
                + "; record with a larger range, or end the cut before it with --t-end"
            )
        lost = place.first > 0 and abs(trace.force[place.first] - trace.force[place.first - 1]) > LOST_SD * noise
        before = place.first - 1 if lost else place.first  # a sensor that falls out shows no value of before
        sound[before + 1 : place.last + 1] = False
        gaps.append(_Gap(before, min(place.last + 1, len(tared) - 1), "the force is frozen"))
    peak_sd = 0.0
    for gap in sorted(gaps, key=lambda gap: gap.before):
        above, note = _bridged(trace, tared, stroke, (end, peak, noise), gap)
        peak_sd = max(peak_sd, 0.5 * above)
        notes += note
    step = quantum(trace.force)
    if step <= max(2.0 * noise, COARSE * peak):
        return Held(sound, peak_sd, 0.0, tuple(_few(notes)))
    step_sd = step / 12**0.5
    notes.append(f"{trace.source}: the force counts in steps of {step:.3g} N, {step / peak:.1%} of the peak")
    return Held(sound, peak_sd, step_sd, tuple(_few(notes)))


def _few(notes: Sequence[str]) -> list[str]:
    """The first notes, and how many more there are."""
    return [*notes[:4], *([f"{len(notes) - 4} more places like these"] if len(notes) > 4 else [])]


def _gaps(trace: Trace) -> list[_Gap]:
    """Where the clock goes on by many samples, or the knife without it, as where times were counted from the rows."""
    steps = np.diff(trace.time)
    late = steps > JUMP * float(np.median(steps))
    found = {int(i): _not_there(trace, int(i), steps) for i in np.flatnonzero(late)}
    if trace.position is not None:
        moves = np.abs(np.diff(trace.position))
        usual = float(np.median(moves[moves > 0.0])) if np.any(moves > 0.0) else 0.0
        usual = max(usual, float(np.percentile(moves, 95)))
        jumps = np.flatnonzero((moves > max(JUMP * usual, SHORTEST_JUMP_M)) & ~late)
        found |= {int(i): "the position jumps from one sample to the next, others are missing" for i in jumps}
    return [_Gap(i, i + 1, why) for i, why in sorted(found.items()) if i + 1 not in trace.breaks]


def _not_there(trace: Trace, i: int, steps: np.ndarray) -> str:
    """What is in place of samples after one of them, by the numbers of the rows: rows without a number, or none."""
    names = trace.rows[i : i + 2] if trace.rows else ()
    if len(names) == 2 and all(isinstance(name, Integral) for name in names):
        missing = round(float(steps[i]) / float(np.median(steps))) - 1
        if abs(int(names[1]) - int(names[0])) - 1 >= missing:
            return "rows without a number (empty or nan) were written"
    return "no samples were written"


def _stands(trace: Trace, place: Standing, what: str) -> str:
    return (
        f"{trace.source}, {trace.where(place.first)} to {trace.where(place.last)}, column "
        f"{trace.columns.get('force', 'force')}: the force is {place.value:.4g} N in all of them, the largest of the "
        f"record: {what}"
    )


def _bridged(
    trace: Trace, tared: np.ndarray, stroke: np.ndarray, limits: tuple[float, float, float], gap: _Gap
) -> tuple[float, list[str]]:
    """By how much the force may exceed the peak in a gap [N], and what to say of it.

    Raises:
        TraceError: By too much, or contact lies in the gap.
    """
    end, peak, noise = limits
    i, j = gap.before, gap.after
    where = f"{trace.source}, {trace.where(i)} to {trace.where(j)}"
    if stroke[j] <= 0.0 or stroke[i] >= end:
        if stroke[i] >= end * (1 - 1e-3) and stroke[max(i - 1, 0)] < stroke[i] and trace.position is not None:
            return 0.0, [f"{where}: {gap.why}, and the knife turns there; the stroke may be longer than what is used"]
        if stroke[i] >= end or float(np.max(stroke[: i + 1])) >= end * (1 - 1e-3):
            return 0.0, []  # behind the cut
        return 0.0, [f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, before contact"]
    if stroke[j] < stroke[i] and trace.position is not None:
        return 0.0, [
            f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, {1e3 * (stroke[i] - stroke[j]):.3g} mm of "
            "the way up; a line bridges it"
        ]
    if stroke[i] < 0.0 and tared[j] > max(5.0 * noise, HIDDEN_PEAK * peak):
        raise TraceError(
            f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, and contact is there; record the cut again"
        )
    high = _carried_on(tared, stroke, i, j)
    above = high - peak
    length = 1e3 * (stroke[j] - stroke[i])
    if above > HIDDEN_PEAK * peak + 3.0 * noise:
        raise TraceError(
            f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, {length:.3g} mm of the cut, and the "
            f"force may reach {high:.3g} N there, where the largest that was recorded is {peak:.3g} N; record the "
            "cut again, or end it before with --t-end"
        )
    if stroke[j] - stroke[i] > LARGEST_GAP * end:
        raise TraceError(
            f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, {length:.3g} mm of {1e3 * end:.3g} mm of "
            "the cut, unless the clock has jumped; record the cut again, or name a position with --position-col"
        )
    said = (
        f"{where}: {gap.why} for {trace.time[j] - trace.time[i]:.3g} s, {length:.3g} mm of the cut; a line bridges it"
    )
    return max(above, 0.0), [said]


def _carried_on(tared: np.ndarray, stroke: np.ndarray, i: int, j: int) -> float:
    """The largest force in a gap if it goes on from both sides as it came, to where both meet [N]."""
    before, after = _slope(stroke[max(i - SIDE, 0) : i + 1], tared[max(i - SIDE, 0) : i + 1]), 0.0
    after = -_slope(stroke[j : j + SIDE + 1], tared[j : j + SIDE + 1])
    width = float(stroke[j] - stroke[i])
    left = float(np.median(tared[max(i - 2, 0) : i + 1]))
    right = float(np.median(tared[j : j + 3]))
    before, after = max(before, 0.0), max(after, 0.0)
    if before + after <= 0.0 or width <= 0.0:
        return max(left, right)
    meet = min(max((right - left + after * width) / (before + after), 0.0), width)
    return max(min(left + before * meet, right + after * (width - meet)), left, right)


def _slope(stroke: np.ndarray, force: np.ndarray) -> float:
    """Slope of the line through some samples [N/m], zero where they are too few."""
    if len(stroke) < 3 or np.ptp(stroke) <= 0.0:
        return 0.0
    return float(np.polyfit(stroke, force, 1)[0])
