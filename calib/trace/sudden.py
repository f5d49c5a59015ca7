"""A force that changes from one sample to the next within a cut: food that breaks, or a sensor that was zeroed."""

from __future__ import annotations

import numpy as np

from calib.errors import TraceError
from calib.io.wording import LONG, brief
from calib.trace.clock import JUMP
from calib.trace.contact_onset import quantum
from calib.trace.mending import noise_of
from calib.trace.trace import Trace

SIDE = 6
"""Samples on each side of a sudden change, which go on as they came."""
CHANGE_SD, CHANGE_PART = 10.0, 0.03
"""Noise standard deviations, and part of the peak, by which the force changes."""
LONGEST_BURST, BURST_PART = 12, 0.05
"""Most samples of a disturbance that begins and ends from one sample to the next, on end and as a part of the cut."""
BURST_RANGE = 0.25
"""Part of the peak by which those samples stand out."""
SAME_STEP = 0.2
"""Part of a change within which the level behind the cut has changed by as much, or the force is at zero."""
LEVEL_SAMPLES = 10
"""Samples at the end of the record, in which the knife is out of the food, that show the level behind the cut."""


def sudden_changes(
    trace: Trace, force: np.ndarray, span: tuple[int, int], out: np.ndarray, sound: np.ndarray
) -> list[str]:
    """Find sudden changes of the force in a cut.

    A change that stays when the knife is out of the food, or that ends at the sensor's zero where the level before the
    cut was another, is none of the food.

    Args:
        trace: The cut.
        force: Its force above the baseline [N], shape (n,).
        span: Index of the first sample in the food and of the last.
        out: Indices of the samples at the end of the record in which the knife is out of the food,
            shape (k,) [-].
        sound: Whether each sample is a measurement, shape (n,) [-].

    Returns:
        What changed by itself and may be food that breaks, one sentence each.

    Raises:
        TraceError: The sensor was zeroed, or its level moved, in the cut; the message names the row.
    """
    first, last = span
    noise, peak = noise_of(force), float(np.max(force[first : last + 1]))
    after = float(np.median(force[out])) if len(out) >= LEVEL_SAMPLES else None
    _check_bursts(trace, force, span, max(CHANGE_SD * noise, BURST_RANGE * peak, 1.5 * quantum(trace.force)))
    notes: list[str] = []
    steps, jumps = steps_of(force)
    large = np.abs(steps) > max(CHANGE_SD * noise, CHANGE_PART * peak, 1.5 * quantum(trace.force))
    alike = (jumps >= 0.7 * np.abs(steps)) & (jumps <= 1.5 * np.abs(steps))
    i = -SIDE
    for place in np.flatnonzero(large & alike):
        if not max(first + SIDE, 1) <= place <= last - SIDE or place < i + SIDE:
            continue
        i, step = int(place), float(steps[place])
        if not (sound[i - 1] and sound[i] and trace.time[i] - trace.time[i - 1] <= JUMP * trace.dt):
            continue
        level = float(np.median(trace.force[:first] if first else trace.force[:1]))
        zeroed = abs(trace.force[i]) <= max(4.0 * noise, 1e-3 * peak) and abs(level) > max(8.0 * noise, 0.02 * peak)
        if zeroed or (after is not None and abs(after - step) <= SAME_STEP * abs(step)):
            raise TraceError(
                f"{_place(trace, i)}: the force changes by {step:.3g} N from one sample to the next within the cut, "
                "and so does its level: the sensor was zeroed or moved there; record the cut again, or end it before "
                "with --t-end"
            )
        notes.append(
            f"{_place(trace, i)}: the force changes by {step:.3g} N from one sample to the next: food that breaks, or "
            "a sensor"
        )
    return [*notes[:3], *([f"{len(notes) - 3} more changes like these"] if len(notes) > 3 else [])]


def _place(trace: Trace, i: int) -> str:
    return f"{trace.source}, {trace.where(i)}, column {brief(trace.columns.get('force', 'force'), LONG)}"


def steps_of(force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sudden changes of a force at each sample.

    Args:
        force: Force [N], shape (n,).

    Returns:
        By how much the line through the samples from each on is above that through the samples before it [N], shape
        (n,), and the change from the sample before, counted in that direction and without the slope of the lines [N],
        shape (n,).
    """
    steps, jumps = np.zeros(len(force)), np.zeros(len(force))
    if len(force) < 2 * SIDE:
        return steps, jumps
    x = np.arange(SIDE) - 0.5 * (SIDE - 1)
    slope = x / float(x @ x)
    reach = 0.5 * SIDE  # from the middle of a window to half a sample beyond its end
    windows = np.lib.stride_tricks.sliding_window_view(force, SIDE)
    ahead, back = windows @ (1 / SIDE + reach * slope), windows @ (1 / SIDE - reach * slope)
    slopes = windows @ slope
    inner = slice(SIDE, len(force) - SIDE + 1)
    steps[inner] = back[SIDE:] - ahead[:-SIDE]
    jumps[inner] = np.diff(force)[SIDE - 1 : len(force) - SIDE] - 0.5 * (slopes[SIDE:] + slopes[:-SIDE])
    return steps, jumps * np.sign(steps)


def _check_bursts(trace: Trace, force: np.ndarray, span: tuple[int, int], limit: float) -> None:
    """Refuse samples on end that stand out from both sides, which no food makes them do from one sample to the next.

    Raises:
        TraceError: There are.
    """
    first, last = span
    most = min(LONGEST_BURST, int(BURST_PART * (last - first)))
    for i in first + 1 + np.flatnonzero(np.abs(np.diff(force[first : last + 1])) > limit):
        if i < 3:
            continue
        before = float(np.median(force[i - 3 : i]))
        for k in range(1, most + 1):
            behind = force[i + k : i + k + 3]
            if len(behind) < 3:
                break
            off = force[i : i + k] - 0.5 * (before + float(np.median(behind)))
            least = max(limit, 3.0 * abs(before - float(np.median(behind))))
            back = abs(float(force[i + k]) - float(np.median(behind))) <= limit
            if back and (np.all(off > least) or np.all(off < -least)):
                raise TraceError(
                    f"{_place(trace, int(i))}: this sample and {k - 1} after it stand out together from both sides, "
                    f"by {off[int(np.argmax(np.abs(off)))]:.3g} N from one sample to the next: the sensor was "
                    "disturbed; remove these rows or record the cut again"
                )
