"""Faults of a compression record: values that stand out are replaced, what cannot be repaired is said or refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from calib.errors import TraceError
from calib.trace.contact_onset import quantum
from calib.trace.mending import noise_of, without_spikes
from calib.trace.recorded import MIN_SAMPLES
from calib.trace.standing import standing
from calib.trace.sudden import CHANGE_PART, CHANGE_SD, steps_of
from calib.trace.trace import Trace
from mpm.arrays import FloatArray

DIGITISED = 1e-4
"""Noise over the largest load below which a curve is digitised, and stands and jumps as it was drawn."""
LARGEST_GAP, GAP_STEPS = 0.03, 10.0
"""Part of the way, and usual steps, between two samples from which on samples are missing."""


def without_faults(
    way: FloatArray, load: FloatArray, end: float, place: Callable[[int], str]
) -> tuple[FloatArray, list[str]]:
    """The load of one loading without values that stand out alone, and what else is wrong with it.

    Args:
        way: Way of the plate [m], shape (n,).
        load: Load on it [N], shape (n,).
        end: Way up to which it is used [m].
        place: What errors call a sample, by its index.

    Returns:
        The load, and one sentence for each fault.

    Raises:
        TraceError: The load is clipped or frozen where it is used.
    """
    gone = np.abs(way - way[0])
    last = int(np.argmax(gone >= end)) or len(way) - 1
    if last < MIN_SAMPLES:
        return load, []
    mended, _ = without_spikes(Trace(np.arange(float(len(load))), load), load, "force")
    notes = [
        f"{place(int(i))}: {load[i]:.4g} N stands out alone from its neighbours; it was replaced by the line between "
        "them"
        for i in np.flatnonzero(mended != load)[:3]
    ]
    used = mended[: last + 1]
    noise, top = noise_of(used), float(np.ptp(used))
    steps = np.diff(gone[: last + 1])
    gap = int(np.argmax(steps))
    if steps[gap] > max(GAP_STEPS * float(np.median(steps)), LARGEST_GAP * gone[last]):
        notes.append(
            f"{place(gap)}: no samples for {1e3 * steps[gap]:.3g} mm of the way behind it; a line bridges them"
        )
    if noise <= DIGITISED * top:
        return mended, notes
    for stands in standing(used, noise):
        if gone[stands.last] - gone[stands.first] > LARGEST_GAP * gone[last]:
            raise TraceError(
                f"{place(stands.first)}: the load is {stands.value:.4g} N from there to {place(stands.last)}: the "
                "sensor is clipped or frozen; record with a larger range, or end before it with --strain"
            )
    changes, jumps = steps_of(used)
    large = np.abs(changes) > max(CHANGE_SD * noise, CHANGE_PART * top, 1.5 * quantum(used))
    sudden = np.flatnonzero(large & (jumps >= 0.7 * np.abs(changes)) & (jumps <= 1.5 * np.abs(changes)))
    if len(sudden):
        i = int(sudden[np.argmax(np.abs(changes[sudden]))])
        notes.append(
            f"{place(i)}: the load changes by {changes[i]:.3g} N from one sample to the next: food that breaks, or a "
            "sensor that was zeroed or moved"
        )
    return mended, notes
