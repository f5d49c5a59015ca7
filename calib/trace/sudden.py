"""A force that changes from one sample to the next within a cut: food that breaks, or a sensor that was zeroed."""

from __future__ import annotations

import numpy as np

from calib.errors import TraceError
from calib.io.wording import LONG, brief
from calib.trace.clock import JUMP
from calib.trace.mending import noise_of
from calib.trace.trace import Trace

SIDE = 6
"""Samples on each side of a sudden change, which go on as they came."""
CHANGE_SD, CHANGE_PART = 10.0, 0.03
"""Noise standard deviations, and part of the peak, by which the force changes."""
SAID_PART = 0.1
"""Part of the peak from which on a change that the level does not show is told."""
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
    notes: list[str] = []
    i = max(first + SIDE, 1)
    while i <= last - SIDE:
        step = float(np.median(force[i : i + SIDE]) - np.median(force[i - SIDE : i]))
        jump = float(force[i] - force[i - 1])
        near = sound[i - 1] and sound[i] and trace.time[i] - trace.time[i - 1] <= JUMP * trace.dt
        if not near or abs(step) <= max(CHANGE_SD * noise, CHANGE_PART * peak) or not 0.7 <= jump / step <= 1.5:
            i += 1
            continue
        place = f"{trace.source}, {trace.where(i)}, column {brief(trace.columns.get('force', 'force'), LONG)}"
        level = float(np.median(trace.force[:first] if first else trace.force[:1]))
        zeroed = abs(trace.force[i]) <= max(4.0 * noise, 1e-3 * peak) and abs(level) > max(8.0 * noise, 0.02 * peak)
        if zeroed or (after is not None and abs(after - step) <= SAME_STEP * abs(step)):
            raise TraceError(
                f"{place}: the force changes by {step:.3g} N from one sample to the next within the cut, and so does "
                "its level: the sensor was zeroed or moved there; record the cut again, or end it before with --t-end"
            )
        if abs(step) > SAID_PART * peak:
            notes.append(
                f"{place}: the force changes by {step:.3g} N from one sample to the next: food that breaks, or a sensor"
            )
        i += SIDE
    return [*notes[:3], *([f"{len(notes) - 3} more changes like these"] if len(notes) > 3 else [])]
